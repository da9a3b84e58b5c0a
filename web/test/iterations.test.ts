import assert from "node:assert/strict";
import test from "node:test";
import type { IterationFunctions, Packed } from "../src/data.ts";
import { curvesAt } from "../src/iterations.ts";

const pack = (shape: number[], numbers: number[]): Packed =>
  ({ type: "f4", shape, data: Buffer.from(Float32Array.from(numbers).buffer).toString("base64"), scale: [], offset: [] });

test("curves at an iteration: those that stay, of the test, of the model at first, and of the model then", () => {
  // two functions, three iterations, two lines; the value tells its place
  const model = [0, 1].flatMap((f) => [0, 1, 2].flatMap((i) => [0, 1].map((line) => 100 * f + 10 * i + line)));
  const data: IterationFunctions = {
    configuration: "c", ordinate: "Accelerance", titles: ["a", "b"], phase: true, note: "", freq_hz: pack([2], [5, 6]),
    real: pack([2, 3, 2], model), imaginary: pack([2, 3, 2], model.map((v) => -v)), test_real: pack([2, 2], [1, 2, 3, 4]), test_imaginary: pack([2, 2], [0, 0, 0, 0]),
    test_look: "equalised", beside: [{ look: "test", freq_hz: pack([3], [5, 5.5, 6]), real: pack([2, 3], [1, 2, 3, 7, 8, 9]), imaginary: pack([2, 3], [0, 0, 0, 0, 0, 0]), phase: true }],
  };
  let now = 2;
  const source = curvesAt(data, () => now);
  const shown = () => source.lines(1).map((l) => [l.look, ...l.real]);
  assert.deepEqual(shown(), [["test", 7, 8, 9], ["equalised", 3, 4], ["before", 100, 101], ["model", 120, 121]]);
  now = 1;
  assert.deepEqual(shown()[3], ["model", 110, 111]);
  assert.deepEqual([...source.lines(1)[3].imaginary], [-110, -111]);
});
