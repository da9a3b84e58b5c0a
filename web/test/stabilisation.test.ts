import assert from "node:assert/strict";
import test from "node:test";
import type { Packed, Stabilisation } from "../src/data.ts";
import { choices, polesOf, quoted } from "../src/stabilisation.ts";

const pack = (numbers: number[]): Packed =>
  ({ type: "f4", shape: [numbers.length], data: Buffer.from(Float32Array.from(numbers).buffer).toString("base64"), scale: [], offset: [] });
const data: Stabilisation = {
  methods: ["N4SID", "pLSCF"], method: pack([0, 1, 0]), order: pack([4, 6, 8]), freq_hz: pack([3, 7.25, 12]), damping_ratio: pack([0.01, 0.5, -0.25]), stable: pack([1, 0, 1]),
  picked: [], curve_hz: pack([]), curve_db: pack([]), words: "all functions together", singular_db: pack([]), power: pack([]), derivatives: -1, decay: 0, functions: 0, band_hz: [1, 20], inputs: [{ path: "a.csv", sha256: "0f" }],
};

test("the file has the inputs, and method, order, frequency and damping of each picked pole", () => {
  const text = choices(data, polesOf(data), [{ row: 0, name: " first ", fitOnly: false }, { row: 1, name: "", fitOnly: true }]);
  assert.deepEqual(text.split("\n").slice(3), [
    "[[input]]", 'path = "a.csv"', 'sha256 = "0f"', "",
    "[[mode]]", 'name = "first"', 'method = "N4SID"', "order = 4", "freq_hz = 3.0", "damping_ratio = 0.0099999998", "",
    "[[mode]]", "fit_only = true", 'method = "pLSCF"', "order = 6", "freq_hz = 7.25", "damping_ratio = 0.5", "",
  ]);
});

test("names are texts of TOML whatever they contain", () => {
  assert.equal(quoted('a "b" \\ \n'), '"a \\"b\\" \\\\ \\u000a"');
});
