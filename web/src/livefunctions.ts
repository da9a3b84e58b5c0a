// FRFs of the live model, as femtune.model.live.frfs: some modes, and the response of all others far below their
// frequencies.

import { unpackDouble, type LiveFunctions } from "./data.ts";
import type { LiveModel, Modes } from "./livemodel.ts";

const KINDS = ["receptance", "mobility", "accelerance"];

/** One function over the lines. */
export interface Curve { real: Float64Array; imaginary: Float64Array }
/** What all functions of a set need of a point. */
interface Point { modes: number; seen: Float64Array; driven: Float64Array; real: Float64Array; imaginary: Float64Array; missed: Float64Array; second: Float64Array }

/** A⁻¹ b with A = L Lᵀ, in place. */
export function solveFactored(l: Float64Array, n: number, b: Float64Array): void {
  for (let i = 0; i < n; i++) {
    let sum = b[i];
    for (let k = 0; k < i; k++) sum -= l[i * n + k] * b[k];
    b[i] = sum / l[i * n + i];
  }
  for (let i = n - 1; i >= 0; i--) {
    b[i] /= l[i * n + i];
    for (let k = 0; k < i; k++) b[k] -= l[i * n + k] * b[i];
  }
}

/** Between the entries of a table that stays at its ends, as numpy.interp. */
export function interpolated(at: number, x: ArrayLike<number>, y: ArrayLike<number>): number {
  const n = x.length;
  if (at <= x[0]) return y[0];
  if (at >= x[n - 1]) return y[n - 1];
  let i = 1;
  while (x[i] < at) i++;
  return y[i - 1] + ((y[i] - y[i - 1]) * (at - x[i - 1])) / (x[i] - x[i - 1]);
}

export class FunctionSet {
  readonly freq: Float64Array;
  readonly testReal: Float64Array;
  readonly testImaginary: Float64Array;
  readonly count: number;
  private readonly outputs: Float64Array;
  private readonly inputs: Float64Array;
  private readonly sd: Float64Array | null;
  private readonly shift: Float64Array | null;

  constructor(readonly data: LiveFunctions) {
    this.freq = unpackDouble(data.freq_hz);
    this.testReal = unpackDouble(data.test_real);
    this.testImaginary = unpackDouble(data.test_imaginary);
    this.outputs = unpackDouble(data.output_rows);
    this.inputs = unpackDouble(data.input_rows);
    this.sd = data.sd && unpackDouble(data.sd);
    this.shift = data.shift && unpackDouble(data.shift);
    this.count = data.outputs.length * data.inputs.length;
  }

  /** Whether the page computes the residuals of these functions. */
  get compared(): boolean { return this.sd !== null; }

  /** What the functions need of a point; of some of the inputs where not all are needed. */
  point(model: LiveModel, modes: Modes): Point {
    const { order: n, shift } = model.data, { data } = this, o = data.outputs.length, i = data.inputs.length, m = Math.min(data.modes, modes.shapes.length);
    const product = (rows: Float64Array, k: number, y: Float64Array) => { let sum = 0; for (let q = 0; q < n; q++) sum += rows[k * n + q] * y[q]; return sum; };
    const seen = new Float64Array(o * m), driven = new Float64Array(i * m), missed = new Float64Array(o * i), second = new Float64Array(o * i);
    for (let r = 0; r < m; r++) {
      for (let k = 0; k < o; k++) seen[k * m + r] = product(this.outputs, k, modes.shapes[r]);
      for (let k = 0; k < i; k++) driven[k * m + r] = product(this.inputs, k, modes.shapes[r]);
    }
    for (let j = 0; j < i; j++) {
      const response = this.inputs.slice(j * n, (j + 1) * n), inertia = new Float64Array(n);
      solveFactored(modes.factor, n, response);
      for (let a = 0; a < n; a++) { let sum = 0; for (let b = 0; b < n; b++) sum += modes.mass[a * n + b] * response[b]; inertia[a] = sum; }
      solveFactored(modes.factor, n, inertia);
      for (let k = 0; k < o; k++) {
        let first = product(this.outputs, k, response), next = product(this.outputs, k, inertia);
        for (let r = 0; r < m; r++) {
          const above = modes.eigenvalues[r] - shift, part = (seen[k * m + r] * driven[j * m + r]) / above;
          first -= part;
          next -= part / above;
        }
        missed[k * i + j] = first;
        second[k * i + j] = next;
      }
    }
    // 1/(λ(1 + iη) − ω² + i d)
    const real = new Float64Array(this.freq.length * m), imaginary = new Float64Array(this.freq.length * m);
    for (let r = 0; r < m; r++) {
      const rigid = modes.eigenvalues[r] < model.still, value = rigid ? 0 : modes.eigenvalues[r], natural = Math.sqrt(value);
      const ratio = rigid ? 0 : this.ratio(r, natural / (2 * Math.PI)), rate = 2 * ratio * (data.hysteretic ? value : natural);
      for (let l = 0; l < this.freq.length; l++) {
        const omega = 2 * Math.PI * this.freq[l], a = value - omega * omega, b = data.loss_factor * value + (data.hysteretic ? rate : rate * omega), size = a * a + b * b;
        real[l * m + r] = a / size;
        imaginary[l * m + r] = -b / size;
      }
    }
    return { modes: m, seen, driven, real, imaginary, missed, second };
  }

  private ratio(r: number, hz: number): number {
    const { ratios, ratios_hz } = this.data;
    return ratios_hz.length ? interpolated(hz, ratios_hz, ratios) : ratios[Math.min(r, ratios.length - 1)];
  }

  /** Function `k`, outputs by inputs, at a point. */
  curve(model: LiveModel, point: Point, k: number): Curve {
    const { data } = this, inputs = data.inputs.length, output = Math.floor(k / inputs), input = k % inputs, m = point.modes, lines = this.freq.length;
    const real = new Float64Array(lines), imaginary = new Float64Array(lines), parts = new Float64Array(m), power = KINDS.indexOf(data.kind), eta = data.loss_factor, size = 1 + eta * eta;
    for (let r = 0; r < m; r++) parts[r] = point.seen[output * m + r] * point.driven[input * m + r];
    for (let l = 0; l < lines; l++) {
      const omega = 2 * Math.PI * this.freq[l], rest = (point.missed[k] + (omega * omega - model.data.shift) * point.second[k]) / size;
      let a = rest, b = -eta * rest;
      for (let r = 0; r < m; r++) { a += parts[r] * point.real[l * m + r]; b += parts[r] * point.imaginary[l * m + r]; }
      // (iω)⁰, (iω)¹ or (iω)²
      if (power === 0) { real[l] = a; imaginary[l] = b; }
      else if (power === 1) { real[l] = -omega * b; imaginary[l] = omega * a; }
      else { real[l] = -omega * omega * a; imaginary[l] = -omega * omega * b; }
    }
    return { real, imaginary };
  }

  /** Sum of the squares of all magnitudes. */
  power(model: LiveModel, point: Point): number {
    let sum = 0;
    for (let k = 0; k < this.count; k++) {
      const { real, imaginary } = this.curve(model, point, k);
      for (let l = 0; l < real.length; l++) sum += real[l] * real[l] + imaginary[l] * imaginary[l];
    }
    return sum;
  }

  /** Sum of squares of the residuals of all functions, as femtune.residuals.frf.residual. */
  squares(model: LiveModel, point: Point): number {
    const { sd, shift, data } = this, lines = this.freq.length;
    if (!sd) return 0;
    let sum = 0;
    for (let k = 0; k < this.count; k++) {
      const { real, imaginary } = this.curve(model, point, k);
      for (let l = 0; l < lines; l++) {
        const at = k * lines + l;
        // 0 stands for what is not compared
        if (!(sd[at] > 0)) continue;
        const c = this.testReal[at], d = this.testImaginary[at];
        let re: number, im: number;
        if (data.form === "linear") { re = real[l] - c; im = imaginary[l] - d; }
        else {
          const whole = c * c + d * d, a = (real[l] * c + imaginary[l] * d) / whole, b = (imaginary[l] * c - real[l] * d) / whole;
          re = 0.5 * Math.log(a * a + b * b) + (shift ? shift[at] : 0);
          im = data.form === "log-magnitude" ? 0 : Math.atan2(b, a);
        }
        sum += (re * re + im * im) / (sd[at] * sd[at]);
      }
    }
    return sum;
  }
}
