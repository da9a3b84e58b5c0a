// The window with moving mode shapes: test and model of a pair side by side or over each other, in the same view.

import { OrthographicCamera, Vector3, WebGLRenderer, type Scene } from "three";
import { readView, unpack, type Functions, type Stage, type View } from "./data.ts";
import { scaleStops } from "./drawing.ts";
import { choice, cycles, fileName, h, hertz, labelled, RIGID_HZ, save, shown } from "./dom.ts";
import { linesOf, nearestLine } from "./functions.ts";
import { MatrixGrid, type MatrixCell } from "./matrix.ts";
import { box, measuredMotion, strongest } from "./motion.ts";
import { control, homeOf, Orbit } from "./orbit.ts";
import { film, filmType, frames } from "./record.ts";
import { SceneOf, type Chosen, type ColourBar, type Colouring, type Theme } from "./scene.ts";

const COLOURINGS: [Colouring, string][] = [["displacement", "displacement"], ["energy", "strain energy"], ["difference", "difference to the test"]];
/** A motion of the live model, the label of the test mode beside it, and the factor from its shape. */
interface LiveDetail { motion: Float32Array; factor: number; test: string; title: string }
const KEYS = "Drag to turn, shift and drag to move, wheel to zoom once the picture has the focus; with two fingers zoom and move. The pointer over a point, or a tap, shows its number and motion. Keys: arrows turn, + and − zoom, 0 resets the view, space starts and stops the motion, n and p go from point to point.";
/** Pixels within which the pointer finds a point. */
const NEAR = 16;
/** A part of the canvas with one view: its place in CSS pixels from the top left, and half the height that it shows. */
interface Pane { side: "model" | "test"; left: number; top: number; width: number; height: number; half: number }
export class Viewer {
  readonly element: HTMLElement;
  private readonly dark = matchMedia("(prefers-color-scheme: dark)");
  private readonly renderer: WebGLRenderer;
  private readonly camera = new OrthographicCamera();
  private readonly canvas: HTMLCanvasElement;
  private readonly title = h("p", { class: "shown", "aria-live": "polite" });
  private readonly remark = h("p", { class: "note" });
  private readonly list = h("div", { class: "choices" });
  private readonly legend = h("p", { class: "legend", "aria-live": "polite" });
  private readonly names = [h("span", { class: "name" }, "Test"), h("span", { class: "name" }, "Model")];
  private readonly play: HTMLButtonElement;
  private readonly phase: HTMLInputElement;
  private readonly scale: HTMLInputElement;
  private readonly speed: HTMLInputElement;
  private readonly arrows: HTMLInputElement;
  private readonly configuration;
  private readonly version;
  private readonly colouring;
  private readonly layout;
  private scene!: SceneOf;
  private orbit!: Orbit;
  private centre = new Vector3();
  private extent: number[] = [1, 1];
  private grid: MatrixGrid | null = null;
  private cells: MatrixCell[][] = [];
  private chosen: Chosen = { test: null, column: 0 };
  private running = false;
  private visible = true;
  private last = 0;
  private dirty = true;
  private last_: LiveDetail | null = null;
  private panes: Pane[] = [];
  private readonly tip = h("div", { class: "tip", role: "status" });
  /** The point that is shown: its side and row. */
  private point: ["model" | "test", number] | null = null;
  /** What is shown instead of a mode. */
  private operating = false;

  /** With `live` it shows the motions of the live model, and offers no others. */
  constructor(private readonly view: View, private readonly live = false) {
    this.canvas = h("canvas", { tabindex: 0, role: "img", "aria-label": "Moving mode shape", "aria-describedby": live ? "live-keys" : "viewer-keys" });
    // where there is none three.js would write errors to the console
    const context = this.canvas.getContext("webgl2", { antialias: true, alpha: true, depth: true, stencil: false, preserveDrawingBuffer: true });
    if (!context) throw new Error("no WebGL");
    this.renderer = new WebGLRenderer({ canvas: this.canvas, context, antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.autoClear = false;
    const range = (low: number, high: number, step: number, value: number) =>
      h("input", { type: "range", min: low, max: high, step, value, input: () => this.redraw() });
    this.play = h("button", { type: "button", class: "play", click: () => this.run(!this.running) }, "Play");
    this.phase = range(0, 360, 1, 0);
    this.phase.addEventListener("input", () => this.run(false));
    this.scale = range(0, 3, 0.05, 1);
    this.speed = range(0.1, 3, 0.1, 1);
    this.arrows = h("input", { type: "checkbox", checked: true, change: () => this.redraw() });
    this.configuration = choice("Configuration", view.scenes.map((s) => s.configuration), (k) => this.open(k));
    this.version = choice("Model", ["before", "after"], () => this.fill());
    this.colouring = choice("Colour", COLOURINGS.map(([, text]) => text), () => this.repaint());
    this.layout = choice("Windows", ["side by side", "overlaid"], () => this.redraw());
    const look = (name: string, azimuth: number, elevation: number) =>
      h("button", { type: "button", "aria-label": `View along ${name}`, click: () => { this.orbit.look(azimuth, elevation); this.fit(); this.redraw(); } }, name);
    const views = h("span", { class: "views", role: "group", "aria-label": "View" },
      look("x", 0, 0), look("y", -Math.PI / 2, 0), look("z", -Math.PI / 2, Math.PI / 2),
      h("button", { type: "button", click: () => { this.orbit.reset(); this.fit(); this.redraw(); } }, "reset"));
    const picture = h("span", { class: "views", role: "group", "aria-label": "Save" },
      h("button", { type: "button", click: () => this.savePicture(), "aria-label": "Save picture as PNG" }, "PNG"),
      ...(filmType() ? [h("button", { type: "button", click: (e) => void this.saveMotion(e.currentTarget, true), "aria-label": "Save the motion as a film" }, "film")] : []),
      h("button", { type: "button", click: (e) => void this.saveMotion(e.currentTarget, false), "aria-label": "Save the motion as PNG frames" }, "frames"));
    const tools = h("div", { class: "controls" }, this.play, labelled("Phase", this.phase), labelled("Scale", this.scale),
      labelled("Speed", this.speed), this.colouring.label, this.layout.label, labelled("Arrows", this.arrows), views, picture);
    const stage = h("div", { class: "stage" }, this.canvas, ...this.names, this.tip);
    const window_ = h("div", { class: "window" }, this.title, stage, this.legend, tools, this.remark, h("p", { class: "note", id: live ? "live-keys" : "viewer-keys" }, KEYS));
    const choices = h("div", { class: "side" }, h("div", { class: "controls" }, this.configuration.label, this.version.label), this.list);
    this.element = h("div", { class: live ? "viewer alone" : "viewer", role: "group", "aria-label": live ? "Moving mode shape of the live model" : "Moving mode shapes" }, ...(live ? [] : [choices]), window_);
    control(this.canvas, () => this.orbit, () => this.redraw());
    this.canvas.addEventListener("pointermove", (e) => { if (!e.buttons) this.hover(e); });
    this.canvas.addEventListener("pointerup", (e) => this.hover(e));
    this.canvas.addEventListener("pointerleave", (e) => { if (e.pointerType === "mouse") this.tell(null); });
    this.canvas.addEventListener("keydown", (e) => { if ((e.key === "n" || e.key === "p") && !e.ctrlKey && !e.metaKey) { e.preventDefault(); this.step(e.key === "n" ? 1 : -1); } });
    this.canvas.addEventListener("keydown", (e) => { if (e.key === " ") { e.preventDefault(); this.run(!this.running); } });
    this.dark.addEventListener("change", () => this.open(this.configuration.select.selectedIndex));
  }

  /** Begin, once the element is part of the page. */
  start(): void {
    if (!this.live) this.open(0);
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
    new IntersectionObserver((found) => { this.visible = found[found.length - 1].isIntersecting; }).observe(this.canvas);
    this.run(!matchMedia("(prefers-reduced-motion: reduce)").matches);
    requestAnimationFrame((now) => this.frame(now));
  }

  /** Show the pair of a test mode, of a row of a table of the page; false where it has none. */
  showPair(configuration: string, label: string): boolean {
    const k = this.view.scenes.findIndex((s) => s.configuration === configuration);
    const test = this.view.scenes[k]?.test_labels.indexOf(label) ?? -1;
    if (test < 0) return false;
    if (k !== this.configuration.select.selectedIndex) { this.configuration.select.selectedIndex = k; this.open(k); }
    const pair = this.stage.pairs.find((p) => p.test === test);
    if (pair) this.choose({ test, column: pair.column });
    return pair !== undefined;
  }

  /** Another scene, of the live model. */
  openLive(scene: number): void { if (this.scene?.data !== this.view.scenes[scene]) { this.configuration.select.selectedIndex = scene; this.open(scene); } }

  /** Show a motion of the live model. */
  showLive({ motion, factor, test, title }: LiveDetail): void {
    const { data } = this.scene, at = data.test_labels.indexOf(test);
    if (motion.length !== this.scene.points.length) return;
    this.chosen = { test: at < 0 || !this.scene.hasTest ? null : at, column: -1 };
    this.scene.chooseLive(motion, this.chosen.test, factor);
    this.last_ = { motion, factor, test, title };
    this.title.textContent = title;
    this.repaint();
  }

  private get stage(): Stage { return this.scene.data.stages[this.version.select.selectedIndex]; }

  /** The structure fills its window in this direction of view; room for half of the largest motion is left. */
  private fit(): void {
    const { points, size } = this.scene, middle = this.centre.toArray();
    this.extent = this.orbit.axes().slice(0, 2).map((axis) => {
      let most = 0;
      for (let i = 0; i < points.length; i += 3) most = Math.max(most, Math.abs(axis[0] * (points[i] - middle[0]) + axis[1] * (points[i + 1] - middle[1]) + axis[2] * (points[i + 2] - middle[2])));
      return 1.04 * most + 0.065 * size;
    });
  }

  /** The operating shape of measured functions at a frequency; null returns to the mode. */
  showOperating(functions: Functions, which: number, hz: number | null): void {
    const { operating, curves } = functions, of = this.scene?.data;
    if (!of?.test_only || !operating) return;
    if (hz === null) { if (this.operating) this.choose(this.chosen); return; }
    const at = operating.inputs.map((name, k) => (name === operating.inputs[which] && operating.rows[k] >= 0 ? k : -1)).filter((k) => k >= 0);
    const directions = unpack(operating.directions), measured = curves.filter((c) => c.look === "test");
    const values = at.map((k) => {
      const [line] = linesOf(measured, k);
      const i = line ? nearestLine(line.freq, hz) : 0;
      return line ? [line.real[i], line.imaginary[i], line.freq[i]] : [0, 0, hz];
    });
    const along = at.flatMap((k) => Array.from(directions.subarray(3 * k, 3 * k + 3)));
    const motion = measuredMotion(this.scene.points.length / 3, at.map((k) => operating.rows[k]), along, values.map((v) => v[0]), values.map((v) => v[1]));
    this.scene.chooseMotion(motion);
    this.operating = true;
    this.title.textContent = `Operating shape at ${shown(values[0]?.[2] ?? hz, 5)} Hz, force at ${operating.inputs[which]}: ${at.length} measured functions`;
    this.element.dataset.shown = "operating";
    for (const b of this.list.querySelectorAll("button")) b.setAttribute("aria-pressed", "false");
    this.repaint();
  }

  private theme(): Theme {
    return this.dark.matches
      ? { dark: true, ink: "#d5dde5", rest: "#66727e", model: "#66a5d8", test: "#f0924c" }
      : { dark: false, ink: "#1d2733", rest: "#98a4b0", model: "#1f5a92", test: "#b4530f" };
  }

  private open(k: number): void {
    const data = this.view.scenes[k], theme = this.theme();
    this.scene = new SceneOf(data, theme);
    const around = box(this.scene.points);
    this.centre = new Vector3(...around.map(([low, high]) => 0.5 * (low + high)));
    this.orbit = new Orbit(homeOf(around.map(([low, high]) => 0.5 * (high - low))));
    this.fit();
    this.tell(null);
    const stages = this.version.select;
    stages.replaceChildren(...data.stages.map((s) => h("option", {}, s.title)));
    stages.selectedIndex = data.stages.length - 1;
    this.version.label.hidden = data.stages.length < 2;
    this.colouring.select.selectedIndex = 0;
    this.layout.label.hidden = !this.scene.hasTest;
    this.arrows.parentElement!.hidden = !this.scene.hasTest && !data.test_only;
    this.remark.textContent = data.note;
    this.remark.hidden = !data.note;
    if (this.live) { if (this.last_) this.showLive(this.last_); return; }
    const first = this.stage.pairs[0];
    this.chosen = first ? { test: first.test, column: first.column } : { test: null, column: this.stage.stored.find((j) => this.stage.freq_hz[j] > RIGID_HZ) ?? this.stage.stored[0] };
    this.fill();
  }

  /** The choices of the stage: a MAC matrix, or a list of modes without a test. */
  private fill(): void {
    const { stage } = this, { data } = this.scene;
    this.grid = null;
    if (this.scene.hasTest && stage.mac) this.fillMatrix(unpack(stage.mac));
    else this.list.replaceChildren(h("div", { class: "modes", role: "group", "aria-label": "Modes" }, ...stage.stored.map((j) =>
      h("button", { type: "button", "aria-pressed": "false", click: () => this.choose({ test: null, column: j }) }, `${data.test_only ? data.test_labels[j] : stage.numbers[j]}: ${hertz(stage.freq_hz[j])}`))));
    // the same test mode at another model version may have another partner
    const pair = stage.pairs.find((p) => p.test === this.chosen.test);
    const column = pair ? pair.column : stage.stored.includes(this.chosen.column) ? this.chosen.column : stage.stored[0];
    this.element.dataset.configuration = data.configuration;
    this.choose({ test: this.chosen.test, column });
  }

  private fillMatrix(mac: Float32Array): void {
    const { stage } = this, { data } = this.scene, count = stage.numbers.length;
    const paired = new Set(stage.pairs.map((p) => p.column));
    const columns = stage.stored.filter((j) => paired.has(j) || stage.freq_hz[j] > RIGID_HZ);
    this.cells = data.test_labels.map((label, i) => columns.map((j) => {
      const value = mac[i * count + j], pair = stage.pairs.some((p) => p.test === i && p.column === j);
      const text = value < 0 ? "MAC not tested" : `MAC ${value.toFixed(2)}`;
      const words = `Test mode ${label}, ${cycles(data.test_freq_hz[i])} Hz; model mode ${stage.numbers[j]}, ${hertz(stage.freq_hz[j])}; ${text}${pair ? "; pair" : ""}`;
      return { row: i, column: j, value, pair, label: words, disabled: false };
    }));
    const rows = data.test_labels.map((label, i) => `${label}: ${shown(data.test_freq_hz[i], 3)} Hz`);
    this.grid = new MatrixGrid("MAC: click a cell to see both shapes. Rows: test; columns: model; framed: pairs.", rows,
      columns.map((j) => String(stage.numbers[j])), this.cells, (cell) => this.choose({ test: cell.row, column: cell.column }));
    this.list.replaceChildren(h("div", { class: "scroll" }, this.grid.element));
  }

  private choose(chosen: Chosen): void {
    this.chosen = chosen;
    this.operating = false;
    this.tell(null);
    this.scene.choose(this.stage, chosen);
    const { stage } = this, { data } = this.scene;
    const ratio = stage.damping_ratio[chosen.column], damped = ratio == null ? "" : `, damping ${shown(100 * ratio, 3)} %`;
    const what = data.test_only ? "mode" : stage.damping_ratio.length ? "complex model mode" : "model mode";
    const model = `${what} ${stage.numbers[chosen.column]}, ${hertz(stage.freq_hz[chosen.column])}${damped}`;
    if (chosen.test === null) {
      this.title.textContent = model[0].toUpperCase() + model.slice(1);
      for (const [k, b] of Array.from(this.list.querySelectorAll("button")).entries()) b.setAttribute("aria-pressed", String(stage.stored[k] === chosen.column));
    } else {
      const hz = data.test_freq_hz[chosen.test], error = 100 * (stage.freq_hz[chosen.column] / hz - 1);
      const cell = this.cells[chosen.test].find((c) => c.column === chosen.column);
      const mac = cell && cell.value >= 0 ? `, MAC ${cell.value.toFixed(3)}` : "";
      const scaled = this.scene.alike ? "" : "; the shapes are unlike and are scaled to the same largest motion";
      this.title.textContent = `Test mode ${data.test_labels[chosen.test]}, ${cycles(hz)} Hz, and ${model} (${error > 0 ? "+" : ""}${shown(error, 3)} %${mac})${scaled}`;
      this.grid?.mark(chosen.test, this.cells[chosen.test].findIndex((c) => c.column === chosen.column));
    }
    this.element.dataset.shown = `${chosen.test ?? ""}|${chosen.column}`;
    this.repaint();
  }

  private repaint(): void {
    const { select } = this.colouring;
    COLOURINGS.forEach(([name], i) => { select.options[i].disabled = select.options[i].hidden = !this.scene.can(name); });
    if (select.selectedOptions[0].disabled) select.selectedIndex = 0;
    this.colouring.label.hidden = COLOURINGS.filter(([name]) => this.scene.can(name)).length < 2;
    this.showBar(this.scene.paint(COLOURINGS[select.selectedIndex][0]));
    this.redraw();
  }

  private showBar(bar: ColourBar): void {
    const tick = (part: number, text: string) => { const mark = h("span", {}, text); mark.style.left = `${part}%`; return mark; };
    const strip = h("i"), from = `from 0 to ${shown(bar.end, 3)}${bar.open ? " and more" : ""}`;
    this.canvas.setAttribute("aria-label", `Moving mode shape. ${this.title.textContent}. Colour: ${bar.name}, ${from}`);
    strip.style.backgroundImage = `linear-gradient(to right, ${scaleStops(this.theme().dark, bar.hot).join(", ")})`;
    const ticks = h("span", { class: "ticks" }, tick(0, "0"), tick(50, shown(bar.end / 2, 3)), tick(100, (bar.open ? "≥ " : "") + shown(bar.end, 3)));
    const { data } = this.scene, { test, column } = this.chosen;
    // slopes are those of the partner of a test mode
    const paired = !this.live && this.stage.pairs.some((p) => p.test === test && p.column === column);
    const moving = bar.hot && test !== null && paired ? strongest(data.parameters, data.slopes[test] ?? []) : [];
    const change = moving.length ? h("span", {}, `Change of the frequency in % for 1 % of a parameter, at the initial values: ${moving.map(([name, slope]) => `${name} ${slope > 0 ? "+" : ""}${shown(slope, 2)}`).join(", ")}`) : null;
    this.legend.replaceChildren(h("span", {}, bar.name), h("span", { class: "bar", role: "img", "aria-label": `Colours ${from}` }, strip, ticks), ...(change ? [change] : []));
  }

  private run(on: boolean): void {
    this.running = on;
    this.play.textContent = on ? "Pause" : "Play";
    this.last = 0;
  }

  private redraw(): void { this.dirty = true; }

  private frame(now: number): void {
    requestAnimationFrame((next) => this.frame(next));
    if (this.running && this.visible && !document.hidden) {
      const seconds = this.last ? Math.min(0.1, (now - this.last) / 1000) : 0;
      this.phase.value = String((Number(this.phase.value) + 240 * Number(this.speed.value) * seconds) % 360);
      this.last = now;
      this.dirty = true;
    }
    if (this.dirty) this.draw();
  }

  private draw(): void {
    this.dirty = false;
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    const ratio = Math.min(devicePixelRatio, 2);
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
    if (this.live && !this.last_) return;
    this.scene.move((Number(this.phase.value) * Math.PI) / 180, Number(this.scale.value), this.arrows.checked);
    const overlaid = this.layout.select.selectedIndex === 1, both = this.scene.hasTest && this.chosen.test !== null;
    this.names[0].hidden = this.names[1].hidden = !both;
    this.names[0].textContent = overlaid ? "Test and model" : "Test";
    this.names[1].hidden ||= overlaid;
    this.renderer.setScissorTest(true);
    this.panes = [];
    // one over the other where both are larger then
    const stacked = this.half(width / 2 / height) / height > 1.1 * (this.half((2 * width) / height) / (height / 2));
    this.element.classList.toggle("stacked", both && !overlaid && stacked);
    if (both && !overlaid && stacked) {
      const half = Math.floor(height / 2);
      this.render([this.scene.test], "test", 0, 0, width, half);
      this.render([this.scene.model], "model", 0, half, width, height - half);
    } else if (both && !overlaid) {
      const half = Math.floor(width / 2);
      this.render([this.scene.test], "test", 0, 0, half, height);
      this.render([this.scene.model], "model", half, 0, width - half, height);
    } else {
      this.render(both ? [this.scene.model, this.scene.test] : [this.scene.model], "model", 0, 0, width, height);
      if (both) this.panes.push({ ...this.panes[0], side: "test" });
    }
    if (this.point) this.tell(this.point);
  }

  private render(scenes: Scene[], side: "model" | "test", left: number, top: number, width: number, height: number): void {
    const [right, up, out] = this.orbit.axes(), wide = width / height;
    // the whole structure as it was seen at first, also in a narrow window
    const y = this.half(wide) / this.orbit.zoom, x = wide * y;
    this.panes.push({ side, left, top, width, height, half: y });
    Object.assign(this.camera, { left: -x, right: x, top: y, bottom: -y, near: 0, far: 20 * this.scene.size });
    const at = this.centre.clone().addScaledVector(new Vector3(...right), -this.orbit.pan[0] * y * 0.5).addScaledVector(new Vector3(...up), -this.orbit.pan[1] * y * 0.5);
    this.camera.up.set(...(up as [number, number, number]));
    this.camera.position.copy(at).addScaledVector(new Vector3(...out), 10 * this.scene.size);
    this.camera.lookAt(at);
    this.camera.updateProjectionMatrix();
    for (const scene of scenes) {
      const sun = scene.getObjectByName("sun")!;
      sun.position.set(0, 0, 0).addScaledVector(new Vector3(...out), 1).addScaledVector(new Vector3(...up), 0.6).addScaledVector(new Vector3(...right), -0.4);
    }
    const bottom = this.canvas.clientHeight - top - height;
    this.renderer.setViewport(left, bottom, width, height);
    this.renderer.setScissor(left, bottom, width, height);
    this.renderer.clear();
    for (const scene of scenes) this.renderer.render(scene, this.camera);
  }

  /** Half the height that a window of this ratio of width to height shows. */
  private half(wide: number): number { return Math.max(this.extent[1], this.extent[0] / wide); }

  /** Places of the points of a pane on the canvas, in CSS pixels. */
  private places(pane: Pane): Float32Array | null {
    const now = this.scene.now(pane.side);
    if (!now) return null;
    const [right, up] = this.orbit.axes(), scale = pane.height / 2 / pane.half, c = this.centre.toArray(), [px, py] = this.orbit.pan;
    const out = new Float32Array((2 * now.length) / 3);
    for (let i = 0; 3 * i < now.length; i++) {
      const d = [0, 1, 2].map((k) => now[3 * i + k] - c[k]), along = (a: number[]) => a[0] * d[0] + a[1] * d[1] + a[2] * d[2];
      out[2 * i] = pane.left + pane.width / 2 + scale * (along(right) + px * pane.half * 0.5);
      out[2 * i + 1] = pane.top + pane.height / 2 - scale * (along(up) + py * pane.half * 0.5);
    }
    return out;
  }

  /** The point under the pointer. */
  private hover(e: PointerEvent): void {
    const frame = this.canvas.getBoundingClientRect(), [x, y] = [e.clientX - frame.left, e.clientY - frame.top];
    let best: ["model" | "test", number] | null = null, least = NEAR;
    for (const pane of this.panes) {
      const places = x >= pane.left && x <= pane.left + pane.width && y >= pane.top && y <= pane.top + pane.height ? this.places(pane) : null;
      for (let i = 0; places && 2 * i < places.length; i++) {
        const away = Math.hypot(places[2 * i] - x, places[2 * i + 1] - y);
        if (away < least) [best, least] = [[pane.side, i], away];
      }
    }
    this.tell(best);
  }

  /** The next point of the model, by the keyboard. */
  private step(by: number): void {
    const count = this.scene.points.length / 3, from = this.point?.[0] === "model" ? this.point[1] : by > 0 ? -1 : 0;
    this.tell(["model", (from + by + count) % count]);
  }

  /** Number and motion of a point beside it. */
  private tell(point: ["model" | "test", number] | null): void {
    const pane = point && this.panes.find((p) => p.side === point[0]), facts = pane && this.scene.point(...point!), places = facts ? this.places(pane!) : null;
    this.point = places ? point : null;
    this.tip.hidden = !places;
    if (!places) return;
    const [side, row] = point!, name = facts!.number ? `${side === "test" || this.scene.data.test_only ? "Test point" : "Point"} ${facts!.number}` : side === "test" ? "Test" : "Point";
    const energy = this.colouring.select.selectedIndex === 1 && facts!.energy !== null ? `, strain energy ${shown(facts!.energy, 3)} %` : "";
    const text = `${name}: ${shown(facts!.percent, 3)} % of the largest displacement${energy}`;
    if (this.tip.textContent !== text) this.tip.textContent = text;
    const [x, y] = [places[2 * row], places[2 * row + 1]], left = x > this.canvas.clientWidth / 2;
    Object.assign(this.tip.style, { top: `${Math.max(0, y + 10)}px`, left: left ? "auto" : `${x + 10}px`, right: left ? `${this.canvas.clientWidth - x + 10}px` : "auto" });
  }

  /** The motion as a film, or the pictures of a period. */
  private async saveMotion(button: HTMLButtonElement, moving: boolean): Promise<void> {
    const [phase, running] = [this.phase.value, this.running], words = button.textContent;
    this.run(false);
    this.tell(null);
    button.disabled = true;
    button.textContent = "…";
    const at = (degrees: number) => { this.phase.value = String(degrees); this.draw(); };
    try {
      const blob = await (moving ? film : frames)(this.canvas, getComputedStyle(this.canvas.parentElement!).backgroundColor, at);
      save(fileName(this.title.textContent ?? "", moving ? blob.type.split("/")[1] : "zip"), blob);
    } finally {
      button.textContent = words;
      button.disabled = false;
      this.phase.value = phase;
      this.run(running);
      this.redraw();
    }
  }

  private savePicture(): void {
    this.draw();
    this.canvas.toBlob((blob) => { if (blob) save(fileName(this.title.textContent ?? "", "png"), blob); }, "image/png");
  }
}

/** Put the viewer before the still pictures, which are then folded; leave the page as it is without WebGL. */
function install(): void {
  const view = readView();
  const found = (ids: string[]) => ids.map((id) => document.getElementById(id)).find((s) => s !== null);
  const own = found(["mode_shapes", "pictures", "shapes"]);
  const section = own ?? found(["modes", "complex_modes", "responses"]);
  if (!view?.scenes.length || !section) return;
  let viewer: Viewer;
  try {
    viewer = new Viewer(view);
  } catch {
    section.querySelector("h2")?.after(h("p", { class: "muted" }, `This browser has no WebGL: ${own ? "the shapes are shown in still pictures" : "the mode shapes are not shown"}.`));
    return;
  }
  const stills = h("details", { class: "stills" }, h("summary", {}, "Still pictures"));
  if (own) {
    stills.append(...Array.from(section.children).filter((c) => c.tagName !== "H2"));
    section.append(viewer.element, stills);
  } else section.append(h("h3", { class: "live" }, "Mode shapes"), viewer.element);
  viewer.start();
  document.addEventListener("femtune:pair", (e) => {
    const { configuration, label } = (e as CustomEvent<{ configuration: string; label: string }>).detail;
    if (viewer.showPair(configuration, label)) viewer.element.scrollIntoView({ block: "start" });
  });
  document.addEventListener("femtune:cursor", (e) => {
    const { section: of, which, hz } = (e as CustomEvent<{ section: string; which: number; hz: number | null }>).detail;
    const functions = view.functions.find((f) => f.section === of);
    if (functions) viewer.showOperating(functions, which, hz);
  });
}

/** The window of the live model, which asks for it once its solver is ready. */
function installLive(): void {
  const view = readView();
  let viewer: Viewer | null = null;
  document.addEventListener("femtune:live-window", (e) => {
    const { host, scene } = (e as CustomEvent<{ host: HTMLElement; scene: number }>).detail;
    if (!view?.scenes[scene]?.live) { host.hidden = true; return; }
    host.hidden = false;
    try {
      if (!viewer) {
        viewer = new Viewer(view, true);
        host.append(viewer.element);
        viewer.start();
      }
      viewer.openLive(scene);
    } catch { host.hidden = true; }
  });
  document.addEventListener("femtune:live-shape", (e) => viewer?.showLive((e as CustomEvent<LiveDetail>).detail));
}

install();
installLive();
