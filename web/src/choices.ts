// Pairs, modes, sensors and parameters that a reader chooses, saved as choices.toml for femtune run, correlate and init.

import { unpack, type Choices, type FieldChoice, type ModeChoices, type SceneData } from "./data.ts";
import { choice, cycles, h, hertz, save, shown } from "./dom.ts";
import { MatrixGrid, type MatrixCell } from "./matrix.ts";
import { partName, PartsPicture } from "./parts.ts";
import { quoted } from "./stabilisation.ts";

/** What is chosen in a configuration: model modes and reasons by label of the test mode, pairs as "label|number". */
export interface Chosen { fixed: Map<string, number>; never: Set<string>; leftOut: Map<string, string>; off: Set<string> }
export type State = "fixed" | "never" | "";

/** What the study has chosen. */
export function begun(of: ModeChoices): Chosen {
  return { fixed: new Map(of.fixed), never: new Set(of.never.map((pair) => pair.join("|"))), leftOut: new Map(of.left_out), off: new Set(of.off) };
}

export function stateOf(chosen: Chosen, test: string, model: number): State {
  return chosen.fixed.get(test) === model ? "fixed" : chosen.never.has(`${test}|${model}`) ? "never" : "";
}

/** The next state of a pair: left to the MAC, a pair, never a pair. */
export function turn(chosen: Chosen, test: string, model: number): State {
  const key = `${test}|${model}`, now = stateOf(chosen, test, model);
  if (now === "never") { chosen.never.delete(key); return ""; }
  if (now === "fixed") { chosen.fixed.delete(test); chosen.never.add(key); return "never"; }
  for (const [other, number] of chosen.fixed) if (number === model) chosen.fixed.delete(other);
  chosen.fixed.set(test, model);
  chosen.leftOut.delete(test);
  return "fixed";
}

/** What else a pair that is never made forbids, in a sentence; "" where its model mode is not one of close ones. */
export function alsoForbidden(of: ModeChoices, test: string, model: number): string {
  const close = of.close.find((modes) => modes.includes(model));
  return close ? ` Model modes ${close.slice(0, -1).join(", ")} and ${close[close.length - 1]} are close and are compared as one subspace: test mode ${test} will be paired with none of them.` : "";
}

const factor = (value: number) => { const text = String(Number(value.toPrecision(12))); return /[.e]/.test(text) ? text : `${text}.0`; };

/** The file of the choices. A mode that is left out without a reason is not in it. */
export function choicesFile(data: Choices, chosen: Chosen[], fields: FieldChoice[]): string {
  const lines = ["# choices of a report, for femtune run, correlate and init --choices", "schema_version = 1", ""];
  for (const one of data.inputs) lines.push("[[input]]", `path = ${quoted(one.path)}`, `sha256 = ${quoted(one.sha256)}`, "");
  data.configurations.forEach((of, k) => {
    const head = (table: string) => lines.push(`[[${table}]]`, `configuration = ${quoted(of.configuration)}`), { fixed, never, leftOut, off } = chosen[k];
    // a number alone may be another mode in a study that has changed
    const frequency = (model: number) => { const at = of.numbers.indexOf(model); return at < 0 ? [] : [`model_hz = ${factor(of.model_freq_hz[at])}`]; };
    for (const [test, model] of fixed) { head("pair"); lines.push(`test = ${quoted(test)}`, `model = ${model}`, ...frequency(model), ""); }
    for (const key of never) {
      const at = key.lastIndexOf("|");
      head("never_pair");
      lines.push(`test = ${quoted(key.slice(0, at))}`, `model = ${key.slice(at + 1)}`, ...frequency(Number(key.slice(at + 1))), "");
    }
    for (const [mode, reason] of leftOut) if (reason.trim()) { head("leave_out"); lines.push(`mode = ${quoted(mode)}`, `reason = ${quoted(reason.trim())}`, ""); }
    for (const sensor of off) { head("sensor_off"); lines.push(`sensor = ${quoted(sensor)}`, ""); }
  });
  for (const p of fields) lines.push("[[parameter]]", `name = ${quoted(p.name)}`, `field = ${quoted(p.field)}`, ...(p.further.length ? [`further_fields = [${p.further.map(quoted).join(", ")}]`] : []), `lower = ${factor(p.lower)}`, `upper = ${factor(p.upper)}`, "");
  return lines.join("\n");
}

const WORDS: Record<State, string> = { fixed: "a pair by hand", never: "never a pair", "": "left to the MAC" };
const SIGNS: Record<State, string> = { fixed: "● ", never: "✕ ", "": "" };

export class Chooser {
  readonly element: HTMLElement;
  private readonly modes = h("div");
  private readonly told = h("p", { class: "note", role: "status" });
  private readonly text = h("textarea", { readonly: true, rows: 8, "aria-label": "Choices as a file" });
  private readonly configuration;
  private chosen: Chosen[];
  private parameters: Set<string>;
  private readonly list = h("div", { class: "boxes wide" });
  private readonly ofPart = h("div", { class: "of-part", role: "group", "aria-label": "Fields of the part", "aria-live": "polite" });
  private readonly scene: SceneData | undefined;
  private picture: PartsPicture | null = null;

  constructor(private readonly data: Choices, scenes: SceneData[] = []) {
    this.chosen = data.configurations.map(begun);
    this.parameters = new Set(data.fields.filter((f) => f.chosen).map((f) => f.field));
    this.configuration = choice("Configuration", data.configurations.map((c) => c.configuration), () => this.fill());
    const button = (words: string, act: () => void) => h("button", { type: "button", click: act }, words);
    this.scene = scenes.find((s) => s.line_parts && s.face_parts);
    if (this.scene && data.fields.length) this.picture = new PartsPicture(this.scene, (part) => this.of(part).some((f) => this.parameters.has(f.field)), () => this.fillFields());
    this.fillFields();
    const begin = () => {
      this.chosen = data.configurations.map(begun);
      this.parameters = new Set(data.fields.filter((f) => f.chosen).map((f) => f.field));
      this.fill();
      this.fillFields();
      this.told.textContent = "The choices are those of the study.";
    };
    const kept = data.kept.length ? ` The file of choices cannot have ${data.kept.join(", ")} (a unit, a tie, some elements only, or a field that is not in this list): femtune run and femtune correlate keep them from the study, and femtune init does not write them.` : "";
    this.element = h("div", { class: "chooser", role: "group", "aria-label": "Choices by hand" },
      h("p", { class: "note" }, "Choices go into a file that femtune run, femtune correlate and femtune init take with --choices. They are refused if the deck or a test has changed since, or the model mode of a pair. A pair, a mode or a sensor that the study file itself states and that is taken back here is not in the file: delete it in the study."),
      h("div", { class: "controls" }, this.configuration.label), this.modes,
      ...(data.fields.length ? [h("fieldset", {}, h("legend", {}, "Parameters: fields of the deck"), h("p", { class: "note" }, `${this.picture ? "A click on a part of the structure shows its fields; parts with a parameter are orange. " : ""}A parameter that stands in the study itself stays one.${kept}`),
        ...(this.picture ? [h("div", { class: "by-part" }, this.picture.element, this.ofPart), h("details", {}, h("summary", {}, `All ${data.fields.length} fields`), this.list)] : [this.list]))] : []),
      h("div", { class: "tools" }, button("Save choices.toml", () => save("choices.toml", new Blob([this.text.value], { type: "application/toml" }))),
        button("Copy", () => void this.copy()), button("As in the study", begin)),
      this.told, this.text);
    this.fill();
  }

  private get at(): number { return this.configuration.select.selectedIndex; }

  /** The matrix, the modes and the sensors of a configuration. */
  private fill(): void {
    const of = this.data.configurations[this.at], chosen = this.chosen[this.at];
    const grid = this.grid(of, chosen);
    const omitted = h("div", { class: "omitted" }, ...of.test_labels.flatMap((label, i) => this.omission(chosen, label, of.test_freq_hz[i])));
    const sensors = h("div", { class: "boxes" }, ...of.sensors.map((label) => this.box(label, !chosen.off.has(label), (on) => {
      if (on) chosen.off.delete(label); else chosen.off.add(label);
      this.changed(`Sensor ${label}: ${on ? "compared" : "not compared"}.`);
    })));
    this.modes.replaceChildren(
      h("fieldset", {}, h("legend", {}, "Pairs at the initial values"),
        h("p", { class: "note" }, "A click on a cell, or Enter, goes from “left to the MAC” to a pair by hand (●), to never a pair (✕), and back. Arrow keys go from cell to cell."),
        h("div", { class: "scroll" }, grid.element)),
      h("fieldset", {}, h("legend", {}, "Test modes that are left out, with the reason"), omitted),
      ...(of.sensors.length ? [h("fieldset", {}, h("legend", {}, "Sensors that are compared"), sensors)] : []));
    this.write();
  }

  private grid(of: ModeChoices, chosen: Chosen): MatrixGrid {
    const mac = unpack(of.mac), pairs = new Set(of.pairs.map((pair) => pair.join("|")));
    const cells = of.test_labels.map((test, i) => of.numbers.map((model, k): MatrixCell => {
      const value = mac[i * of.numbers.length + k], state = stateOf(chosen, test, model), pair = pairs.has(`${test}|${model}`);
      const text = value < 0 ? "MAC not tested" : `MAC ${value.toFixed(2)}`;
      const label = `Test mode ${test}, ${cycles(of.test_freq_hz[i])} Hz; model mode ${model}, ${hertz(of.model_freq_hz[k])}; ${text}; ${WORDS[state]}${pair ? "; a pair of this run" : ""}`;
      return { row: i, column: k, value, pair, label, disabled: false, look: state || (pair ? "of-run" : ""), sign: SIGNS[state] };
    }));
    const rows = of.test_labels.map((label, i) => `${label}: ${shown(of.test_freq_hz[i], 3)} Hz`);
    const made: MatrixGrid = new MatrixGrid("MAC before the update. Rows: test; columns: model; framed: pairs of this run.", rows, of.numbers.map(String), cells, ({ row, column }) => {
      const [test, model] = [of.test_labels[row], of.numbers[column]], state = turn(chosen, test, model);
      this.fill();
      // the matrix is a new one: the focus stays on its cell
      this.last!.focus(row, column);
      this.told.textContent = `Test mode ${test} and model mode ${model}: ${WORDS[state]}.${state === "never" ? alsoForbidden(of, test, model) : ""}`;
    });
    this.last = made;
    return made;
  }

  private last: MatrixGrid | null = null;

  private omission(chosen: Chosen, label: string, hz: number): HTMLElement[] {
    const reason = h("input", {
      type: "text", maxlength: 200, value: chosen.leftOut.get(label) ?? "", placeholder: "reason", disabled: !chosen.leftOut.has(label),
      "aria-label": `Reason for leaving out test mode ${label}`, input: () => { chosen.leftOut.set(label, reason.value); this.changed(""); },
    });
    const box = this.box(`${label}, ${cycles(hz)} Hz`, chosen.leftOut.has(label), (on) => {
      reason.disabled = !on;
      if (!on) chosen.leftOut.delete(label);
      else {
        chosen.leftOut.set(label, reason.value);
        // a pair by hand gives way, also in the matrix
        if (chosen.fixed.delete(label)) this.fill();
      }
      this.changed(`Test mode ${label}: ${on ? "left out" : "compared"}.`);
      if (on) this.modes.querySelector<HTMLElement>(`input[aria-label="${CSS.escape(`Reason for leaving out test mode ${label}`)}"]`)?.focus();
    });
    return [box, reason];
  }

  /** The fields of a part of the picture. */
  private of(part: number): FieldChoice[] {
    const names = new Set(this.scene?.part_fields[part] ?? []);
    return this.data.fields.filter((f) => [f.field, ...f.further].some((field) => names.has(field))).sort((a, b) => Number(a.field.startsWith("MAT")) - Number(b.field.startsWith("MAT")));
  }

  /** The list of all fields, and that of the part which is chosen. */
  private fillFields(): void {
    const shownPart = this.picture?.part ?? -1;
    this.list.replaceChildren(...this.data.fields.map((f) => this.fieldBox(f, () => this.fillPart(shownPart))));
    this.fillPart(shownPart);
    this.picture?.draw();
  }

  private fillPart(part: number): void {
    const fields = this.of(part);
    this.ofPart.replaceChildren(...(fields.length
      ? [h("p", { class: "shown" }, partName(this.scene!.part_fields[part])), ...fields.map((f) => this.fieldBox(f, () => this.fillList()))]
      : [h("p", { class: "note" }, "No part is chosen.")]));
  }

  private fillList(): void { this.list.replaceChildren(...this.data.fields.map((f) => this.fieldBox(f, () => this.fillPart(this.picture?.part ?? -1)))); }

  private fieldBox(f: FieldChoice, after: () => void): HTMLLabelElement {
    return this.box(`${f.field} = ${shown(f.value)}, ${f.what}${f.further.length ? `; with the same factor ${f.further.join(", ")}` : ""}`, this.parameters.has(f.field), (on) => {
      if (on) this.parameters.add(f.field); else this.parameters.delete(f.field);
      this.changed(`${f.field}: ${on ? "a parameter" : "no parameter of the choices"}.`);
      after();
      this.picture?.draw();
    });
  }

  private box(text: string, checked: boolean, change: (on: boolean) => void): HTMLLabelElement {
    const box = h("input", { type: "checkbox", checked, change: () => change(box.checked) });
    return h("label", {}, box, h("span", {}, text));
  }

  private changed(words: string): void {
    this.told.textContent = words;
    this.write();
  }

  private write(): void {
    this.text.value = choicesFile(this.data, this.chosen, this.data.fields.filter((f) => this.parameters.has(f.field)));
    const open = this.data.configurations.flatMap((of, k) => Array.from(this.chosen[k].leftOut).filter(([, reason]) => !reason.trim()).map(([label]) => `${label} (${of.configuration})`));
    if (open.length) this.told.textContent = `State the reason for leaving out ${open.join(", ")}: without it the mode is not in the file.`;
  }

  private async copy(): Promise<void> {
    try {
      await navigator.clipboard.writeText(this.text.value);
      this.told.textContent = "Copied.";
    } catch {
      this.text.focus();
      this.text.select();
      this.told.textContent = "This browser lets no page write to the clipboard: the lines are selected.";
    }
  }
}
