// Acceptance criteria at the values of the sliders: of frequencies, MAC, orthogonality and FRFs.

import type { LiveConfiguration, LiveCriterion } from "./data.ts";
import { shown } from "./dom.ts";
import type { Solved } from "./livemodel.ts";

/** Difference from the value of the report, at the update, up to which the page computes the same quantity. */
const SAME: Record<string, number> = {
  frequency: 0.03, mac: 0.005, diagonal: 0.005, off_diagonal: 0.005, self: 0.005, frac: 0.005, fdac: 0.005, mean_db: 0.05, max_db: 0.1, resonance: 0.03,
};

export interface CriterionRow { name: string; limit: string; updated: string; now: string; verdict: string; live: boolean }

/** The worst value: of the pairs the frequency error in % or the MAC, else what the worker found; null where none is defined. */
export function worstValue(c: LiveConfiguration, solved: Solved, quantity: string): number | null {
  if (quantity !== "frequency" && quantity !== "mac") return solved.measures?.[quantity] ?? null;
  const values = solved.pairs.flatMap(({ test, column, whole }) => {
    if (column < 0) return [];
    if (quantity === "mac") return whole === null ? [] : [whole];
    return c.test_freq_hz[test] > 0 ? [100 * Math.abs(solved.freq_hz[column] / c.test_freq_hz[test] - 1)] : [];
  });
  return !values.length ? null : quantity === "mac" ? Math.min(...values) : Math.max(...values);
}

const within = (c: LiveCriterion, value: number) => (c.at_most ? value <= c.limit : value >= c.limit);
const text = (c: LiveCriterion, value: number | null) => (value === null ? "–" : value === Infinity ? "no partner" : `${shown(value, 3)}${c.unit ? ` ${c.unit}` : ""}`);

/** Each criterion at the update and now; one that the page does not compute keeps the verdict of the update. */
export function criterionRows(c: LiveConfiguration, first: Solved | null, now: Solved | null): CriterionRow[] {
  return c.criteria.map((one) => {
    const limit = `${one.at_most ? "≤" : "≥"} ${text(one, one.limit)}`, kept = { name: one.name, limit, updated: text(one, one.measured), now: "as updated", verdict: one.verdict, live: false };
    if (!one.quantity || one.measured === null || !first) return kept;
    const before = worstValue(c, first, one.quantity);
    if (before === null || !(Math.abs(before - one.measured) <= SAME[one.quantity])) return kept;
    const value = now && worstValue(c, now, one.quantity);
    if (value === null) return { ...kept, now: "–", verdict: now ? "not tested" : "–", live: true };
    // modes without a partner fail a criterion whatever the others are
    const missing = one.verdict === "fail" && one.quantity !== "self" && within(one, one.measured);
    return { ...kept, now: text(one, value), verdict: within(one, value) && !missing ? "pass" : "fail", live: true };
  });
}
