// The live FRFs: one function at the update and now, beside that of the test.

import type { Live, LiveFunctions } from "./data.ts";
import { unpack } from "./data.ts";
import { choice, h } from "./dom.ts";
import { FunctionPlot, type Line } from "./functions.ts";
import type { Chosen } from "./livemodel.ts";
import { doubtOfLevel, levelRatio, type DroppedCurve } from "./livetest.ts";
import { size } from "./livetext.ts";
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
  private at = 0;
  /** The function that is shown; null without any. */
  chosen: Chosen | null = null;

  constructor(private readonly live: Live, private readonly reach: string, private readonly ask: () => void, private readonly doubted: (doubt: string) => void) {}

  /** Show those of a configuration. */
  open(configuration: number): void {
    this.at = configuration;
    const c = this.live.configurations[configuration];
    this.curves = this.plot = this.chosen = null;
    this.element.hidden = !c.functions.length && !c.functions_reason;
    const reason = c.functions_reason ? [h("p", { class: "note" }, `${c.functions.length ? "Some" : "The"} measured FRFs are not computed again: ${c.functions_reason}.`)] : [];
    if (!c.functions.length) { this.element.replaceChildren(...reason); return; }
    const place = h("div"), which = choice("Functions", c.functions.map((f, i) => `${f.label || "not compared"} ${i + 1}`), (k) => this.show(place, k));
    this.element.replaceChildren(h("h3", {}, "FRFs now"), ...(c.functions.length > 1 ? [h("div", { class: "controls" }, which.label)] : []), place, this.doubt, ...reason);
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
    const data = this.live.configurations[this.at].functions[this.chosen.set], own = this.dropped?.(data, this.chosen.k), text = own && curves.now ? doubtOfLevel(levelRatio(own, unpack(data.freq_hz), curves.now.real, curves.now.imaginary)) : "";
    if (this.doubt.textContent === text) return;
    this.doubt.textContent = text;
    this.doubted(text);
  }

  /** Draw the functions of a dropped test too, or no more. */
  drop(found: ((set: LiveFunctions, k: number) => DroppedCurve | null) | null): void {
    this.dropped = found;
    if (this.chosen) this.plot?.reopen();
  }
}
