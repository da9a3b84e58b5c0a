// What poles make of measured functions or spectra: residues and terms of the modes outside, by least squares.

import { cholesky } from "./eigen.ts";

/** Values of one function over the lines. */
export interface Complex { real: ArrayLike<number>; imaginary: ArrayLike<number> }
export interface Mode { freq: number; damping: number }

/** 1/τ is the decay of an exponential window, which the poles do not have. */
function poleOf({ freq, damping }: Mode, decay: number): [number, number] {
  const w = 2 * Math.PI * freq;
  return [-damping * w - decay, w * Math.sqrt(Math.max(0, 1 - damping * damping))];
}

/** 1/(iω − λ). */
function inverse(w: number, [a, b]: [number, number]): [number, number] {
  const re = -a, im = w - b, size = re * re + im * im;
  return [re / size, -im / size];
}

/** Least squares with columns (n rows each): the solution for each right side. Columns that depend on others share. */
export function leastSquares(columns: Float64Array[], rights: ((row: number) => number)[]): Float64Array[] {
  const m = columns.length, n = columns[0]?.length ?? 0;
  const size = columns.map((c) => Math.sqrt(c.reduce((sum, v) => sum + v * v, 0)) || 1);
  const gram = new Float64Array(m * m);
  for (let i = 0; i < m; i++) for (let j = 0; j <= i; j++) {
    let sum = i === j ? 1e-12 * size[i] * size[j] : 0;
    for (let k = 0; k < n; k++) sum += columns[i][k] * columns[j][k];
    gram[i * m + j] = gram[j * m + i] = sum / (size[i] * size[j]);
  }
  if (!cholesky(gram, m)) return rights.map(() => new Float64Array(m));
  return rights.map((right) => {
    const x = new Float64Array(m);
    const values = Float64Array.from({ length: n }, (_, k) => right(k));
    for (let i = 0; i < m; i++) {
      let sum = 0;
      for (let k = 0; k < n; k++) sum += columns[i][k] * values[k];
      x[i] = sum / size[i];
    }
    for (let i = 0; i < m; i++) { for (let k = 0; k < i; k++) x[i] -= gram[i * m + k] * x[k]; x[i] /= gram[i * m + i]; }
    for (let i = m - 1; i >= 0; i--) { for (let k = i + 1; k < m; k++) x[i] -= gram[k * m + i] * x[k]; x[i] /= gram[i * m + i]; }
    return x.map((v, i) => v / size[i]);
  });
}

/**
 * Functions (iω)^d (Σ R/(iω − λ) + R̄/(iω − λ̄) + a + b/(iω)²) of the poles of `modes`, with the residues that fit best.
 * Lines at 0 Hz have no term of the modes below.
 */
export function synthesised(freq: ArrayLike<number>, measured: Complex[], derivatives: number, modes: Mode[], decay = 0): Complex[] {
  const n = freq.length, columns = Array.from({ length: 2 * modes.length + 2 }, () => new Float64Array(2 * n));
  const put = (column: Float64Array, k: number, w: number, [re, im]: [number, number]) => {
    // times (iω)^d
    if (derivatives === 1) [re, im] = [-w * im, w * re];
    if (derivatives === 2) [re, im] = [-w * w * re, -w * w * im];
    column[k] = re;
    column[n + k] = im;
  };
  const poles = modes.map((mode) => poleOf(mode, decay));
  for (let k = 0; k < n; k++) {
    const w = 2 * Math.PI * freq[k];
    poles.forEach(([a, b], j) => {
      const p = inverse(w, [a, b]), q = inverse(w, [a, -b]);
      put(columns[2 * j], k, w, [p[0] + q[0], p[1] + q[1]]);
      put(columns[2 * j + 1], k, w, [q[1] - p[1], p[0] - q[0]]);
    });
    put(columns[2 * poles.length], k, w, [1, 0]);
    put(columns[2 * poles.length + 1], k, w, [w > 0 ? -1 / (w * w) : 0, 0]);
  }
  const found = leastSquares(columns, measured.map(({ real, imaginary }) => (row) => (row < n ? real[row] : imaginary[row - n])));
  return found.map((x) => {
    const out = { real: new Float32Array(n), imaginary: new Float32Array(n) };
    for (let k = 0; k < n; k++) {
      let re = 0, im = 0;
      for (let j = 0; j < x.length; j++) { re += x[j] * columns[j][k]; im += x[j] * columns[j][n + k]; }
      out.real[k] = re;
      out.imaginary[k] = im;
    }
    return out;
  });
}

/**
 * A sum of auto spectra 2 Re Σ c/(iω − λ) + c̄/(iω − λ̄) + a, fitted relative to its values: responses of these poles to
 * unmeasured random forces. Negative sums are 0.
 */
export function synthesisedPower(freq: ArrayLike<number>, power: ArrayLike<number>, modes: Mode[]): Float64Array {
  const n = freq.length, columns = Array.from({ length: 2 * modes.length + 1 }, () => new Float64Array(n));
  for (let k = 0; k < n; k++) {
    const w = 2 * Math.PI * freq[k], weight = power[k] > 0 ? 1 / power[k] : 0;
    modes.forEach((mode, j) => {
      const [a, b] = poleOf(mode, 0), p = inverse(w, [a, b]), q = inverse(w, [a, -b]);
      columns[2 * j][k] = weight * (p[0] + q[0]);
      columns[2 * j + 1][k] = weight * (q[1] - p[1]);
    });
    columns[2 * modes.length][k] = weight;
  }
  const [x] = leastSquares(columns, [(k) => (power[k] > 0 ? 1 : 0)]);
  return Float64Array.from({ length: n }, (_, k) => {
    const sum = x.reduce((total, v, j) => total + v * columns[j][k], 0);
    return Math.max(0, sum * power[k]);
  });
}

/** Root of the sum of squares over functions, at each line. */
export function together(functions: Complex[], lines: number): Float64Array {
  const out = new Float64Array(lines);
  for (const { real, imaginary } of functions) for (let k = 0; k < lines; k++) out[k] += real[k] ** 2 + imaginary[k] ** 2;
  return out.map(Math.sqrt);
}

/** ‖a − b‖ / ‖a‖ of a function. */
export function misfit(a: Complex, b: Complex): number {
  let off = 0, size = 0;
  for (let k = 0; k < a.real.length; k++) {
    off += (a.real[k] - b.real[k]) ** 2 + (a.imaginary[k] - b.imaginary[k]) ** 2;
    size += a.real[k] ** 2 + a.imaginary[k] ** 2;
  }
  return size > 0 ? Math.sqrt(off / size) : 0;
}
