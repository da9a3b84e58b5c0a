// Small dense systems.

/** Solution of a symmetric positive definite system, by elimination. */
export function solveDense(matrix: number[][], right: number[]): number[] {
  const a = matrix.map((row, i) => [...row, right[i]]), n = a.length;
  for (let i = 0; i < n; i++) for (let j = i + 1; j < n; j++) {
    const f = a[j][i] / a[i][i];
    for (let k = i; k <= n; k++) a[j][k] -= f * a[i][k];
  }
  const x = new Array(n).fill(0);
  for (let i = n - 1; i >= 0; i--) x[i] = (a[i][n] - x.reduce((sum, v, k) => (k > i ? sum + a[i][k] * v : sum), 0)) / a[i][i];
  return x;
}

/** The matrix with orthonormal columns that is nearest to one of c rows and t ≤ c columns, by Newton's iteration. */
export function polarFactor(columns: number[][]): number[][] {
  const t = columns.length, c = columns[0].length;
  let X = columns.map((v) => v.slice());
  for (let turn = 0; turn < 60; turn++) {
    const gram = X.map((a) => X.map((b) => a.reduce((sum, v, i) => sum + v * b[i], 0)));
    const inverse = Array.from({ length: c }, (_, i) => solveDense(gram, X.map((v) => v[i])));
    const next = X.map((v, j) => v.map((e, i) => 0.5 * (e + inverse[i][j])));
    const off = next.reduce((sum, v, j) => sum + v.reduce((inner, e, i) => inner + Math.abs(e - X[j][i]), 0), 0);
    X = next;
    if (off < 1e-15 * t * c) break;
  }
  return X;
}
