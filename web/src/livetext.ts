// Texts and sums of the live model.

import type { Live, LiveCertificate, LiveParameter } from "./data.ts";
import { shown } from "./dom.ts";
import { inRegion } from "./livemodel.ts";
import type { Solved } from "./livemodel.ts";

/** As many digits as a study file needs. */
export const written = (value: number) => String(Number(value.toPrecision(6)));

/** Lines of a study in which the parameters begin at these values. */
export function studyLines(parameters: LiveParameter[], values: number[]): string {
  return parameters.map((p, i) => `[[parameter]]\nname = ${JSON.stringify(p.name)}\nnominal = ${written(values[i])}\n`).join("\n");
}

/** χ² by kind of residual over all configurations, with the error that all frequencies share. */
export function partsOf(solved: Solved[]): Record<string, number> {
  const out: Record<string, number> = {};
  let u2 = 0, ur = 0;
  for (const s of solved) {
    for (const [kind, value] of Object.entries(s.squares)) out[kind] = (out[kind] ?? 0) + value;
    u2 += s.common[0];
    ur += s.common[1];
  }
  if (u2 > 0 && "frequency" in out) out.frequency -= (ur * ur) / (1 + u2);
  return out;
}

/** Sum of squares over the kinds, each over the square of its factor. */
export function scaledSquares(parts: Record<string, number>, factors: Record<string, number>): number {
  return Object.entries(parts).reduce((sum, [kind, value]) => sum + value / (factors[kind] ?? 1) ** 2, 0);
}

/** Distance from the limit, relative to it, on which the page takes no side: the worst cases that it finds lie on the edge of
 * the linearised region. */
const ON_LIMIT = 0.1;

/** What the true χ² says of the values; "" where a part of it is not computed again, or without a region. */
export function truthText(live: Live, first: Record<string, number>, now: Record<string, number>): string {
  const { region, draws, others, rejected } = live;
  if (!region || others.length || draws?.reason) return "";
  const factors = draws?.factors ?? {}, change = scaledSquares(now, factors) - scaledSquares(first, factors);
  const limit = region.limit * (1 - inRegion(region, live.x)), inside = change <= limit;
  const scaled = Object.values(factors).some((f) => f !== 1) ? ", with the factors on the standard deviations" : "";
  const verdict = rejected ? `${inside ? "within" : "beyond"} the limit. The fit of the update was rejected, so that this compares these values with the update and does not say that the data allow either.`
    : Math.abs(change / limit - 1) < ON_LIMIT ? "these values are about on it."
    : inside ? "the data allow these values, if the errors are as large as they were taken to be." : "the data speak against these values.";
  return `χ² itself differs from that of the update by ${change > 0 ? "+" : ""}${shown(Math.abs(change) < 5e-4 ? 0 : change, 3)}${scaled}; 95 % limit ${shown(limit, 3)}: ${verdict}`;
}

/** A size that may be rounding. */
export const size = (value: number) => (Math.abs(value) < 1e-3 ? "<\u00a00.001" : shown(value, 2));

/** An error in %, signed; it does not show the digits of rounding. */
export const signed = (value: number) => (Math.abs(value) < 1e-3 ? size(value) : (value > 0 ? "+" : "") + shown(value, 3));

/** What is said of the errors at a point: what was compared with what, and where. */
export function certificateText(all: LiveCertificate[], where: string): string {
  const one = (c: LiveCertificate) => {
    const parts = [`frequencies ${size(c.frequency_percent)} %`];
    if (c.mac !== null) parts.push(`MAC ${size(c.mac)}`);
    if (c.chi_square_percent !== null) parts.push(`χ² ${size(c.chi_square_percent)} %`);
    const corners = c.corners ? `, ${c.corners} of them corners` : "", without = c.without_modes ? `; at ${c.without_modes} of them neither has modes` : "";
    return `from ${c.other} at ${c.points} points ${where}${corners}${without}: ${parts.join(", ")}`;
  };
  return `Largest differences that were found ${all.map(one).join("; ")}.`;
}
