import assert from "node:assert/strict";
import test from "node:test";
import { fileName, hertz, shown } from "../src/dom.ts";
import { magnitudes, ticks } from "../src/functions.ts";
import { shade } from "../src/matrix.ts";
import { compare, csv, numberOf } from "../src/tables.ts";

test("numbers as the page writes them", () => {
  const cases: [string, number | null][] = [["1.509e−5", 1.509e-5], ["−0.31 %", -0.31], ["+2", 2], ["≤ 3 %", 3], ["2232.1 … 3572.2", 2232.1],
    ["12Z+", null], ["PBAR 1 I1", null], ["", null], ["—", null], ["4a", null], [".98", 0.98]];
  for (const [text, value] of cases) assert.equal(numberOf(text), value, text);
});

test("rounding is no frequency of a rigid-body mode", () => {
  assert.deepEqual([0, 1.1e-4, 0.25, 102.9, 1234.56].map(hertz), ["0 Hz (rigid body)", "0 Hz (rigid body)", "0.25000 Hz", "102.90 Hz", "1234.6 Hz"]);
});

test("numbers sort by size, texts by their numbers inside, empty cells last in both directions", () => {
  const cells = ["10", "−3", "—", "2.5e1", "mode 10", "mode 9", ""];
  assert.deepEqual([...cells].sort((a, b) => compare(a, b, false)), ["−3", "10", "2.5e1", "mode 9", "mode 10", "—", ""]);
  assert.deepEqual([...cells].filter((c) => numberOf(c) !== null || c.length < 2).sort((a, b) => compare(a, b, true)), ["2.5e1", "10", "−3", "—", ""]);
});

test("CSV quotes what must be quoted, writes minus signs that programs read, and no formulas", () => {
  assert.equal(csv([['a "b"', "c,d", "−1.5", "=HYPERLINK(1)", "@x", "-3", "line\nbreak"]]), '"a ""b""","c,d",-1.5,\'=HYPERLINK(1),\'@x,-3,"line\nbreak"\r\n');
});

test("texts of numbers and names of files", () => {
  assert.equal(shown(-1.23456), "−1.235");
  assert.equal(shown(0), "0");
  assert.equal(shown(1.5e-5), "1.500e−5");
  assert.equal(shown(null), "–");
  assert.equal(fileName("MAC: BC / after", "csv"), "mac-bc-after.csv");
  assert.equal(fileName("梁", "csv"), "femtune.csv");
});

test("ticks are round and inside the range", () => {
  assert.deepEqual(ticks(0, 100, 5), [0, 20, 40, 60, 80, 100]);
  assert.deepEqual(ticks(3.1, 3.3, 4).map((t) => Number(t.toFixed(6))), [3.1, 3.15, 3.2, 3.25, 3.3]);
});

test("the range of magnitudes looks at the lines that are shown, and spans six decades at most", () => {
  const line = { look: "test", freq: Float32Array.of(1, 2, 3), real: Float32Array.of(1e-9, 3, 0), imaginary: Float32Array.of(0, 4, 0), phase: true };
  assert.deepEqual(magnitudes([line], 0, 10).map((v) => Number(v.toPrecision(3))), [3.5e-6, 7.5]);
  assert.deepEqual(magnitudes([line], 2.5, 10), [0.1, 1]);
});

test("text on dark cells is white", () => {
  assert.equal(shade(1)[1], "#fff");
  assert.equal(shade(0)[1], "#1d2733");
});
