// Motions as amplitudes: real and imaginary parts of (n, 3) vectors; what is shown is Re(u · e^{iφ}).

import { solveDense } from "./dense.ts";

export interface Motion { real: Float32Array; imaginary: Float32Array | null }

/** Σ weight · column of motions, whose imaginary parts may be absent. */
export function combined(columns: Float32Array[], weights: number[], imaginary: Float32Array[] | null = null): Motion {
  const sum = (parts: Float32Array[]) => {
    const out = new Float32Array(parts[0].length);
    parts.forEach((values, k) => { for (let i = 0; i < out.length; i++) out[i] += weights[k] * values[i]; });
    return out;
  };
  return { real: sum(columns), imaginary: imaginary && sum(imaginary) };
}

/** Strain energy of Σ weight · mode by point: modes have no energy in common, so that theirs are weighted by squares. */
export function energyOf(columns: Float32Array[], weights: number[]): Float32Array {
  const whole = weights.reduce((total, w) => total + w * w, 0) || 1;
  return combined(columns, weights.map((w) => (w * w) / whole)).real;
}

/** A motion times a complex number. */
export function times(motion: Motion, [a, b]: [number, number]): Motion {
  const { real, imaginary } = motion;
  if (!imaginary && b === 0) return { real: real.map((v) => a * v), imaginary: null };
  const out = { real: new Float32Array(real.length), imaginary: new Float32Array(real.length) };
  for (let i = 0; i < real.length; i++) {
    const im = imaginary ? imaginary[i] : 0;
    out.real[i] = a * real[i] - b * im;
    out.imaginary[i] = a * im + b * real[i];
  }
  return out;
}

/** a − b. */
export function minus(a: Motion, b: Motion): Motion {
  const part = (x: Float32Array | null, y: Float32Array | null) =>
    x || y ? Float32Array.from({ length: a.real.length }, (_, i) => (x ? x[i] : 0) - (y ? y[i] : 0)) : null;
  return { real: part(a.real, b.real)!, imaginary: part(a.imaginary, b.imaginary) };
}

/**
 * The shortest motion of each point that agrees with complex values along directions (values, 3) at `rows` of the points;
 * −1 stands for no point.
 */
export function measuredMotion(points: number, rows: number[], directions: ArrayLike<number>, real: number[], imaginary: number[]): Motion {
  const out = { real: new Float32Array(3 * points), imaginary: new Float32Array(3 * points) };
  for (const row of new Set(rows)) {
    if (row < 0) continue;
    const at = rows.map((r, k) => (r === row ? k : -1)).filter((k) => k >= 0);
    const d = at.map((k) => [directions[3 * k], directions[3 * k + 1], directions[3 * k + 2]]);
    const gram = d.map((a, i) => d.map((b, j) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + (i === j ? 1e-9 : 0)));
    for (const [values, part] of [[real, out.real], [imaginary, out.imaginary]] as const) {
      const weights = solveDense(gram, at.map((k) => values[k]));
      for (let c = 0; c < 3; c++) part[3 * row + c] = weights.reduce((sum, w, i) => sum + w * d[i][c], 0);
    }
  }
  return out;
}

/** (n,) length of the largest motion of each point: the root of the sum of squares of both parts. */
export function sizes(motion: Motion): Float32Array {
  const out = new Float32Array(motion.real.length / 3);
  for (let i = 0; i < out.length; i++) {
    let sum = 0;
    for (let k = 3 * i; k < 3 * i + 3; k++) sum += motion.real[k] ** 2 + (motion.imaginary ? motion.imaginary[k] ** 2 : 0);
    out[i] = Math.sqrt(sum);
  }
  return out;
}

export const largest = (values: ArrayLike<number>): number => {
  let most = 0;
  for (let i = 0; i < values.length; i++) if (values[i] > most) most = values[i];
  return most;
};

/** Positions at a phase in radians, into `out`. */
export function moved(rest: Float32Array, motion: Motion, scale: number, phase: number, out: Float32Array): void {
  const c = scale * Math.cos(phase), s = scale * Math.sin(phase);
  const { real, imaginary } = motion;
  if (imaginary) for (let i = 0; i < out.length; i++) out[i] = rest[i] + c * real[i] - s * imaginary[i];
  else for (let i = 0; i < out.length; i++) out[i] = rest[i] + c * real[i];
}

/** Length of the diagonal of the box around the points. */
export function diagonal(points: Float32Array): number {
  return Math.hypot(...box(points).map(([low, high]) => high - low)) || 1;
}

/** Smallest and largest coordinate in each direction. */
export function box(points: Float32Array): [number, number][] {
  const out: [number, number][] = [[Infinity, -Infinity], [Infinity, -Infinity], [Infinity, -Infinity]];
  for (let i = 0; i < points.length; i++) {
    const side = out[i % 3];
    if (points[i] < side[0]) side[0] = points[i];
    if (points[i] > side[1]) side[1] = points[i];
  }
  return out;
}

/**
 * The factor from a test's shape to a model's: the modal scale factor where the shapes are alike; else the one that makes
 * their largest motions equal, since the modal scale factor of unlike shapes is small.
 */
export function shownFactor(factor: [number, number], mac: number, test: Motion, seen: Motion): [number, number] {
  if (mac >= 0.5) return factor;
  const size = Math.hypot(...factor) || 1, most = largest(sizes(test)) || 1;
  const wanted = largest(sizes(seen)) / most;
  return [(wanted * factor[0]) / size || wanted, (wanted * factor[1]) / size];
}

/** Two triangles of each quadrilateral (f, 4); one where the fourth corner is the third. */
export function triangles(faces: Uint32Array): Uint32Array {
  const out: number[] = [];
  for (let i = 0; i < faces.length; i += 4) {
    const [a, b, c, d] = faces.subarray(i, i + 4);
    out.push(a, b, c);
    if (d !== c) out.push(a, c, d);
  }
  return Uint32Array.from(out);
}

/** The parameters that move a frequency most, and by how much: at most `most`, largest first, none below a hundredth of the first. */
export function strongest(names: string[], slopes: number[], most = 5): [string, number][] {
  const found = names.map((name, i): [string, number] => [name, slopes[i]]).filter(([, slope]) => Number.isFinite(slope) && slope !== 0);
  found.sort((a, b) => Math.abs(b[1]) - Math.abs(a[1]));
  return found.slice(0, most).filter(([, slope]) => Math.abs(slope) >= 0.01 * Math.abs(found[0][1]));
}
