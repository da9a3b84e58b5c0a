// The update step by step: parameters, frequencies and MAC at the iteration that a slider chooses.

import { unpack, type History, type IterationFunctions } from "./data.ts";
import { cycles, h, labelled, shown } from "./dom.ts";
import { FunctionPlot, linesOf, type Line, type Source } from "./functions.ts";
import { enhance } from "./tables.ts";

/** Curves of the test, of the model at first, and of the model at the iteration `now()`, which comes last. */
export function curvesAt(data: IterationFunctions, now: () => number): Source {
  const [freq, real, imaginary, testReal, testImaginary] = [data.freq_hz, data.real, data.imaginary, data.test_real, data.test_imaginary].map(unpack);
  const count = data.real.shape[1], n = freq.length;
  const model = (look: string, k: number, at: number): Line => {
    const from = (k * count + at) * n;
    return { look, phase: data.phase, freq, real: real.subarray(from, from + n), imaginary: imaginary.subarray(from, from + n) };
  };
  const lines = (k: number) => [
    ...linesOf(data.beside, k),
    { look: data.test_look, phase: data.phase, freq, real: testReal.subarray(k * n, (k + 1) * n), imaginary: testImaginary.subarray(k * n, (k + 1) * n) },
    model("before", k, 0), model("model", k, now()),
  ];
  return { configuration: data.configuration, ordinate: data.ordinate, titles: data.titles, note: data.note, phase: data.phase, lines };
}

export class Iterations {
  readonly element: HTMLElement;
  private readonly slider: HTMLInputElement;
  private readonly said = h("p", { class: "shown", "aria-live": "polite" });
  private readonly values: HTMLTableCellElement[][] = [];
  private readonly modes: HTMLTableCellElement[][] = [];
  private readonly plots: FunctionPlot[];

  constructor(private readonly data: History) {
    const last = data.iterations.length - 1;
    this.slider = h("input", { type: "range", min: 0, max: last, step: 1, value: last, input: () => this.show(Number(this.slider.value)) });
    const tables = [
      this.table("Parameters", ["Parameter", "Unit", "Initial", "Value", "Change %"], data.parameters.map((name, i) => [name, data.units[i] || "–", shown(data.nominal[i])]), this.values, 2),
      this.table("Modes", ["Test mode", "Test Hz", "Model Hz", "Error %", "MAC"], data.modes.map((m) => [`${m.configuration} ${m.test_label}`, cycles(m.test_freq_hz)]), this.modes, 3),
    ];
    this.element = h("div", { class: "iterations" }, labelled("Iteration", this.slider), this.said, h("div", { class: "row" }, ...tables.filter((t) => t !== null)));
    const several = data.functions.length > 1;
    this.plots = data.functions.map((f) => new FunctionPlot(curvesAt(f, () => Number(this.slider.value))));
    this.element.append(...this.plots.flatMap((plot, i) => [h("h3", {}, `Compared FRFs at the iteration${several ? `: ${data.functions[i].configuration}` : ""}`), plot.element]));
    this.show(last);
  }

  /** Fixed cells, and cells that follow the slider; null without rows. */
  private table(title: string, heads: string[], rows: string[][], cells: HTMLTableCellElement[][], moving: number): HTMLElement | null {
    if (!rows.length) return null;
    const body = rows.map((row) => {
      const own = Array.from({ length: moving }, () => h("td", { class: "right" }));
      cells.push(own);
      return h("tr", {}, h("th", { scope: "row" }, row[0]), ...row.slice(1).map((t) => h("td", { class: "right" }, t)), ...own);
    });
    const table = h("table", {}, h("caption", {}, title), h("thead", {}, h("tr", {}, ...heads.map((t, k) => h("th", { scope: "col", class: k ? "right" : "left" }, t)))), h("tbody", {}, ...body));
    const whole = h("div", {}, h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `${title} at the iteration` }, table));
    enhance(table);
    return whole;
  }

  /** Take the values of the k-th record. */
  show(k: number): void {
    const { data } = this;
    this.said.textContent = `Iteration ${data.iterations[k]} of ${data.iterations[data.iterations.length - 1]}: weighted mean error ${shown(data.objective_percent[k], 3)} %`;
    this.slider.setAttribute("aria-valuetext", this.said.textContent);
    for (const plot of this.plots) plot.refresh();
    this.values.forEach(([value, change], i) => {
      value.textContent = shown(data.values[k][i], 5);
      change.textContent = data.nominal[i] ? signed(100 * (data.values[k][i] / data.nominal[i] - 1) * Math.sign(data.nominal[i])) : "–";
    });
    this.modes.forEach(([hz, error, mac], i) => {
      const mode = data.modes[i], freq = mode.freq_hz[k];
      hz.textContent = cycles(freq);
      error.textContent = freq === null ? "–" : signed(100 * (freq / mode.test_freq_hz - 1));
      mac.textContent = mode.mac[k] === null ? "–" : mode.mac[k]!.toFixed(3);
    });
  }
}

/** In %, to two decimals; what rounds to zero has no sign. */
function signed(value: number): string {
  const rounded = Number(value.toFixed(2));
  return (rounded > 0 ? "+" : "") + shown(rounded, 4);
}
