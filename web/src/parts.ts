// A picture of the structure at rest, whose parts are chosen by a click: drawn without WebGL.

import { unpack, unpackRows, type SceneData } from "./data.ts";
import { choice, h } from "./dom.ts";
import { box } from "./motion.ts";
import { control, homeOf, Orbit } from "./orbit.ts";

/** Pixels within which a click finds a line. */
const NEAR = 10;
/** Pixels below which a drag is a click. */
const STILL = 6;

/** A face or line as corners on the screen. */
export interface Shape { corners: [number, number][]; part: number; depth: number }

/** Whether a point is inside a polygon. */
export function inside([x, y]: [number, number], corners: [number, number][]): boolean {
  let odd = false;
  for (let i = 0, j = corners.length - 1; i < corners.length; j = i++) {
    const [[ax, ay], [bx, by]] = [corners[i], corners[j]];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) odd = !odd;
  }
  return odd;
}

/** Distance from a point to a piece of a line. */
export function distance([x, y]: [number, number], [[ax, ay], [bx, by]]: [number, number][]): number {
  const dx = bx - ax, dy = by - ay, size = dx * dx + dy * dy;
  const t = size > 0 ? Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / size)) : 0;
  return Math.hypot(x - ax - t * dx, y - ay - t * dy);
}

/** The part under a point: of the nearest line that is close, else of the face in front; −1 for none. `shapes` are in the order of drawing. */
export function hit(at: [number, number], shapes: Shape[]): number {
  let best = -1, least = NEAR;
  for (const { corners, part } of shapes) {
    if (corners.length !== 2) continue;
    const away = distance(at, corners);
    if (away < least) [best, least] = [part, away];
  }
  for (let i = shapes.length - 1; best < 0 && i >= 0; i--) if (shapes[i].corners.length > 2 && inside(at, shapes[i].corners)) best = shapes[i].part;
  return best;
}

/** What the fields of a part are of: "PBAR 1, MAT1 1". */
export function partName(fields: string[]): string {
  const cards = fields.map((field) => field.split(" ").slice(0, 2).join(" "));
  // what one part has alone comes first
  return Array.from(new Set(cards)).sort((a, b) => Number(a.startsWith("MAT")) - Number(b.startsWith("MAT"))).join(", ");
}

export class PartsPicture {
  readonly element: HTMLElement;
  private readonly canvas = h("canvas", { tabindex: 0, role: "img", "aria-label": "Parts of the structure" });
  private readonly told = h("p", { class: "note" });
  private readonly select;
  private readonly points: Float32Array;
  private readonly pieces: { rows: number[]; part: number }[] = [];
  private readonly orbit: Orbit;
  private readonly parts: number[];
  private readonly dark = matchMedia("(prefers-color-scheme: dark)");
  private shapes: Shape[] = [];
  private over = -1;
  part = -1;

  /** `chosen` says whether some field of a part is a parameter; `picked` follows each choice of a part. */
  constructor(scene: SceneData, private readonly chosen: (part: number) => boolean, private readonly picked: (part: number) => void) {
    this.points = unpack(scene.points);
    const [lines, faces] = [unpackRows(scene.lines), unpackRows(scene.faces)], [ofLines, ofFaces] = [unpackRows(scene.line_parts!), unpackRows(scene.face_parts!)];
    ofLines.forEach((part, i) => this.pieces.push({ rows: Array.from(lines.subarray(2 * i, 2 * i + 2)), part }));
    ofFaces.forEach((part, i) => this.pieces.push({ rows: Array.from(new Set(faces.subarray(4 * i, 4 * i + 4))), part }));
    const used = new Set(this.pieces.map((p) => p.part));
    this.parts = scene.part_fields.map((_, k) => k).filter((k) => scene.part_fields[k].length && used.has(k));
    this.select = choice("Part", ["none", ...this.parts.map((k) => partName(scene.part_fields[k]))], (k) => this.take(k ? this.parts[k - 1] : -1));
    this.select.label.hidden = false;
    this.orbit = new Orbit(homeOf(box(this.points).map(([low, high]) => 0.5 * (high - low))));
    const look = (name: string, azimuth: number, elevation: number) =>
      h("button", { type: "button", "aria-label": `Parts: view along ${name}`, click: () => { this.orbit.look(azimuth, elevation); this.draw(); } }, name);
    this.element = h("div", { class: "parts" }, h("div", { class: "controls" }, this.select.label,
      h("span", { class: "views", role: "group", "aria-label": "View of the parts" }, look("x", 0, 0), look("y", -Math.PI / 2, 0), look("z", -Math.PI / 2, Math.PI / 2),
        h("button", { type: "button", "aria-label": "Parts: reset the view", click: () => { this.orbit.reset(); this.draw(); } }, "reset"))),
      h("div", { class: "stage" }, this.canvas), this.told);
    control(this.canvas, () => this.orbit, () => this.draw());
    this.pointer();
    this.dark.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  /** Draw again, after a change of the parameters. */
  draw(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas, on = this.canvas.getContext("2d");
    if (!width || !height || !on) return;
    const ratio = Math.min(devicePixelRatio, 2);
    [this.canvas.width, this.canvas.height] = [Math.round(ratio * width), Math.round(ratio * height)];
    on.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.shapes = this.projected(width, height);
    const style = getComputedStyle(this.canvas), colour = (name: string) => style.getPropertyValue(name).trim();
    const [plain, edge, mark, orange] = [colour("--track"), colour("--soft"), colour("--blue"), colour("--orange")];
    on.lineJoin = on.lineCap = "round";
    for (const { corners, part } of this.shapes) {
      const is = part === this.part || part === this.over, tint = this.chosen(part) ? orange : is ? mark : "";
      on.beginPath();
      corners.forEach(([x, y], i) => (i ? on.lineTo(x, y) : on.moveTo(x, y)));
      if (corners.length > 2) {
        on.closePath();
        on.fillStyle = plain;
        on.fill();
        if (tint) { on.globalAlpha = is ? 0.85 : 0.6; on.fillStyle = tint; on.fill(); on.globalAlpha = 1; }
        on.strokeStyle = part === this.part ? mark : edge;
        on.lineWidth = part === this.part ? 1.6 : 0.5;
        on.stroke();
        continue;
      }
      if (is) { on.strokeStyle = mark; on.lineWidth = 8; on.globalAlpha = 0.45; on.stroke(); on.globalAlpha = 1; }
      on.strokeStyle = this.chosen(part) ? orange : edge;
      on.lineWidth = 3;
      on.stroke();
    }
    this.canvas.dataset.part = String(this.part);
  }

  /** Faces and lines on the screen, far ones first; the structure fills the picture. */
  private projected(width: number, height: number): Shape[] {
    const axes = this.orbit.axes(), n = this.points.length / 3;
    const at = axes.map((axis) => Float32Array.from({ length: n }, (_, i) => axis[0] * this.points[3 * i] + axis[1] * this.points[3 * i + 1] + axis[2] * this.points[3 * i + 2]));
    const ends = at.map((values) => [Math.min(...chunks(values, Math.min)), Math.max(...chunks(values, Math.max))]);
    const [[left, right], [down, up]] = ends, scale = 0.9 * Math.min(width / (right - left || 1e-9), height / (up - down || 1e-9), 1e9) * this.orbit.zoom;
    const x = (i: number) => width / 2 + scale * (at[0][i] - 0.5 * (left + right)) + 0.5 * this.orbit.pan[0] * height / 2;
    const y = (i: number) => height / 2 - scale * (at[1][i] - 0.5 * (down + up)) - 0.5 * this.orbit.pan[1] * height / 2;
    return this.pieces.map(({ rows, part }): Shape => ({
      corners: rows.map((i) => [x(i), y(i)]), part, depth: rows.reduce((sum, i) => sum + at[2][i], 0) / rows.length,
    })).sort((a, b) => a.depth - b.depth);
  }

  /** The part of the picture or of the list. */
  take(part: number): void {
    this.part = part;
    this.select.select.selectedIndex = 1 + this.parts.indexOf(part);
    this.draw();
    this.picked(part);
  }

  private pointer(): void {
    const at = (e: PointerEvent): [number, number] => { const frame = this.canvas.getBoundingClientRect(); return [e.clientX - frame.left, e.clientY - frame.top]; };
    let from: [number, number] | null = null;
    this.canvas.addEventListener("pointerdown", (e) => { from = at(e); });
    this.canvas.addEventListener("pointerup", (e) => {
      const begin = from, end = at(e);
      from = null;
      if (!begin || Math.hypot(end[0] - begin[0], end[1] - begin[1]) > STILL) return;
      const found = hit(end, this.shapes);
      if (this.parts.includes(found)) this.take(found);
      else if (found >= 0) this.told.textContent = "No field of this part can become a parameter here.";
    });
    this.canvas.addEventListener("pointermove", (e) => {
      if (e.buttons) return;
      const found = hit(at(e), this.shapes), over = this.parts.includes(found) ? found : -1;
      if (over === this.over) return;
      this.over = over;
      this.told.textContent = over < 0 ? "" : this.select.select.options[1 + this.parts.indexOf(over)].text;
      this.draw();
    });
    this.canvas.addEventListener("pointerleave", () => { if (this.over >= 0) { this.over = -1; this.told.textContent = ""; this.draw(); } });
  }
}

/** Smallest or largest value by pieces: a call has a limit of arguments. */
function chunks(values: Float32Array, of: (...v: number[]) => number): number[] {
  const out = [];
  for (let i = 0; i < values.length; i += 5000) out.push(of(...values.subarray(i, i + 5000)));
  return out;
}
