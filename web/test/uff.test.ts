// A test that is dropped on the page: what is read of it, what is refused, and what it is compared with.

import assert from "node:assert/strict";
import test from "node:test";
import { doubtOfFrequencies, doubtOfLevel, droppedCurve, atSensors, levelRatio, sensorOf } from "../src/livetest.ts";
import { paired } from "../src/livepairs.ts";
import { readUff, UffError } from "../src/uff.ts";
import type { LiveFunctions } from "../src/data.ts";

const UNITS = "    -1\n   164\n         9m-kg-s                       2\n   1.0000000000000000D+03   1.0000000000000000D+00   1.0000000000000000D+00\n   2.7314999999999998D+02\n    -1\n";
const mode = (number: number, hz: string, values: string, type = 2, analysis = 2) =>
  `    -1\n    55\ntest\nNONE\nNONE\nNONE\nNONE\n         1         ${analysis}         2         8         ${type}         3\n         2         4         1         ${number}\n  ${hz}  1.00000E+00  0.00000E+00  0.00000E+00\n${values}    -1\n`;
const TWO = "         1\n  0.00000E+00 -1.00000E+00 0.0\n        12\n  0.00000E+00-2.50000E+00 3.00000E+00\n";
const frf = (more: Partial<{ kind: string; out: string; in_: string; type: number; lines: number; data: string; axis: number; over: number }> = {}) => {
  const { kind = "4", out = "         1   2", in_ = "        12  -3", type = 5, lines = 3, data = "  1.0 2.0 3.0 4.0\n  5.0 6.0\n", axis = 12, over = 13 } = more;
  return `    -1\n    58\nfrfs\nNONE\nNONE\nNONE\nNONE\n${kind.padStart(5)}         0    0         0 NONE      ${out} NONE      ${in_}\n${String(type).padStart(10)}${String(lines).padStart(10)}         1           1.          0.5  0.00000E+00\n        18    0    0    0 Frequency            Hz                  \n${String(axis).padStart(10)}    1    0    0 Acceleration         m/s2                \n${String(over).padStart(10)}    0    1    0 Excitation Force     N                   \n         0    0    0    0 NONE                 NONE                \n${data}    -1\n`;
};

test("modes and functions of a file, with Windows line ends and numbers without spaces", () => {
  const { modes, functions, notices } = readUff((UNITS + mode(1, "3.14918E+01", TWO) + frf()).replaceAll("\n", "\r\n"));
  assert.deepEqual(modes.map((m) => [m.label, m.freq_hz]), [["1", 31.4918]]);
  assert.deepEqual([...modes[0].shape], [["1X", 0], ["1Y", -1], ["1Z", 0], ["12X", 0], ["12Y", -2.5], ["12Z", 3]]);
  const [f] = functions;
  assert.deepEqual([f.output, f.input, f.sign, f.power, Array.from(f.freq)], ["1Y", "12Z", -1, 2, [1, 1.5, 2]]);
  // one unit of length is a thousandth of a metre
  assert.deepEqual(Array.from(f.real), [0.001, 0.003, 0.005]);
  assert.deepEqual(Array.from(f.imaginary), [0.002, 0.004, 0.006]);
  assert.deepEqual(notices, []);
  const six = "         1\n 1.0 2.0 3.0 4.0 5.0 6.0\n", turning = readUff(mode(1, "1.0", six).replace("8         2         3", "8         2         6")).modes[0];
  assert.deepEqual([turning.shape.get("1Z"), turning.shape.get("1RX"), turning.shape.get("1RZ")], [3, 4, 6]);
  assert.match(readUff(frf()).notices[0], /states no units .* taken to be in SI units/);
});

test("a complex shape is turned to the real one, and a complex eigenvalue has a frequency", () => {
  const values = "         1\n 0.6 0.8 1.2 1.6 0.0 0.0\n", { modes } = readUff(mode(4, "-3.0 4.0", values, 5, 3));
  assert.ok(Math.abs(modes[0].freq_hz - 5 / (2 * Math.PI)) < 1e-12);
  const [x, y, z] = [...modes[0].shape.values()];
  assert.ok(Math.abs(y / x - 2) < 1e-12 && Math.abs(Math.abs(x) - 1) < 1e-12 && z === 0);
});

const HOSTILE: [string, string, RegExp][] = [
  ["an empty file", "", /has no modes .* has no data sets at all: is it a Universal File\?/],
  ["a picture", "\x89PNG\r\n\x1a\n\0\0", /no data sets at all/],
  ["geometry alone", "    -1\n  2411\n 1 0 0 1\n 0. 0. 0.\n    -1\n", /It has the data sets 2411\./],
  ["binary functions", "    -1\n    58b     2     1        11\nabc\n    -1\n", /Line 2: binary functions/],
  ["a mode that is cut off", mode(1, "1.0", TWO).slice(0, -7), /Line 2: data set 55 does not end; the file is cut off/],
  ["NaN in a shape", mode(1, "1.0", TWO.replace("3.00000E+00", "NaN")), /Line 14: ".*NaN" has something that is no finite number/],
  ["asterisks in a shape", mode(1, "1.0", TWO.replace("3.00000E+00", "***********")), /no finite number/],
  ["an infinite value", mode(1, "1.0", TWO.replace("3.00000E+00", "3.0E+999")), /no finite number/],
  ["a mode without a frequency", mode(1, "-1.0", TWO), /mode 1 has no frequency/],
  ["a mode without points", mode(1, "1.0", ""), /mode 1 has no points/],
  ["a point that stands twice", mode(1, "1.0", TWO.replace("        12", "         1")), /point 1 stands twice/],
  ["too few values of a point", mode(1, "1.0", TWO.replace(" 3.00000E+00", "")), /data set 55 ends too early/],
  ["too many values of a point", mode(1, "1.0", TWO.replace("3.00000E+00", "3.0 4.0")), /point 12 has 4 values instead of 3/],
  ["units that are zero", UNITS.replace("1.0000000000000000D+03", "0.0") + mode(1, "1.0", TWO), /no usable factors/],
  ["two systems of units", UNITS + UNITS.replace("D+03", "D+00") + mode(1, "1.0", TWO), /state different units/],
  ["an FRF with too few values", frf({ lines: 4 }), /has 6 values instead of 8/],
  ["an FRF of a billion lines", frf({ lines: 999999999 }), /with 999999999 lines; up to 200,000/],
  ["an FRF that no plot can hold", frf({ data: "  1.0 2.0 3.0E+200 4.0\n  5.0 6.0\n" }), /values beyond 1e\+30/],
  ["an FRF without points", frf({ out: "         ?   2" }), /points of an FRF cannot be read/],
  ["a real FRF", frf({ type: 2 }), /1 data set left out: FRFs that are not complex/],
  ["an FRF of strain", frf({ axis: 3 }), /left out: FRFs of something else than motion over force/],
  ["a time record", frf({ kind: "1" }), /left out: functions that are no FRFs/],
];
for (const [what, text, wanted] of HOSTILE) test(`${what} is a message`, () => {
  assert.throws(() => readUff(text), (error) => error instanceof UffError && wanted.test(error.message), (() => { try { readUff(text); return "read"; } catch (e) { return String(e); } })());
});

test("a long FRF is read in time that grows with its length", () => {
  const of = (lines: number) => { const text = frf({ lines, data: "  1.0 2.0 3.0 4.0\n".repeat(lines / 2) }), start = performance.now(); assert.equal(readUff(text).functions[0].real.length, lines); return performance.now() - start; };
  of(2000);
  assert.ok(of(160_000) < 5000, "a quadratic reader takes minutes");
});

test("any damage is a message or a test, never another error", () => {
  const whole = UNITS + mode(1, "3.0E+01", TWO) + mode(2, "4.0E+01", TWO) + frf();
  let seed = 11, refused = 0;
  const random = (n: number) => { seed = (seed * 16807) % 2147483647; return seed % n; };
  for (let i = 0; i < 3000; i++) {
    const at = random(whole.length), kind = random(4), other = String.fromCharCode(random(256)), to = at + random(80);
    const text = kind === 0 ? whole.slice(0, at) : kind === 1 ? whole.slice(0, at) + other + whole.slice(at + 1) : kind === 2 ? whole.slice(0, at) + whole.slice(to) : whole.slice(0, to) + whole.slice(at);
    try {
      const { modes, functions } = readUff(text);
      assert.ok(modes.every((m) => m.freq_hz >= 0 && [...m.shape.values()].every(Number.isFinite)));
      assert.ok(functions.every((f) => f.freq.length === f.real.length && f.real.every(Number.isFinite) && f.imaginary.every(Number.isFinite)));
    } catch (error) {
      assert.ok(error instanceof UffError, `${error}`);
      refused++;
    }
  }
  assert.ok(refused > 500);
});

test("sensors have a point, a direction and a sign; channels that are zero everywhere were not measured", () => {
  assert.deepEqual([sensorOf("301X+"), sensorOf("12RZ-"), sensorOf("mean of two")], [{ name: "301X", sign: 1 }, { name: "12RZ", sign: -1 }, null]);
  const { modes } = readUff(mode(1, "1.0", TWO)), found = atSensors(modes, ["1Y+", "12Y-", "12X+", "99X+"]);
  assert.equal(found.count, 2);
  assert.deepEqual(Array.from(found.modes.shapes[0]), [-1, 2.5, NaN, NaN]);
  assert.equal(atSensors(modes, ["99X+"]).count, 0);
});

test("partners by shape and frequency; none for a mode that is like no other", () => {
  const seen = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((v) => Float64Array.from(v)), hz = [10, 11, 40];
  const of = (freq_hz: number[], shapes: number[][]) => paired({ labels: freq_hz.map(String), freq_hz, shapes: shapes.map((s) => Float64Array.from(s)) }, hz, seen);
  assert.deepEqual(of([10.5, 10.6], [[0, 2, 0], [3, 0.1, 0]]).map((p) => p.column), [1, 0]);
  assert.deepEqual(of([10.5], [[0, 0, 1]]), [{ column: -1, mac: null }], "the shape is that of a mode far away");
  // two sensors say nothing: the frequency alone
  assert.deepEqual(of([39], [[1, NaN, 1]]), [{ column: 2, mac: null }]);
  assert.equal(of([1, 2, 3, 4, 5], Array(5).fill([1, 1, 1])).length, 5);
  const test_ = { labels: ["1", "2"], freq_hz: [62.8, 69.1], shapes: [] };
  assert.match(doubtOfFrequencies(test_, of([62.8, 69.1], [[1, 0, 0], [0, 1, 0]]), hz), /above 60 Hz.*rad\/s/);
  assert.match(doubtOfFrequencies({ ...test_, freq_hz: [20, 21] }, of([20, 21], [[1, 0, 0], [0, 1, 0]]), [10, 11, 40]), /^$|no partner/);
});

test("a function of the file in the kind, unit and directions of the page, and its level", () => {
  const file = readUff(UNITS + frf()), data = { kind: "receptance", outputs: ["5X+", "1Y-"], inputs: ["12Z+"], si: 0.001 } as unknown as LiveFunctions;
  assert.equal(droppedCurve(file, data, 0), null);
  const found = droppedCurve(file, data, 1)!;
  // 1 + 2i mm/s²/N at 1 Hz by 12Z−, seen at 1Y−: no change of sign, over (iω)²
  assert.ok(Math.abs(found.real[0] + 1 / (2 * Math.PI) ** 2) < 1e-12 && Math.abs(found.imaginary[0] + 2 / (2 * Math.PI) ** 2) < 1e-12, `${found.real[0]}`);
  const same = (factor: number) => levelRatio(found, found.freq, found.real.map((v) => v / factor), found.imaginary.map((v) => v / factor));
  assert.ok(Math.abs(same(9.81) - 9.81) < 1e-9);
  assert.match(doubtOfLevel(same(9.81)), /9\.8 times as large .* are the units right\?/);
  assert.equal(doubtOfLevel(same(1.5)), "");
  assert.ok(Number.isNaN(levelRatio(found, [50, 60], [1, 1], [0, 0])));
});
