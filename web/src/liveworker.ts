// The worker that solves the live model, so that the page stays quick while a reader drags.

import { unpack, type Live, type SceneData } from "./data.ts";
import { LiveModel, verified, type Modes, type Solved } from "./livemodel.ts";

export interface Begin { kind: "begin"; live: Live; shapes: (SceneData["live"])[] }
export interface Solve { kind: "solve"; id: number; x: number[]; configurations: number[]; shape: { configuration: number; test: number } | null }
/** A shape that is drawn: motion (points, 3), factor from the test's shape to it, and the partner. */
export interface LiveShape { configuration: number; test: number; column: number; motion: Float32Array; factor: number }
export type Answer =
  | { kind: "ready"; verified: boolean }
  | { kind: "solved"; id: number; configuration: number; solved: Solved | null; shape: LiveShape | null; last: boolean };

let models: LiveModel[] = [];
let drawing: ({ vectors: Float32Array; weights: Float32Array; count: number } | null)[] = [];

function begin({ live, shapes }: Begin): void {
  const bounds = (which: "lower" | "upper") => live.parameters.map((p) => (p[which] - p.nominal) / p.scale);
  models = live.configurations.map((c) => new LiveModel(c, bounds("lower"), bounds("upper")));
  drawing = shapes.map((s) => s && { vectors: unpack(s.vectors), weights: unpack(s.weights), count: s.weights.shape[0] });
  answer({ kind: "ready", verified: models.every(verified) });
}

function solve({ id, x, configurations, shape }: Solve): void {
  configurations.forEach((k, i) => {
    const model = models[k], modes = model.modes(x), solved = modes && model.solve(modes);
    const drawn = modes && solved && shape?.configuration === k ? shapeOf(k, shape.test, modes, solved) : null;
    answer({ kind: "solved", id, configuration: k, solved, shape: drawn, last: i === configurations.length - 1 }, drawn ? [drawn.motion.buffer] : []);
  });
}

function shapeOf(k: number, test: number, modes: Modes, solved: Solved): LiveShape | null {
  const with_ = drawing[k], column = solved.pairs[test].column;
  if (!with_ || column < 0) return null;
  const y = modes.shapes[column], n = y.length, parts = new Float64Array(with_.count);
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
  return { configuration: k, test, column, motion, factor: square > 0 ? inner / square : 1 };
}

function answer(message: Answer, transfer: Transferable[] = []): void { (self as unknown as Worker).postMessage(message, transfer); }

self.onmessage = (e: MessageEvent<Begin | Solve>) => (e.data.kind === "begin" ? begin(e.data) : solve(e.data));
