// The stabilisation diagram to pick poles from: they are named, and saved as choices.toml for femtune identify --choices.

import { unpack, type Stabilisation } from "./data.ts";
import { h, save, shown, svg } from "./dom.ts";
import { ticks } from "./functions.ts";
import { pictureButtons } from "./pictures.ts";

const WIDTH = 860, HEIGHT = 420, LEFT = 54, RIGHT = 12, TOP = 12, BOTTOM = 372;
/** Pixels within which a click finds a pole. */
const NEAR = 14;

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

export class StabilisationPlot {
  readonly element: HTMLElement;
  private readonly drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "application", tabindex: 0, class: "plot", "font-family": "sans-serif" }) as SVGSVGElement;
  private readonly rows = h("tbody");
  private readonly told = h("p", { class: "note", role: "status" });
  private readonly poles: Pole[];
  private readonly highest: number;
  private readonly curve: [Float32Array, Float32Array];
  private picked: Picked[];
  private range: [number, number];
  private at = -1;

  constructor(private readonly data: Stabilisation) {
    this.poles = polesOf(data);
    this.highest = Math.max(2, ...this.poles.map((p) => p.order));
    this.curve = [unpack(data.curve_hz), unpack(data.curve_db)];
    this.picked = data.picked.map((p) => ({ row: p.row, name: p.name, fitOnly: p.fit_only }));
    this.range = data.band_hz;
    const button = (text: string, words: string, act: () => void) => h("button", { type: "button", "aria-label": words, click: act }, text);
    const heads = ["Name", "Hz", "Damping %", "Method", "Order", ""].map((text) => h("th", { scope: "col" }, text));
    const saved = () => save("choices.toml", new Blob([choices(data, this.poles, this.picked)], { type: "application/toml" }));
    this.element = h("div", { class: "stabilisation" },
      h("div", { class: "controls" },
        h("span", { class: "zoom" }, button("+", "Zoom in", () => this.zoom(0.5)), button("−", "Zoom out", () => this.zoom(2)), button("whole range", "Show the whole range", () => this.set(data.band_hz))),
        ...pictureButtons("stabilisation diagram", () => new XMLSerializer().serializeToString(this.drawing), () => [WIDTH, HEIGHT]),
        button("as identified", "as identified: return to the identified modes", () => this.reset()),
        button("Save choices.toml", "Save choices.toml: the picked poles", saved)),
      h("div", { class: "scroll" }), this.told,
      h("p", { class: "note" }, "A click on a pole picks or drops it; drag over a range of frequencies to zoom into it. Keys: arrows go from pole to pole, Enter picks or drops, + and − zoom, 0 shows the whole range."),
      h("table", { class: "picked" }, h("caption", {}, "Picked poles"), h("thead", {}, h("tr", {}, ...heads)), this.rows),
      h("p", { class: "note" }, "The saved file gives these modes: femtune identify FILE --choices choices.toml, with the other settings as before. It is refused if the measured files have changed."));
    this.element.querySelector(".scroll")!.append(this.drawing);
    this.drawing.setAttribute("width", String(WIDTH));
    this.drawing.setAttribute("height", String(HEIGHT));
    this.pointer();
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

  private x(f: number): number { return LEFT + ((f - this.range[0]) / (this.range[1] - this.range[0])) * (WIDTH - LEFT - RIGHT); }
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

  private pointer(): void {
    let from: [number, number] | null = null, mark: SVGElement | null = null;
    const at = (e: PointerEvent): [number, number] => {
      const frame = this.drawing.getBoundingClientRect();
      return [Math.min(WIDTH - RIGHT, Math.max(LEFT, ((e.clientX - frame.left) * WIDTH) / frame.width)), ((e.clientY - frame.top) * HEIGHT) / frame.height];
    };
    const hz = (x: number) => this.range[0] + ((x - LEFT) / (WIDTH - LEFT - RIGHT)) * (this.range[1] - this.range[0]);
    this.drawing.addEventListener("pointerdown", (e) => {
      from = at(e);
      this.drawing.setPointerCapture(e.pointerId);
      mark = svg("rect", { y: TOP, height: BOTTOM - TOP, x: from[0], width: 0, fill: "#1f5a92", opacity: 0.15 });
      this.drawing.append(mark);
    });
    this.drawing.addEventListener("pointermove", (e) => {
      if (from === null || !mark) return;
      mark.setAttribute("x", String(Math.min(from[0], at(e)[0])));
      mark.setAttribute("width", String(Math.abs(at(e)[0] - from[0])));
    });
    this.drawing.addEventListener("pointerup", (e) => {
      if (from === null) return;
      const [begin, end] = [from, at(e)];
      mark?.remove();
      from = null;
      if (Math.abs(end[0] - begin[0]) > 6) return this.set([hz(Math.min(begin[0], end[0])), hz(Math.max(begin[0], end[0]))]);
      const found = this.nearest(end);
      if (found >= 0) this.toggle((this.at = found));
    });
  }

  /** The pole nearest to a point of the drawing; −1 where none is near. */
  private nearest([px, py]: [number, number]): number {
    let best = -1, least = NEAR;
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
      svg("rect", { width: WIDTH, height: HEIGHT, fill: "#fff" }),
      svg("defs", {}, svg("clipPath", { id: "poles-clip" }, svg("rect", { x: LEFT, y: TOP, width: WIDTH - LEFT - RIGHT, height: BOTTOM - TOP }))),
      ...ticks(low, high, 8).flatMap((f) => [rule(this.x(f), TOP, this.x(f), BOTTOM), text(shown(f, 6), this.x(f), BOTTOM + 16, "middle")]),
      ...ticks(0, this.highest, 6).map((o) => text(String(o), LEFT - 6, this.y(o) + 4, "end")),
      text("Hz", WIDTH - RIGHT, HEIGHT - 8, "end"),
      svg("text", { transform: `translate(14 ${(TOP + BOTTOM) / 2}) rotate(-90)`, "text-anchor": "middle", "font-size": 12, fill: "#1d2733" }, "model order"),
      svg("path", { d: this.background(), fill: "none", stroke: "#b9c4ce", "clip-path": "url(#poles-clip)" }),
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

  /** The curve behind the poles over the whole height. */
  private background(): string {
    const [freq, level] = this.curve, [least, most] = [Math.min(...level), Math.max(...level)];
    if (!(most > least)) return "";
    const at = (i: number) => `${this.x(freq[i]).toFixed(1)} ${(BOTTOM - ((level[i] - least) / (most - least)) * (BOTTOM - TOP)).toFixed(1)}`;
    const points = Array.from(freq.keys()).filter((i) => (freq[i + 1] ?? Infinity) >= this.range[0] && (freq[i - 1] ?? -Infinity) <= this.range[1]);
    return points.length ? `M${points.map(at).join("L")}` : "";
  }
}
