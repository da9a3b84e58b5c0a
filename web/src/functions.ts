// Frequency response functions to look at closely: magnitude and phase or Nyquist plot, a range of frequencies to zoom
// into, and a cursor that reads values.

import { unpack, type Curve, type Functions } from "./data.ts";
import { choice, fileName, h, save, shown, svg } from "./dom.ts";
import { gestures } from "./gestures.ts";
import { pictureButtons } from "./pictures.ts";
import { csv } from "./tables.ts";
import { xlsx, XLSX_TYPE } from "./xlsx.ts";

const WIDTH = 860, HEIGHT = 420, LEFT = 74, RIGHT = 12, TOP = 12, SPLIT = 280, LOWER = 306, BOTTOM = 376;
/** Width below which a drawing is not drawn narrower but shrunk. */
const NARROWEST = 320;
/** Words, colour, width and dashes of the curves, in the order in which they are drawn. */
const LOOKS: Record<string, [string, string, number, string]> = {
  test: ["test", "#e0a06a", 3, ""], equalised: ["test, equal damping", "#8a5aa8", 2.2, ""],
  before: ["model before", "#5b6977", 1.2, "5 3"], model: ["model", "#1f5a92", 1.4, ""], after: ["model after", "#1f5a92", 1.4, ""],
  identified: ["identified test", "#1d2733", 1.2, "2 2"], picked: ["picked poles", "#1d2733", 1.4, ""],
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

/** Where a plot takes its curves from; `section` and `inputs` are empty where no operating shape belongs to them. */
export interface Source {
  configuration: string; ordinate: string; titles: string[]; note: string; phase: boolean; lines(k: number): Line[]; section?: string; operating?: boolean;
  /** Called with the frequency of the cursor. */
  placed?(hz: number | null): void;
}

/** The line of a curve that is nearest to a frequency. */
export function nearestLine(freq: ArrayLike<number>, hz: number): number {
  let low = 0, high = freq.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (freq[middle] <= hz) low = middle; else high = middle; }
  return high >= 0 && Math.abs(freq[high] - hz) < Math.abs(freq[low] - hz) ? high : low;
}

/** A plot is as wide as its place. */
export function fitWidth(drawing: SVGSVGElement, height: number, draw: (width: number) => void): void {
  let last = 0;
  new ResizeObserver(([{ contentRect }]) => {
    const width = Math.round(Math.max(NARROWEST, Math.min(WIDTH, contentRect.width)));
    if (!contentRect.width || width === last) return;
    last = width;
    drawing.setAttribute("viewBox", `0 0 ${width} ${height}`);
    drawing.setAttribute("width", String(width));
    draw(width);
  }).observe(drawing.parentElement!);
}

/** Curves that do not change. */
export const fixed = (data: Functions): Source => ({ ...data, phase: true, operating: data.operating !== null, lines: (k) => linesOf(data.curves, k) });

export class FunctionPlot {
  readonly element: HTMLElement;
  private readonly drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", tabindex: 0, class: "plot", "font-family": "sans-serif" }) as SVGSVGElement;
  private readonly which;
  private readonly shownLooks = h("span", { class: "looks", role: "group", "aria-label": "Curves" });
  private readonly hidden = new Set<string>();
  private lines: Line[] = [];
  private whole: [number, number] = [0, 1];
  private range: [number, number] = [0, 1];
  private width = WIDTH;
  /** Frequency of the cursor; null where there is none. */
  private cursor: number | null = null;
  private readonly readout = h("p", { class: "note readout", role: "status" });
  private readonly kind;

  constructor(private readonly data: Source) {
    this.which = choice("Function", data.titles, (k) => this.open(k));
    const button = (text: string, words: string, act: () => void) => h("button", { type: "button", "aria-label": words, click: act }, text);
    const name = () => `${data.configuration} ${data.titles[this.which.select.selectedIndex]}`;
    this.kind = choice("Plot", ["magnitude and phase", "Nyquist"], () => this.draw());
    this.kind.label.hidden = !data.phase;
    const tools = h("div", { class: "controls" }, this.which.label, this.kind.label, this.shownLooks,
      h("span", { class: "zoom" }, button("+", "Zoom in", () => this.zoom(0.5)), button("−", "Zoom out", () => this.zoom(2)), button("whole range", "Show the whole range", () => this.set(this.whole))),
      ...pictureButtons("frequency response", () => new XMLSerializer().serializeToString(this.drawing), () => [this.width, HEIGHT]),
      button("CSV", "Save the curves as CSV", () => save(fileName(name(), "csv"), new Blob([csv(this.table())], { type: "text/csv" }))),
      button("XLSX", "Save the curves as XLSX", () => save(fileName(name(), "xlsx"), new Blob([xlsx(this.table())], { type: XLSX_TYPE }))));
    const note = "Drag over a range of frequencies to zoom into it, or use two fingers. A click reads the values at a frequency" +
      (data.operating ? ", and shows the operating shape there" : "") +
      ". Keys: arrows move, + and − zoom, 0 shows the whole range, c sets a cursor that the arrows then move, Escape removes it." + (data.note ? ` ${data.note}` : "");
    this.element = h("div", { class: "functions" }, tools, h("div", { class: "scroll" }), this.readout, h("p", { class: "note" }, note));
    this.element.querySelector(".scroll")!.append(this.drawing);
    this.drawing.setAttribute("width", String(WIDTH));
    this.drawing.setAttribute("height", String(HEIGHT));
    fitWidth(this.drawing, HEIGHT, (width) => { this.width = width; this.draw(); });
    const whole = this;
    gestures({
      drawing: this.drawing, get width() { return whole.width; }, height: HEIGHT, left: LEFT, get right() { return whole.width - RIGHT; }, top: TOP, bottom: BOTTOM,
      range: () => this.range, set: (range) => { if (!this.nyquist) this.set(range); }, tapped: (x, y) => this.put(this.frequencyAt(x, y)),
    });
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

  private get nyquist(): boolean { return this.kind.select.selectedIndex === 1; }

  /** Read the values at a frequency. */
  private put(hz: number | null): void {
    this.cursor = hz;
    this.draw();
    this.data.placed?.(hz);
    const { configuration, section } = this.data;
    if (this.data.operating) document.dispatchEvent(new CustomEvent("femtune:cursor", { detail: { configuration, section, which: this.which.select.selectedIndex, hz } }));
  }

  /** The frequency under a point of the drawing. */
  private frequencyAt(x: number, y: number): number | null {
    const [low, high] = this.range;
    if (!this.nyquist) return Math.min(high, Math.max(low, low + ((x - LEFT) / (this.width - LEFT - RIGHT)) * (high - low)));
    let best: number | null = null, least = Infinity;
    const { px, py } = this.plane();
    for (const { freq, real, imaginary } of this.seen()) for (let i = 0; i < freq.length; i++) {
      if (freq[i] < low || freq[i] > high || (!real[i] && !imaginary[i])) continue;
      const away = Math.hypot(px(real[i]) - x, py(imaginary[i]) - y);
      if (away < least) [best, least] = [freq[i], away];
    }
    return best;
  }

  private seen(): Line[] { return this.lines.filter((l) => !this.hidden.has(l.look)); }

  /** Move the cursor by lines of the first curve. */
  private step(by: number): void {
    const line = this.seen()[0];
    if (!line || this.cursor === null) return;
    const at = Math.min(line.freq.length - 1, Math.max(0, nearestLine(line.freq, this.cursor) + by)), hz = line.freq[at];
    const [low, high] = this.range, half = 0.5 * (high - low);
    if (hz < low || hz > high) this.set([hz - half, hz + half]);
    this.put(hz);
  }

  private open(k: number): void {
    this.lines = this.data.lines(k);
    this.whole = [Math.min(...this.lines.map((l) => l.freq[0])), Math.max(...this.lines.map((l) => l.freq[l.freq.length - 1]))];
    if (!(this.whole[1] > this.whole[0])) this.whole = [0, 1];
    this.shownLooks.replaceChildren(...this.lines.map(({ look }) => {
      const box = h("input", { type: "checkbox", checked: !this.hidden.has(look), change: () => { box.checked ? this.hidden.delete(look) : this.hidden.add(look); this.draw(); } });
      return h("label", {}, box, swatch(look), LOOKS[look][0]);
    }));
    this.set(this.whole);
    if (this.cursor !== null) this.put(this.cursor);
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
      ArrowLeft: () => (this.cursor === null ? move(-step) : this.step(e.shiftKey ? -10 : -1)),
      ArrowRight: () => (this.cursor === null ? move(step) : this.step(e.shiftKey ? 10 : 1)),
      c: () => this.put(this.cursor ?? 0.5 * (this.range[0] + this.range[1])), Escape: () => this.put(null),
    };
    if (!(e.key in actions) || e.ctrlKey || e.metaKey) return;
    e.preventDefault();
    actions[e.key]();
  }

  private draw(): void {
    const lines = this.seen(), [low, high] = this.range;
    this.drawing.dataset.range = `${low} ${high}`;
    this.drawing.dataset.cursor = this.cursor === null ? "" : String(this.cursor);
    this.read(lines);
    if (this.nyquist) return this.drawNyquist(lines);
    const [least, most] = magnitudes(lines, low, high), decades = Math.log10(most / least);
    const x = (f: number) => LEFT + ((f - low) / (high - low)) * (this.width - LEFT - RIGHT);
    const y = (v: number) => SPLIT - (Math.log10(Math.max(v, 1e-300) / least) / decades) * (SPLIT - TOP);
    const p = (degrees: number) => BOTTOM - ((degrees + 180) / 360) * (BOTTOM - LOWER);
    const text = (words: string, at: [number, number], anchor: string) => svg("text", { x: at[0], y: at[1], "text-anchor": anchor, "font-size": 12, fill: "#5b6977" }, words);
    const rule = (x1: number, y1: number, x2: number, y2: number) => svg("line", { x1, y1, x2, y2, stroke: "#d4dae0" });
    const first = Math.ceil(Math.log10(least)), every = Math.max(1, Math.ceil(decades / 6));
    const powers = Array.from({ length: Math.max(0, Math.floor(Math.log10(most)) - first + 1) }, (_, i) => first + i).filter((q) => (q - first) % every === 0);
    const parts: SVGElement[] = [
      svg("rect", { width: this.width, height: HEIGHT, fill: "#fff" }),
      svg("defs", {}, svg("clipPath", { id: "frf-clip" }, svg("rect", { x: LEFT, y: TOP - 2, width: this.width - LEFT - RIGHT, height: BOTTOM - TOP + 4 }))),
      ...ticks(low, high, this.width < 520 ? 4 : 8).flatMap((f) => [rule(x(f), TOP, x(f), SPLIT), rule(x(f), LOWER, x(f), BOTTOM), text(shown(f, 6), [x(f), BOTTOM + 16], "middle")]),
      ...powers.flatMap((q) => [rule(LEFT, y(10 ** q), this.width - RIGHT, y(10 ** q)), text(`1e${q}`.replace("-", "−"), [LEFT - 6, y(10 ** q) + 4], "end")]),
      ...[-180, 0, 180].flatMap((d) => [rule(LEFT, p(d), this.width - RIGHT, p(d)), text(`${String(d).replace("-", "−")}°`, [LEFT - 6, p(d) + 4], "end")]),
      text("Hz", [this.width - RIGHT, HEIGHT - 6], "end"),
      svg("text", { transform: `translate(14 ${(TOP + SPLIT) / 2}) rotate(-90)`, "text-anchor": "middle", "font-size": 12, fill: "#1d2733" }, this.data.ordinate),
    ];
    for (const line of [...lines].sort((a, b) => ORDER.indexOf(a.look) - ORDER.indexOf(b.look))) {
      const [, colour, width, dashes] = LOOKS[line.look];
      const style = { fill: "none", stroke: colour, "stroke-width": width, "stroke-dasharray": dashes || undefined, "stroke-linejoin": "round", "clip-path": "url(#frf-clip)" };
      const [upper, lower] = paths(line, low, high, (f) => x(f), (v) => y(v), (d) => p(d));
      parts.push(svg("path", { d: upper, ...style, "data-look": line.look }), ...(this.data.phase && line.phase ? [svg("path", { d: lower, ...style, "stroke-width": Math.min(width, 2) })] : []));
    }
    if (this.cursor !== null && this.cursor >= low && this.cursor <= high) parts.push(svg("line", { x1: x(this.cursor), x2: x(this.cursor), y1: TOP, y2: BOTTOM, stroke: "#1d2733", class: "cursor" }));
    this.drawing.replaceChildren(...parts);
    this.drawing.setAttribute("aria-label", `${this.data.titles[this.which.select.selectedIndex]} from ${shown(low)} to ${shown(high)} Hz: magnitude and phase of ${lines.map((l) => LOOKS[l.look][0]).join(", ")}`);
  }

  /** Values at the cursor, in words. */
  private read(lines: Line[]): void {
    const hz = this.cursor;
    if (hz === null) { this.readout.textContent = ""; return; }
    const values = lines.map(({ look, freq, real, imaginary, phase }) => {
      const i = nearestLine(freq, hz), size = Math.hypot(real[i], imaginary[i]);
      if (!size) return `${LOOKS[look][0]} –`;
      return `${LOOKS[look][0]} ${shown(size)}${phase ? ` at ${shown((Math.atan2(imaginary[i], real[i]) * 180) / Math.PI, 3)}°` : ""}`;
    });
    const first = lines[0], at = first ? first.freq[nearestLine(first.freq, hz)] : hz;
    this.readout.textContent = `${shown(at, 6)} Hz: ${values.join("; ")}`;
  }

  /** Places of real and imaginary parts with one scale for both, and the largest magnitude. */
  private plane(): { px: (re: number) => number; py: (im: number) => number; box: [number, number, number, number] } {
    const [low, high] = this.range;
    let [left, right, down, up] = [0, 0, 0, 0];
    for (const { freq, real, imaginary } of this.seen()) for (let i = 0; i < freq.length; i++) {
      if (freq[i] < low || freq[i] > high) continue;
      [left, right] = [Math.min(left, real[i]), Math.max(right, real[i])];
      [down, up] = [Math.min(down, imaginary[i]), Math.max(up, imaginary[i])];
    }
    const across = this.width - LEFT - RIGHT, tall = BOTTOM - TOP;
    const scale = 0.92 * Math.min(across / (right - left || 1), tall / (up - down || 1));
    const [mx, my] = [0.5 * (left + right), 0.5 * (down + up)];
    return {
      px: (re) => LEFT + across / 2 + scale * (re - mx), py: (im) => TOP + tall / 2 - scale * (im - my),
      box: [mx - across / 2 / scale, mx + across / 2 / scale, my - tall / 2 / scale, my + tall / 2 / scale],
    };
  }

  private drawNyquist(lines: Line[]): void {
    const [low, high] = this.range, { px, py, box: [left, right, down, up] } = this.plane(), end = this.width - RIGHT;
    const text = (words: string, x: number, y: number, anchor: string) => svg("text", { x, y, "text-anchor": anchor, "font-size": 12, fill: "#5b6977" }, words);
    const parts: SVGElement[] = [
      svg("rect", { width: this.width, height: HEIGHT, fill: "#fff" }),
      ...ticks(left, right, 6).flatMap((v) => [svg("line", { x1: px(v), x2: px(v), y1: TOP, y2: BOTTOM, stroke: v ? "#d4dae0" : "#5b6977" }), text(shown(v, 3), px(v), BOTTOM + 16, "middle")]),
      ...ticks(down, up, 5).flatMap((v) => [svg("line", { x1: LEFT, x2: end, y1: py(v), y2: py(v), stroke: v ? "#d4dae0" : "#5b6977" }), text(shown(v, 3), LEFT - 6, py(v) + 4, "end")]),
      text(`real part, ${this.data.ordinate}`, end, HEIGHT - 6, "end"),
      svg("text", { transform: `translate(14 ${(TOP + BOTTOM) / 2}) rotate(-90)`, "text-anchor": "middle", "font-size": 12, fill: "#1d2733" }, "imaginary part"),
    ];
    for (const line of [...lines].sort((a, b) => ORDER.indexOf(a.look) - ORDER.indexOf(b.look))) {
      if (!line.phase) continue;
      const [, stroke, width, dashes] = LOOKS[line.look];
      let path = "", pen = "M";
      for (let i = 0; i < line.freq.length; i++) {
        if (line.freq[i] < low || line.freq[i] > high) continue;
        if (!line.real[i] && !line.imaginary[i]) { pen = "M"; continue; }
        path += `${pen}${px(line.real[i]).toFixed(1)} ${py(line.imaginary[i]).toFixed(1)}`;
        pen = "L";
      }
      parts.push(svg("path", { d: path, fill: "none", stroke, "stroke-width": width, "stroke-dasharray": dashes || undefined, "stroke-linejoin": "round", "data-look": line.look }));
      if (this.cursor === null) continue;
      const i = nearestLine(line.freq, this.cursor);
      if (line.real[i] || line.imaginary[i]) parts.push(svg("circle", { cx: px(line.real[i]), cy: py(line.imaginary[i]), r: 4, fill: stroke, stroke: "#fff", class: "cursor" }));
    }
    this.drawing.replaceChildren(...parts);
    this.drawing.setAttribute("aria-label", `${this.data.titles[this.which.select.selectedIndex]} from ${shown(low)} to ${shown(high)} Hz: Nyquist plot of ${lines.map((l) => LOOKS[l.look][0]).join(", ")}`);
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
