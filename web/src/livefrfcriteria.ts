// Criteria on measured FRFs that the update did not use, as femtune.validation.frfs.

import { assignment } from "./livemodel.ts";
import type { Curve } from "./livefunctions.ts";

/** Level by which a resonance stands out, level below the highest one down to which others count, both in dB; difference of
 * resonances that are not the same; outputs of a deflection; size of a function that is rounding. */
const PROMINENCE = 10, DEPTH = 60, FAR = 0.2, FEWEST_OUTPUTS = 3, SILENT = 1e-10;

export type FrfQuantity = "frac" | "fdac" | "mean_db" | "max_db" | "resonance";
export type FrfMeasures = Record<FrfQuantity, number | null>;

/** Functions of model and test, outputs before inputs; 0 in the test stands for what is not compared. */
export interface Compared { freq: Float64Array; outputs: number; inputs: number; model: Curve[]; test: Curve[] }

const power = (c: Curve, l: number) => c.real[l] ** 2 + c.imaginary[l] ** 2;

/** The worst values: resonance errors in %, infinite where the model has no peak near one of the test. */
export function frfMeasures({ freq, outputs, inputs, model, test }: Compared): FrfMeasures {
  const tops = model.map((c) => c.real.reduce((top, _, l) => Math.max(top, power(c, l)), 0)), most = Math.max(...tops);
  const known = model.map((c, k) => Array.from(freq, (_, l) => tops[k] > SILENT ** 2 * most && power(test[k], l) > 0 && power(c, l) > 0));
  const frac: number[] = [], mean: number[] = [], largest: number[] = [], fdac: number[] = [], errors: number[] = [];
  model.forEach((c, k) => {
    const lines = known[k].flatMap((is, l) => (is ? [l] : []));
    if (!lines.length) return;
    const levels = lines.map((l) => Math.abs(10 * Math.log10(power(c, l) / power(test[k], l))));
    mean.push(levels.reduce((a, b) => a + b, 0) / levels.length);
    largest.push(Math.max(...levels));
    if (lines.length > 1) frac.push(likeness(lines.map((l) => [c, l]), lines.map((l) => [test[k], l])));
  });
  for (let j = 0; j < inputs; j++) {
    const of = Array.from({ length: outputs }, (_, i) => i * inputs + j), deflections: number[] = [];
    freq.forEach((_, l) => {
      const some = of.filter((k) => known[k][l]);
      if (some.length >= FEWEST_OUTPUTS) deflections.push(likeness(some.map((k) => [model[k], l]), some.map((k) => [test[k], l])));
    });
    if (deflections.length) fdac.push(deflections.reduce((a, b) => a + b, 0) / deflections.length);
    errors.push(...resonanceErrors(freq, of.filter((k) => known[k].some(Boolean)), known, model, test));
  }
  return { frac: least(frac), fdac: least(fdac), mean_db: greatest(mean), max_db: greatest(largest), resonance: greatest(errors) };
}

/** δ: mean over the lines of |lg(H/H_test)|², as femtune.validation.frfs.squared_deviation; null where nothing is compared. */
export function squaredDeviation(model: { real: ArrayLike<number>; imaginary: ArrayLike<number> }, test: { real: ArrayLike<number>; imaginary: ArrayLike<number> }): number | null {
  let sum = 0, count = 0;
  for (let l = 0; l < model.real.length; l++) {
    const [a, b, c, d] = [model.real[l], model.imaginary[l], test.real[l], test.imaginary[l]], own = a * a + b * b, other = c * c + d * d;
    if (!own || !other) continue;
    sum += (0.5 * Math.log(own / other)) ** 2 + Math.atan2(b * c - a * d, a * c + b * d) ** 2;
    count++;
  }
  return count ? sum / count / Math.LN10 ** 2 : null;
}

const least = (values: number[]) => (values.length ? Math.min(...values) : null), greatest = (values: number[]) => (values.length ? Math.max(...values) : null);

/** |Σ a* b|²/(Σ|a|² Σ|b|²) of values of curves at lines. */
function likeness(a: [Curve, number][], b: [Curve, number][]): number {
  let re = 0, im = 0, p = 0, q = 0;
  a.forEach(([c, l], i) => {
    const [d, m] = b[i];
    re += c.real[l] * d.real[m] + c.imaginary[l] * d.imaginary[m];
    im += c.real[l] * d.imaginary[m] - c.imaginary[l] * d.real[m];
    p += power(c, l);
    q += power(d, m);
  });
  return (re * re + im * im) / (p * q);
}

function resonanceErrors(freq: Float64Array, some: number[], known: boolean[][], model: Curve[], test: Curve[]): number[] {
  const lines = some.length ? Array.from(freq.keys()).filter((l) => some.every((k) => known[k][l])) : [];
  if (!lines.length) return [];
  const hz = lines.map((l) => freq[l]), sum = (of: Curve[]) => lines.map((l) => some.reduce((total, k) => total + power(of[k], l), 0));
  const [own, measured] = [model, test].map((of) => peaks(hz, sum(of)));
  if (!measured.length) return [];
  const far = measured.map((t) => own.map((m) => Math.abs(Math.log(m / t)))), partner = new Array(measured.length).fill(-1);
  if (own.length) {
    if (measured.length <= own.length) assignment(far).forEach((k, i) => { partner[i] = k; });
    else assignment(own.map((_, k) => far.map((row) => row[k]))).forEach((i, k) => { partner[i] = k; });
  }
  return measured.map((t, i) => {
    const error = partner[i] < 0 ? Infinity : Math.abs(own[partner[i]] / t - 1);
    return error <= FAR ? 100 * error : Infinity;
  });
}

/** Frequencies of the peaks of Σ|H|²: near a resonance its inverse is a parabola. */
export function peaks(hz: number[], power: number[]): number[] {
  const level = power.map((p) => 10 * Math.log10(p)), top = Math.max(...level), most = Math.max(...power), out: number[] = [];
  for (let i = 1; i + 1 < level.length; i++) {
    if (!(level[i] > level[i - 1] && level[i] > level[i + 1]) || level[i] < top - DEPTH) continue;
    const lowest = (step: number) => { let low = level[i]; for (let k = i + step; k >= 0 && k < level.length && level[k] <= level[i]; k += step) low = Math.min(low, level[k]); return low; };
    if (level[i] - Math.max(lowest(-1), lowest(1)) < PROMINENCE) continue;
    const x = [hz[i - 1], hz[i], hz[i + 1]], y = [power[i - 1], power[i], power[i + 1]].map((p) => most / p);
    const first = (y[1] - y[0]) / (x[1] - x[0]), second = (y[2] - y[1]) / (x[2] - x[1]), bend = (second - first) / (x[2] - x[0]);
    out.push(0.5 * (x[0] + x[1]) - (0.5 * first) / bend);
  }
  return out;
}
