// Texts and sums of the live model.

import type { LiveCertificate, LiveParameter } from "./data.ts";
import { shown } from "./dom.ts";
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

/** What is said of the errors at a point. */
export function certificateText(c: LiveCertificate, where: string): string {
  const size = (value: number) => (value < 1e-4 ? "less than 0.0001" : shown(value, 2));
  const mac = c.mac === null ? "" : `, and the MAC by ${size(c.mac)}`;
  return `Errors of these numbers: frequencies differ from the model by ${size(c.frequency_percent)} %${mac}, the largest of ${c.points} points ${where}.`;
}
