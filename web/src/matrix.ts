// The MAC matrix as a grid of buttons: one stop of the tab key, arrow keys inside.

import { h } from "./dom.ts";

export interface MatrixCell { row: number; column: number; value: number; pair: boolean; label: string; disabled: boolean; look?: string; sign?: string }

const BLUES = [[247, 250, 253], [195, 216, 234], [117, 165, 207], [45, 108, 166], [14, 58, 102]];

/** Colour of a value from 0 to 1, and of legible text on it. */
export function shade(value: number): [string, string] {
  const at = Math.min(1, Math.max(0, value)) * (BLUES.length - 1), k = Math.min(Math.floor(at), BLUES.length - 2);
  const rgb = BLUES[k].map((a, i) => Math.round(a + (at - k) * (BLUES[k + 1][i] - a)));
  return [`rgb(${rgb.join(",")})`, at > 2.2 ? "#fff" : "#1d2733"];
}

export class MatrixGrid {
  readonly element: HTMLTableElement;
  private readonly buttons: HTMLButtonElement[][] = [];

  constructor(title: string, rows: string[], columns: string[], cells: MatrixCell[][], chosen: (cell: MatrixCell) => void) {
    const head = h("tr", {}, h("td"), ...columns.map((text) => h("th", { scope: "col" }, text)));
    const body = cells.map((line, i) => {
      const made = line.map((cell, k) => this.button(cell, i, k, chosen));
      this.buttons.push(made);
      return h("tr", {}, h("th", { scope: "row" }, rows[i]), ...made.map((b) => h("td", {}, b)));
    });
    this.element = h("table", { class: "mac" }, h("caption", {}, title), h("thead", {}, head), h("tbody", {}, ...body));
    this.element.addEventListener("keydown", (e) => this.key(e));
  }

  private button(cell: MatrixCell, i: number, k: number, chosen: (cell: MatrixCell) => void): HTMLButtonElement {
    const known = cell.value >= 0;
    const text = (cell.sign ?? "") + (known && cell.value >= 0.095 ? cell.value.toFixed(2) : "");
    const button = h("button", {
      type: "button", tabindex: i + k === 0 ? 0 : -1, "aria-label": cell.label, title: cell.label, "aria-pressed": "false",
      class: cell.look ?? (cell.pair ? "pair" : ""), disabled: cell.disabled, click: () => chosen(cell),
    }, text);
    const [ground, ink] = shade(known ? cell.value : 0);
    button.style.backgroundColor = ground;
    button.style.color = ink;
    return button;
  }

  /** Mark a cell as the one that is shown. */
  mark(i: number, k: number): void {
    for (const line of this.buttons) for (const b of line) { b.setAttribute("aria-pressed", "false"); b.tabIndex = -1; }
    const found = this.buttons[i]?.[k];
    if (!found) return;
    found.setAttribute("aria-pressed", "true");
    found.tabIndex = 0;
  }

  /** Take the focus to a cell. */
  focus(i: number, k: number): void {
    for (const line of this.buttons) for (const b of line) b.tabIndex = -1;
    const found = this.buttons[i]?.[k];
    if (!found) return;
    found.tabIndex = 0;
    found.focus();
  }

  private key(e: KeyboardEvent): void {
    const step = ({ ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] } as Record<string, number[]>)[e.key];
    if (!step) return;
    const i = this.buttons.findIndex((line) => line.includes(e.target as HTMLButtonElement));
    if (i < 0) return;
    const k = this.buttons[i].indexOf(e.target as HTMLButtonElement);
    const next = this.buttons[i + step[0]]?.[k + step[1]];
    e.preventDefault();
    if (!next) return;
    (e.target as HTMLElement).tabIndex = -1;
    next.tabIndex = 0;
    next.focus();
  }
}
