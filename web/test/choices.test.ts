import assert from "node:assert/strict";
import test from "node:test";
import { alsoForbidden, begun, choicesFile, stateOf, turn } from "../src/choices.ts";
import type { Choices, ModeChoices } from "../src/data.ts";

const of: ModeChoices = {
  configuration: "BC", test_labels: ["1", "2", "a|b"], test_freq_hz: [3, 4, 5], numbers: [1, 2, 3], model_freq_hz: [3, 4, 5],
  mac: { type: "f4", shape: [0], data: "", scale: [], offset: [] }, pairs: [["1", 1]], fixed: [["2", 2]], never: [["1", 3]], close: [[2, 3]], left_out: [["a|b", "local"]],
  sensors: ["1X+", "2X+"], off: ["2X+"],
};
const data: Choices = { inputs: [{ path: "a.bdf", sha256: "0f" }], configurations: [of], fields: [{ name: "E", field: "MAT1 1 E", what: "", value: 1, lower: 0.8, upper: 2, chosen: false, further: [] }, { name: "k", field: "PBUSH 4 K4", what: "", value: 1, lower: 0.5, upper: 2, chosen: true, further: ["PBUSH 4 K5"] }], kept: [] };
const tables = (text: string) => text.split("\n\n").slice(1).map((part) => part.trim().split("\n"));

test("a pair goes from the MAC to a pair by hand, to never, and back", () => {
  const chosen = begun(of);
  assert.equal(stateOf(chosen, "1", 2), "");
  assert.equal(turn(chosen, "1", 2), "fixed");
  assert.equal(stateOf(chosen, "2", 2), "", "a model mode has one partner");
  assert.equal(turn(chosen, "1", 2), "never");
  assert.equal(turn(chosen, "1", 2), "");
  assert.equal(stateOf(chosen, "1", 3), "never");
});

test("a test mode has one partner, and a pair by hand takes it back from those that are left out", () => {
  const chosen = begun(of);
  turn(chosen, "1", 1);
  turn(chosen, "1", 2);
  assert.deepEqual([...chosen.fixed], [["1", 2]]);
  turn(chosen, "a|b", 3);
  assert.equal(chosen.leftOut.has("a|b"), false);
});

test("the file has inputs, pairs, modes, sensors and parameters", () => {
  const chosen = begun(of);
  turn(chosen, "a|b", 1);
  turn(chosen, "a|b", 1);
  chosen.leftOut.set("1", "  ");
  assert.deepEqual(tables(choicesFile(data, [chosen], data.fields)), [
    ["[[input]]", 'path = "a.bdf"', 'sha256 = "0f"'],
    ["[[pair]]", 'configuration = "BC"', 'test = "2"', "model = 2", "model_hz = 4.0"],
    ["[[never_pair]]", 'configuration = "BC"', 'test = "1"', "model = 3", "model_hz = 5.0"],
    ["[[never_pair]]", 'configuration = "BC"', 'test = "a|b"', "model = 1", "model_hz = 3.0"],
    ["[[sensor_off]]", 'configuration = "BC"', 'sensor = "2X+"'],
    ["[[parameter]]", 'name = "E"', 'field = "MAT1 1 E"', "lower = 0.8", "upper = 2.0"],
    ["[[parameter]]", 'name = "k"', 'field = "PBUSH 4 K4"', 'further_fields = ["PBUSH 4 K5"]', "lower = 0.5", "upper = 2.0"],
  ]);
  assert.deepEqual(tables(choicesFile(data, [begun(of)], []))[3], ["[[leave_out]]", 'configuration = "BC"', 'mode = "a|b"', 'reason = "local"']);
});

test("a pair that is never made with one of close modes is none with all of them", () => {
  assert.match(alsoForbidden(of, "1", 3), /Model modes 2 and 3 are close .* test mode 1 will be paired with none of them\.$/);
  assert.equal(alsoForbidden(of, "1", 1), "");
});
