// The live FRFs: one function at the update and now, beside that of the test.

import type { Live, LiveFunctions } from "./data.ts";
import { unpack } from "./data.ts";
import { choice, cycles, h, labelled, shown } from "./dom.ts";
import { FunctionPlot, nearestLine, type Line } from "./functions.ts";
import type { Chosen } from "./livemodel.ts";
import { squaredDeviation } from "./livefrfcriteria.ts";
import type { AskedLevel, LevelExtreme } from "./liveregion.ts";
import { doubtOfLevel, levelRatio, type DroppedCurve } from "./livetest.ts";
import { size, written } from "./livetext.ts";
import type { LiveCurves } from "./liveworker.ts";

/** What was compared of the functions, and where. */
export function functionErrors(data: LiveFunctions, reach: string): string {
  const where: Record<string, string> = { region: "of the 95 % region", bounds: `within ${reach}` };
  const parts = data.errors.map(([at, points, percent, name]) => `${size(percent)} %${name ? ` (${name})` : ""} at ${points} points ${where[at]}`);
  return parts.length ? ` Largest difference of a function from that of the full model (root mean square over the lines): ${parts.join(", ")}.` : "";
}

export class LiveFrfs {
  readonly element = h("div", { class: "livefrfs" });
  private plot: FunctionPlot | null = null;
  private curves: LiveCurves | null = null;
  private dropped: ((set: LiveFunctions, k: number) => DroppedCurve | null) | null = null;
  private readonly doubt = h("p", { class: "note", role: "status" });
  private readonly deviation = h("p", { class: "note deviation" });
  private readonly questions = h("div", { class: "questions" });
  private readonly told = h("p", { class: "note told", "aria-live": "polite" });
  private readonly hz = h("input", { type: "number", step: "any", min: 0 });
  private at = 0;
  /** The function that is shown; null without any. */
  chosen: Chosen | null = null;

  constructor(private readonly live: Live, private readonly reach: string, private readonly ask: () => void, private readonly doubted: (doubt: string) => void, private readonly question: (level: AskedLevel) => void) {
    const button = (text: string, act: () => void) => h("button", { type: "button", click: act }, text), where = live.region ? "the 95 % region" : reach;
    const level = (sign: number) => () => this.askLevel(sign, true);
    this.questions.append(h("div", { class: "controls" }, labelled("Level at, Hz", this.hz)), h("p", { class: "tools" }, button(`Lowest level there in ${where}`, level(-1)), button(`Highest level there in ${where}`, level(1)),
      button(`Highest peak of the function in ${where}`, () => this.askLevel(1, false))), this.told);
  }

  /** Ask for the lowest or highest level in the region, at the frequency of the field or over all lines. */
  private askLevel(sign: number, there: boolean): void {
    if (!this.chosen) return;
    const freq = unpack(this.live.configurations[this.at].functions[this.chosen.set].freq_hz), hz = this.hz.valueAsNumber;
    if (there && !Number.isFinite(hz)) { this.told.textContent = "Enter a frequency, or click on the plot."; return; }
    const line = there ? nearestLine(freq, hz) : null;
    if (line !== null) this.hz.value = written(freq[line]);
    this.told.textContent = "…";
    this.question({ chosen: this.chosen, line, sign });
  }

  /** What was found in the region, in words. */
  answer({ chosen, line, sign }: AskedLevel, found: LevelExtreme | null, updated: number | null, mass: string): void {
    const data = this.live.configurations[this.at].functions[chosen.set], inputs = data.inputs.length, name = `${data.outputs[Math.floor(chosen.k / inputs)]} by ${data.inputs[chosen.k % inputs]}`;
    if (!found || !updated) { this.told.textContent = `${name} is zero.`; return; }
    const where = this.live.region ? "the 95 % region of the update (linearised)" : this.reach, db = 20 * Math.log10(found.value / updated), unit = /, (.*)$/.exec(data.ordinate)?.[1] ?? "";
    const what = line === null ? `Highest peak of ${name}` : `${sign < 0 ? "Lowest" : "Highest"} level of ${name} at ${cycles(found.hz)} Hz`;
    this.told.textContent = `${what} in ${where}${mass}: ${`${shown(found.value)} ${unit}`.trim()}${line === null ? ` at ${cycles(found.hz)} Hz` : ""}, ${db < 0 ? "−" : "+"}${Math.abs(db).toFixed(1)} dB from that of the update. `
      + `Found by steps from the update and from the best of ${found.tried} models, over the lines of the test${found.cut ? ", and stopped after 20 s" : ""}; the sliders stand at these values.`;
  }


  /** Show those of a configuration. */
  open(configuration: number): void {
    this.at = configuration;
    const c = this.live.configurations[configuration];
    this.curves = this.plot = this.chosen = null;
    this.element.hidden = !c.functions.length && !c.functions_reason;
    const reason = c.functions_reason ? [h("p", { class: "note" }, `${c.functions.length ? "Some" : "The"} measured FRFs are not computed again: ${c.functions_reason}.`)] : [];
    if (!c.functions.length) { this.element.replaceChildren(...reason); return; }
    const place = h("div"), which = choice("Functions", c.functions.map((f, i) => `${f.label || "not compared"} ${i + 1}`), (k) => this.show(place, k));
    this.element.replaceChildren(h("h3", {}, "FRFs now"), ...(c.functions.length > 1 ? [h("div", { class: "controls" }, which.label)] : []), place, this.deviation, this.questions, this.doubt, ...reason);
    this.told.textContent = this.deviation.textContent = "";
    this.show(place, 0);
  }

  private show(place: HTMLElement, set: number): void {
    const c = this.live.configurations[this.at], data = c.functions[set], freq = unpack(data.freq_hz), n = freq.length, real = unpack(data.test_real), imaginary = unpack(data.test_imaginary);
    this.curves = null;
    this.chosen = { set, k: 0 };
    const titles = data.outputs.flatMap((o) => data.inputs.map((i) => `${o} by ${i}`)), phase = data.form !== "log-magnitude" || !data.label;
    const line = (look: string, curve: { real: ArrayLike<number>; imaginary: ArrayLike<number> } | null): Line => ({
      look, phase, freq, real: curve ? Float32Array.from(curve.real) : new Float32Array(n), imaginary: curve ? Float32Array.from(curve.imaginary) : new Float32Array(n),
    });
    let opened = false;
    this.plot = new FunctionPlot({
      configuration: c.configuration, ordinate: data.ordinate, titles, phase, note: data.note + functionErrors(data, this.reach),
      placed: (hz) => { if (hz !== null) this.hz.value = written(hz); },
      lines: (k) => {
        if (this.chosen?.k !== k || this.chosen.set !== set) {
          this.chosen = { set, k };
          this.curves = null;
          if (opened) this.ask();
        }
        const known = this.curves, own = this.dropped?.(data, k);
        return [
          line(data.look, { real: real.subarray(k * n, (k + 1) * n), imaginary: imaginary.subarray(k * n, (k + 1) * n) }), line("after", known?.updated ?? null), line("live", known?.now ?? null),
          ...(own ? [{ look: "dropped", phase: true, freq: Float32Array.from(own.freq), real: Float32Array.from(own.real), imaginary: Float32Array.from(own.imaginary) }] : []),
        ];
      },
    });
    opened = true;
    place.replaceChildren(this.plot.element);
  }

  /** Take an answer of the worker. */
  take(curves: LiveCurves): void {
    if (!this.chosen || curves.chosen.set !== this.chosen.set || curves.chosen.k !== this.chosen.k) return;
    this.curves = curves;
    this.plot?.refresh();
    this.sayDeviation(curves);
    if (!this.hz.value && curves.updated) {
      // the highest line, until the reader chooses another one
      const { real, imaginary } = curves.updated, sizes = Array.from(real, (re, l) => Math.hypot(re, imaginary[l]));
      this.hz.value = written(unpack(this.live.configurations[this.at].functions[this.chosen.set].freq_hz)[sizes.indexOf(Math.max(...sizes))]);
    }
    const data = this.live.configurations[this.at].functions[this.chosen.set], own = this.dropped?.(data, this.chosen.k), text = own && curves.now ? doubtOfLevel(levelRatio(own, unpack(data.freq_hz), curves.now.real, curves.now.imaginary)) : "";
    if (this.doubt.textContent === text) return;
    this.doubt.textContent = text;
    this.doubted(text);
  }

  /** δ of the function that is shown, at the update and now. */
  private sayDeviation({ chosen: { set, k }, updated, now }: LiveCurves): void {
    const data = this.live.configurations[this.at].functions[set], n = unpack(data.freq_hz).length;
    const test = { real: unpack(data.test_real).subarray(k * n, (k + 1) * n), imaginary: unpack(data.test_imaginary).subarray(k * n, (k + 1) * n) };
    const [before, after] = [updated, now].map((c) => c && squaredDeviation(c, test));
    this.deviation.textContent = before === null && after === null ? "" : `Deviation δ of this function, mean over the lines of |lg(H/H_test)|²: updated ${shown(before, 3)}, now ${shown(after, 3)}.`;
  }

  /** Draw the functions of a dropped test too, or no more. */
  drop(found: ((set: LiveFunctions, k: number) => DroppedCurve | null) | null): void {
    this.dropped = found;
    if (this.chosen) this.plot?.reopen();
  }
}
