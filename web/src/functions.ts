// Frequency response functions to look at closely: magnitude and phase, with a range of frequencies to zoom into.

import { unpack, type Curve, type Functions } from "./data.ts";
import { choice, fileName, h, save, shown, svg } from "./dom.ts";
import { pictureButtons } from "./pictures.ts";
import { csv } from "./tables.ts";
import { xlsx, XLSX_TYPE } from "./xlsx.ts";

const WIDTH = 860, HEIGHT = 420, LEFT = 74, RIGHT = 12, TOP = 12, SPLIT = 280, LOWER = 306, BOTTOM = 376;
/** Words, colour, width and dashes of the curves, in the order in which they are drawn. */
const LOOKS: Record<string, [string, string, number, string]> = {
  test: ["test", "#e0a06a", 3, ""], equalised: ["test, equal damping", "#8a5aa8", 2.2, ""],
  before: ["model before", "#5b6977", 1.2, "5 3"], model: ["model", "#1f5a92", 1.4, ""], after: ["model after", "#1f5a92", 1.4, ""],
  identified: ["identified test", "#1d2733", 1.2, "2 2"],
  dropped: ["dropped test", "#2e7d5b", 2.2, ""], live: ["model now", "#b3246b", 1.8, ""],
};
const ORDER = Object.keys(LOOKS);

/** Values are 0 where there are none; `phase` is false where they are magnitudes. */
export interface Line { look: string; freq: Float32Array; real: Float32Array; imaginary: Float32Array; phase: boolean }

/** The curves of one function. */
export function linesOf(curves: Curve[], k: number): Line[] {
  return curves.map((c) => {
    const freq = unpack(c.freq_hz), n = freq.length;
    return { look: c.look, phase: c.phase, freq, real: unpack(c.real).subarray(k * n, (k + 1) * n), imaginary: unpack(c.imaginary).subarray(k * n, (k + 1) * n) };
  }).filter((line) => line.real.some((v) => v !== 0) || line.imaginary.some((v) => v !== 0));
}

/** Round numbers, about `count`, inside a range. */
export function ticks(low: number, high: number, count: number): number[] {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw)!;
  const out = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) out.push(i * step + 0);
  return out;
}

/** Smallest and largest positive magnitude of the lines within a range, over six decades at most. */
export function magnitudes(lines: Line[], low: number, high: number): [number, number] {
  let least = Infinity, most = 0;
  for (const { freq, real, imaginary } of lines) for (let i = 0; i < freq.length; i++) {
    const size = Math.hypot(real[i], imaginary[i]);
    if (freq[i] < low || freq[i] > high || size === 0) continue;
    least = Math.min(least, size);
    most = Math.max(most, size);
  }
  return most === 0 ? [0.1, 1] : [0.7 * Math.max(least, 1e-6 * most), 1.5 * most];
}

/** Where a plot takes its curves from. */
export interface Source { configuration: string; ordinate: string; titles: string[]; note: string; phase: boolean; lines(k: number): Line[] }

/** Curves that do not change. */
export const fixed = (data: Functions): Source => ({ ...data, phase: true, lines: (k) => linesOf(data.curves, k) });

export class FunctionPlot {
  readonly element: HTMLElement;
  private readonly drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", tabindex: 0, class: "plot", "font-family": "sans-serif" }) as SVGSVGElement;
  private readonly which;
  private readonly shownLooks = h("span", { class: "looks", role: "group", "aria-label": "Curves" });
  private readonly hidden = new Set<string>();
  private lines: Line[] = [];
  private whole: [number, number] = [0, 1];
  private range: [number, number] = [0, 1];

  constructor(private readonly data: Source) {
    this.which = choice("Function", data.titles, (k) => this.open(k));
    const button = (text: string, words: string, act: () => void) => h("button", { type: "button", "aria-label": words, click: act }, text);
    const name = () => `${data.configuration} ${data.titles[this.which.select.selectedIndex]}`;
    const tools = h("div", { class: "controls" }, this.which.label, this.shownLooks,
      h("span", { class: "zoom" }, button("+", "Zoom in", () => this.zoom(0.5)), button("−", "Zoom out", () => this.zoom(2)), button("whole range", "Show the whole range", () => this.set(this.whole))),
      ...pictureButtons("frequency response", () => new XMLSerializer().serializeToString(this.drawing), () => [WIDTH, HEIGHT]),
      button("CSV", "Save the curves as CSV", () => save(fileName(name(), "csv"), new Blob([csv(this.table())], { type: "text/csv" }))),
      button("XLSX", "Save the curves as XLSX", () => save(fileName(name(), "xlsx"), new Blob([xlsx(this.table())], { type: XLSX_TYPE }))));
    const note = "Drag over a range of frequencies to zoom into it. Keys: arrows move, + and − zoom, 0 shows the whole range." + (data.note ? ` ${data.note}` : "");
    this.element = h("div", { class: "functions" }, tools, h("div", { class: "scroll" }), h("p", { class: "note" }, note));
    this.element.querySelector(".scroll")!.append(this.drawing);
    this.drawing.setAttribute("width", String(WIDTH));
    this.drawing.setAttribute("height", String(HEIGHT));
    this.pointer();
    this.drawing.addEventListener("keydown", (e) => this.key(e as KeyboardEvent));
    this.open(0);
  }

  /** Frequencies and values of all curves, as stored. */
  table(): string[][] {
    const rows = this.lines.flatMap(({ look, freq, real, imaginary }) =>
      Array.from(freq, (f, i) => [LOOKS[look][0], String(f), String(real[i]), String(imaginary[i])]).filter((r) => r[2] !== "0" || r[3] !== "0"));
    return [["curve", "frequency Hz", "real", "imaginary"], ...rows];
  }

  /** Take the curves again, the range of frequencies stays. */
  refresh(): void {
    this.lines = this.data.lines(this.which.select.selectedIndex);
    this.draw();
  }

  /** Take the curves again where there are others now; the range of frequencies is the whole one. */
  reopen(): void { this.open(this.which.select.selectedIndex); }

  private open(k: number): void {
    this.lines = this.data.lines(k);
    this.whole = [Math.min(...this.lines.map((l) => l.freq[0])), Math.max(...this.lines.map((l) => l.freq[l.freq.length - 1]))];
    if (!(this.whole[1] > this.whole[0])) this.whole = [0, 1];
    this.shownLooks.replaceChildren(...this.lines.map(({ look }) => {
      const box = h("input", { type: "checkbox", checked: !this.hidden.has(look), change: () => { box.checked ? this.hidden.delete(look) : this.hidden.add(look); this.draw(); } });
      return h("label", {}, box, swatch(look), LOOKS[look][0]);
    }));
    this.set(this.whole);
  }

  private set([low, high]: [number, number]): void {
    const least = 1e-4 * (this.whole[1] - this.whole[0]);
    if (high - low < least) high = low + least;
    this.range = [Math.max(low, this.whole[0]), Math.min(high, this.whole[1])];
    this.draw();
  }

  private zoom(factor: number): void {
    const [low, high] = this.range, middle = 0.5 * (low + high), half = 0.5 * factor * (high - low);
    this.set([middle - half, middle + half]);
  }

  private key(e: KeyboardEvent): void {
    const step = 0.2 * (this.range[1] - this.range[0]);
    const move = (by: number) => {
      const d = Math.max(this.whole[0] - this.range[0], Math.min(this.whole[1] - this.range[1], by));
      this.set([this.range[0] + d, this.range[1] + d]);
    };
    const actions: Record<string, () => void> = {
      "+": () => this.zoom(0.5), "=": () => this.zoom(0.5), "-": () => this.zoom(2), "0": () => this.set(this.whole),
      ArrowLeft: () => move(-step), ArrowRight: () => move(step),
    };
    if (!(e.key in actions) || e.ctrlKey || e.metaKey) return;
    e.preventDefault();
    actions[e.key]();
  }

  private pointer(): void {
    let from: number | null = null, mark: SVGElement | null = null;
    const at = (e: PointerEvent) => {
      const frame = this.drawing.getBoundingClientRect();
      return Math.min(WIDTH - RIGHT, Math.max(LEFT, ((e.clientX - frame.left) * WIDTH) / frame.width));
    };
    const hz = (x: number) => this.range[0] + ((x - LEFT) / (WIDTH - LEFT - RIGHT)) * (this.range[1] - this.range[0]);
    this.drawing.addEventListener("pointerdown", (e) => {
      from = at(e);
      this.drawing.setPointerCapture(e.pointerId);
      mark = svg("rect", { y: TOP, height: BOTTOM - TOP, x: from, width: 0, fill: "#1f5a92", opacity: 0.15 });
      this.drawing.append(mark);
    });
    this.drawing.addEventListener("pointermove", (e) => {
      if (from === null || !mark) return;
      mark.setAttribute("x", String(Math.min(from, at(e))));
      mark.setAttribute("width", String(Math.abs(at(e) - from)));
    });
    this.drawing.addEventListener("pointerup", (e) => {
      if (from === null) return;
      const [a, b] = [Math.min(from, at(e)), Math.max(from, at(e))];
      mark?.remove();
      from = null;
      if (b - a > 6) this.set([hz(a), hz(b)]);
    });
  }

  private draw(): void {
    const lines = this.lines.filter((l) => !this.hidden.has(l.look)), [low, high] = this.range;
    const [least, most] = magnitudes(lines, low, high), decades = Math.log10(most / least);
    const x = (f: number) => LEFT + ((f - low) / (high - low)) * (WIDTH - LEFT - RIGHT);
    const y = (v: number) => SPLIT - (Math.log10(Math.max(v, 1e-300) / least) / decades) * (SPLIT - TOP);
    const p = (degrees: number) => BOTTOM - ((degrees + 180) / 360) * (BOTTOM - LOWER);
    const text = (words: string, at: [number, number], anchor: string) => svg("text", { x: at[0], y: at[1], "text-anchor": anchor, "font-size": 12, fill: "#5b6977" }, words);
    const rule = (x1: number, y1: number, x2: number, y2: number) => svg("line", { x1, y1, x2, y2, stroke: "#d4dae0" });
    const first = Math.ceil(Math.log10(least)), every = Math.max(1, Math.ceil(decades / 6));
    const powers = Array.from({ length: Math.max(0, Math.floor(Math.log10(most)) - first + 1) }, (_, i) => first + i).filter((q) => (q - first) % every === 0);
    const parts: SVGElement[] = [
      svg("rect", { width: WIDTH, height: HEIGHT, fill: "#fff" }),
      svg("defs", {}, svg("clipPath", { id: "frf-clip" }, svg("rect", { x: LEFT, y: TOP - 2, width: WIDTH - LEFT - RIGHT, height: BOTTOM - TOP + 4 }))),
      ...ticks(low, high, 8).flatMap((f) => [rule(x(f), TOP, x(f), SPLIT), rule(x(f), LOWER, x(f), BOTTOM), text(shown(f, 6), [x(f), BOTTOM + 16], "middle")]),
      ...powers.flatMap((q) => [rule(LEFT, y(10 ** q), WIDTH - RIGHT, y(10 ** q)), text(`1e${q}`.replace("-", "−"), [LEFT - 6, y(10 ** q) + 4], "end")]),
      ...[-180, 0, 180].flatMap((d) => [rule(LEFT, p(d), WIDTH - RIGHT, p(d)), text(`${String(d).replace("-", "−")}°`, [LEFT - 6, p(d) + 4], "end")]),
      text("Hz", [WIDTH - RIGHT, HEIGHT - 6], "end"),
      svg("text", { transform: `translate(14 ${(TOP + SPLIT) / 2}) rotate(-90)`, "text-anchor": "middle", "font-size": 12, fill: "#1d2733" }, this.data.ordinate),
    ];
    for (const line of [...lines].sort((a, b) => ORDER.indexOf(a.look) - ORDER.indexOf(b.look))) {
      const [, colour, width, dashes] = LOOKS[line.look];
      const style = { fill: "none", stroke: colour, "stroke-width": width, "stroke-dasharray": dashes || undefined, "stroke-linejoin": "round", "clip-path": "url(#frf-clip)" };
      const [upper, lower] = paths(line, low, high, (f) => x(f), (v) => y(v), (d) => p(d));
      parts.push(svg("path", { d: upper, ...style, "data-look": line.look }), ...(this.data.phase && line.phase ? [svg("path", { d: lower, ...style, "stroke-width": Math.min(width, 2) })] : []));
    }
    this.drawing.replaceChildren(...parts);
    this.drawing.dataset.range = `${low} ${high}`;
    this.drawing.setAttribute("aria-label", `${this.data.titles[this.which.select.selectedIndex]} from ${shown(low)} to ${shown(high)} Hz: magnitude and phase of ${lines.map((l) => LOOKS[l.look][0]).join(", ")}`);
  }
}

/** A piece of a curve, for its name. */
function swatch(look: string): SVGElement {
  const [, stroke, width, dashes] = LOOKS[look];
  const line = svg("line", { x1: 0, y1: 5, x2: 22, y2: 5, stroke, "stroke-width": Math.max(width, 1.6), "stroke-dasharray": dashes || undefined });
  return svg("svg", { width: 24, height: 10, "aria-hidden": "true", class: "swatch" }, svg("rect", { width: 24, height: 10, fill: "#fff" }), line);
}

/** Magnitude and phase as paths; gaps where a function was not measured, and where the phase jumps. */
function paths(line: Line, low: number, high: number, x: (f: number) => number, y: (v: number) => number, p: (d: number) => number): [string, string] {
  let upper = "", lower = "", pen = "M", turned = "M", before = 0;
  const { freq, real, imaginary } = line;
  for (let i = 0; i < freq.length; i++) {
    // one line more on both sides, which the frame cuts off
    if ((freq[i + 1] ?? Infinity) < low || (freq[i - 1] ?? -Infinity) > high) continue;
    const size = Math.hypot(real[i], imaginary[i]);
    if (size === 0) { pen = turned = "M"; continue; }
    const degrees = (Math.atan2(imaginary[i], real[i]) * 180) / Math.PI;
    if (Math.abs(degrees - before) > 180) turned = "M";
    upper += `${pen}${x(freq[i]).toFixed(1)} ${y(size).toFixed(1)}`;
    lower += `${turned}${x(freq[i]).toFixed(1)} ${p(degrees).toFixed(1)}`;
    pen = turned = "L";
    before = degrees;
  }
  return [upper, lower];
}
