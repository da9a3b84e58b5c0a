// Modes of a test that was dropped on the page, and their partners among those of the live model.

import { assignment, macOf } from "./livemodel.ts";

/** Modes of a test at the sensors of a configuration: NaN where it has not measured. */
export interface DroppedModes { labels: string[]; freq_hz: number[]; shapes: Float64Array[] }
/** A mode of the test and its partner; −1 without one. */
export interface DroppedPair { column: number; mac: number | null }

/** Beyond this sum of 1 − MAC and |ln(f/f_test)| two modes are no pair. */
const APART = 0.8;
/** Sensors from which a MAC says something. */
const TELLING = 3;

/** Partners of the modes of a test among modes of the model, together as near and as like as can be. */
export function paired(test: DroppedModes, freq_hz: ArrayLike<number>, seen: Float64Array[]): DroppedPair[] {
  const n = test.labels.length;
  if (!n || !seen.length) return test.labels.map(() => ({ column: -1, mac: null }));
  const telling = test.shapes.map((s) => s.filter((v) => !Number.isNaN(v)).length >= TELLING);
  const macs = test.shapes.map((s, i) => seen.map((m) => { const value = telling[i] ? macOf(m, s) : NaN; return Number.isNaN(value) ? null : value; }));
  const cost = macs.map((row, i) => [
    ...row.map((mac, j) => Math.min(10, (mac === null ? 0 : 1 - mac) + Math.abs(Math.log(Math.max(freq_hz[j], 1e-9) / Math.max(test.freq_hz[i], 1e-9))))),
    // as many places without a partner
    ...test.labels.map(() => APART),
  ]);
  return assignment(cost).map((j, i) => (j < seen.length && j >= 0 ? { column: j, mac: macs[i][j] } : { column: -1, mac: null }));
}
