// A test that a reader drops on the page, beside the live model: modes at the sensors of the model, and FRFs.

import type { Live, LiveConfiguration, LiveFunctions } from "./data.ts";
import { cycles, h, shown } from "./dom.ts";
import type { DroppedModes, DroppedPair } from "./livepairs.ts";
import { signed } from "./livetext.ts";
import { MOST_BYTES, readUff, UffError, type UffMode, type UffTest } from "./uff.ts";

/** A function of the test, as the page has it. */
export interface DroppedCurve { freq: Float64Array; real: Float64Array; imaginary: Float64Array }
/** Ratio of levels or frequencies from which units are doubted. */
const LEVEL = 3;
const NAMED = 4;

/** "301X+" or "10RZ-" as point with direction, and sign. */
export function sensorOf(label: string): { name: string; sign: number } | null {
  const found = /^(\d+)(R?[XYZ])([+-])?$/.exec(label.trim().replace("−", "-"));
  return found && { name: found[1] + found[2], sign: found[3] === "-" ? -1 : 1 };
}

/** The modes of a file at the sensors; channels that are zero in all modes were not measured. */
export function atSensors(modes: UffMode[], labels: string[]): { modes: DroppedModes; count: number } {
  const measured = new Set(modes.flatMap((m) => [...m.shape].filter(([, v]) => v !== 0).map(([name]) => name)));
  const sensors = labels.map(sensorOf), seen = sensors.map((s) => s !== null && measured.has(s.name));
  const shapes = modes.map((m) => Float64Array.from(sensors, (s, i) => (seen[i] ? (m.shape.get(s!.name) ?? NaN) * s!.sign : NaN)));
  return { modes: { labels: modes.map((m) => m.label), freq_hz: modes.map((m) => m.freq_hz), shapes }, count: seen.filter(Boolean).length };
}

/** What is doubtful of the frequencies, in a sentence; "" if nothing is. */
export function doubtOfFrequencies(test: DroppedModes, pairs: DroppedPair[], freq_hz: ArrayLike<number>): string {
  const alone = pairs.filter((p) => p.column < 0).length;
  const highest = Math.max(...Array.from(freq_hz)), inside = test.freq_hz.filter((f) => f > 0 && f <= 1.5 * highest).length;
  if (test.freq_hz.length && !inside) return `All frequencies of the file are above ${shown(1.5 * highest)} Hz, beyond the modes of this page: are they in rad/s, or of another structure?`;
  if (alone > test.labels.length / 2) return `${alone} of ${test.labels.length} modes of the file have no partner: is it a test of this structure, in Hz, with these points?`;
  return "";
}

/** The function of the file that is one of the page, as the page has its kind, unit and directions; null without one. */
export function droppedCurve(test: UffTest, data: LiveFunctions, k: number): DroppedCurve | null {
  const inputs = data.inputs.length, output = sensorOf(data.outputs[Math.floor(k / inputs)]), input = sensorOf(data.inputs[k % inputs]);
  const found = output && input && test.functions.find((f) => f.output === output.name && f.input === input.name);
  if (!found || !output || !input) return null;
  const power = ["receptance", "mobility", "accelerance"].indexOf(data.kind) - found.power, factor = (found.sign * output.sign * input.sign) / data.si;
  const from = found.freq.findIndex((f) => f > 0), count = from < 0 ? 0 : found.freq.length - from;
  const out = { freq: found.freq.slice(Math.max(from, 0)), real: new Float64Array(count), imaginary: new Float64Array(count) };
  for (let i = 0; i < count; i++) {
    // times (iω)^power
    const omega = (2 * Math.PI * out.freq[i]) ** power, turn = ((power % 4) + 4) % 4, a = factor * omega * found.real[i + from], b = factor * omega * found.imaginary[i + from];
    [out.real[i], out.imaginary[i]] = turn === 0 ? [a, b] : turn === 1 ? [-b, a] : turn === 2 ? [-a, -b] : [b, -a];
  }
  return out;
}

/** Median ratio of the magnitudes of two functions of the same place, at lines that both have; NaN without any. */
export function levelRatio(curve: DroppedCurve, freq: ArrayLike<number>, real: ArrayLike<number>, imaginary: ArrayLike<number>): number {
  const ratios: number[] = [];
  for (let i = 0, j = 0; i < curve.freq.length; i++) {
    while (j + 1 < freq.length && freq[j] < curve.freq[i]) j++;
    if (!freq.length || curve.freq[i] < freq[0] || curve.freq[i] > freq[freq.length - 1]) continue;
    const a = Math.hypot(curve.real[i], curve.imaginary[i]), b = Math.hypot(real[j], imaginary[j]);
    if (a > 0 && b > 0) ratios.push(a / b);
  }
  return ratios.length ? ratios.sort((p, q) => p - q)[Math.floor(ratios.length / 2)] : NaN;
}

export class DroppedTest {
  readonly element = h("details", { class: "dropped" }, h("summary", {}, "A test of your own"));
  private readonly said = h("p", { class: "note", role: "status" });
  private readonly rows = h("tbody");
  private readonly table = h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Modes of the dropped test", hidden: true },
    h("table", {}, h("caption", {}, "Modes of the dropped test"), h("thead", {}, h("tr", {}, ...["Mode of the file", "File, Hz", "Model mode", "Now, Hz", "Error, %", "MAC"].map((t, k) => h("th", { scope: "col", class: k ? "right" : "left" }, t)))), this.rows));
  private readonly clear = h("button", { type: "button", hidden: true, click: () => this.take(null, "") }, "Remove the test");
  private test: UffTest | null = null;
  private name = "";
  private configuration: LiveConfiguration;
  private modes: DroppedModes | null = null;
  private notices: string[] = [];
  private compared = false;
  private level = "";
  private unpaired = "";

  constructor(live: Live, private readonly changed: (modes: DroppedModes | null, curves: ((set: LiveFunctions, k: number) => DroppedCurve | null) | null) => void) {
    this.configuration = live.configurations[0];
    const input = h("input", { type: "file", accept: ".uff,.unv,.uf", "aria-label": "Universal File of a test", change: () => { if (input.files?.[0]) void this.read(input.files[0]); input.value = ""; } });
    this.element.append(
      h("p", { class: "note" }, "Drop a Universal File (ASCII; modes of data set 55, FRFs of data set 58) on this page, or choose one. It stays in this browser. Its points and directions are matched with the sensors by their numbers."),
      h("p", { class: "tools" }, h("label", { class: "file" }, h("span", {}, "File"), input), this.clear), this.said, this.table);
    const files = (e: DragEvent) => e.dataTransfer?.types.includes("Files");
    document.addEventListener("dragover", (e) => { if (files(e)) e.preventDefault(); });
    document.addEventListener("drop", (e) => {
      if (!files(e)) return;
      e.preventDefault();
      const file = e.dataTransfer!.files[0];
      if (file) void this.read(file);
    });
  }

  private async read(file: File): Promise<void> {
    (this.element as HTMLDetailsElement).open = true;
    const failed = (why: string) => this.take(null, `${file.name.slice(0, 80)}: ${why}`);
    if (file.size > MOST_BYTES) { failed(`the file has ${(file.size / 1e6).toFixed(0)} MB; up to ${MOST_BYTES / 1e6} MB are read.`); return; }
    try {
      const test = readUff(new TextDecoder("latin1").decode(await file.arrayBuffer()));
      this.name = file.name.slice(0, 80);
      this.take(test, "");
    } catch (error) {
      failed(error instanceof UffError ? error.message : "the file cannot be read.");
    }
  }

  private take(test: UffTest | null, why: string): void {
    this.test = test;
    this.open(this.configuration);
    if (!test) this.said.textContent = why;
  }

  /** Compare with a configuration. */
  open(configuration: LiveConfiguration): void {
    this.configuration = configuration;
    this.clear.hidden = this.test === null;
    this.table.hidden = true;
    this.modes = null;
    this.notices = [];
    this.said.textContent = "";
    const { test } = this;
    if (!test) {
      if (this.compared) this.changed(null, null);
      this.compared = false;
      return;
    }
    this.compared = true;
    const { modes, count } = atSensors(test.modes, configuration.sensor_labels), own = (set: LiveFunctions, k: number) => droppedCurve(test, set, k);
    if (test.modes.length) {
      if (count || !configuration.sensor_labels.length) {
        this.modes = modes;
        const points = new Set(test.modes.flatMap((m) => [...m.shape.keys()])).size;
        if (count) this.notices.push(`Shapes are compared at ${count} of the ${configuration.sensor_labels.length} sensors of this page; the file has ${points} degrees of freedom.`);
      }
      else this.notices.push(`None of the points of the file is a sensor here. The file has ${named([...(test.modes[0]?.shape.keys() ?? [])])}; the sensors are ${named(configuration.sensor_labels)}.`);
    }
    const matched = configuration.functions.reduce((sum, set) => sum + set.outputs.flatMap((_, i) => set.inputs.map((_i, j) => own(set, i * set.inputs.length + j))).filter((c) => c !== null).length, 0);
    if (test.functions.length) this.notices.push(matched ? `${matched} of ${test.functions.length} FRFs of the file are FRFs of this page; the one that is chosen is drawn there.` : `None of the ${test.functions.length} FRFs of the file is one of this page${configuration.functions.length ? "" : ", which has none"}.`);
    this.unpaired = this.level = "";
    this.tell();
    this.table.hidden = !this.modes;
    this.changed(this.modes, matched ? own : null);
  }

  /** What is doubtful of the level of the function that is shown; "" if nothing is. */
  doubted(level: string): void {
    this.level = level;
    if (this.test) this.tell();
  }

  private tell(): void {
    const head = this.test ? `${this.name}: ${[this.test.modes.length ? `${this.test.modes.length} modes` : "", this.test.functions.length ? `${this.test.functions.length} FRFs` : ""].filter(Boolean).join(", ")}.` : "";
    const text = [head, ...(this.test?.notices ?? []), ...this.notices, this.unpaired, this.level].filter(Boolean).join(" ");
    if (this.said.textContent !== text) this.said.textContent = text;
  }

  /** Show what the worker found at the values of the sliders. */
  show(pairs: DroppedPair[], freq_hz: ArrayLike<number>): void {
    const { modes } = this;
    if (!modes || pairs.length !== modes.labels.length) return;
    this.unpaired = doubtOfFrequencies(modes, pairs, freq_hz);
    this.tell();
    const cell = (text: string) => h("td", { class: "right" }, text);
    this.rows.replaceChildren(...pairs.map(({ column, mac }, i) => {
      const hz = column < 0 ? null : freq_hz[column], error = hz === null || !(modes.freq_hz[i] > 0) ? null : 100 * (hz / modes.freq_hz[i] - 1);
      return h("tr", {}, h("th", { scope: "row" }, modes.labels[i]), cell(cycles(modes.freq_hz[i])), cell(column < 0 ? "none" : String(column + 1)), cell(cycles(hz)), cell(error === null ? "–" : signed(error)), cell(mac === null ? "–" : mac.toFixed(3)));
    }));
  }
}

export function doubtOfLevel(ratio: number): string {
  return ratio > LEVEL || ratio < 1 / LEVEL ? `The dropped function is ${shown(ratio, 2)} times as large as that of the model in the median: are the units right?` : "";
}

const named = (labels: string[]) => labels.slice(0, NAMED).join(", ") + (labels.length > NAMED ? " …" : "");
