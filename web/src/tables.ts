// Tables that sort, and that can be saved as CSV or XLSX.

import { fileName, h, save } from "./dom.ts";
import { xlsx, XLSX_TYPE } from "./xlsx.ts";

/** The number that a cell begins with; null for a text. */
export function numberOf(text: string): number | null {
  const plain = text.trim().replace(/[−–](?=\d)/g, "-").replace(/[\u2009\u202f\u00a0]/g, "").replace(/^[≤≥±<>~]\s*/, "");
  const found = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?(?![\w.])/i.exec(plain);
  return found ? Number(found[0]) : null;
}

/** Numbers in their order, before texts in theirs; cells without content last, whatever the direction. */
export function compare(a: string, b: string, falling: boolean): number {
  const empty = (t: string) => /^[—–-]?$/.test(t.trim());
  if (empty(a) || empty(b)) return Number(empty(a)) - Number(empty(b));
  const x = numberOf(a), y = numberOf(b);
  if ((x === null) !== (y === null)) return x === null ? 1 : -1;
  const order = x !== null && y !== null ? x - y : a.localeCompare(b, undefined, { numeric: true });
  return falling ? -order : order;
}

/** Rows as CSV (RFC 4180). Numbers are written plainly; a text that a spreadsheet would run as a formula is quoted. */
export function csv(rows: string[][]): string {
  return rows.map((cells) => cells.map(field).join(",")).join("\r\n") + "\r\n";
}

function field(text: string): string {
  const value = numberOf(text);
  let plain = text.trim();
  if (value !== null) plain = plain.replace(/[−](?=\d)/g, "-");
  else if (/^[=+\-@\t]/.test(plain)) plain = `'${plain}`;
  return /[",\r\n]/.test(plain) ? `"${plain.replace(/"/g, '""')}"` : plain;
}

const textOf = (cell: Element) => (cell.textContent ?? "").replace(/\s+/g, " ").trim();

/** Heads, with the name of their group before them, and all rows as they are sorted now. */
export function contents(table: HTMLTableElement): string[][] {
  const rows = Array.from(table.tHead?.rows ?? []);
  const groups = rows.length > 1 ? Array.from(rows[0].cells).flatMap((c) => Array<string>(c.colSpan).fill(textOf(c))) : [];
  const heads = Array.from(rows[rows.length - 1]?.cells ?? []).map((c, k) => [groups[k], textOf(c)].filter(Boolean).join(" "));
  return [heads, ...Array.from(table.tBodies[0]?.rows ?? []).map((row) => Array.from(row.cells).map(textOf))];
}

/** Sort by a column; the same column again turns the order round. */
export function sort(table: HTMLTableElement, head: HTMLTableCellElement, k: number): void {
  const falling = head.getAttribute("aria-sort") === "ascending";
  for (const other of head.parentElement!.children) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", falling ? "descending" : "ascending");
  const body = table.tBodies[0];
  const rows = Array.from(body.rows);
  rows.sort((a, b) => compare(textOf(a.cells[k]), textOf(b.cells[k]), falling));
  body.append(...rows);
}

/** Buttons in the heads of a table and below it. */
export function enhance(table: HTMLTableElement): void {
  const heads = table.tHead?.rows[table.tHead.rows.length - 1];
  if (!heads || !table.tBodies[0]) return;
  Array.from(heads.cells).forEach((head, k) => {
    if (!textOf(head) || table.tBodies[0].rows.length < 2) return;
    const button = h("button", { type: "button", class: "sort", title: "Sort", click: () => sort(table, head, k) });
    button.append(...head.childNodes);
    head.append(button);
  });
  const region = table.closest(".scroll");
  const title = region?.getAttribute("aria-label") ?? "table";
  const section = table.closest("section")?.id ?? "";
  const button = (ending: string, content: () => Blob) =>
    h("button", { type: "button", click: () => save(fileName(`${section} ${title}`, ending), content()), "aria-label": `Save table as ${ending.toUpperCase()}: ${title}` }, ending.toUpperCase());
  region?.after(h("p", { class: "tools" },
    button("csv", () => new Blob(["\ufeff", csv(contents(table))], { type: "text/csv" })), " ",
    button("xlsx", () => new Blob([xlsx(contents(table))], { type: XLSX_TYPE }))));
}
