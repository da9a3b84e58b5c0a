// The largest eigenvalues θ of M z = θ A z with A positive definite, and their vectors: Cholesky, Householder, implicit QL
// for the values, inverse iteration for the vectors. Matrices are dense and symmetric, n × n in rows.

/** L of A = L Lᵀ in the lower triangle, in place; false if A is not positive definite. */
export function cholesky(a: Float64Array, n: number): boolean {
  for (let i = 0; i < n; i++) {
    const ri = i * n;
    for (let j = 0; j <= i; j++) {
      const rj = j * n;
      let sum = a[ri + j];
      for (let k = 0; k < j; k++) sum -= a[ri + k] * a[rj + k];
      if (i === j) {
        if (!(sum > 0)) return false;
        a[ri + i] = Math.sqrt(sum);
      } else a[ri + j] = sum / a[rj + j];
    }
  }
  return true;
}

/** L⁻¹ M L⁻ᵀ, in place in `m`. */
export function congruent(m: Float64Array, l: Float64Array, n: number): void {
  forward(m, l, n, false);
  transpose(m, n);
  // the result is symmetric: each row from its diagonal on
  forward(m, l, n, true);
  for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) m[i * n + j] = m[j * n + i];
}

/** Rows of L⁻¹ M, in place: each needs those before it, which are taken four at a time. */
function forward(m: Float64Array, l: Float64Array, n: number, upper: boolean): void {
  for (let i = 0; i < n; i++) {
    const ri = i * n, d = 1 / l[ri + i], from = upper ? i : 0;
    let k = 0;
    for (; k + 3 < i; k += 4) {
      const a = l[ri + k], b = l[ri + k + 1], c = l[ri + k + 2], e = l[ri + k + 3], r0 = k * n, r1 = r0 + n, r2 = r1 + n, r3 = r2 + n;
      for (let j = from; j < n; j++) m[ri + j] -= a * m[r0 + j] + b * m[r1 + j] + c * m[r2 + j] + e * m[r3 + j];
    }
    for (; k < i; k++) {
      const f = l[ri + k], rk = k * n;
      for (let j = from; j < n; j++) m[ri + j] -= f * m[rk + j];
    }
    for (let j = from; j < n; j++) m[ri + j] *= d;
  }
}

function transpose(m: Float64Array, n: number): void {
  for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) { const t = m[i * n + j]; m[i * n + j] = m[j * n + i]; m[j * n + i] = t; }
}

/** Householder reduction to a tridiagonal matrix; row i of `a` keeps the vector that was used for it. */
export function tridiagonal(a: Float64Array, n: number): { diagonal: Float64Array; off: Float64Array; size: Float64Array } {
  const diagonal = new Float64Array(n), off = new Float64Array(n), size = new Float64Array(n), p = new Float64Array(n);
  for (let i = n - 1; i > 0; i--) {
    const ri = i * n;
    let square = 0;
    for (let k = 0; k < i; k++) square += a[ri + k] * a[ri + k];
    const last = a[ri + i - 1];
    if (square - last * last <= 1e-300) { off[i] = last; size[i] = 0; continue; }
    const g = last >= 0 ? -Math.sqrt(square) : Math.sqrt(square);
    off[i] = g;
    const h = square - last * g;
    a[ri + i - 1] = last - g;
    size[i] = h;
    // p = A u / h on the leading block, both triangles are kept
    p.fill(0, 0, i);
    for (let j = 0; j < i; j++) {
      const u = a[ri + j], rj = j * n;
      if (u === 0) continue;
      for (let k = 0; k < i; k++) p[k] += u * a[rj + k];
    }
    let c = 0;
    for (let j = 0; j < i; j++) { p[j] /= h; c += p[j] * a[ri + j]; }
    c /= 2 * h;
    for (let j = 0; j < i; j++) p[j] -= c * a[ri + j];
    for (let j = 0; j < i; j++) {
      const u = a[ri + j], v = p[j], rj = j * n;
      for (let k = 0; k < i; k++) a[rj + k] -= u * p[k] + v * a[ri + k];
    }
  }
  for (let i = 0; i < n; i++) diagonal[i] = a[i * n + i];
  return { diagonal, off, size };
}

/** Eigenvalues of a tridiagonal matrix by implicit QL, descending; null if they do not converge. */
export function tridiagonalValues(diagonal: Float64Array, off: Float64Array): Float64Array | null {
  const n = diagonal.length, d = diagonal.slice(), e = new Float64Array(n);
  for (let i = 1; i < n; i++) e[i - 1] = off[i];
  for (let l = 0; l < n; l++) {
    for (let turn = 0; ; turn++) {
      let m = l;
      for (; m < n - 1; m++) if (Math.abs(e[m]) <= Number.EPSILON * (Math.abs(d[m]) + Math.abs(d[m + 1]))) break;
      if (m === l) break;
      if (turn === 60) return null;
      let g = (d[l + 1] - d[l]) / (2 * e[l]), r = Math.hypot(g, 1);
      g = d[m] - d[l] + e[l] / (g + (g >= 0 ? r : -r));
      let s = 1, c = 1, p = 0, i = m - 1;
      for (; i >= l; i--) {
        const f = s * e[i], b = c * e[i];
        r = Math.hypot(f, g);
        e[i + 1] = r;
        if (r === 0) { d[i + 1] -= p; e[m] = 0; break; }
        s = f / r; c = g / r;
        g = d[i + 1] - p;
        r = (d[i] - g) * s + 2 * c * b;
        p = s * r;
        d[i + 1] = g + p;
        g = c * r - b;
      }
      if (r === 0 && i >= l) continue;
      d[l] -= p; e[l] = g; e[m] = 0;
    }
  }
  return d.sort().reverse();
}

/** Vectors of the `count` first of the values by inverse iteration, of unit length, one after the other. */
export function tridiagonalVectors(diagonal: Float64Array, off: Float64Array, values: Float64Array, count: number): Float64Array {
  const n = diagonal.length, out = new Float64Array(count * n);
  let norm = 0;
  for (let i = 0; i < n; i++) norm = Math.max(norm, Math.abs(diagonal[i]) + Math.abs(off[i]) + (i + 1 < n ? Math.abs(off[i + 1]) : 0));
  const tiny = Number.EPSILON * (norm || 1), close = 1e-3 * norm;
  const a = new Float64Array(n), b = new Float64Array(n), c = new Float64Array(n), low = new Float64Array(n), swapped = new Uint8Array(n);
  let seed = 1, before = Infinity;
  for (let k = 0; k < count; k++) {
    // equal values are moved apart a little, so that their vectors differ
    const value = Math.min(values[k], before - 10 * tiny);
    before = value;
    // U with two upper diagonals, rows exchanged where that is needed
    for (let i = 0; i < n; i++) { a[i] = diagonal[i] - value; b[i] = i + 1 < n ? off[i + 1] : 0; c[i] = 0; }
    for (let i = 0; i + 1 < n; i++) {
      const under = off[i + 1];
      if (Math.abs(a[i]) >= Math.abs(under)) {
        if (a[i] === 0) a[i] = tiny;
        swapped[i] = 0;
        low[i] = under / a[i];
        a[i + 1] -= low[i] * b[i];
      } else {
        swapped[i] = 1;
        low[i] = a[i] / under;
        const above = b[i];
        a[i] = under; b[i] = a[i + 1]; c[i] = b[i + 1];
        a[i + 1] = above - low[i] * b[i];
        b[i + 1] = -low[i] * c[i];
      }
    }
    if (Math.abs(a[n - 1]) < tiny) a[n - 1] = tiny;
    const v = out.subarray(k * n, (k + 1) * n);
    for (let i = 0; i < n; i++) { seed = (seed * 16807) % 2147483647; v[i] = seed / 2147483647 - 0.5; }
    for (let turn = 0; turn < 3; turn++) {
      if (turn) for (let i = 0; i + 1 < n; i++) {
        if (swapped[i]) { const t = v[i]; v[i] = v[i + 1]; v[i + 1] = t; }
        v[i + 1] -= low[i] * v[i];
      }
      for (let i = n - 1; i >= 0; i--) {
        let sum = v[i];
        if (i + 1 < n) sum -= b[i] * v[i + 1];
        if (i + 2 < n) sum -= c[i] * v[i + 2];
        v[i] = sum / (Math.abs(a[i]) < tiny ? tiny : a[i]);
      }
      scale(v);
      for (let q = 0; q < k; q++) if (Math.abs(values[q] - values[k]) <= close) {
        const w = out.subarray(q * n, (q + 1) * n);
        let dot = 0;
        for (let i = 0; i < n; i++) dot += v[i] * w[i];
        for (let i = 0; i < n; i++) v[i] -= dot * w[i];
      }
      scale(v);
    }
  }
  return out;
}

function scale(v: Float64Array): void {
  let most = 0, sum = 0;
  for (let i = 0; i < v.length; i++) most = Math.max(most, Math.abs(v[i]));
  if (most === 0) return;
  for (let i = 0; i < v.length; i++) { v[i] /= most; sum += v[i] * v[i]; }
  const f = 1 / Math.sqrt(sum);
  for (let i = 0; i < v.length; i++) v[i] *= f;
}

/** θ descending (n) and `count` vectors (rows) with zᵀ A z = 1; null if A is not positive definite. Both matrices are overwritten. */
export function largestPairs(m: Float64Array, a: Float64Array, n: number, count: number): { theta: Float64Array; vectors: Float64Array } | null {
  if (!cholesky(a, n)) return null;
  congruent(m, a, n);
  const { diagonal, off, size } = tridiagonal(m, n);
  const theta = tridiagonalValues(diagonal, off);
  if (!theta) return null;
  const vectors = tridiagonalVectors(diagonal, off, theta, count);
  for (let k = 0; k < count; k++) {
    const v = vectors.subarray(k * n, (k + 1) * n);
    for (let i = 1; i < n; i++) {
      if (size[i] === 0) continue;
      const ri = i * n;
      let sum = 0;
      for (let j = 0; j < i; j++) sum += m[ri + j] * v[j];
      sum /= size[i];
      for (let j = 0; j < i; j++) v[j] -= sum * m[ri + j];
    }
    // z = L⁻ᵀ v
    for (let i = n - 1; i >= 0; i--) {
      v[i] /= a[i * n + i];
      for (let j = 0; j < i; j++) v[j] -= a[i * n + j] * v[i];
    }
  }
  return { theta, vectors };
}
