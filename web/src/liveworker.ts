// The worker that solves the live model, so that the page stays quick while a reader drags.

import { unpack, type Live, type SceneData } from "./data.ts";
import type { Curve } from "./livefunctions.ts";
import { inRegion, LiveModel, verified, type AddedMass, type Chosen, type Modes, type Solved } from "./livemodel.ts";
import { paired, type DroppedModes, type DroppedPair } from "./livepairs.ts";
import { drawRows, extreme, levelExtreme, logWeights, resampled, type Allowed, type Asked, type AskedLevel, type Extreme, type LevelExtreme } from "./liveregion.ts";
import { partsOf, scaledSquares } from "./livetext.ts";

export interface Begin { kind: "begin"; live: Live; shapes: (SceneData["live"])[] }
export interface Solve { kind: "solve"; id: number; x: number[]; configurations: number[]; shape: { configuration: number; test: number } | null; off: number[][]; added: { configuration: number; mass: AddedMass } | null; functions: { configuration: number; chosen: Chosen } | null }
/** Modes of a test that is compared too, and with which configuration; none any more. */
export interface Drop { kind: "drop"; configuration: number; modes: DroppedModes | null }
/** Asks for models that the data allow. */
export interface AskAllowed { kind: "allowed"; count: number }
/** Asks for the lowest (−1) or highest (1) frequency or MAC of a test mode in the region. */
export interface AskExtreme { kind: "extreme"; asked: Asked; configuration: number; test: number; sign: number; added: AddedMass | null }
/** Asks for the lowest or highest level of a function in the region. */
export interface AskLevel { kind: "level"; configuration: number; level: AskedLevel; added: AddedMass | null }
/** A shape that is drawn: motion (points, 3), factor from the test's shape to it, and the modes that it is a combination of. */
export interface LiveShape { configuration: number; test: number; columns: number[]; motion: Float32Array; factor: number }
/** One of the functions, at the updated point and now. */
export interface LiveCurves { chosen: Chosen; updated: Curve | null; now: Curve | null }
export type Answer =
  | { kind: "ready"; verified: boolean }
  | { kind: "allowed"; allowed: Allowed }
  | { kind: "extreme"; asked: Asked; test: number; sign: number; extreme: Extreme | null }
  | { kind: "level"; configuration: number; level: AskedLevel; extreme: LevelExtreme | null; updated: number | null }
  | { kind: "solved"; id: number; configuration: number; solved: Solved | null; shape: LiveShape | null; functions: LiveCurves | null; dropped: DroppedPair[] | null; last: boolean };

let live: Live;
let models: LiveModel[] = [];
let dropped: Drop | null = null;
let updated: (Modes | null)[] = [];
let drawing: ({ vectors: Float32Array; weights: Float32Array; count: number } | null)[] = [];

function begin(given: Begin): void {
  const { shapes } = given;
  live = given.live;
  const bounds = (which: "lower" | "upper") => live.parameters.map((p) => (p[which] - p.nominal) / p.scale);
  models = live.configurations.map((c) => new LiveModel(c, bounds("lower"), bounds("upper")));
  drawing = shapes.map((s) => s && { vectors: unpack(s.vectors), weights: unpack(s.weights), count: s.weights.shape[0] });
  answer({ kind: "ready", verified: models.every(verified) });
}

function solve({ id, x, configurations, shape, off, added, functions }: Solve): void {
  configurations.forEach((k, i) => {
    const criteria = models[k].data.criteria.some((c) => !["", "frequency", "mac"].includes(c.quantity)), model = models[k], chosen = functions?.configuration === k ? functions.chosen : null;
    const all = modesFor(model, x, added?.configuration === k ? added.mass : null, chosen !== null || criteria), modes = all && model.lowest(all), solved = modes && model.solve(modes, off[k]);
    let curves: LiveCurves | null = null;
    if (all && solved) {
      const { squares, curve } = model.functionsAt(all, chosen);
      Object.assign(solved.squares, squares);
      const mass = model.massAt(x);
      if (mass) { Object.assign(solved.squares, mass.squares); solved.totalMass = mass.total; }
      if (criteria) solved.measures = model.measures(all);
      if (chosen) curves = { chosen, updated: curveAtUpdate(k, chosen), now: curve };
    }
    const drawn = modes && solved && shape?.configuration === k ? shapeOf(k, shape.test, modes) : null;
    answer({ kind: "solved", id, configuration: k, solved, shape: drawn, functions: curves, dropped: modes && dropped?.modes && dropped.configuration === k ? paired(dropped.modes, modes.freq_hz, modes.shapes.map((y) => model.seen(y))) : null, last: i === configurations.length - 1 }, drawn ? [drawn.motion.buffer] : []);
  });
}

/** As many modes as are needed: more of them where functions are drawn or compared. */
function modesFor(model: LiveModel, x: number[], added: AddedMass | null, drawn: boolean): Modes | null {
  return model.modes(x, added, drawn || model.functions.some((f) => f.compared) ? model.most : undefined);
}

function curveAtUpdate(k: number, chosen: Chosen): Curve | null {
  const modes = updated[k] ??= models[k].modes(live.x, null, models[k].most);
  const set = models[k].functions[chosen.set];
  return modes && set.curve(models[k], set.point(models[k], modes), chosen.k);
}

function shapeOf(k: number, test: number, modes: Modes): LiveShape | null {
  const with_ = drawing[k], own = with_ && models[k].compared(modes, test);
  if (!with_ || !own) return null;
  const y = own.shape, n = y.length, parts = new Float64Array(with_.count);
  for (let a = 0; a < with_.count; a++) for (let i = 0; i < n; i++) parts[a] += with_.weights[a * n + i] * y[i];
  const motion = new Float32Array(with_.vectors.length / with_.count);
  for (let p = 0, at = 0; p < motion.length; p++) {
    let sum = 0;
    for (let a = 0; a < with_.count; a++, at++) sum += with_.vectors[at] * parts[a];
    motion[p] = sum;
  }
  const seen = models[k].seen(y), measured = models[k].tests[test];
  let inner = 0, square = 0;
  for (let s = 0; s < seen.length; s++) if (!Number.isNaN(measured[s])) { inner += seen[s] * measured[s]; square += measured[s] * measured[s]; }
  return { configuration: k, test, columns: own.columns, motion, factor: square > 0 ? inner / square : 1 };
}

function answer(message: Answer, transfer: Transferable[] = []): void { (self as unknown as Worker).postMessage(message, transfer); }

/** Sum of squares of all residuals, with the factors on their standard deviations; null where a model has no modes. */
function trueSquares(x: number[], factors: Record<string, number>): number | null {
  const all = models.map((model) => {
    const found = modesFor(model, x, null, false), solved = found && model.solve(model.lowest(found));
    if (found && solved) Object.assign(solved.squares, model.functionsAt(found, null).squares, model.massAt(x)?.squares);
    return solved;
  });
  return all.every((s) => s !== null) ? scaledSquares(partsOf(all as Solved[]), factors) : null;
}

function allowed({ count }: AskAllowed): void {
  const { draws, region } = live, rows = draws ? drawRows(draws) : [];
  if (!draws || !draws.linear || draws.reason || !region) {
    answer({ kind: "allowed", allowed: { models: draws?.source === "posterior" ? rows.slice(0, count) : [], effective: rows.length, weighed: false } });
    return;
  }
  const at: [number, number] = [inRegion(region, live.x) * region.limit, trueSquares(live.x, draws.factors) ?? 0];
  // those within the 95 % limit of the true χ²
  const within = (q: number | null) => (q !== null && q - at[1] <= region.limit - at[0] ? q : null);
  const logs = logWeights(draws.linear, rows.map((x) => within(trueSquares(x, draws.factors))), at, draws.degrees, region.moving.length);
  const { chosen, effective } = resampled(logs, count);
  answer({ kind: "allowed", allowed: { models: chosen.map((i) => rows[i]), effective, weighed: true } });
}

function level({ configuration, level: asked, added }: AskLevel): void {
  const found = levelExtreme(models[configuration], live.region, live.draws ? drawRows(live.draws) : [], live.x, asked, added);
  const curve = found && curveAtUpdate(configuration, asked.chosen), sizes = curve && Array.from(curve.real, (re, l) => Math.hypot(re, curve.imaginary[l]));
  answer({ kind: "level", configuration, level: asked, extreme: found, updated: sizes && (asked.line === null ? Math.max(...sizes) : sizes[asked.line]) });
}

self.onmessage = ({ data }: MessageEvent<Begin | Solve | Drop | AskAllowed | AskExtreme | AskLevel>) => {
  if (data.kind === "begin") begin(data);
  else if (data.kind === "solve") solve(data);
  else if (data.kind === "drop") dropped = data;
  else if (data.kind === "allowed") allowed(data);
  else if (data.kind === "level") level(data);
  else answer({ kind: "extreme", asked: data.asked, test: data.test, sign: data.sign, extreme: extreme(models[data.configuration], live.region, live.x, data.test, data.sign, data.added, data.asked) });
};
