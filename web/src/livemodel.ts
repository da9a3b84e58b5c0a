// The live model: matrices from the polynomials of the parameters, modes, pairs followed from the update, MAC and χ².

import type { LiveConfiguration, LivePart, LiveRegion, LiveTerm } from "./data.ts";
import { unpackDouble } from "./data.ts";
import { polarFactor, solveDense } from "./dense.ts";
import { largestPairs } from "./eigen.ts";
import { frfMeasures } from "./livefrfcriteria.ts";
import { FunctionSet, type Curve } from "./livefunctions.ts";
import { orthogonality } from "./livemass.ts";

const MASSLESS = 1e-14, LEAST_MASS = 1e-6;
/** λ over |σ| below which a mode has no frequency, without and with an added mass; as femtune.model.live.matrices. */
const STILL = 1e-4, STILL_WITH_MASS = 1e-6;

/** `factor` is L of K − σM = L Lᵀ. */
export interface Modes { eigenvalues: Float64Array; freq_hz: Float64Array; shapes: Float64Array[]; mass: Float64Array; factor: Float64Array }
/** A mass at one of the points that carry one. */
export interface AddedMass { point: number; mass: number }
/** A test mode and the position of its partner at the point, −1 without one; MAC of the chosen sensors, and of all. */
export interface LivePair { test: number; column: number; mac: number | null; whole: number | null }
export interface Solved { freq_hz: Float64Array; pairs: LivePair[]; mac: Float64Array; squares: Record<string, number>; common: [number, number]; chiSquare: number; measures?: Record<string, number | null>; totalMass?: number }
/** One of the functions of a configuration: which set, and which of its functions. */
export interface Chosen { set: number; k: number }

/** T_0 … of a place of the range, −1 … 1. */
export function chebyshev(t: number, count: number): Float64Array {
  const out = new Float64Array(count);
  for (let k = 0; k < count; k++) out[k] = k === 0 ? 1 : k === 1 ? t : 2 * t * out[k - 1] - out[k - 2];
  return out;
}

/** Value of the polynomial of a term. */
export function polynomial(term: LiveTerm, x: ArrayLike<number>, lower: ArrayLike<number>, upper: ArrayLike<number>): number {
  const [first, second] = term.parameters.map((p, k) => chebyshev((2 * x[p] - lower[p] - upper[p]) / (upper[p] - lower[p]), term.shape[k]));
  let sum = 0;
  if (!second) for (let i = 0; i < first.length; i++) sum += term.coefficients[i] * first[i];
  else for (let i = 0; i < first.length; i++) for (let j = 0; j < second.length; j++) sum += term.coefficients[i * second.length + j] * first[i] * second[j];
  return sum;
}

/** |rows (x − at) + offset|² over its limit: at most 1 in the 95 % region. */
export function inRegion(region: LiveRegion, x: ArrayLike<number>): number {
  const k = region.moving.length;
  let sum = 0;
  for (let i = 0; i < region.offset.length; i++) {
    let value = region.offset[i];
    for (let j = 0; j < k; j++) value += region.rows[i * k + j] * (x[region.moving[j]] - region.at[j]);
    sum += value * value;
  }
  return sum / region.limit;
}

/** Columns of a matrix of costs (rows × columns, rows ≤ columns) of which the sum is smallest, one a row. */
export function assignment(cost: number[][]): number[] {
  const n = cost.length, m = n ? cost[0].length : 0;
  const u = new Array(n + 1).fill(0), v = new Array(m + 1).fill(0), row = new Array(m + 1).fill(0), way = new Array(m + 1).fill(0);
  for (let i = 1; i <= n; i++) {
    row[0] = i;
    let j0 = 0;
    const least = new Array(m + 1).fill(Infinity), used = new Array(m + 1).fill(false);
    do {
      used[j0] = true;
      const i0 = row[j0];
      let delta = Infinity, j1 = 0;
      for (let j = 1; j <= m; j++) if (!used[j]) {
        const now = cost[i0 - 1][j - 1] - u[i0] - v[j];
        if (now < least[j]) { least[j] = now; way[j] = j0; }
        if (least[j] < delta) { delta = least[j]; j1 = j; }
      }
      for (let j = 0; j <= m; j++) if (used[j]) { u[row[j]] += delta; v[j] -= delta; } else least[j] -= delta;
      j0 = j1;
    } while (row[j0] !== 0);
    do { const j1 = way[j0]; row[j0] = row[j1]; j0 = j1; } while (j0);
  }
  const out = new Array(n).fill(-1);
  for (let j = 1; j <= m; j++) if (row[j]) out[row[j] - 1] = j - 1;
  return out;
}

/** MAC of two shapes over the entries that the test has; NaN without any. */
export function macOf(shape: Float64Array, test: Float64Array): number {
  let inner = 0, a = 0, b = 0;
  for (let i = 0; i < test.length; i++) if (!Number.isNaN(test[i])) { inner += shape[i] * test[i]; a += shape[i] * shape[i]; b += test[i] * test[i]; }
  return a > 0 && b > 0 ? (inner * inner) / (a * b) : NaN;
}

/** Part of a test's shape in the span of some model shapes, over the entries that the test has: the MAC of one shape. */
export function subspaceMac(shapes: Float64Array[], test: Float64Array): number {
  const rows = Array.from(test.keys()).filter((i) => !Number.isNaN(test[i])), target = rows.map((i) => test[i]);
  const basis: number[][] = [];
  for (const shape of shapes) {
    const v = rows.map((i) => shape[i]), before = Math.hypot(...v);
    for (const b of basis) { const d = v.reduce((sum, e, i) => sum + e * b[i], 0); v.forEach((_, i) => { v[i] -= d * b[i]; }); }
    const size = Math.hypot(...v);
    if (size > 1e-9 * before) basis.push(v.map((e) => e / size));
  }
  const whole = target.reduce((sum, e) => sum + e * e, 0);
  return whole > 0 ? basis.reduce((sum, b) => sum + b.reduce((inner, e, i) => inner + e * target[i], 0) ** 2, 0) / whole : NaN;
}

/** Eigenvalues and shapes of the combinations of close modes that are nearest to test shapes, as femtune.residuals.aligned. */
export function aligned(shapes: Float64Array[], eigenvalues: number[], tests: Float64Array[]): { eigenvalues: number[]; shapes: Float64Array[]; parts: number[][] } {
  if (shapes.length === 1 || !shapes[0].length) return { eigenvalues, shapes, parts: shapes.map((_, i) => shapes.map((_s, j) => (i === j ? 1 : 0))) };
  const columns = tests.map((b) => {
    const rows = Array.from(b.keys()).filter((i) => !Number.isNaN(b[i]));
    const inner = (p: Float64Array, q: Float64Array) => rows.reduce((sum, i) => sum + p[i] * q[i], 0);
    const x = solveDense(shapes.map((p) => shapes.map((q) => inner(p, q))), shapes.map((p) => inner(p, b))), size = Math.hypot(...x);
    return x.map((v) => v / size);
  });
  const Q = polarFactor(columns);
  return {
    eigenvalues: Q.map((q) => q.reduce((sum, v, a) => sum + v * v * eigenvalues[a], 0)),
    shapes: Q.map((q) => shapes[0].map((_, s) => q.reduce((sum, v, a) => sum + v * shapes[a][s], 0))),
    parts: Q.map((q) => Array.from(q)),
  };
}

export class LiveModel {
  readonly size: Float64Array;
  private readonly triangles: Float64Array[];
  readonly sensors: Float64Array;
  readonly tests: Float64Array[];
  private readonly weights: Map<LivePart, Float64Array>;
  private readonly massRows: Float64Array | null;
  /** Rigid-body modes of the updated point. */
  private readonly rigid: number;
  readonly functions: FunctionSet[];
  /** λ below which a mode has no frequency. */
  readonly still: number;

  constructor(readonly data: LiveConfiguration, readonly lower: number[], readonly upper: number[]) {
    const { order, theta } = data, n = (order * (order + 1)) / 2;
    const all = unpackDouble(data.triangles);
    this.triangles = data.terms.map((t, k) => Float64Array.from(all.subarray(k * n, (k + 1) * n), (v) => v * t.scale));
    this.size = Float64Array.from(theta, (t) => Math.sqrt(Math.max(t, LEAST_MASS * Math.max(...theta))));
    this.sensors = unpackDouble(data.sensors);
    this.rigid = theta.filter((t) => t > MASSLESS * Math.max(...theta) && data.shift + 1 / t < STILL * Math.abs(data.shift)).length;
    this.massRows = data.mass_rows && unpackDouble(data.mass_rows);
    const shapes = unpackDouble(data.test_shapes), modes = data.test_labels.length, count = modes ? shapes.length / modes : 0;
    this.tests = data.test_labels.map((_, i) => Float64Array.from({ length: count }, (_, s) => shapes[s * modes + i]));
    this.functions = data.functions.map((f) => new FunctionSet(f));
    this.still = STILL * Math.abs(data.shift);
    this.weights = new Map(data.parts.filter((p) => p.weights).map((p) => [p, Float64Array.from(p.weights!)]));
  }

  /** Modes that all functions need. */
  get most(): number { return Math.max(this.data.count, ...this.data.functions.map((f) => f.modes)); }

  /** The lowest modes, with a mass at a point where one is added; null where the model has none, or a motion without stiffness. */
  modes(x: ArrayLike<number>, added: AddedMass | null = null, wanted = this.data.count): Modes | null {
    const { order: n, theta, shift, terms } = this.data;
    const sums = { stiffness: new Float64Array((n * (n + 1)) / 2), mass: new Float64Array((n * (n + 1)) / 2) };
    terms.forEach((term, k) => {
      const f = polynomial(term, x, this.lower, this.upper), to = sums[term.kind], from = this.triangles[k];
      if (f !== 0) for (let i = 0; i < to.length; i++) to[i] += f * from[i];
    });
    const a = new Float64Array(n * n), m = new Float64Array(n * n), rows = added && this.massRows ? [0, 1, 2].map((d) => this.massRows!.subarray((3 * added.point + d) * n, (3 * added.point + d + 1) * n)) : [];
    for (let i = 0, at = 0; i < n; i++) for (let j = i; j < n; j++, at++) {
      let more = 0;
      for (const r of rows) more += added!.mass * r[i] * r[j];
      const moved = sums.mass[at] * this.size[i] * this.size[j] + more, same = i === j;
      a[i * n + j] = a[j * n + i] = (same ? 1 : 0) + sums.stiffness[at] - shift * moved;
      m[i * n + j] = m[j * n + i] = (same ? theta[i] : 0) + moved;
    }
    const mass = m.slice(), count = Math.min(wanted, n), found = largestPairs(m, a, n, count);
    if (!found) return null;
    const values: number[] = [], shapes: Float64Array[] = [];
    for (let k = 0; k < count; k++) {
      const t = found.theta[k];
      if (!(t > MASSLESS * found.theta[0])) break;
      values.push(shift + 1 / t);
      shapes.push(found.vectors.slice(k * n, (k + 1) * n).map((v) => v / Math.sqrt(t)));
    }
    const still = (added ? STILL_WITH_MASS : STILL) * Math.abs(shift);
    if (values.filter((v) => v < still).length > this.rigid) return null;
    const eigenvalues = Float64Array.from(values);
    return { eigenvalues, freq_hz: eigenvalues.map((v) => Math.sqrt(Math.max(v, 0)) / (2 * Math.PI)), shapes, mass, factor: a };
  }

  /** Those that are shown, of more of them. */
  lowest(modes: Modes): Modes {
    const { count } = this.data;
    return modes.shapes.length <= count ? modes : { ...modes, eigenvalues: modes.eigenvalues.slice(0, count), freq_hz: modes.freq_hz.slice(0, count), shapes: modes.shapes.slice(0, count) };
  }

  /** χ² of the functions by kind, and one of them. */
  functionsAt(modes: Modes, chosen: Chosen | null): { squares: Record<string, number>; curve: Curve | null } {
    const squares: Record<string, number> = {};
    let curve: Curve | null = null;
    this.functions.forEach((set, i) => {
      if (!set.compared && chosen?.set !== i) return;
      const point = set.point(this, modes);
      if (set.compared) squares[set.data.label] = (squares[set.data.label] ?? 0) + set.squares(this, point);
      if (chosen?.set === i) curve = set.curve(this, point, chosen.k);
    });
    return { squares, curve };
  }

  /** The mass of the model, and the χ² of what was weighed; null where the mass is not followed. */
  massAt(x: ArrayLike<number>): { total: number; squares: Record<string, number> } | null {
    const { mass, terms } = this.data;
    if (!mass) return null;
    const total = terms.filter((t) => t.kind === "mass").reduce((sum, term, k) => sum + mass.slopes[k] * polynomial(term, x, this.lower, this.upper), mass.updated);
    return { total, squares: mass.weighed.length ? { mass: mass.weighed.reduce((sum, [weighed, sd]) => sum + ((total - weighed) / sd) ** 2, 0) } : {} };
  }

  /** Values of the criteria other than those of single pairs, as far as the page computes them. */
  measures(modes: Modes): Record<string, number | null> {
    const wanted = new Set(this.data.criteria.map((c) => c.quantity)), out: Record<string, number | null> = {}, kept = this.data.mass_sensors;
    if (kept.length && ["diagonal", "off_diagonal", "self"].some((q) => wanted.has(q))) {
      const own = this.lowest(modes), become = this.followed(own), seen = own.shapes.map((s) => this.seen(s)), motions = this.motions(own, become, seen);
      Object.assign(out, orthogonality(this, own, kept, Array.from(motions, ([test, { shape, columns }]) => ({ test: this.tests[test], model: shape, columns })), seen));
    }
    // functions that the update did not use, with all of their lines
    const unused = this.functions.filter((set) => !set.data.label && set.data.every === 1);
    if (unused.length === 1 && ["frac", "fdac", "mean_db", "max_db", "resonance"].some((q) => wanted.has(q))) {
      const [set] = unused, point = set.point(this, modes), n = set.freq.length, test = (k: number) => ({ real: set.testReal.subarray(k * n, (k + 1) * n), imaginary: set.testImaginary.subarray(k * n, (k + 1) * n) });
      const places = Array.from({ length: set.count }, (_, k) => k);
      Object.assign(out, frfMeasures({ freq: set.freq, outputs: set.data.outputs.length, inputs: set.data.inputs.length, model: places.map((k) => set.curve(this, point, k)), test: places.map(test) }));
    }
    return out;
  }

  /** yᵀ T y of the matrix of each term. */
  forms(y: Float64Array): number[] {
    const n = this.data.order, scaled = y.map((v, i) => v * this.size[i]);
    return this.data.terms.map((term, k) => {
      const z = term.kind === "mass" ? scaled : y, from = this.triangles[k];
      let sum = 0;
      for (let i = 0, at = 0; i < n; i++) {
        let row = 0.5 * from[at++] * z[i];
        for (let j = i + 1; j < n; j++, at++) row += from[at] * z[j];
        sum += 2 * row * z[i];
      }
      return sum;
    });
  }

  /** Motion of the sensors in a shape. */
  seen(shape: Float64Array): Float64Array {
    const n = this.data.order, out = new Float64Array(this.sensors.length / n);
    for (let s = 0; s < out.length; s++) {
      let sum = 0;
      for (let i = 0; i < n; i++) sum += this.sensors[s * n + i] * shape[i];
      out[s] = sum;
    }
    return out;
  }

  /** The partner of each test mode: the mode that its partner of the update has become. */
  follow(modes: Modes): Map<number, number> {
    const become = this.followed(modes);
    return new Map(become.size ? this.data.pairs.map(([test, j]) => [test, become.get(j)!]) : []);
  }

  /** What the modes of the update that are compared have become. */
  private followed(modes: Modes): Map<number, number> {
    const { order: n, theta, pairs } = this.data, old = [...new Set(pairs.flatMap(([, , group]) => group))];
    if (!old.length || modes.shapes.length < old.length) return new Map();
    const cost = old.map((j) => modes.shapes.map((shape) => {
      let sum = 0;
      for (let i = 0; i < n; i++) sum += modes.mass[j * n + i] * shape[i];
      return -(sum * sum) / theta[j];
    }));
    const found = assignment(cost);
    return new Map(old.map((j, k) => [j, found[k]]));
  }

  /** All that is shown of a point; the MAC without the sensors that are `off`, which residuals have all the same. */
  solve(modes: Modes, off: number[] = []): Solved {
    const { data } = this, become = this.followed(modes), partner = this.follow(modes), seen = modes.shapes.map((s) => this.seen(s));
    const mac = new Float64Array(data.test_labels.length * seen.length), out = new Set(off);
    const tests = out.size ? this.tests.map((t) => t.map((v, i) => (out.has(i) ? NaN : v))) : this.tests;
    data.test_labels.forEach((_, i) => seen.forEach((s, j) => { mac[i * seen.length + j] = macOf(s, tests[i]); }));
    const enough = (left: number) => this.tests.length > 0 && left > 1;
    // of close modes what the subspace has of the test's shape
    const group = new Map(become.size ? data.pairs.filter(([, , old]) => old.length > 1).map(([test, , old]) => [test, old.map((j) => become.get(j)!)]) : []);
    const motion = this.motions(modes, become, seen);
    const pairs = data.test_labels.map((_, test) => {
      const column = partner.get(test) ?? -1, with_ = group.get(test);
      const value = (of: Float64Array, left: number) => {
        const found = column < 0 || !enough(left) ? NaN : with_ ? subspaceMac(with_.map((c) => seen[c]), of) : macOf(seen[column], of);
        return Number.isNaN(found) ? null : found;
      };
      const sensors = this.tests[test].length, chosen = value(tests[test], sensors - out.size);
      return { test, column, mac: chosen, whole: out.size ? value(this.tests[test], sensors) : chosen };
    });
    const squares: Record<string, number> = {};
    let u2 = 0, ur = 0, chiSquare = 0;
    for (const part of data.parts) {
      const own = motion.get(part.test);
      if (!own) continue;
      const values = this.residuals(part, own.eigenvalue, own.shape);
      let sum = 0;
      for (const v of values) sum += v * v;
      chiSquare += sum;
      squares[part.kind] = (squares[part.kind] ?? 0) + sum;
      if (part.common) { u2 += part.common * part.common; ur += part.common * values[0]; }
    }
    return { freq_hz: modes.freq_hz, pairs, mac, squares, common: [u2, ur], chiSquare };
  }

  /** Eigenvalue and shape at the sensors of what each test mode is compared with, and the modes that it is a combination of. */
  private motions(modes: Modes, become: Map<number, number>, seen: Float64Array[]): Map<number, { eigenvalue: number; shape: Float64Array; columns: number[]; parts: number[] }> {
    const out = new Map<number, { eigenvalue: number; shape: Float64Array; columns: number[]; parts: number[] }>();
    if (!become.size) return out;
    for (const key of new Set(this.data.pairs.map(([, , old]) => old.join()))) {
      const of = this.data.pairs.filter(([, , old]) => old.join() === key), columns = of[0][2].map((j) => become.get(j)!);
      const found = aligned(columns.map((c) => seen[c]), columns.map((c) => modes.eigenvalues[c]), of.map(([test]) => this.tests[test]));
      of.forEach(([test], i) => out.set(test, { eigenvalue: found.eigenvalues[i], shape: found.shapes[i], columns, parts: found.parts[i] }));
    }
    return out;
  }

  /** The shape (order,) that a test mode is compared with and its modes: of close modes the combination nearest to the test's. */
  compared(modes: Modes, test: number): { shape: Float64Array; columns: number[] } | null {
    const own = this.motions(modes, this.followed(modes), modes.shapes.map((s) => this.seen(s))).get(test);
    if (!own) return null;
    return { shape: modes.shapes[0].map((_, i) => own.columns.reduce((sum, c, a) => sum + own.parts[a] * modes.shapes[c][i], 0)), columns: own.columns };
  }

  private residuals(part: LivePart, eigenvalue: number, seen: Float64Array): Float64Array {
    const test = this.tests[part.test];
    if (part.quantity === "frequency") {
      const ratio = eigenvalue / (2 * Math.PI * this.data.test_freq_hz[part.test]) ** 2;
      return Float64Array.of(((part.form === "frequency" ? Math.sqrt(Math.max(ratio, 0)) : ratio) - 1) / part.sd);
    }
    if (part.quantity === "mac") {
      const root = Math.sqrt(macOf(seen, test));
      const value = part.form === "root" ? (1 - root) / root : part.form === "ratio" ? (1 - root ** 2) / root ** 2 : 1 - root ** 2;
      return Float64Array.of(value / part.sd);
    }
    const rows = part.sensors.filter((s) => !Number.isNaN(test[s]));
    const errors = differences(Float64Array.from(rows, (s) => seen[s]), Float64Array.from(rows, (s) => test[s]), part.form);
    const weights = this.weights.get(part), n = errors.length;
    if (!weights) return errors.map((e) => e / part.sd);
    return Float64Array.from({ length: n }, (_, i) => {
      let sum = 0;
      for (let j = 0; j < n; j++) sum += weights[i * n + j] * errors[j];
      return sum;
    });
  }
}

const dot = (a: Float64Array, b: Float64Array) => { let sum = 0; for (let i = 0; i < a.length; i++) sum += a[i] * b[i]; return sum; };

/** Differences of a model shape and a test shape in one scale, as femtune.residuals.shape.scaled_difference. */
export function differences(phi: Float64Array, test: Float64Array, scaling: string): Float64Array {
  const side = dot(phi, test) >= 0 ? 1 : -1, size = Math.sqrt(dot(test, test));
  if (scaling === "unit-norm") { const norm = side * Math.sqrt(dot(phi, phi)); return phi.map((v, i) => v / norm - test[i] / size); }
  if (scaling === "scale-factor") { const factor = dot(phi, test) / dot(phi, phi); return phi.map((v, i) => (factor * v - test[i]) / size); }
  if (scaling === "mass") return phi.map((v, i) => (side * v - test[i]) / size);
  let top = 0;
  test.forEach((v, i) => { if (Math.abs(v) > Math.abs(test[top])) top = i; });
  return phi.map((v, i) => v / phi[top] - test[i] / test[top]).filter((_, i) => i !== top);
}

/** Whether the page finds what femtune found at its check points, to 1e-6. */
export function verified(model: LiveModel): boolean {
  return model.data.checks.every(({ x, eigenvalues, chi_square, functions }) => {
    const all = model.modes(x, null, model.most), modes = all && model.lowest(all);
    if (!all || !modes || modes.eigenvalues.length !== eigenvalues.length) return false;
    const most = Math.max(...eigenvalues.map(Math.abs));
    const same = eigenvalues.every((v, i) => Math.abs(modes.eigenvalues[i] - v) <= 1e-6 * Math.abs(v) + 1e-9 * most);
    const powers = model.functions.map((set) => set.power(model, set.point(model, all)));
    return same && powers.every((p, i) => Math.abs(p - functions[i]) <= 1e-5 * functions[i]) && Math.abs(model.solve(modes).chiSquare - chi_square) <= 1e-5 * Math.max(1, chi_square);
  }) && model.data.checks.length > 0;
}
