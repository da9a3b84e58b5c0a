// The live model: sliders for the parameters; frequencies, MAC, χ² and a moving shape that follow them.

import { readView, type Live, type LiveParameter, type View } from "./data.ts";
import { choice, cycles, h, hertz, labelled, save, shown, svg } from "./dom.ts";
import { criterionRows } from "./livecriteria.ts";
import { LiveFrfs } from "./livefrfs.ts";
import { DroppedTest } from "./livetest.ts";
import { inRegion, type AddedMass, type Solved } from "./livemodel.ts";
import type { Asked, Extreme } from "./liveregion.ts";
import { certificateText, partsOf, signed, size, studyLines, truthText, written } from "./livetext.ts";
import type { Answer, LiveShape } from "./liveworker.ts";

declare const WORKER: string;

const STEPS = 500;
/** Models that pass by, and samples that must count for them. */
const MODELS = 20, LEAST_EFFECTIVE = 10;
/** A sum of squares; it does not show the digits of rounding. */
const square = (value: number | null | undefined) => (value != null && value < 1e-3 && value > 0 ? size(value) : shown(value));

class Slider {
  private value = NaN;
  readonly element: HTMLElement;
  readonly range: HTMLInputElement;
  readonly number: HTMLInputElement;
  constructor(readonly parameter: LiveParameter, k: number, ends: string, changed: (value: number) => void) {
    const { name, unit, lower, upper, nominal, updated, interval } = parameter, id = `live-${k}`;
    const bound = (value: number) => Math.min(upper, Math.max(lower, value));
    this.range = h("input", { type: "range", id, min: 0, max: STEPS, step: 1, "aria-describedby": `${id}-marks`, input: () => changed(lower + (Number(this.range.value) / STEPS) * (upper - lower)) });
    this.number = h("input", {
      type: "number", step: "any", min: lower, max: upper, "aria-label": `${name}, value`,
      change: () => { const value = this.number.valueAsNumber; changed(Number.isFinite(value) ? bound(value) : this.value); },
    });
    const place = (value: number) => `${(100 * (bound(value) - lower)) / (upper - lower)}%`;
    const marks = svg("svg", { class: "marks", width: "100%", height: 12, "aria-hidden": "true" });
    if (interval) marks.append(svg("rect", { class: "interval", x: place(interval[0]), width: `${(100 * (bound(interval[1]) - bound(interval[0]))) / (upper - lower)}%`, y: 1, height: 5 }));
    marks.append(svg("rect", { class: "initial", x: place(nominal), width: 2, y: 0, height: 8 }), svg("rect", { class: "updated", x: place(updated), width: 2.5, y: 0, height: 12 }));
    const words = `${ends} ${shown(lower)} to ${shown(upper)}; initial ${shown(nominal)}; updated ${shown(updated)}${interval ? `; 95 % interval ${shown(interval[0])} to ${shown(interval[1])}` : ""}`;
    this.element = h("div", { class: "slider", title: words },
      h("label", { for: id }, h("span", {}, unit ? `${name}, ${unit}` : name)), this.number,
      h("div", { class: "track" }, this.range, marks, h("span", { class: "ends", "aria-hidden": "true" }, h("span", {}, shown(lower, 3)), h("span", {}, shown(upper, 3)))),
      h("span", { class: "said", id: `${id}-marks` }, words));
  }
  set(value: number): void {
    const { lower, upper, name, unit } = this.parameter;
    this.value = value;
    this.range.value = String(Math.round((STEPS * (value - lower)) / (upper - lower)));
    this.range.setAttribute("aria-valuetext", `${name} ${shown(value)} ${unit}`.trim());
    this.number.value = written(value);
  }
}

export class LivePanel {
  readonly element = h("div", { class: "livemodel" });
  private readonly live: Live;
  private readonly sliders: Slider[];
  private readonly values: number[];
  private readonly where = h("p", { class: "shown", "aria-live": "polite" });
  private readonly truth = h("p", { class: "note truth" });
  private readonly certificate = h("p", { class: "note certificate" });
  private readonly parts = h("tbody");
  private readonly modes = h("tbody");
  private readonly criteria = h("tbody");
  private readonly criteriaTable = h("div");
  private readonly keptNote = h("p", { class: "note" });
  private readonly frfs: LiveFrfs;
  private readonly dropped: DroppedTest;
  private readonly configuration;
  private readonly lines: HTMLTextAreaElement;
  private readonly copied = h("span", { class: "note", role: "status" });
  private readonly host = h("div", { class: "liveshape" });
  private readonly worker: Worker;
  private readonly off: Set<number>[];
  private readonly totalMass = h("p", { class: "note totalmass" });
  private readonly noMasses = h("p", { class: "note nomasses" });
  private readonly masses = h("details", {}, h("summary", {}, "A mass at a sensor"));
  private point = 0;
  private mass = 0;
  private readonly sensors = h("details", {}, h("summary", {}, "MAC without some sensors"));
  private readonly solved: (Solved | null)[];
  private readonly first: (Solved | null)[];
  private touched = false;
  private busy = false;
  private waiting = false;
  private id = 0;
  private readonly asks = h("fieldset", { class: "asks" });
  private readonly told = h("p", { class: "note", "aria-live": "polite" });
  private readonly models = h("div", { class: "controls", hidden: true });
  private allowed: number[][] = [];
  private chosen = 0;
  private timer = 0;
  private asked = 0;
  /** When the first input that is not yet asked for was made. */
  private input: number | null = null;
  /** Whether the configurations that are not shown are being solved. */
  private resting = false;
  private shape: LiveShape | null = null;
  private test: number;

  constructor(private readonly view: View, private readonly failed: (why: string) => void) {
    const live = this.live = view.live!;
    this.values = live.parameters.map((p) => p.updated);
    this.solved = live.configurations.map(() => null);
    this.off = live.configurations.map(() => new Set());
    this.first = live.configurations.map(() => null);
    this.test = live.configurations[0].pairs[0]?.[0] ?? -1;
    this.sliders = live.parameters.map((p, k) => new Slider(p, k, live.narrowed ? "Range" : "Bounds", (value) => this.set(k, value)));
    this.configuration = choice("Configuration", live.configurations.map((c) => c.configuration), () => this.choose());
    this.lines = h("textarea", { readonly: true, rows: 6, "aria-label": "Values as lines for a study" });
    this.frfs = new LiveFrfs(live, this.reach, () => this.ask(), (doubt) => this.dropped.doubted(doubt), (level) => {
      this.stop();
      this.worker.postMessage({ kind: "level", configuration: this.at, level, added: this.added });
    });
    this.dropped = new DroppedTest(live, (modes, curves) => {
      this.worker.postMessage({ kind: "drop", configuration: this.at, modes });
      this.frfs.drop(curves);
      this.ask();
    });
    const address = URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" }));
    this.worker = new Worker(address);
    this.worker.onmessage = (e: MessageEvent<Answer>) => this.take(e.data);
    this.worker.onerror = (e) => { e.preventDefault(); this.failed("this browser does not run its solver"); };
    this.worker.postMessage({ kind: "begin", live, shapes: live.configurations.map((c) => view.scenes.find((s) => s.configuration === c.configuration)?.live ?? null) });
  }

  private get at(): number { return this.configuration.select.selectedIndex; }
  /** What the sliders reach, in words. */
  private get reach(): string { return this.live.narrowed ? "the ranges of the sliders" : "the bounds"; }
  private get added(): AddedMass | null { return this.mass ? { point: this.point, mass: this.mass } : null; }
  private get x(): number[] { return this.live.parameters.map((p, i) => (this.values[i] - p.nominal) / p.scale); }

  private build(): void {
    const button = (text: string, act: () => void) => h("button", { type: "button", click: act }, text);
    const legend = h("p", { class: "note marks-key" },
      mark("updated"), "updated", mark("initial"), "initial", ...(this.live.parameters.some((p) => p.interval) ? [mark("interval"), "95 % interval"] : []));
    const table = (title: string, heads: string[], body: HTMLElement) => h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": title },
      h("table", {}, h("caption", {}, title), h("thead", {}, h("tr", {}, ...heads.map((t, k) => h("th", { scope: "col", class: k ? "right" : "left" }, t)))), body));
    const lines = h("details", {}, h("summary", {}, "The values as lines for a study"),
      h("p", { class: "note" }, "In a study these are the initial values; the other keys of each parameter stay as they are."), this.lines,
      h("p", { class: "tools" }, button("Copy", () => void this.copy()), button("Save", () => save("parameters.toml", new Blob([this.lines.value], { type: "text/plain" }))), this.copied));
    this.element.replaceChildren(
      h("div", { class: "columns" },
        h("fieldset", { class: "sliders" }, h("legend", {}, "Parameters"), legend, ...this.sliders.map((s) => s.element),
          h("p", { class: "tools" }, button("Back to the update", () => { this.stop(); this.setAll((p) => p.updated); }), this.live.parameters.every((p) => p.lower <= p.nominal && p.nominal <= p.upper) ? button("Initial values", () => { this.stop(); this.setAll((p) => p.nominal); }) : null)),
        h("div", { class: "answers" }, this.where, this.truth, this.certificate, h("div", { class: "controls" }, this.configuration.label),
          table("Frequencies and MAC now", [this.live.configurations.some((c) => c.test_labels.length) ? "Test mode" : "Mode", "Test, Hz", "Updated, Hz", "Now, Hz", "Error, %", "MAC"], this.modes), this.totalMass,
          table("χ² of all configurations", ["Residuals", "Updated", "Now"], this.parts), this.criteriaTable, this.host)),
      this.frfs.element, this.asks, this.masses, this.noMasses, this.sensors, this.dropped.element, lines);
    this.criteriaTable.append(table("Criteria now", ["Criterion", "Limit", "Updated", "Now", "Verdict"], this.criteria),
      this.keptNote);
    this.fillAsks();
    this.choose();
    this.sliders.forEach((s, i) => s.set(this.values[i]));
  }

  /** Questions about the region. */
  private fillAsks(): void {
    const button = (text: string, act: () => void) => h("button", { type: "button", click: act }, text), { live } = this;
    const where = live.region ? "the 95 % region" : this.reach;
    const ask = (sign: number, asked: Asked = "frequency") => () => {
      this.stop();
      this.told.textContent = "…";
      this.worker.postMessage({ kind: "extreme", asked, configuration: this.at, test: this.test, sign, added: this.added });
    };
    const show = button(live.rejected ? "Models within the limit" : "Models that the data allow", () => { this.told.textContent = "…"; this.worker.postMessage({ kind: "allowed", count: MODELS }); });
    const step = (by: number) => () => { this.stop(); this.showModel(this.chosen + by); };
    const play = button("Play", () => (this.timer ? this.stop() : this.play()));
    play.classList.add("play");
    this.models.append(button("Previous", step(-1)), button("Next", step(1)), play);
    this.asks.replaceChildren(h("legend", {}, "Ask"),
      h("p", { class: "tools" }, ...(this.live.configurations.some((c) => c.pairs.length) ? [button(`Lowest frequency of the test mode in ${where}`, ask(-1)), button(`Highest frequency of the test mode in ${where}`, ask(1)), ...(live.configurations.some((c) => c.sensor_labels.length > 1) ? [button(`Lowest MAC of the test mode in ${where}`, ask(-1, "mac"))] : [])] : []), ...(live.draws ? [show] : [])),
      this.models, this.told);
  }

  private takeExtreme(asked: Asked, test: number, sign: number, found: Extreme | null): void {
    const c = this.live.configurations[this.at], first = this.first[this.at], column = first?.pairs[test]?.column ?? -1;
    if (!found || !first || column < 0) { this.told.textContent = "The test mode has no partner."; return; }
    const where = this.live.region ? "the 95 % region of the update (linearised)" : this.reach;
    this.models.hidden = true;
    const mass = this.mass ? `, with ${this.massText()}` : "";
    if (asked === "mac") this.told.textContent = `Lowest MAC of test mode ${c.test_labels[test]} in ${where}${mass}: ${found.value.toFixed(3)}; updated ${first.pairs[test].whole?.toFixed(3) ?? "–"}. Found by steps from the update; the sliders stand at these values.`;
    else this.told.textContent = `${sign < 0 ? "Lowest" : "Highest"} frequency of test mode ${c.test_labels[test]} in ${where}${mass}: ${cycles(found.value)} Hz; updated${this.mass ? " without the mass" : ""} ${cycles(first.freq_hz[column])} Hz, test ${cycles(c.test_freq_hz[test])} Hz. Found by steps from the update; the sliders stand at these values.`;
    this.setAll((p, i) => p.nominal + p.scale * found.x[i]);
  }

  private takeLevel({ configuration, level, extreme, updated }: Answer & { kind: "level" }): void {
    if (configuration !== this.at) return;
    this.models.hidden = true;
    this.frfs.answer(level, extreme, updated, this.mass ? `, with ${this.massText()}` : "");
    if (extreme) this.setAll((p, i) => p.nominal + p.scale * extreme.x[i]);
  }

  private massText(): string { return `a mass of ${shown(this.mass)} ${this.live.mass_unit}`.trimEnd() + ` at ${this.live.configurations[this.at].mass_points[this.point]}`; }

  private takeAllowed(models: number[][], effective: number, weighed: boolean): void {
    const { source, reason, x } = this.live.draws!;
    if (source === "linear" && !weighed) {
      this.models.hidden = true;
      this.told.textContent = `Samples of the linearised distribution cannot be weighed by the true χ² here: ${reason}. [posterior] in the study samples the models that the data allow.`;
      return;
    }
    if (weighed && (effective < LEAST_EFFECTIVE || !models.length)) {
      this.models.hidden = true;
      this.told.textContent = `The linearised distribution is no source of such models here: the true χ² leaves ${shown(effective, 2)} of ${x.shape[0]} samples. [posterior] in the study samples them.`;
      return;
    }
    this.allowed = models;
    this.models.hidden = false;
    this.source = source === "posterior" ? "a sample of the posterior distribution"
      : `of the linearised distribution, weighted by the true χ² and within its 95 % limit (${shown(effective, 3)} of ${x.shape[0]} samples are effective)`;
    this.showModel(0);
  }

  private source = "";

  private showModel(k: number): void {
    const n = this.allowed.length;
    this.chosen = (k + n) % n;
    const rejected = this.live.rejected ? " The fit of the update was rejected: these models are as near to the data as the update is, and that is not as near as the stated errors allow." : "";
    this.told.textContent = `Model ${this.chosen + 1} of ${n}: ${this.source}.${rejected}`;
    this.setAll((p, i) => p.nominal + p.scale * this.allowed[this.chosen][i]);
  }

  private play(): void {
    this.models.querySelector(".play")!.textContent = "Pause";
    this.timer = window.setInterval(() => this.showModel(this.chosen + 1), 800);
  }

  private stop(): void {
    clearInterval(this.timer);
    this.timer = 0;
    const play = this.models.querySelector(".play");
    if (play) play.textContent = "Play";
  }

  private set(k: number, value: number): void {
    this.stop();
    this.values[k] = value;
    this.sliders[k].set(value);
    if (!this.touched) this.openWindow();
    this.ask();
  }

  private setAll(value: (p: LiveParameter, k: number) => number): void {
    this.live.parameters.forEach((p, k) => { this.values[k] = value(p, k); this.sliders[k].set(this.values[k]); });
    if (!this.touched) this.openWindow();
    this.ask();
  }

  private choose(): void {
    const c = this.live.configurations[this.at];
    if (!c.pairs.some(([test]) => test === this.test)) this.test = c.pairs[0]?.[0] ?? -1;
    if (this.touched) this.openWindow();
    this.mass = 0;
    this.fillMasses();
    this.fillSensors();
    this.frfs.open(this.at);
    this.dropped.open(this.live.configurations[this.at]);
    this.fill();
    this.ask();
  }

  /** The window with the moving shape opens when the reader changes something: until then the page has that of the update. */
  private openWindow(): void {
    this.touched = true;
    if (this.test < 0) return;
    const { configuration } = this.live.configurations[this.at], scene = this.view.scenes.findIndex((s) => s.configuration === configuration);
    document.dispatchEvent(new CustomEvent("femtune:live-window", { detail: { host: this.host, scene } }));
  }

  /** A point and a mass, where the live model can carry one. */
  private fillMasses(): void {
    const { mass_points: points, mass_reason: reason } = this.live.configurations[this.at], { masses, noMasses } = this, unit = this.live.mass_unit;
    masses.hidden = !points.length;
    noMasses.hidden = !reason;
    noMasses.textContent = `A mass at a sensor cannot be added: ${reason}.`;
    const which = choice("Point", points, (k) => { this.point = k; if (this.mass) this.ask(); });
    which.label.hidden = false;
    this.point = 0;
    const number = h("input", { type: "number", min: 0, step: "any", value: 0, change: () => { this.mass = Math.max(0, number.valueAsNumber || 0); number.value = String(this.mass); this.ask(); } });
    masses.replaceChildren(masses.firstElementChild!, h("p", { class: "note" }, "Frequencies, MAC, shapes and FRFs of this configuration are those with a point mass there. χ² would not be that of the test, and is not shown then."),
      h("div", { class: "controls" }, which.label, labelled(unit ? `Mass, ${unit}` : "Mass", number)));
  }

  /** A box for each sensor of the configuration. */
  private fillSensors(): void {
    const labels = this.live.configurations[this.at].sensor_labels, off = this.off[this.at], { sensors } = this;
    sensors.hidden = labels.length < 3;
    const boxes = labels.map((label, i) => h("label", {}, h("input", { type: "checkbox", checked: !off.has(i), change: (e: Event) => { (e.target as HTMLInputElement).checked ? off.delete(i) : off.add(i); this.ask(); } }), label));
    const all = h("button", { type: "button", click: () => { off.clear(); this.fillSensors(); this.ask(); } }, "All sensors");
    sensors.replaceChildren(sensors.firstElementChild!, h("p", { class: "note" }, "The MAC in the table is that of the sensors that are chosen. χ² and the criteria keep all of them."), h("div", { class: "boxes" }, ...boxes), h("p", { class: "tools" }, all));
  }

  private ask(): void {
    this.lines.value = studyLines(this.live.parameters, this.values);
    this.copied.textContent = "";
    // an input that waits is counted from when it was made
    this.input ??= performance.now();
    if (this.busy) { this.waiting = true; return; }
    this.busy = true;
    this.asked = this.input;
    this.input = null;
    this.id++;
    this.solve([this.at], true);
  }

  /** Ask the worker; what is shown comes first, other configurations when nothing newer waits. */
  private solve(configurations: number[], shown: boolean): void {
    this.worker.postMessage({
      kind: "solve", id: this.id, x: this.x, configurations, shape: !shown || this.test < 0 ? null : { configuration: this.at, test: this.test }, off: this.off.map((s) => Array.from(s)),
      added: this.added && { configuration: this.at, mass: this.added }, functions: shown ? this.frfs.chosen && { configuration: this.at, chosen: this.frfs.chosen } : null,
    });
  }

  private take(answer: Answer): void {
    if (answer.kind === "ready") {
      if (!answer.verified) { this.failed("the numbers at the check points are not those that femtune found"); return; }
      this.build();
      return;
    }
    if (answer.kind === "extreme") { this.takeExtreme(answer.asked, answer.test, answer.sign, answer.extreme); return; }
    if (answer.kind === "level") { this.takeLevel(answer); return; }
    if (answer.kind === "allowed") { this.takeAllowed(answer.allowed.models, answer.allowed.effective, answer.allowed.weighed); return; }
    this.solved[answer.configuration] = answer.solved;
    if (!this.mass) this.first[answer.configuration] ??= answer.solved;
    if (answer.configuration === this.at) { this.fill(); this.say(); }
    if (answer.functions && answer.configuration === this.at) this.frfs.take(answer.functions);
    if (answer.dropped && answer.solved && answer.configuration === this.at) this.dropped.show(answer.dropped, answer.solved.freq_hz);
    if (answer.shape) this.shape = answer.shape;
    if (!answer.last) return;
    const { asked } = this, rest = this.live.configurations.map((_, k) => k).filter((k) => k !== this.at), shown = !this.resting;
    if (shown) requestAnimationFrame(() => { this.element.dataset.ms = (performance.now() - asked).toFixed(1); });
    if (shown && rest.length && !this.waiting) { this.resting = true; this.solve(rest, false); return; }
    this.resting = this.busy = false;
    if (this.waiting) { this.waiting = false; this.drawLater(asked, null); this.ask(); return; }
    this.fillParts();
    this.drawLater(asked, answer.id);
  }

  /** Draw the shape in the frame after that of the numbers: a computer without a graphics card takes long to draw it. */
  private drawLater(asked: number, id: number | null): void {
    requestAnimationFrame(() => setTimeout(() => {
      const { shape } = this;
      this.shape = null;
      if (shape && this.solved[shape.configuration]) this.draw(shape);
      requestAnimationFrame(() => {
        if (shape) this.element.dataset.shapeMs = (performance.now() - asked).toFixed(1);
        if (id !== null) this.element.dataset.solved = String(id);
      });
    }));
  }

  /** Where the values are, and what holds there. */
  private say(): void {
    const { region } = this.live, c = this.live.configurations[this.at];
    if (!this.solved[this.at]) {
      this.where.textContent = "The model has no modes at these values.";
      this.certificate.textContent = "";
      return;
    }
    const same = this.live.parameters.every((p, i) => p.updated === this.values[i]);
    const inside = region ? inRegion(region, this.x) : null;
    this.element.classList.toggle("outside", inside !== null && inside > 1);
    this.where.textContent = same ? "These are the updated values." : inside === null ? `Within ${this.reach}. The update gives no distribution of the parameters.`
      : inside <= 1 ? "Within the 95 % region of the update (linearised)."
      : `Outside the 95 % region of the update (linearised), ${inside < 1.21 ? "just beyond its edge" : `${shown(Math.sqrt(inside), 2)} times as far as its edge`}.`;
    if (this.mass) { const text = this.massText(); this.where.textContent += ` ${text[0].toUpperCase()}${text.slice(1).replace(" at ", " is added at ")}.`; }
    const useRegion = c.region.length && ((inside !== null && inside <= 1) || same);
    this.certificate.textContent = useRegion ? certificateText(c.region, "of the 95 % region") : certificateText(c.bounds, `within ${this.reach}`);
    if (this.mass && this.certificate.textContent) this.certificate.textContent += " These differences are those without the mass.";
  }

  private fill(): void {
    const c = this.live.configurations[this.at], now = this.solved[this.at], first = this.first[this.at];
    this.modes.parentElement?.classList.toggle("alone", !c.test_labels.length);
    if (!c.test_labels.length) { this.fillModel(now, first); return; }
    this.modes.replaceChildren(...c.test_labels.map((label, test) => {
      const pair = now?.pairs[test], before = first?.pairs[test], hz = pair && pair.column >= 0 ? now!.freq_hz[pair.column] : null;
      const error = hz === null || !c.test_freq_hz[test] ? null : 100 * (hz / c.test_freq_hz[test] - 1);
      const better = pair && pair.mac !== null && hz !== null ? this.better(now!, test, pair.column, pair.mac) : null;
      const cell = (text: string) => h("td", { class: "right" }, text);
      const head = hz !== null && this.view.scenes.some((s) => s.configuration === c.configuration && s.live)
        ? h("button", { type: "button", class: "show", "aria-pressed": String(test === this.test), "aria-label": `Show the shape of test mode ${label}`, click: () => { this.test = test; this.openWindow(); this.ask(); } }, label) : label;
      return h("tr", { class: test === this.test ? "chosen" : "" }, h("th", { scope: "row" }, head), cell(cycles(c.test_freq_hz[test])),
        cell(before && before.column >= 0 ? cycles(first!.freq_hz[before.column]) : "–"), cell(hz === null ? "–" : cycles(hz)), cell(error === null ? "–" : signed(error)),
        h("td", { class: "right" }, pair?.mac == null ? "–" : pair.mac.toFixed(3), better === null ? null : h("small", {}, ` mode ${better + 1} is more alike`)));
    }));
    this.fillCriteria();
  }

  /** Frequencies of the model where the test has FRFs alone. */
  private fillModel(now: Solved | null, first: Solved | null): void {
    const cell = (text: string) => h("td", { class: "right" }, text);
    this.modes.replaceChildren(...Array.from(first?.freq_hz ?? [], (hz, j) => h("tr", {}, h("th", { scope: "row" }, `model mode ${j + 1}`), cell("–"), cell(cycles(hz)), cell(now && j < now.freq_hz.length ? cycles(now.freq_hz[j]) : "–"), cell("–"), cell("–"))));
    this.fillCriteria();
  }

  private fillMass(): void {
    const { mass } = this.live.configurations[this.at], now = this.solved[this.at]?.totalMass, of = (value: number | undefined) => `${shown(value, 5)} ${this.live.mass_unit}`.trimEnd();
    this.totalMass.hidden = !mass;
    if (!mass) return;
    const weighed = mass.weighed.map(([m, sd]) => `; weighed ${of(m)}, ${signed((100 * ((now ?? NaN) - m)) / m)} % (standard deviation ${shown((100 * sd) / m, 3)} %)`);
    this.totalMass.textContent = `Mass of the model: now ${of(now)}, updated ${of(mass.updated)}${weighed.join("")}.`;
  }

  private fillCriteria(): void {
    this.fillMass();
    const c = this.live.configurations[this.at], rows = criterionRows(c, this.first[this.at], this.mass ? null : this.solved[this.at]);
    const kept = rows.filter((r) => !r.live).length;
    this.criteriaTable.hidden = kept === rows.length;
    const others = kept === 0 ? "" : kept === 1 ? "One other criterion, " : `${kept} other criteria, `;
    this.keptNote.textContent = `${others}${others ? "the" : "The"} score and neighbour tests of the judge and the verdict of the report keep the values of the update.`;
    this.criteria.replaceChildren(...rows.filter((r) => r.live).map((r) => h("tr", {}, h("th", { scope: "row" }, r.name),
      ...[r.limit, r.updated, r.now].map((t) => h("td", { class: "right" }, t)), h("td", { class: `verdict-${r.verdict}` }, r.verdict))));
  }

  /** A mode without a partner that is more like the test's than its partner. */
  private better(now: Solved, test: number, column: number, mac: number): number | null {
    const n = now.freq_hz.length, taken = new Set(now.pairs.map((p) => p.column));
    let best = column, most = mac + 0.1;
    for (let j = 0; j < n; j++) if (!taken.has(j) && now.mac[test * n + j] > most) { best = j; most = now.mac[test * n + j]; }
    return best === column ? null : best;
  }

  private fillParts(): void {
    const whole = (list: (Solved | null)[]) => (list.every((s) => s !== null) ? partsOf(list as Solved[]) : null);
    const now = this.mass ? null : whole(this.solved), first = whole(this.first);
    const kinds = Object.keys(first ?? {}), total = (of: Record<string, number> | null) => of && kinds.reduce((sum, k) => sum + of[k], 0) + this.live.others.reduce((sum, o) => sum + o.chi_square, 0);
    const line = (name: string, a: number | null | undefined, b: number | null | undefined, muted = false) =>
      h("tr", { class: muted ? "muted" : "" }, h("th", { scope: "row" }, name), h("td", { class: "right" }, square(a)), h("td", { class: "right" }, square(b)));
    this.truth.textContent = first && now ? truthText(this.live, first, now) : "";
    this.truth.classList.toggle("poor", this.truth.textContent.endsWith("against these values."));
    this.parts.replaceChildren(...kinds.map((k) => line(k, first?.[k], now?.[k])),
      ...this.live.others.map((o) => line(`${o.kind} (not computed again)`, o.chi_square, this.mass ? null : o.chi_square, true)), line("total", total(first), total(now)));
  }

  private draw(shape: LiveShape): void {
    const c = this.live.configurations[shape.configuration], now = this.solved[shape.configuration]!;
    const list = (texts: (string | number)[]) => texts.join(" and "), several = shape.columns.length > 1;
    const which = several ? `the combination of model modes ${list(shape.columns.map((k) => k + 1))}, close at the update, that is nearest to it` : `model mode ${shape.columns[0] + 1} with these values`;
    const title = `Test mode ${c.test_labels[shape.test]}, ${cycles(c.test_freq_hz[shape.test])} Hz, and ${which}, ${list(shape.columns.map((k) => hertz(now.freq_hz[k])))}`;
    document.dispatchEvent(new CustomEvent("femtune:live-shape", { detail: { motion: shape.motion, factor: shape.factor, test: c.test_labels[shape.test], title } }));
  }

  private async copy(): Promise<void> {
    try {
      await navigator.clipboard.writeText(this.lines.value);
      this.copied.textContent = "Copied.";
    } catch {
      this.lines.focus();
      this.lines.select();
      this.copied.textContent = "This browser lets no page write to the clipboard: the lines are selected.";
    }
  }
}

function mark(kind: string): SVGElement {
  return svg("svg", { class: "marks key", width: 14, height: 12, "aria-hidden": "true" }, kind === "interval"
    ? svg("rect", { class: kind, x: 0, y: 3, width: 14, height: 5 }) : svg("rect", { class: kind, x: 6, y: 0, width: 2.5, height: kind === "updated" ? 12 : 8 }));
}

function install(): void {
  const view = readView(), section = document.getElementById("live");
  if (!view?.live || !section) return;
  const place = section.querySelector(".scroll") ?? section.children[1];
  const failed = (why: string) => panel?.element.replaceWith(h("p", { class: "alert warning" }, `The live model is not shown: ${why}. The still pictures and tables of this report do not depend on it.`));
  let panel: LivePanel | null = null;
  try {
    panel = new LivePanel(view, failed);
    panel.element.classList.add("live");
    section.insertBefore(panel.element, place);
  } catch {
    section.insertBefore(h("p", { class: "alert warning" }, "The live model is not shown: this browser starts no worker. The still pictures and tables of this report do not depend on it."), place);
  }
}

install();
