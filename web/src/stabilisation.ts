// The stabilisation diagram to pick poles from: they are named, and saved as choices.toml for femtune identify --choices.
// What the picked poles make of the measurement is computed again with each of them.

import { unpack, type Functions, type Stabilisation } from "./data.ts";
import { choice, h, save, shown, svg } from "./dom.ts";
import { fitWidth, FunctionPlot, ticks, type Line } from "./functions.ts";
import { gestures } from "./gestures.ts";
import { pictureButtons } from "./pictures.ts";
import { misfit, synthesised, synthesisedPower, together, type Complex, type Mode } from "./synthesis.ts";

const WIDTH = 860, HEIGHT = 420, LEFT = 54, RIGHT = 12, TOP = 12, BOTTOM = 372;
/** Pixels within which a click finds a pole, and a finger does. */
const NEAR = 14, NEAR_FINGER = 24;
/** Curves this far below the highest one are not followed further, in dB. */
const DEPTH_DB = 120;
const SUM = "sum of the auto spectra", CMIF = "singular values (CMIF)", NOTHING = "nothing";
/** Colours of the curve behind the poles and of further singular values. */
const GREYS = ["#8d9aa6", "#a9b4be", "#bcc6cf", "#ccd4db"];

export interface Pole { method: string; order: number; freq: number; damping: number; stable: boolean }
export interface Picked { row: number; name: string; fitOnly: boolean }

/** The poles of the page. */
export function polesOf(data: Stabilisation): Pole[] {
  const [method, order, freq, damping, stable] = [data.method, data.order, data.freq_hz, data.damping_ratio, data.stable].map(unpack);
  return Array.from(freq, (f, i) => ({ method: data.methods[method[i]], order: order[i], freq: f, damping: damping[i], stable: stable[i] > 0 }));
}

/** A text as a basic string of TOML. */
export function quoted(text: string): string {
  return `"${text.replace(/[\\"]/g, (c) => `\\${c}`).replace(/[\u0000-\u001f\u007f]/g, (c) => `\\u${c.charCodeAt(0).toString(16).padStart(4, "0")}`)}"`;
}

const decimal = (value: number) => {
  const text = String(Number(value.toPrecision(8)));
  return /[.e]/.test(text) ? text : `${text}.0`;
};

/** The choice as a file for femtune. */
export function choices(data: Stabilisation, poles: Pole[], picked: Picked[]): string {
  const inputs = data.inputs.map((one) => ["[[input]]", `path = ${quoted(one.path)}`, `sha256 = ${quoted(one.sha256)}`, ""]);
  const modes = picked.map(({ row, name, fitOnly }) => {
    const { method, order, freq, damping } = poles[row];
    const about = [...(name.trim() && !fitOnly ? [`name = ${quoted(name.trim())}`] : []), ...(fitOnly ? ["fit_only = true"] : [])];
    return ["[[mode]]", ...about, `method = ${quoted(method)}`, `order = ${order}`, `freq_hz = ${decimal(freq)}`, `damping_ratio = ${decimal(damping)}`, ""];
  });
  return ["# poles picked in the stabilisation diagram, for femtune identify --choices", "schema_version = 1", "", ...inputs.flat(), ...modes.flat()].join("\n");
}

/** Measured functions of the page, or the sum of the auto spectra, and what poles make of them. */
export class Synthesis {
  private readonly freq: Float32Array;
  private readonly measured: Complex[];
  private readonly power: Float32Array;
  /** In dB of the largest value of the measurement together. */
  level: { freq: Float32Array; db: Float64Array } | null = null;
  /** Of each function of the page. */
  made: Complex[] = [];
  words = "";

  constructor(private readonly data: Stabilisation, private readonly functions: Functions | undefined) {
    const test = data.derivatives < 0 ? undefined : functions?.curves.find((c) => c.look === "test");
    this.power = unpack(data.power);
    this.freq = test ? unpack(test.freq_hz) : unpack(data.curve_hz);
    const n = this.freq.length, parts = test ? [unpack(test.real), unpack(test.imaginary)] : [];
    this.measured = test ? functions!.titles.map((_, k) => ({ real: parts[0].subarray(k * n, (k + 1) * n), imaginary: parts[1].subarray(k * n, (k + 1) * n) })) : [];
  }

  get possible(): boolean { return this.measured.length > 0 || this.power.length > 0; }
  get ofFunctions(): boolean { return this.measured.length > 0; }

  fit(modes: Mode[]): void {
    const { freq, data } = this, n = freq.length;
    const db = (values: ArrayLike<number>, factor: number, largest: number) => Float64Array.from({ length: n }, (_, k) => factor * Math.log10(Math.max(values[k], 1e-300) / largest));
    if (!this.possible || !modes.length) { this.level = null; this.made = []; this.words = ""; return; }
    if (this.ofFunctions) {
      this.made = synthesised(freq, this.measured, data.derivatives, modes, data.decay);
      const largest = Math.max(...together(this.measured, n)) || 1;
      this.level = { freq, db: db(together(this.made, n), 20, largest) };
      const errors = this.measured.map((one, k) => 100 * misfit(one, this.made[k])), sorted = [...errors].sort((a, b) => a - b);
      const worst = errors.indexOf(sorted[sorted.length - 1]), name = this.functions!.titles[worst].replace(/, error .*/, "");
      const of = errors.length < data.functions ? ` of the ${errors.length} functions on this page (of ${data.functions})` : "";
      this.words = `Synthesis of the picked poles${of}: error ${shown(sorted[sorted.length >> 1], 3)} % in the median, ${shown(errors[worst], 3)} % for ${name}, the poorest.`;
      return;
    }
    const sum = synthesisedPower(freq, this.power, modes), level = db(sum, 10, 1);
    this.level = { freq, db: level };
    let off = 0;
    for (let k = 0; k < n; k++) off += Math.min(DEPTH_DB, Math.abs(level[k] - 10 * Math.log10(Math.max(this.power[k], 1e-300)))) ** 2;
    this.words = `Synthesis of the picked poles: ${shown(Math.sqrt(off / n), 3)} dB from the sum of the auto spectra (root mean square over the lines).`;
  }

  /** A function of the test and what the picked poles make of it. */
  lines(k: number): Line[] {
    const line = (look: string, { real, imaginary }: Complex): Line => ({ look, freq: this.freq, real: real as Float32Array, imaginary: imaginary as Float32Array, phase: true });
    const none = new Float32Array(this.freq.length);
    return [line("test", this.measured[k]), line("picked", this.made[k] ?? { real: none, imaginary: none })];
  }
}

export class StabilisationPlot {
  readonly element: HTMLElement;
  private readonly drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "application", tabindex: 0, class: "plot", "font-family": "sans-serif" }) as SVGSVGElement;
  private readonly rows = h("tbody");
  private readonly told = h("p", { class: "note", role: "status" });
  private readonly poles: Pole[];
  private readonly highest: number;
  private readonly curve: [Float32Array, Float32Array];
  private readonly singular: Float32Array[];
  private readonly sum: Float32Array;
  private readonly synthesis: Synthesis;
  private readonly synthesisBox: HTMLInputElement;
  private readonly behind;
  private readonly plot: FunctionPlot | null;
  private readonly fitted = h("p", { class: "note", role: "status" });
  private width = WIDTH;
  private picked: Picked[];
  private range: [number, number];
  private at = -1;

  constructor(private readonly data: Stabilisation, functions?: Functions) {
    this.poles = polesOf(data);
    this.highest = Math.max(2, ...this.poles.map((p) => p.order));
    this.curve = [unpack(data.curve_hz), unpack(data.curve_db)];
    this.picked = data.picked.map((p) => ({ row: p.row, name: p.name, fitOnly: p.fit_only }));
    this.range = data.band_hz;
    const flat = unpack(data.singular_db), lines = this.curve[0].length;
    this.singular = Array.from({ length: data.singular_db.shape[0] }, (_, k) => flat.subarray(k * lines, (k + 1) * lines));
    this.sum = unpack(data.power).map((v) => 10 * Math.log10(Math.max(v, 1e-30)));
    this.synthesis = new Synthesis(data, functions);
    this.synthesisBox = h("input", { type: "checkbox", checked: true, change: () => this.draw() });
    this.behind = choice("Behind the poles", [...(data.power.shape[0] ? [SUM] : []), data.words, ...(this.singular.length ? [CMIF] : []), NOTHING], () => this.draw());
    this.plot = this.synthesis.ofFunctions ? new FunctionPlot({
      configuration: "picked", ordinate: functions!.ordinate, titles: functions!.titles.map((t) => t.replace(/, error .*/, "")), note: functions!.note, phase: true, lines: (k) => this.synthesis.lines(k),
    }) : null;
    const button = (text: string, words: string, act: () => void) => h("button", { type: "button", "aria-label": words, click: act }, text);
    const heads = ["Name", "Hz", "Damping %", "Method", "Order", ""].map((text) => h("th", { scope: "col" }, text));
    const saved = () => save("choices.toml", new Blob([choices(data, this.poles, this.picked)], { type: "application/toml" }));
    this.element = h("div", { class: "stabilisation" },
      h("div", { class: "controls" },
        this.behind.label, ...(this.synthesis.possible ? [h("label", {}, this.synthesisBox, h("span", {}, "synthesis of the picked poles"))] : []),
        h("span", { class: "zoom" }, button("+", "Zoom in", () => this.zoom(0.5)), button("−", "Zoom out", () => this.zoom(2)), button("whole range", "Show the whole range", () => this.set(data.band_hz))),
        ...pictureButtons("stabilisation diagram", () => new XMLSerializer().serializeToString(this.drawing), () => [this.width, HEIGHT]),
        button("as identified", "as identified: return to the identified modes", () => this.reset()),
        button("Save choices.toml", "Save choices.toml: the picked poles", saved)),
      h("div", { class: "scroll" }), this.told, this.fitted,
      h("p", { class: "note" }, "A click on a pole picks or drops it; drag over a range of frequencies to zoom into it, or use two fingers. Keys: arrows go from pole to pole, Enter picks or drops, + and − zoom, 0 shows the whole range."),
      h("div", { class: "scroll" }, h("table", { class: "picked" }, h("caption", {}, "Picked poles"), h("thead", {}, h("tr", {}, ...heads)), this.rows)),
      h("p", { class: "note" }, "The saved file gives these modes: femtune identify FILE --choices choices.toml, with the other settings as before. It is refused if the measured files have changed."),
      ...(this.plot ? [h("h4", {}, "Measured functions, and the synthesis of the picked poles"), this.plot.element,
        h("p", { class: "note" }, "The page fits residues and two terms for the modes outside the band to each function by least squares; frequencies and damping ratios stay those of the poles. femtune identify fits these too, and its errors are smaller.")]
        : this.synthesis.possible ? [h("p", { class: "note" }, "The synthesis is a sum of modes with these poles under random forces, and a constant, fitted to the sum of the auto spectra. Segments of the record widen its peaks.")] : []));
    this.element.querySelector(".scroll")!.append(this.drawing);
    this.drawing.setAttribute("width", String(WIDTH));
    this.drawing.setAttribute("height", String(HEIGHT));
    fitWidth(this.drawing, HEIGHT, (width) => { this.width = width; this.draw(); });
    const whole = this;
    gestures({
      drawing: this.drawing, get width() { return whole.width; }, height: HEIGHT, left: LEFT, get right() { return whole.width - RIGHT; }, top: TOP, bottom: BOTTOM,
      range: () => this.range, set: (range) => this.set(range),
      tapped: (x, y) => { const found = this.nearest([x, y]); if (found >= 0) this.toggle((this.at = found)); },
    });
    this.drawing.addEventListener("keydown", (e) => this.key(e as KeyboardEvent));
    this.changed();
  }

  private reset(): void {
    this.picked = this.data.picked.map((p) => ({ row: p.row, name: p.name, fitOnly: p.fit_only }));
    this.changed();
  }

  /** Pick a pole, or drop it. */
  private toggle(row: number): void {
    const before = this.picked.length;
    this.picked = this.picked.filter((p) => p.row !== row);
    const { freq, method, order } = this.poles[row];
    const words = `${shown(freq, 6)} Hz, ${method}, order ${order}`;
    if (this.picked.length === before) this.picked.push({ row, name: "", fitOnly: false });
    this.changed();
    this.told.textContent = `${this.picked.length > before ? "Picked" : "Dropped"}: ${words}.`;
  }

  private changed(): void {
    this.picked.sort((a, b) => this.poles[a.row].freq - this.poles[b.row].freq);
    this.rows.replaceChildren(...this.picked.map((one, k) => {
      const { freq, damping, method, order } = this.poles[one.row];
      const name = h("input", { type: "text", value: one.name, maxlength: 80, placeholder: String(k + 1), "aria-label": `Name of the mode at ${shown(freq)} Hz`, input: () => { one.name = name.value; } });
      const drop = h("button", { type: "button", "aria-label": `Drop the mode at ${shown(freq)} Hz`, click: () => this.toggle(one.row) }, "drop");
      const cells = [shown(freq, 6), shown(100 * damping), method, String(order)].map((text) => h("td", {}, text));
      return h("tr", {}, h("td", {}, one.fitOnly ? "only in the fit, no mode" : name), ...cells, h("td", {}, drop));
    }));
    this.synthesis.fit(this.picked.map((one) => ({ freq: this.poles[one.row].freq, damping: this.poles[one.row].damping })));
    this.fitted.textContent = this.synthesis.words;
    this.plot?.refresh();
    this.draw();
  }

  private set([low, high]: [number, number]): void {
    const [first, last] = this.data.band_hz, least = 1e-4 * (last - first);
    if (high - low < least) high = low + least;
    this.range = [Math.max(low, first), Math.min(high, last)];
    this.draw();
  }

  private zoom(factor: number): void {
    const [low, high] = this.range, middle = 0.5 * (low + high), half = 0.5 * factor * (high - low);
    this.set([middle - half, middle + half]);
  }

  private x(f: number): number { return LEFT + ((f - this.range[0]) / (this.range[1] - this.range[0])) * (this.width - LEFT - RIGHT); }
  private y(order: number): number { return BOTTOM - (order / (1.05 * this.highest)) * (BOTTOM - TOP); }
  private inside(f: number): boolean { return f >= this.range[0] && f <= this.range[1]; }

  private key(e: KeyboardEvent): void {
    const actions: Record<string, () => void> = {
      "+": () => this.zoom(0.5), "=": () => this.zoom(0.5), "-": () => this.zoom(2), "0": () => this.set(this.data.band_hz),
      ArrowLeft: () => this.go(-1, 0), ArrowRight: () => this.go(1, 0), ArrowUp: () => this.go(0, 1), ArrowDown: () => this.go(0, -1),
      Enter: () => { if (this.at >= 0) this.toggle(this.at); }, " ": () => { if (this.at >= 0) this.toggle(this.at); },
    };
    if (!(e.key in actions) || e.ctrlKey || e.metaKey) return;
    e.preventDefault();
    actions[e.key]();
  }

  /** To the next pole: of this order to the left or right, or the nearest one of the next order. */
  private go(right: number, up: number): void {
    const from = this.poles[this.at];
    const seen = this.poles.map((_, i) => i).filter((i) => this.inside(this.poles[i].freq));
    if (!from) {
      // the highest order, at the left
      this.at = seen.sort((a, b) => this.poles[b].order - this.poles[a].order || this.poles[a].freq - this.poles[b].freq)[0] ?? -1;
    } else {
      const ahead = right
        ? seen.filter((i) => this.poles[i].order === from.order && right * (this.poles[i].freq - from.freq) > 0)
        : seen.filter((i) => up * (this.poles[i].order - from.order) > 0);
      const far = (i: number) => Math.abs(this.poles[i].freq - from.freq) + (right ? 0 : 1e6 * Math.abs(this.poles[i].order - from.order));
      this.at = ahead.sort((a, b) => far(a) - far(b))[0] ?? this.at;
    }
    const now = this.poles[this.at];
    if (now) this.told.textContent = `${shown(now.freq, 6)} Hz, damping ${shown(100 * now.damping)} %, ${now.method}, order ${now.order}${this.picked.some((p) => p.row === this.at) ? ", picked" : ""}.`;
    this.draw();
  }

  /** The pole nearest to a point of the drawing; −1 where none is near. */
  private nearest([px, py]: [number, number]): number {
    let best = -1, least = matchMedia("(pointer: coarse)").matches ? NEAR_FINGER : NEAR;
    this.poles.forEach((pole, i) => {
      const away = Math.hypot(this.x(pole.freq) - px, this.y(pole.order) - py);
      if (this.inside(pole.freq) && away < least) [best, least] = [i, away];
    });
    return best;
  }

  private draw(): void {
    const [low, high] = this.range;
    const text = (words: string, x: number, y: number, anchor: string) => svg("text", { x, y, "text-anchor": anchor, "font-size": 12, fill: "#5b6977" }, words);
    const rule = (x1: number, y1: number, x2: number, y2: number, stroke = "#d4dae0") => svg("line", { x1, y1, x2, y2, stroke });
    const parts: SVGElement[] = [
      svg("rect", { width: this.width, height: HEIGHT, fill: "#fff" }),
      svg("defs", {}, svg("clipPath", { id: "poles-clip" }, svg("rect", { x: LEFT, y: TOP, width: this.width - LEFT - RIGHT, height: BOTTOM - TOP }))),
      ...ticks(low, high, this.width < 520 ? 4 : 8).flatMap((f) => [rule(this.x(f), TOP, this.x(f), BOTTOM), text(shown(f, 6), this.x(f), BOTTOM + 16, "middle")]),
      ...ticks(0, this.highest, 6).map((o) => text(String(o), LEFT - 6, this.y(o) + 4, "end")),
      text("Hz", this.width - RIGHT, HEIGHT - 8, "end"),
      svg("text", { transform: `translate(14 ${(TOP + BOTTOM) / 2}) rotate(-90)`, "text-anchor": "middle", "font-size": 12, fill: "#1d2733" }, "model order"),
      ...this.background(),
    ];
    for (const { row, fitOnly } of this.picked) {
      const f = this.poles[row].freq;
      if (this.inside(f)) parts.push(svg("line", { x1: this.x(f), y1: TOP, x2: this.x(f), y2: BOTTOM, stroke: "#c2601a", "stroke-dasharray": fitOnly ? "3 3" : undefined }));
    }
    const chosen = new Set(this.picked.map((p) => p.row));
    this.poles.forEach((pole, i) => {
      if (!this.inside(pole.freq)) return;
      const [x, y, r] = [this.x(pole.freq), this.y(pole.order), chosen.has(i) ? 6 : pole.stable ? 3.6 : 1.8];
      const first = pole.method === this.data.methods[0];
      const style = { fill: chosen.has(i) ? "#c2601a" : pole.stable && first ? "#1f5a92" : pole.stable ? "#fff" : "#9aa7b3", stroke: pole.stable ? "#1d2733" : "none", "data-pole": i };
      parts.push(first ? svg("circle", { cx: x, cy: y, r, ...style }) : svg("rect", { x: x - r, y: y - r, width: 2 * r, height: 2 * r, ...style }));
    });
    const here = this.poles[this.at];
    if (here && this.inside(here.freq)) parts.push(svg("circle", { cx: this.x(here.freq), cy: this.y(here.order), r: 10, fill: "none", stroke: "#c2601a", "stroke-width": 2 }));
    this.drawing.replaceChildren(...parts);
    this.drawing.dataset.picked = String(this.picked.length);
    this.drawing.setAttribute("aria-label", `Stabilisation diagram from ${shown(low)} to ${shown(high)} Hz: ${this.poles.length} poles of ${this.data.methods.join(" and ")}, ${this.picked.length} picked`);
  }

  /** The curves behind the poles over the whole height, and the synthesis on the same scale. */
  private background(): SVGElement[] {
    const which = this.behind.select.selectedOptions[0].textContent!, { level } = this.synthesis;
    const grey = (db: ArrayLike<number>, k: number): [ArrayLike<number>, ArrayLike<number>, string, string] => [this.curve[0], db, GREYS[k], "measured"];
    const own = which === NOTHING ? [] : which === CMIF ? this.singular.map(grey) : [grey(which === SUM ? this.sum : this.curve[1], 0)];
    const all = [...own, ...(level && this.synthesisBox.checked ? [[level.freq, level.db, "#b4530f", "synthesis"] as [ArrayLike<number>, ArrayLike<number>, string, string]] : [])];
    // the scale does not depend on what is picked
    let [least, most] = [Infinity, -Infinity];
    for (const db of [this.curve[1], ...(own.length > 1 ? this.singular : [])]) for (let i = 0; i < db.length; i++) [least, most] = [Math.min(least, db[i]), Math.max(most, db[i])];
    least = Math.max(least, most - DEPTH_DB);
    if (!(most > least)) return [];
    const y = (v: number) => BOTTOM - ((Math.min(Math.max(v, least - 5), most + 5) - least) / (most - least)) * (BOTTOM - TOP);
    return all.map(([freq, db, stroke, curve]) => {
      let path = "";
      for (let i = 0; i < freq.length; i++) {
        if ((freq[i + 1] ?? Infinity) < this.range[0] || (freq[i - 1] ?? -Infinity) > this.range[1]) continue;
        path += `${path ? "L" : "M"}${this.x(freq[i]).toFixed(1)} ${y(db[i]).toFixed(1)}`;
      }
      return svg("path", { d: path, fill: "none", stroke, "stroke-width": curve === "synthesis" ? 1.3 : 1.1, "clip-path": "url(#poles-clip)", "data-curve": curve });
    });
  }
}
