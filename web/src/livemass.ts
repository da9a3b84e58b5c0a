// Mass reduced to the sensors, as femtune.correlation.reduced_mass, and the orthogonalities of test and model with it.

import { cholesky, largestPairs } from "./eigen.ts";
import { solveFactored } from "./livefunctions.ts";
import { assignment, type LiveModel, type Modes } from "./livemodel.ts";

/** Eigenvalue over the largest one from which a mode is elastic; shift of a free structure over its lowest elastic one. */
const ELASTIC = 1e-6, SHIFT = 1e-2;
/** Likeness from which a mode of the reduced and of the full model are one, and the frequency error of it that is accepted. */
const SAME_SHAPE = 0.8, TOLERANCE = 0.05;

export interface Orthogonality { diagonal: number | null; off_diagonal: number | null; self: number | null }
const NONE: Orthogonality = { diagonal: null, off_diagonal: null, self: null };

/** A pair: test shape and model shape at all sensors, and the modes of the model that it is made of. */
export interface PairShapes { test: Float64Array; model: Float64Array; columns: number[] }

interface Reduced { mass: Float64Array; stiffness: Float64Array; shift: number }

/** Mass and stiffness at some sensors by static condensation; null where the sensors depend on each other. */
function reduced(model: LiveModel, modes: Modes, kept: number[]): Reduced | null {
  const { order: n, shift } = model.data, k = kept.length, L = modes.factor, M = modes.mass;
  const most = Math.max(...modes.eigenvalues), elastic = Array.from(modes.eigenvalues).filter((v) => v > ELASTIC * most);
  if (!elastic.length) return null;
  const alpha = elastic.length < modes.eigenvalues.length ? SHIFT * elastic[0] : 0;
  // B = K + αM, with K − σM = L Lᵀ
  const B = new Float64Array(n * n);
  for (let i = 0; i < n; i++) for (let j = 0; j <= i; j++) {
    let sum = 0;
    for (let a = 0; a <= j; a++) sum += L[i * n + a] * L[j * n + a];
    B[i * n + j] = sum + (shift + alpha) * M[i * n + j];
  }
  if (!cholesky(B, n)) return null;
  const rows = kept.map((s) => model.sensors.slice(s * n, (s + 1) * n)), static_ = rows.map((r) => { const x = r.slice(); solveFactored(B, n, x); return x; });
  const F = new Float64Array(k * k);
  for (let i = 0; i < k; i++) for (let j = 0; j < k; j++) for (let a = 0; a < n; a++) F[i * k + j] += rows[i][a] * static_[j][a];
  if (!cholesky(F, k)) return null;
  // columns of T = X F⁻¹, by rows of X
  const T = Array.from({ length: k }, () => new Float64Array(n)), one = new Float64Array(k);
  for (let a = 0; a < n; a++) {
    for (let i = 0; i < k; i++) one[i] = static_[i][a];
    solveFactored(F, k, one);
    for (let i = 0; i < k; i++) T[i][a] = one[i];
  }
  const mass = new Float64Array(k * k), stiffness = new Float64Array(k * k), image = new Float64Array(n);
  for (let j = 0; j < k; j++) {
    for (let i = 0; i < n; i++) { let sum = 0; for (let a = 0; a < n; a++) sum += M[i * n + a] * T[j][a]; image[i] = sum; }
    for (let i = 0; i < k; i++) { let sum = 0; for (let a = 0; a < n; a++) sum += T[i][a] * image[a]; mass[i * k + j] = sum; }
  }
  // Tᵀ B T = F⁻¹
  for (let j = 0; j < k; j++) {
    one.fill(0);
    one[j] = 1;
    solveFactored(F, k, one);
    for (let i = 0; i < k; i++) stiffness[i * k + j] = one[i] - alpha * mass[i * k + j];
  }
  return { mass, stiffness, shift: alpha };
}

const weighted = (M: Float64Array, a: ArrayLike<number>, b: ArrayLike<number>) => {
  const k = a.length;
  let sum = 0;
  for (let i = 0; i < k; i++) for (let j = 0; j < k; j++) sum += a[i] * M[i * k + j] * b[j];
  return sum;
};

/** Modes of the model whose frequency the reduced mass and stiffness repeat to 5 %. */
function repeated(own: Reduced, modes: Modes, seen: Float64Array[]): boolean[] {
  const k = Math.sqrt(own.mass.length), M = own.mass, m = M.slice(), a = own.stiffness.map((v, i) => v + own.shift * M[i]);
  const found = largestPairs(m, a, k, k);
  if (!found) return seen.map(() => false);
  const vectors = Array.from({ length: k }, (_, i) => found.vectors.subarray(i * k, (i + 1) * k)), values = Array.from(found.theta, (t) => 1 / t - own.shift);
  const norms = vectors.map((v) => weighted(M, v, v));
  const likeness = seen.map((phi) => { const size = weighted(M, phi, phi); return vectors.map((v, j) => (size > 0 ? weighted(M, phi, v) ** 2 / (size * norms[j]) : 0)); });
  const cost = seen.length <= k ? likeness.map((row) => row.map((v) => -v)) : vectors.map((_, j) => likeness.map((row) => -row[j]));
  const partner = new Array(seen.length).fill(-1);
  assignment(cost).forEach((to, from) => { if (seen.length <= k) partner[from] = to; else partner[to] = from; });
  const most = Math.max(...modes.eigenvalues);
  return partner.map((j, i) => {
    if (j < 0 || likeness[i][j] < SAME_SHAPE) return false;
    return !(modes.eigenvalues[i] > ELASTIC * most) || Math.abs(Math.sqrt(Math.max(values[j], 0) / modes.eigenvalues[i]) - 1) <= TOLERANCE;
  });
}

/** The worst orthogonalities of the pairs; null where the reduced mass does not repeat the model, or there is no such term. */
export function orthogonality(model: LiveModel, modes: Modes, kept: number[], pairs: PairShapes[], seen: Float64Array[]): Orthogonality {
  const at = (v: Float64Array) => Float64Array.from(kept, (s) => v[s]), own = pairs.length ? reduced(model, modes, kept) : null;
  if (!own) return NONE;
  const good = repeated(own, modes, seen.map(at));
  if (!pairs.every(({ columns }) => columns.every((c) => good[c]))) return NONE;
  const scaled = (v: Float64Array) => { const size = Math.sqrt(weighted(own.mass, v, v)); return v.map((e) => e / size); };
  const psi = pairs.map(({ test }) => scaled(at(test))), phi = pairs.map((p) => scaled(at(p.model)));
  const product = (a: Float64Array, b: Float64Array) => Math.min(1, Math.abs(weighted(own.mass, a, b)));
  const off = (of: Float64Array[]) => psi.flatMap((a, i) => of.flatMap((b, j) => (i === j ? [] : [product(a, b)])));
  return { diagonal: Math.min(...psi.map((a, i) => product(a, phi[i]))), off_diagonal: pairs.length < 2 ? null : Math.max(...off(phi)), self: pairs.length < 2 ? null : Math.max(...off(psi)) };
}
