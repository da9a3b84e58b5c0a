// Questions about the 95 % region: models that the data allow, and the lowest and highest frequency in it.

import { unpackDouble, type LiveDraws, type LiveRegion } from "./data.ts";
import { solveDense } from "./dense.ts";
import { inRegion, polynomial, type AddedMass, type Chosen, type LiveModel, type Modes } from "./livemodel.ts";

export interface Allowed { models: number[][]; effective: number; weighed: boolean }

/**
 * Logarithms of weights that make samples of the linearised distribution samples of the true one: `linear` are its sums of
 * squares, `true_` those of the model, null where it has no modes; both at the update are given last.
 */
export function logWeights(linear: number[], true_: (number | null)[], at: [number, number], degrees: number | null, k: number): number[] {
  const log = (q: number) => (degrees === null ? -0.5 * q : -0.5 * (degrees + k) * Math.log1p(Math.max(q, 1e-9 - degrees) / degrees));
  return linear.map((q, i) => (true_[i] === null ? -Infinity : log(true_[i]! - at[1] + at[0]) - log(q)));
}

/** Positions of `count` samples by their weights (systematic resampling), each at most once, and the effective number. */
export function resampled(logs: number[], count: number): { chosen: number[]; effective: number } {
  const most = Math.max(...logs);
  const weights = logs.map((l) => (Number.isFinite(most) ? Math.exp(l - most) : 0)), sum = weights.reduce((a, b) => a + b, 0);
  if (!(sum > 0)) return { chosen: [], effective: 0 };
  const chosen: number[] = [];
  for (let i = 0, total = 0, next = 0.5 * sum / count; i < weights.length; i++) {
    total += weights[i];
    if (total > next) { chosen.push(i); while (next < total) next += sum / count; }
  }
  return { chosen, effective: (sum * sum) / weights.reduce((a, w) => a + w * w, 0) };
}

/** Rows of the samples. */
export function drawRows(draws: LiveDraws): number[][] {
  const [n, k] = draws.x.shape, all = unpackDouble(draws.x);
  return Array.from({ length: n }, (_, i) => Array.from(all.subarray(i * k, (i + 1) * k)));
}

/** ∂λ/∂x (k,) of a mode: yᵀ(K′ − λM′)y, the polynomials by central differences. */
export function eigenvalueGradient(model: LiveModel, x: number[], modes: Modes, column: number): number[] {
  const y = modes.shapes[column], lambda = modes.eigenvalues[column], { lower, upper } = model;
  const forms = model.forms(y);
  return x.map((_, p) => {
    const h = 1e-6 * (upper[p] - lower[p]), [up, down] = [x.slice(), x.slice()];
    up[p] += h;
    down[p] -= h;
    return model.data.terms.reduce((sum, term, t) => {
      if (!term.parameters.includes(p)) return sum;
      const slope = (polynomial(term, up, lower, upper) - polynomial(term, down, lower, upper)) / (2 * h);
      return sum + slope * forms[t] * (term.kind === "mass" ? -lambda : 1);
    }, 0);
  });
}

/**
 * The point of the region and the bounds at which a linear function with slopes g is largest. Parameters that would leave
 * their bounds are set to them one after the other, the region is cut there.
 */
export function linearOptimum(region: LiveRegion | null, x: number[], g: number[], lower: number[], upper: number[]): number[] {
  if (region === null) return x.map((v, i) => (g[i] > 0 ? upper[i] : g[i] < 0 ? lower[i] : v));
  const { moving, centre, precision, radius_square } = region, k = moving.length, out = x.slice();
  const H = (i: number, j: number) => precision[i * k + j], places = Array.from({ length: k }, (_, i) => i);
  const d = new Array(k).fill(0), fixed = new Set<number>();
  for (let turn = 0; turn <= k; turn++) {
    const free = places.filter((i) => !fixed.has(i)), held = places.filter((i) => fixed.has(i));
    const inner = free.map((i) => free.map((j) => H(i, j)));
    const shift = solveDense(inner, free.map((i) => -held.reduce((sum, j) => sum + H(i, j) * d[j], 0)));
    const way = solveDense(inner, free.map((i) => g[moving[i]]));
    // what the parameters at their bounds leave of the radius
    const used = held.reduce((sum, i) => sum + d[i] * (held.reduce((s, j) => s + H(i, j) * d[j], 0) + free.reduce((s, j, a) => s + H(i, j) * shift[a], 0)), 0);
    const rise = free.reduce((sum, i, a) => sum + g[moving[i]] * way[a], 0), rest = Math.max(0, radius_square - used);
    free.forEach((i, a) => { d[i] = shift[a] + (rise > 0 ? way[a] * Math.sqrt(rest / rise) : 0); });
    let worst = -1, most = 1e-12;
    for (const i of free) {
      const p = moving[i], value = centre[i] + d[i], off = Math.max(lower[p] - value, value - upper[p]) / (upper[p] - lower[p]);
      if (off > most) { most = off; worst = i; }
    }
    if (worst < 0) break;
    const p = moving[worst];
    d[worst] = Math.min(upper[p], Math.max(lower[p], centre[worst] + d[worst])) - centre[worst];
    fixed.add(worst);
  }
  const inside = out.slice(), middle = moving.map((p, i) => Math.min(upper[p], Math.max(lower[p], centre[i])));
  moving.forEach((p, i) => { inside[p] = Math.min(upper[p], Math.max(lower[p], centre[i] + d[i])); });
  // where the bounds leave nothing of the region on that side: back towards its middle
  for (let turn = 0; turn < 200 && inRegion(region, inside) > 1 + 1e-9; turn++) moving.forEach((p, i) => { inside[p] += 0.05 * (middle[i] - inside[p]); });
  return inside;
}

/** What is asked of a region: the frequency of a test mode's partner, or the MAC of the pair. */
export type Asked = "frequency" | "mac";
/** Values of the parameters and what is found there: Hz, or MAC. */
export interface Extreme { x: number[]; value: number }

/** Part of the width of a parameter's range for differences. */
const STEP = 1e-4;

/**
 * The lowest (sign −1) or highest (sign 1) frequency of a test mode's partner in the region, or MAC of the pair, by steps
 * that stay in it; with the mass that is added, which does not depend on the parameters.
 */
export function extreme(model: LiveModel, region: LiveRegion | null, start: number[], test: number, sign: number, added: AddedMass | null = null, asked: Asked = "frequency"): Extreme | null {
  const at = (x: number[]) => {
    const modes = model.modes(x, added), column = modes ? model.follow(modes).get(test) : undefined;
    if (!modes || column === undefined || column < 0) return null;
    const value = asked === "frequency" ? modes.eigenvalues[column] : model.solve(modes).pairs[test].whole;
    return value === null ? null : { modes, column, value };
  };
  const slopes = (x: number[], here: { modes: Modes; column: number; value: number }) => (asked === "frequency" ? eigenvalueGradient(model, x, here.modes, here.column) : x.map((v, p) => {
    const h = STEP * (model.upper[p] - model.lower[p]), [low, high] = [v - h, v + h].map((w) => at(x.map((u, i) => (i === p ? Math.min(model.upper[p], Math.max(model.lower[p], w)) : u))));
    return low && high ? (high.value - low.value) / (2 * h) : 0;
  }));
  let x = start.slice(), here = at(x);
  if (!here) return null;
  for (let turn = 0; turn < (asked === "frequency" ? 25 : 10); turn++) {
    const g = slopes(x, here).map((v) => sign * v);
    const target = linearOptimum(region, x, g, model.lower, model.upper);
    let better = null;
    for (let step = 1; step > 0.01 && !better; step /= 2) {
      const tried = x.map((v, i) => v + step * (target[i] - v)), there = at(tried);
      if (there && sign * (there.value - here.value) > 1e-7 * Math.abs(here.value)) better = { tried, there };
    }
    if (!better) break;
    x = better.tried;
    here = better.there;
  }
  return { x, value: asked === "frequency" ? here.modes.freq_hz[here.column] : here.value };
}

/** The level of a function at one of its lines, or the highest of all of them where `line` is null. */
export interface AskedLevel { chosen: Chosen; line: number | null; sign: number }
/** Values of the parameters, the magnitude there and its frequency; how many models were tried first; whether the time ended it. */
export interface LevelExtreme { x: number[]; value: number; hz: number; tried: number; cut: boolean }

/** Models from which the best are taken as starts: a level has an optimum of its own for each mode that can pass a line. */
const TRIED = 40, STARTS = 3;
/** Radius of the first step and of the last one, as a part of that of the region; factors where a step helps and where not. */
const FIRST = 0.5, LAST = 1e-3, WIDER = 1.5, NARROWER = 0.4, MOST_STEPS = 80;
/** Time after which the search ends with the best that it has, in ms. */
const MOST_MS = 20_000;

/**
 * The lowest (sign −1) or highest (sign 1) level of a function in the region: steps along the slope, in the metric of the
 * region and projected on it, from the best of some models and from the update.
 */
export function levelExtreme(model: LiveModel, region: LiveRegion | null, models: number[][], start: number[], { chosen, line, sign }: AskedLevel, added: AddedMass | null = null): LevelExtreme | null {
  const set = model.functions[chosen.set], { lower, upper } = model, end = performance.now() + MOST_MS;
  const at = (x: number[]) => {
    const modes = model.modes(x, added, model.most);
    if (!modes) return null;
    const { real, imaginary } = set.curve(model, set.point(model, modes), chosen.k);
    let best = line ?? 0;
    const size = (l: number) => Math.hypot(real[l], imaginary[l]);
    if (line === null) for (let l = 1; l < real.length; l++) if (size(l) > size(best)) best = l;
    return size(best) > 0 ? { log: Math.log(size(best)), line: best } : null;
  };
  const places = region ? region.moving : start.map((_, p) => p);
  const slopes = (x: number[], log: number) => x.map((v, p) => {
    if (!places.includes(p)) return 0;
    // away from the nearer bound
    const h = STEP * (upper[p] - lower[p]) * (2 * v < lower[p] + upper[p] ? 1 : -1), there = at(x.map((u, i) => (i === p ? v + h : u)));
    return there ? (sign * (there.log - log)) / h : 0;
  });
  const some = region ? models.filter((x) => inRegion(region, x) <= 1).slice(0, TRIED) : spread(lower, upper, TRIED);
  const known = [start, ...some].flatMap((x) => { const found = at(x); return found ? [{ x, ...found }] : []; }).sort((a, b) => sign * (b.log - a.log));
  let best: { x: number[]; log: number; line: number } | null = null;
  for (const from of known.slice(0, STARTS)) {
    if (best && performance.now() > end) break;
    let here = from, g = slopes(here.x, here.log), radius = FIRST;
    for (let step = 0; step < MOST_STEPS && radius > LAST && performance.now() <= end; step++) {
      const x = stepTo(region, here.x, g, radius, lower, upper), there = at(x);
      if (there && sign * (there.log - here.log) > 1e-9) { here = { x, ...there }; g = slopes(x, there.log); radius = Math.min(1, WIDER * radius); }
      else radius *= NARROWER;
    }
    if (!best || sign * (here.log - best.log) > 0) best = here;
  }
  return best && { x: best.x, value: Math.exp(best.log), hz: set.freq[best.line], tried: known.length, cut: performance.now() > end };
}

/** The best point for a linear function within a part of the region's radius about x, and in the region. */
function stepTo(region: LiveRegion | null, x: number[], g: number[], radius: number, lower: number[], upper: number[]): number[] {
  if (!region) {
    const [low, high] = [-1, 1].map((side) => x.map((v, i) => Math.min(upper[i], Math.max(lower[i], v + side * radius * (upper[i] - lower[i])))));
    return linearOptimum(null, x, g, low, high);
  }
  const { moving, centre, precision, radius_square } = region, k = moving.length, at = moving.map((p) => x[p]), size = radius * radius * radius_square;
  const near = { ...region, at, centre: at, offset: region.offset.map(() => 0), limit: size, radius_square: size }, out = linearOptimum(near, x, g, lower, upper);
  const d = moving.map((p, i) => out[p] - centre[i]), form = d.reduce((sum, v, i) => sum + v * d.reduce((inner, w, j) => inner + precision[i * k + j] * w, 0), 0);
  if (form > radius_square) moving.forEach((p, i) => { out[p] = Math.min(upper[p], Math.max(lower[p], centre[i] + d[i] * Math.sqrt(radius_square / form))); });
  return out;
}

/** Points of a box that fill it evenly, from the fractions of multiples of an irrational number for each parameter. */
function spread(lower: number[], upper: number[], count: number): number[][] {
  // the root of y^(k + 1) = y + 1
  let root = 2;
  for (let turn = 0; turn < 40; turn++) root = (1 + root) ** (1 / (lower.length + 1));
  return Array.from({ length: count }, (_, n) => lower.map((low, i) => low + (((n + 1) / root ** (i + 1)) % 1) * (upper[i] - low)));
}
