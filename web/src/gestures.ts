// Pointer and fingers on a plot over a range of frequencies: drag to zoom, two fingers to zoom and move, tap to choose.

import { svg } from "./dom.ts";

export interface Plot {
  drawing: SVGSVGElement;
  /** Size of the drawing, and the rectangle of the plot in it. */
  width: number; height: number; left: number; right: number; top: number; bottom: number;
  range(): [number, number];
  set(range: [number, number]): void;
  /** A click, at a point of the drawing. */
  tapped?(x: number, y: number): void;
  /** The pointer over the drawing, without a button; null when it leaves. */
  hovered?(at: [number, number] | null): void;
}

/** Pixels below which a drag is a click. */
const STILL = 6;

/** Frequencies (a, b) that were under two fingers at x = (p, q) are there again; `x` from 0 to 1 along the plot. */
export function pinched([a, b]: [number, number], [p, q]: [number, number]): [number, number] {
  const slope = Math.abs(q - p) < 0.02 ? NaN : (b - a) / (q - p);
  return [a - p * slope, a + (1 - p) * slope];
}

export function gestures(plot: Plot): void {
  const { drawing } = plot;
  const fingers = new Map<number, [number, number]>();
  let from: [number, number] | null = null, mark: SVGElement | null = null, held: [number, number] | null = null;
  const at = (e: PointerEvent): [number, number] => {
    const frame = drawing.getBoundingClientRect();
    return [((e.clientX - frame.left) * plot.width) / frame.width, ((e.clientY - frame.top) * plot.height) / frame.height];
  };
  const inside = (x: number) => Math.min(plot.right, Math.max(plot.left, x));
  const part = (x: number) => (x - plot.left) / (plot.right - plot.left);
  const hz = (x: number) => { const [low, high] = plot.range(); return low + part(x) * (high - low); };
  const drop = () => { mark?.remove(); mark = from = null; };
  drawing.addEventListener("pointerdown", (e) => {
    if (e.button > 0) return;
    const point = at(e);
    fingers.set(e.pointerId, point);
    drawing.setPointerCapture(e.pointerId);
    drop();
    if (fingers.size === 2) held = Array.from(fingers.values(), ([x]) => hz(x)) as [number, number];
    if (fingers.size > 1) return;
    from = [inside(point[0]), point[1]];
    mark = svg("rect", { y: plot.top, height: plot.bottom - plot.top, x: from[0], width: 0, fill: "#1f5a92", opacity: 0.15 });
    drawing.append(mark);
  });
  drawing.addEventListener("pointermove", (e) => {
    if (!fingers.has(e.pointerId)) { plot.hovered?.(at(e)); return; }
    const point = at(e);
    fingers.set(e.pointerId, point);
    if (held && fingers.size === 2) {
      const range = pinched(held, Array.from(fingers.values(), ([x]) => part(x)) as [number, number]);
      if (range.every(Number.isFinite) && range[1] > range[0]) plot.set(range);
    } else if (from && mark) {
      mark.setAttribute("x", String(Math.min(from[0], inside(point[0]))));
      mark.setAttribute("width", String(Math.abs(inside(point[0]) - from[0])));
    }
  });
  const up = (e: PointerEvent) => {
    fingers.delete(e.pointerId);
    if (held) { if (!fingers.size) held = null; return; }
    if (!from) return;
    const begin = from, end = at(e);
    drop();
    const to = inside(end[0]);
    if (Math.abs(to - begin[0]) > STILL) plot.set([hz(Math.min(begin[0], to)), hz(Math.max(begin[0], to))]);
    else plot.tapped?.(end[0], end[1]);
  };
  drawing.addEventListener("pointerup", up);
  // the browser scrolls the page
  drawing.addEventListener("pointercancel", (e) => { fingers.delete(e.pointerId); drop(); if (!fingers.size) held = null; });
  drawing.addEventListener("pointerleave", () => plot.hovered?.(null));
}
