// Questions about the 95 % region: models that the data allow, and the lowest and highest frequency in it.

import { unpackDouble, type LiveDraws, type LiveRegion } from "./data.ts";
import { inRegion, polynomial, type LiveModel, type Modes } from "./livemodel.ts";

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

/** The point of the region (and the bounds) that a linear function with slopes g is largest at, but for what bounds cut off. */
export function linearOptimum(region: LiveRegion | null, x: number[], g: number[], lower: number[], upper: number[]): number[] {
  const out = x.slice();
  if (region === null) return out.map((v, i) => (g[i] > 0 ? upper[i] : g[i] < 0 ? lower[i] : v));
  const { moving, centre, spread, radius_square } = region, k = moving.length;
  // in u with x = centre + G u the region is a ball
  const u = Array.from({ length: k }, (_, j) => moving.reduce((sum, p, i) => sum + spread[i * k + j] * g[p], 0));
  const size = Math.hypot(...u) || 1, r = Math.sqrt(radius_square);
  moving.forEach((p, i) => { out[p] = centre[i] + u.reduce((sum, v, j) => sum + (spread[i * k + j] * v * r) / size, 0); });
  const inside = out.map((v, i) => Math.min(upper[i], Math.max(lower[i], v)));
  // clipping may leave the ball: back towards the middle
  for (let turn = 0; turn < 60 && inRegion(region, inside) > 1 + 1e-9; turn++) moving.forEach((p, i) => { inside[p] += 0.05 * (Math.min(upper[p], Math.max(lower[p], centre[i])) - inside[p]); });
  return inside;
}

export interface Extreme { x: number[]; freq_hz: number }

/** The lowest (sign −1) or highest (sign 1) frequency of a test mode's partner in the region, by steps that stay in it. */
export function extreme(model: LiveModel, region: LiveRegion | null, start: number[], test: number, sign: number): Extreme | null {
  const at = (x: number[]) => {
    const modes = model.modes(x), column = modes ? model.follow(modes).get(test) : undefined;
    return modes && column !== undefined && column >= 0 ? { modes, column, value: modes.eigenvalues[column] } : null;
  };
  let x = start.slice(), here = at(x);
  if (!here) return null;
  for (let turn = 0; turn < 25; turn++) {
    const g = eigenvalueGradient(model, x, here.modes, here.column).map((v) => sign * v);
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
  return { x, freq_hz: here.modes.freq_hz[here.column] };
}
