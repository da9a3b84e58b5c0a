// The solver of the live model beside NumPy, and its parts.

import assert from "node:assert/strict";
import test from "node:test";
import { largestPairs } from "../src/eigen.ts";
import { criterionRows } from "../src/livecriteria.ts";
import { FunctionSet, interpolated, solveFactored } from "../src/livefunctions.ts";
import { aligned, assignment, chebyshev, differences, inRegion, LiveModel, macOf, polynomial, subspaceMac, verified } from "../src/livemodel.ts";
import { frfMeasures, peaks, squaredDeviation } from "../src/livefrfcriteria.ts";
import { orthogonality } from "../src/livemass.ts";
import { eigenvalueGradient, extreme, levelExtreme, linearOptimum, logWeights, resampled } from "../src/liveregion.ts";
import { certificateText, partsOf, scaledSquares, size, studyLines, truthText } from "../src/livetext.ts";
import type { LiveConfiguration, Packed } from "../src/data.ts";

/** Numbers between −1 and 1 that every language makes alike. */
function numbers(count: number, seed: number): Float64Array {
  let s = seed;
  return Float64Array.from({ length: count }, () => { s = (s * 16807) % 2147483647; return (2 * s) / 2147483647 - 1; });
}

/** B Bᵀ + d·1 of a matrix of such numbers (n × m). */
function positive(n: number, m: number, seed: number, d: number): Float64Array {
  const b = numbers(n * m, seed), out = new Float64Array(n * n);
  for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) {
    for (let k = 0; k < m; k++) out[i * n + j] += b[i * m + k] * b[j * m + k];
    if (i === j) out[i * n + j] += d;
  }
  return out;
}

// scipy.linalg.eigh(M, A) of the same matrices (n, columns of B of M, seeds 7 and 11, 1 on the diagonal of A): largest first
const KNOWN: [number, number, number[]][] = [
  [5, 5, [2.0604959769912865, 1.0618688116659882, 0.6369352524044309, 0.25980585710445725, 0.0428161635657793]],
  [24, 24, [12.569331258512134, 8.684692450676993, 8.03266197288087, 6.57328840475424, 5.995316335607542, 4.5711260629149155, 3.468931647960527, 2.2544394465699438]],
  [40, 25, [16.607777082412618, 13.132130279249724, 11.449972526399948, 9.931411736186398, 7.281136377195865, 5.886449751069066, 3.9593538862992443, 3.7727380650804236]],
];

for (const [n, rank, wanted] of KNOWN) test(`eigenvalues of order ${n} are those of LAPACK, with ${n - rank} motions without mass`, () => {
  const m = positive(n, rank, 7, 0), a = positive(n, n, 11, 1), [m0, a0] = [m.slice(), a.slice()];
  const count = wanted.length, found = largestPairs(m, a, n, count)!;
  wanted.forEach((v, i) => assert.ok(Math.abs(found.theta[i] / v - 1) < 1e-11, `${i}: ${found.theta[i]} ${v}`));
  for (let p = 0; p < count; p++) for (let q = 0; q <= p; q++) {
    const [y, z] = [found.vectors.subarray(p * n, (p + 1) * n), found.vectors.subarray(q * n, (q + 1) * n)];
    const form = (k: Float64Array) => { let sum = 0; for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) sum += y[i] * k[i * n + j] * z[j]; return sum; };
    assert.ok(Math.abs(form(a0) - (p === q ? 1 : 0)) < 1e-9);
    assert.ok(Math.abs(form(m0) - (p === q ? wanted[p] : 0)) < 1e-9 * wanted[0]);
  }
});

test("equal eigenvalues have orthogonal vectors", () => {
  const n = 6, eye = () => Float64Array.from({ length: n * n }, (_, i) => (i % (n + 1) === 0 ? 1 : 0));
  const m = eye();
  m[0] = 3; m[7] = 3; m[14] = 2;
  const { theta, vectors } = largestPairs(m, eye(), n, 4)!;
  assert.deepEqual(Array.from(theta), [3, 3, 2, 1, 1, 1]);
  let inner = 0;
  for (let i = 0; i < n; i++) inner += vectors[i] * vectors[n + i];
  assert.ok(Math.abs(inner) < 1e-12);
});

test("a matrix that is not positive definite is refused", () => {
  assert.equal(largestPairs(Float64Array.of(1, 0, 0, 1), Float64Array.of(1, 2, 2, 1), 2, 1), null);
});

test("polynomials of one and two parameters", () => {
  assert.deepEqual(Array.from(chebyshev(0.5, 4)), [1, 0.5, -0.5, -1]);
  const one = { kind: "mass" as const, parameters: [1], shape: [3], coefficients: [1, 2, 3], scale: 1 };
  assert.equal(polynomial(one, [9, 1.5], [0, 1], [1, 2]), 1 - 3);
  const two = { kind: "mass" as const, parameters: [0, 1], shape: [2, 2], coefficients: [1, 2, 3, 4], scale: 1 };
  assert.equal(polynomial(two, [1, 1], [0, 1], [1, 2]), 1 - 2 + 3 - 4);
});

test("the assignment with the smallest sum", () => {
  assert.deepEqual(assignment([[4, 1, 3], [2, 0, 5], [3, 2, 2]]), [1, 0, 2]);
  assert.deepEqual(assignment([[1, 0, 9], [0, 9, 9]]), [1, 0]);
});

test("the region is an ellipsoid about its centre", () => {
  const region = { moving: [1], at: [2], rows: [3], offset: [0.5], limit: 4, centre: [2 - 0.5 / 3], precision: [9], radius_square: 4 };
  assert.equal(inRegion(region, [99, 2.5]), 1);
  assert.ok(inRegion(region, [99, 2.6]) > 1 && inRegion(region, [99, 2.4]) < 1);
});

test("the optimum of a linear function in the region stays in the bounds", () => {
  // |(x − 1, 2(y − 1))| ≤ 1
  const region = { moving: [0, 1], at: [1, 1], rows: [1, 0, 0, 2], offset: [0, 0], limit: 1, centre: [1, 1], precision: [1, 0, 0, 4], radius_square: 1 };
  const wide = linearOptimum(region, [1, 1], [1, 2], [0, 0], [3, 3]);
  assert.ok(Math.abs(wide[0] - 1 - Math.SQRT1_2) < 1e-12 && Math.abs(wide[1] - 1 - 0.5 * Math.SQRT1_2) < 1e-12);
  const cut = linearOptimum(region, [1, 1], [1, 2], [0, 0], [1.2, 3]);
  // the rest of the radius goes to the other one
  assert.ok(Math.abs(cut[0] - 1.2) < 1e-12 && Math.abs(cut[1] - 1 - 0.5 * Math.sqrt(1 - 0.04)) < 1e-12);
  // a narrow valley across the bounds
  const valley = { moving: [0, 1], at: [0, 0], rows: [10, -10, 1, 1], offset: [0, 0], limit: 4, centre: [0, 0], precision: [101, -99, -99, 101], radius_square: 4 };
  const end = linearOptimum(valley, [0, 0], [1, 0.2], [-0.5, -2], [0.5, 2]);
  assert.ok(end[0] <= 0.5 && inRegion(valley, end) <= 1 + 1e-9 && end[0] > 0.5 - 1e-9);
  assert.deepEqual(linearOptimum(null, [1, 1], [-1, 2], [0, 0], [3, 4]), [0, 4]);
});

test("the lowest and the highest frequency in a region, by a closed form", () => {
  const model = chain(0), at = [0.1], region = { moving: [0], at: [0.1], rows: [5], offset: [0], limit: 1, centre: [0.1], precision: [25], radius_square: 1 };
  const exact = (x: number) => { const half = 1.5 + x; return Math.sqrt(half - Math.sqrt(half * half - (1 + x))) / (2 * Math.PI); };
  const modes = model.modes(at)!, h = 1e-5, slope = (model.modes([0.1 + h])!.eigenvalues[0] - model.modes([0.1 - h])!.eigenvalues[0]) / (2 * h);
  assert.ok(Math.abs(eigenvalueGradient(model, at, modes, 0)[0] - slope) < 1e-8);
  assert.ok(Math.abs(extreme(model, region, at, 0, -1)!.value - exact(-0.1)) < 1e-9);
  assert.ok(Math.abs(extreme(model, region, at, 0, 1)!.value - exact(0.3)) < 1e-9);
});

test("the lowest MAC in a region is that of its end", () => {
  const model = chain(0), region = { moving: [0], at: [0.1], rows: [5], offset: [0], limit: 1, centre: [0.1], precision: [25], radius_square: 1 };
  const mac = (x: number) => model.solve(model.modes([x])!).pairs[0].whole!, found = extreme(model, region, [0.1], 0, -1, null, "mac")!;
  assert.ok(Math.abs(found.value - Math.min(mac(-0.1), mac(0.3))) < 1e-9 && found.value < mac(0.1), `${found.value}`);
});

test("samples are weighted by the true sum of squares, and those without modes do not count", () => {
  const logs = logWeights([1, 1, 4], [3, null, 4], [0, 2], null, 1);
  assert.deepEqual(logs, [0, -Infinity, 1]);
  // Student's t with few degrees of freedom
  assert.ok(Math.abs(logWeights([0], [3], [0, 0], 2, 2)[0] + 2 * Math.log(2.5)) < 1e-12);
  const { chosen, effective } = resampled([0, -Infinity, 0, 0], 2);
  assert.equal(effective, 3);
  assert.deepEqual(chosen, [0, 3]);
  assert.deepEqual(resampled([-Infinity], 2), { chosen: [], effective: 0 });
  assert.equal(scaledSquares({ frequency: 8, shape: 3 }, { frequency: 2 }), 5);
});

test("differences of shapes in their scales", () => {
  const phi = Float64Array.of(2, -2, 1), psi = Float64Array.of(-4, 4, -2);
  for (const scaling of ["unit-norm", "scale-factor", "largest-entry"]) assert.ok(differences(phi, psi, scaling).every((e) => Math.abs(e) < 1e-15), scaling);
  assert.equal(differences(phi, psi, "largest-entry").length, 2);
  assert.equal(macOf(phi, Float64Array.of(-4, NaN, -2)), 1);
});

test("the part of a shape in a subspace", () => {
  const a = Float64Array.of(1, 0, 0, 5), b = Float64Array.of(1, 1, 0, 5), t = Float64Array.of(3, 4, 12, NaN);
  assert.ok(Math.abs(subspaceMac([a, b], t) - 25 / 169) < 1e-15);
  assert.ok(Math.abs(subspaceMac([b], t) - macOf(b, t)) < 1e-15);
  assert.ok(Math.abs(subspaceMac([b, b], t) - macOf(b, t)) < 1e-15);
});

test("close modes are turned to the test's shapes", () => {
  const c = Math.cos(0.3), s = Math.sin(0.3), [a, b] = [Float64Array.of(1, 0, 2), Float64Array.of(0, 1, -1)];
  const turned = [a.map((v, i) => c * v + s * b[i]), a.map((v, i) => -s * v + c * b[i])];
  const found = aligned([a, b], [4, 9], [turned[0].map((v) => 3 * v), turned[1]]);
  found.shapes.forEach((shape, k) => shape.forEach((v, i) => assert.ok(Math.abs(v - turned[k][i]) < 1e-12)));
  assert.ok(Math.abs(found.eigenvalues[0] - (4 * c * c + 9 * s * s)) < 1e-12);
  found.parts.forEach((q, k) => q.forEach((v, i) => assert.ok(Math.abs(v - [[c, s], [-s, c]][k][i]) < 1e-12)));
  assert.deepEqual(aligned([a], [4], [b]), { eigenvalues: [4], shapes: [a], parts: [[1]] });
  const none = new Float64Array();
  assert.deepEqual(aligned([none, none], [4, 9], [none, none]).parts, [[1, 0], [0, 1]], "without sensors the modes stay as they are");
});

test("frequencies with an error that all share count less", () => {
  const one = { freq_hz: new Float64Array(), pairs: [], mac: new Float64Array(), squares: { frequency: 8, shape: 1 }, common: [2, 4] as [number, number], chiSquare: 9 };
  // rᵀ(1 + uuᵀ)⁻¹r of r = (2, 2), u = (1, 1)
  assert.deepEqual(partsOf([one]), { frequency: 8 - 16 / 3, shape: 1 });
});

test("what the true sum of squares says beside the limit of the region", () => {
  const region = { moving: [0], at: [0], rows: [1], offset: [0], limit: 4, centre: [0], precision: [1], radius_square: 4 };
  const live = { region, x: [0], draws: null, others: [], narrowed: false, rejected: false, mass_unit: "kg", parameters: [], configurations: [] };
  assert.match(truthText(live, { frequency: 1 }, { frequency: 4.5 }), /differs from that of the update by \+3\.5; 95 % limit 4: the data allow these values, if the errors are as large as they were taken to be\.$/);
  for (const [value, word] of [[4.5, "within"], [5.5, "beyond"]] as const) {
    const text = truthText({ ...live, rejected: true }, { frequency: 1 }, { frequency: value });
    assert.match(text, new RegExp(`${word} the limit\\. The fit of the update was rejected`));
    assert.doesNotMatch(text, /the data allow these values|speak against/);
  }
  assert.match(truthText(live, { frequency: 1 }, { frequency: 5.5 }), /the data speak against these values\.$/);
  assert.equal(truthText({ ...live, others: [{ kind: "FRF", chi_square: 1 }] }, { frequency: 1 }, { frequency: 4.5 }), "");
});

test("values as lines of a study, and what is said of errors", () => {
  const p = { name: "Icx1", unit: "", nominal: 1, updated: 0.6, lower: 0.2, upper: 3, scale: 1, interval: null };
  assert.equal(studyLines([p], [0.61234567]), '[[parameter]]\nname = "Icx1"\nnominal = 0.612346\n');
  const full = { other: "the full model", points: 4, corners: 2, without_modes: 0, frequency_percent: 0.0123, mac: 1e-9, chi_square_percent: 2 };
  const reduced = { ...full, other: "the reduced model of order 60", points: 82, corners: 32, without_modes: 3, mac: null, chi_square_percent: null };
  assert.equal(certificateText([full, reduced], "within the bounds"), "Largest differences that were found from the full model at 4 points within the bounds, 2 of them corners: "
    + "frequencies 0.012 %, MAC <\u00a00.001, χ² 2 %; from the reduced model of order 60 at 82 points within the bounds, 32 of them corners; at 3 of them neither has modes: frequencies 0.012 %.");
  assert.equal(size(1e-14), "<\u00a00.001");
});

function packed(values: Float64Array, shape: number[]): Packed {
  return { type: "f8", shape, data: Buffer.from(values.buffer).toString("base64"), scale: [], offset: [] };
}

/** Two springs in line to the ground, unit masses; the second spring has the stiffness 1 + x. */
function chain(check: number): LiveModel {
  const shift = -1, k = [[2, -1], [-1, 1]], added = [[1, -1], [-1, 1]];
  // coordinates that diagonalise both: eigenvectors of K by their golden ratio
  const g = (1 + Math.sqrt(5)) / 2, raw = [[1, g], [g, -1]].map((v) => v.map((e) => e / Math.hypot(...v)));
  const lambda = raw.map((v) => v[0] * (k[0][0] * v[0] + k[0][1] * v[1]) + v[1] * (k[1][0] * v[0] + k[1][1] * v[1]));
  const basis = raw.map((v, i) => v.map((e) => e / Math.sqrt(lambda[i] - shift)));
  const term = (a: number, b: number) => basis[a].reduce((sum, va, i) => sum + basis[b].reduce((inner, vb, j) => inner + va * added[i][j] * vb, 0), 0);
  const data: LiveConfiguration = {
    configuration: "chain", order: 2, count: 2, shift, theta: lambda.map((l) => 1 / (l - shift)),
    terms: [{ kind: "stiffness", parameters: [0], shape: [2], coefficients: [0, 1], scale: 1 }],
    triangles: packed(Float64Array.of(term(0, 0), term(0, 1), term(1, 1)), [1, 3]),
    sensors: packed(Float64Array.of(basis[0][0], basis[1][0], basis[0][1], basis[1][1]), [2, 2]),
    sensor_labels: ["1X+", "2X+"], mass_points: ["grid 1"], mass_reason: "",
    mass_rows: packed(Float64Array.of(basis[0][0], basis[1][0], 0, 0, 0, 0), [1, 3, 2]), test_labels: ["1"], test_freq_hz: [0.1], test_shapes: packed(Float64Array.of(raw[0][0], raw[0][1]), [2, 1]), pairs: [[0, 0, [0]]],
    parts: [{ kind: "frequency", quantity: "frequency", form: "eigenvalue", test: 0, sd: 0.5, sensors: [], weights: null, common: 0 }],
    region: [], bounds: [],
    checks: [{ x: [0.5], eigenvalues: [check, 0], chi_square: 0, functions: [] }], functions: [], functions_reason: "", criteria: [], mass: null, mass_sensors: [],
  };
  return new LiveModel(data, [-1], [1]);
}

test("modes of a chain of two masses", () => {
  const model = chain(0), x = 0.5, modes = model.modes([x])!;
  // λ² − (3 + 2x)λ + (1 + x) = 0
  const half = 1.5 + x, root = Math.sqrt(half * half - (1 + x));
  assert.ok(Math.abs(modes.eigenvalues[0] - (half - root)) < 1e-12 && Math.abs(modes.eigenvalues[1] - (half + root)) < 1e-12);
  // a mass of 3 at the first one: 4 in its row
  const heavy = model.modes([x], { point: 0, mass: 3 })!, b = (2 + x + 4 * (1 + x)) / 8, c = (1 + x) / 4;
  assert.ok(Math.abs(heavy.eigenvalues[0] - (b - Math.sqrt(b * b - c))) < 1e-9, String(heavy.eigenvalues));
  const solved = model.solve(modes);
  assert.deepEqual(solved.pairs.map((p) => [p.test, p.column]), [[0, 0]]);
  assert.ok(solved.pairs[0].mac! > 0.98 && solved.pairs[0].mac! < 1);
  const r = ((half - root) / (2 * Math.PI * 0.1) ** 2 - 1) / 0.5;
  assert.ok(Math.abs(solved.chiSquare - r * r) < 1e-12);
  // what the page finds is held against what it was given
  const right = chain(half - root);
  right.data.checks[0].eigenvalues[1] = half + root;
  right.data.checks[0].chi_square = r * r;
  assert.ok(verified(right));
  right.data.checks[0].eigenvalues[1] *= 1 + 1e-5;
  assert.ok(!verified(right));
});

test("the shape of close modes that is drawn is the combination that is nearest to the test's", () => {
  const { data } = chain(0), shapes = [[1, 0.2], [-0.2, 1]], close = { ...data, pairs: [[0, 0, [0, 1]], [1, 1, [0, 1]]] as [number, number, number[]][],
    test_labels: ["1", "2"], test_freq_hz: [0.1, 0.2], test_shapes: packed(Float64Array.of(shapes[0][0], shapes[1][0], shapes[0][1], shapes[1][1]), [2, 2]) };
  const model = new LiveModel(close, [-1], [1]), modes = model.modes([0])!;
  for (const test of [0, 1]) {
    const { shape, columns } = model.compared(modes, test)!;
    assert.deepEqual(columns, [0, 1]);
    assert.ok(macOf(model.seen(shape), model.tests[test]) > 1 - 1e-12);
    assert.ok(macOf(model.seen(modes.shapes[test]), model.tests[test]) < 0.9, "no single mode is this shape");
  }
  const single = chain(0), own = single.modes([0])!;
  assert.deepEqual(single.compared(own, 0)!.columns, [0]);
});

test("a motion without stiffness is no mode", () => {
  const model = chain(0);
  assert.equal(model.modes([-1]), null);
  assert.equal(model.modes([-0.99999]), null);
  assert.ok(model.modes([-0.99]));
  // a heavy mass is no loss of stiffness
  assert.ok(model.modes([0], { point: 0, mass: 1e4 }));
  assert.equal(model.modes([-1], { point: 0, mass: 1 }), null);
});

test("a question is answered with the mass that is added", () => {
  const model = chain(0), at = [0.1], region = { moving: [0], at: [0.1], rows: [5], offset: [0], limit: 1, centre: [0.1], precision: [25], radius_square: 1 };
  const exact = (x: number) => { const b = (2 + x + 4 * (1 + x)) / 8, c = (1 + x) / 4; return Math.sqrt(b - Math.sqrt(b * b - c)) / (2 * Math.PI); };
  for (const [sign, x] of [[-1, -0.1], [1, 0.3]]) assert.ok(Math.abs(extreme(model, region, at, 0, sign, { point: 0, mass: 3 })!.value - exact(x)) < 1e-9);
});

const BASE = { kind: "accelerance", ordinate: "", look: "test", outputs: ["1X+", "2X+"], inputs: ["2X+"], freq_hz: packed(Float64Array.of(0.05, 0.2, 0.4), [3]), test_real: packed(Float64Array.of(1, 2, 3, 4, 5, 6), [2, 1, 3]),
  test_imaginary: packed(new Float64Array(6), [2, 1, 3]), modes: 2, ratios: [0.02, 0.03], ratios_hz: [], hysteretic: false, loss_factor: 0, si: 1, label: "frf", form: "linear", every: 1, sd: packed(Float64Array.of(1, 0, 1, 1, 1, 2), [2, 1, 3]), shift: null, note: "", errors: [] };

/** x of two equations with complex numbers [re, im]. */
function both(a: [number, number][][], b: [number, number][]): [number, number][] {
  const times = (p: number[], q: number[]): [number, number] => [p[0] * q[0] - p[1] * q[1], p[0] * q[1] + p[1] * q[0]], minus = (p: number[], q: number[]): [number, number] => [p[0] - q[0], p[1] - q[1]];
  const over = (p: number[], q: number[]) => times(p, [q[0] / (q[0] ** 2 + q[1] ** 2), -q[1] / (q[0] ** 2 + q[1] ** 2)]), det = minus(times(a[0][0], a[1][1]), times(a[0][1], a[1][0]));
  return [over(minus(times(b[0], a[1][1]), times(a[0][1], b[1])), det), over(minus(times(a[0][0], b[1]), times(b[0], a[1][0])), det)];
}

test("functions of the chain by modes, and with one mode and what the other responds", () => {
  const plain = chain(0), x = [0.5], rows = { output_rows: plain.data.sensors, input_rows: packed(plain.sensors.slice(2, 4), [1, 2]) };
  // (K (1 + iη) − ω² + iωC) u = f at mass 2; without modal damping in closed form
  for (const [eta, modes, within] of [[0.1, 2, 1e-12], [0, 1, 0.02]] as const) {
    const data = { ...BASE, ...rows, modes, ratios: [0], loss_factor: eta }, model = new LiveModel({ ...plain.data, functions: [data] }, [-1], [1]), set = model.functions[0];
    const found = model.modes(x, null, 2)!, point = set.point(model, found);
    set.freq.forEach((f, l) => {
      if (modes === 1 && f > 0.1) return;
      const w = (2 * Math.PI * f) ** 2, K = [[2.5, -1.5], [-1.5, 1.5]];
      const u = both(K.map((row, i) => row.map((v, j) => [v - (i === j ? w : 0), eta * v] as [number, number])), [[0, 0], [1, 0]]);
      for (const k of [0, 1]) {
        const { real, imaginary } = set.curve(model, point, k), size = Math.hypot(...u[k]) * w;
        assert.ok(Math.hypot(real[l] + w * u[k][0], imaginary[l] + w * u[k][1]) < within * size, `${eta} ${f} ${k}`);
      }
    });
  }
});

test("residuals of functions: differences, logarithms, and what is not compared", () => {
  const plain = chain(0), rows = { output_rows: plain.data.sensors, input_rows: packed(plain.sensors.slice(2, 4), [1, 2]) };
  const of = (more: object) => { const model = new LiveModel({ ...plain.data, functions: [{ ...BASE, ...rows, ...more }] }, [-1], [1]), set = model.functions[0]; return { model, set, point: set.point(model, model.modes([0])!) }; };
  const { model, set, point } = of({}), curves = [0, 1].map((k) => set.curve(model, point, k));
  const wanted = [[0, 0, 1, 1], [0, 2, 3, 1], [1, 0, 4, 1], [1, 1, 5, 1], [1, 2, 6, 2]].reduce((sum, [k, l, t, sd]) => sum + ((curves[k].real[l] - t) ** 2 + curves[k].imaginary[l] ** 2) / sd ** 2, 0);
  assert.ok(Math.abs(set.squares(model, point) / wanted - 1) < 1e-12);
  // the test is the model turned by 0.1 rad and 10 % smaller
  const turned = (part: "real" | "imaginary") => packed(Float64Array.from(curves.flatMap((c) => Array.from(c.real, (re, l) => 0.9 * (part === "real" ? re * Math.cos(0.1) + c.imaginary[l] * Math.sin(0.1) : c.imaginary[l] * Math.cos(0.1) - re * Math.sin(0.1))))), [2, 1, 3]);
  const test_ = { test_real: turned("real"), test_imaginary: turned("imaginary") }, a = Math.log(1 / 0.9), lines = 1 + 1 + 1 + 1 + 0.25;
  const complex = of({ ...test_, form: "log-complex" }), magnitude = of({ ...test_, form: "log-magnitude", shift: packed(new Float64Array(6).fill(0.2), [2, 1, 3]) });
  assert.ok(Math.abs(complex.set.squares(complex.model, complex.point) - lines * (a * a + 0.01)) < 1e-9);
  assert.ok(Math.abs(magnitude.set.squares(magnitude.model, magnitude.point) - lines * (a + 0.2) ** 2) < 1e-9);
  assert.deepEqual(Object.keys(complex.model.functionsAt(complex.model.modes([0])!, null).squares), ["frf"]);
  assert.equal(new FunctionSet({ ...BASE, ...rows, sd: null }).compared, false);
});

test("factors solve, and tables of damping stay at their ends", () => {
  // A = L Lᵀ of L = [[2, 0], [1, 3]], times (3, 5)
  const b = Float64Array.of(4 * 3 + 2 * 5, 2 * 3 + 10 * 5);
  solveFactored(Float64Array.of(2, 0, 1, 3), 2, b);
  assert.ok(Math.abs(b[0] - 3) < 1e-14 && Math.abs(b[1] - 5) < 1e-14);
  assert.deepEqual([0, 2, 2.5, 4].map((v) => interpolated(v, [1, 2, 3], [0.1, 0.2, 0.4])), [0.1, 0.2, 0.2 + 0.4 * 0.5 - 0.2 * 0.5, 0.4]);
});

test("criteria follow frequencies and MAC; others, and those that the page finds otherwise, keep the verdict of the update", () => {
  const solved = (hz: number, mac: number) => ({ freq_hz: Float64Array.of(hz, 9), pairs: [{ test: 0, column: 0, mac: 0.1, whole: mac }, { test: 1, column: -1, mac: null, whole: null }], mac: new Float64Array(), squares: {}, common: [0, 0] as [number, number], chiSquare: 0 });
  const one = (quantity: string, at_most: boolean, limit: number, measured: number | null, verdict: string) => ({ name: quantity, quantity, at_most, limit, unit: quantity === "frequency" ? "%" : "", measured, verdict, remark: "" });
  const of = (...criteria: ReturnType<typeof one>[]) => ({ ...chain(0).data, test_freq_hz: [10, 20], criteria });
  const rows = criterionRows(of(one("frequency", true, 5, 2, "pass"), one("mac", false, 0.9, 0.95, "pass"), one("", true, 3, 1, "pass"), one("frequency", true, 5, 1, "pass"), one("mac", false, 0.9, 0.95, "fail")), solved(10.2, 0.95), solved(9.4, 0.91));
  assert.deepEqual(rows.map((r) => [r.now, r.verdict, r.live]), [["6 %", "fail", true], ["0.91", "pass", true], ["as updated", "pass", false], ["as updated", "pass", false], ["0.91", "fail", true]]);
  assert.deepEqual([rows[0].limit, rows[0].updated], ["≤ 5 %", "2 %"]);
  assert.equal(criterionRows(of(one("mac", false, 0.9, 0.95, "pass")), solved(10, 0.95), null)[0].verdict, "–");
});

test("orthogonality with the mass at the sensors: of all masses of the chain, and of one of them", () => {
  const model = chain(0), modes = model.modes([0])!, seen = modes.shapes.map((y) => model.seen(y)), pair = (test: number[], k: number) => ({ test: Float64Array.from(test), model: seen[k], columns: [k] });
  const all = orthogonality(model, modes, [0, 1], [pair([1, 1], 0), pair([1, -1], 1)], seen), g = (1 + Math.sqrt(5)) / 2, half = Math.SQRT1_2 / Math.hypot(1, g);
  // unit masses: φ = (1, g) and (g, −1) over their size
  assert.ok(Math.abs(all.diagonal! - half * (1 + g)) < 1e-12 && Math.abs(all.off_diagonal! - half * (g - 1)) < 1e-12 && all.self! < 1e-12, JSON.stringify(all));
  // condensed on the second mass: m = 1 + 1/4 and k = 1/2, whose frequency is that of the first mode to 2.4 %; the second mode is lost
  const single = orthogonality(model, modes, [1], [pair([9, 1], 0)], seen);
  assert.ok(Math.abs(single.diagonal! - 1) < 1e-12 && single.off_diagonal === null && single.self === null);
  assert.equal(orthogonality(model, modes, [1], [pair([9, 1], 1)], seen).diagonal, null);
});

test("the deviation of functions: decades and phases, and lines that are not compared", () => {
  const one = (...v: number[]) => ({ real: v.filter((_, i) => i % 2 === 0), imaginary: v.filter((_, i) => i % 2 === 1) });
  assert.ok(Math.abs(squaredDeviation(one(10, 0, 0, 20, 5, 5), one(1, 0, 0, 2, 0, 0))! - 1) < 1e-12);
  assert.ok(Math.abs(squaredDeviation(one(0, 3), one(3, 0))! - (Math.PI / 2 / Math.LN10) ** 2) < 1e-12);
  assert.equal(squaredDeviation(one(1, 1), one(0, 0)), null);
});

test("resonances are peaks that stand out, between the lines", () => {
  const hz = Array.from({ length: 200 }, (_, i) => 1 + 0.1 * i), one = (f: number, f0: number) => 1 / ((f * f - f0 * f0) ** 2 + (0.02 * f0 * f) ** 2);
  const found = peaks(hz, hz.map((f) => one(f, 5.03) + one(f, 12.26)));
  assert.equal(found.length, 2);
  assert.ok(Math.abs(found[0] / 5.03 - 1) < 1e-3 && Math.abs(found[1] / 12.26 - 1) < 1e-3, `${found}`);
  assert.deepEqual(peaks([1, 2, 3, 4, 5], [1, 1.5, 1, 1.4, 1]), [], "less than 10 dB");
});

test("criteria of functions: of the same functions, of twice as large ones, and without a partner", () => {
  const freq = Float64Array.from({ length: 100 }, (_, i) => 1 + 0.1 * i), curve = (factor: number, f0: number) => ({ real: freq.map((f) => (factor * (f0 * f0 - f * f)) / ((f0 * f0 - f * f) ** 2 + 0.01 * f * f)), imaginary: freq.map((f) => (-factor * 0.1 * f) / ((f0 * f0 - f * f) ** 2 + 0.01 * f * f)) });
  const of = (factor: number, f0: number, off = 0) => frfMeasures({ freq, outputs: 3, inputs: 1, model: [1, -1, 2].map((a) => curve(factor * a, f0)), test: [1, -1, 2].map((a, i) => { const c = curve(a, 5); if (i === 2) c.real.fill(0, 0, off), c.imaginary.fill(0, 0, off); return c; }) });
  const same = of(1, 5), twice = of(2, 5, 3), other = of(1, 9);
  assert.ok(Math.abs(same.frac! - 1) < 1e-12 && Math.abs(same.fdac! - 1) < 1e-12 && same.max_db! < 1e-9 && same.resonance! < 1e-9);
  assert.ok(Math.abs(twice.mean_db! - 20 * Math.log10(2)) < 1e-12 && Math.abs(twice.frac! - 1) < 1e-12);
  assert.equal(other.resonance, Infinity);
  assert.ok(other.frac! < 0.5 && Math.abs(other.fdac! - 1) < 1e-12, "the deflections are alike at every frequency");
});

test("the highest and lowest level of a function in a region, beside a search", () => {
  const plain = chain(0), rows = { output_rows: plain.data.sensors, input_rows: packed(plain.sensors.slice(2, 4), [1, 2]), freq_hz: packed(Float64Array.of(0.08, 0.1, 0.12), [3]) };
  const model = new LiveModel({ ...plain.data, functions: [{ ...BASE, ...rows }] }, [-1], [1]), region = { moving: [0], at: [0.1], rows: [2], offset: [0], limit: 1, centre: [0.1], precision: [4], radius_square: 1 };
  const level = (x: number, line: number) => { const set = model.functions[0], { real, imaginary } = set.curve(model, set.point(model, model.modes([x], null, 2)!), 1); return Math.hypot(real[line], imaginary[line]); };
  const all = Array.from({ length: 4001 }, (_, i) => -0.4 + i / 4000);
  for (const line of [0, 1, 2]) for (const sign of [-1, 1]) {
    const wanted = sign * Math.max(...all.map((x) => sign * level(x, line))), found = levelExtreme(model, region, [[-0.2], [0.4], [9]], [0.1], { chosen: { set: 0, k: 1 }, line, sign })!;
    assert.ok(Math.abs(found.value / wanted - 1) < 1e-4 && Math.abs(found.x[0] - 0.1) <= 0.5 + 1e-9, `${line} ${sign}: ${found.value} ${wanted}`);
    assert.equal(found.tried, 3, "a model outside of the region does not count");
  }
  const peak = levelExtreme(model, region, [], [0.1], { chosen: { set: 0, k: 1 }, line: null, sign: 1 })!;
  assert.ok(peak.value > Math.max(...[0, 1, 2].map((l) => level(0.1, l))) && [0.08, 0.1, 0.12].includes(peak.hz));
  const wide = levelExtreme(model, null, [], [0.1], { chosen: { set: 0, k: 1 }, line: 0, sign: 1 })!;
  assert.ok(wide.value >= (1 - 1e-4) * Math.max(...all.map((x) => level(x, 0))) && wide.x[0] >= -1 && wide.x[0] <= 1 && wide.tried > 20);
});

test("criteria that the worker finds follow too, and one without a value is not tested", () => {
  const solved = (frac: number | null, resonance: number) => ({ freq_hz: new Float64Array(), pairs: [], mac: new Float64Array(), squares: {}, common: [0, 0] as [number, number], chiSquare: 0, measures: { frac, resonance } });
  const of = (quantity: string, at_most: boolean, limit: number, measured: number) => ({ name: quantity, quantity, at_most, limit, unit: "", measured, verdict: "pass", remark: "" });
  const c = { ...chain(0).data, criteria: [of("frac", false, 0.8, 0.95), of("resonance", true, 5, 0)] };
  assert.deepEqual(criterionRows(c, solved(0.95, 0), solved(0.7, Infinity)).map((r) => [r.now, r.verdict]), [["0.7", "fail"], ["no partner", "fail"]]);
  assert.deepEqual(criterionRows(c, solved(0.95, 0), solved(null, 1)).map((r) => [r.now, r.verdict]), [["–", "not tested"], ["1", "pass"]]);
  assert.equal(criterionRows(c, solved(0.9, NaN), solved(0.7, 1)).some((r) => r.live), false, "the page finds something else at the update");
});
