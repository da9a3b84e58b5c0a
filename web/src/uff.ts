// Measured modes (data set 55) and FRFs (data set 58) of an ASCII Universal File, read in the page. The file is a
// stranger's: what cannot be read is a message with the line, and nothing is guessed.

export const MOST_BYTES = 60e6;
const MOST_MODES = 300, MOST_FUNCTIONS = 3000, MOST_LINES = 200_000, MOST_VALUES = 6e6, SHOWN = 3;
/** Beyond this a value is no response. */
const LARGEST = 1e30;
const LETTERS = ["", "X", "Y", "Z", "RX", "RY", "RZ"];

/** A mode: values by point and direction ("301X"). */
export interface UffMode { label: string; freq_hz: number; shape: Map<string, number> }
/** An FRF in SI units; `power` of iω: 0 receptance, 1 mobility, 2 accelerance. Signs are those of the directions. */
export interface UffFunction { output: string; input: string; sign: number; power: number; freq: Float64Array; real: Float64Array; imaginary: Float64Array }
export interface UffTest { modes: UffMode[]; functions: UffFunction[]; notices: string[] }

export class UffError extends Error {}

interface DataSet { name: string; lines: string[]; first: number }

/** Modes and FRFs of a file. */
export function readUff(text: string): UffTest {
  const sets = dataSets(text), notices: string[] = [], modes: UffMode[] = [], functions: UffFunction[] = [], left = new Map<string, number>();
  let length = 1, force = 1, stated = false, values = 0;
  for (const set of sets) {
    if (set.name.startsWith("58b")) throw new UffError(`Line ${set.first}: binary functions (58b) are not read here; save them as ASCII.`);
    if (set.name === "164") {
      const [l, f] = numbers(set, 1, 2);
      if (!(l > 1e-12 && l < 1e12 && f > 1e-12 && f < 1e12)) throw new UffError(`Line ${set.first + 1}: data set 164 has no usable factors of length and force.`);
      if (stated && (Math.abs(l / length - 1) > 1e-3 || Math.abs(f / force - 1) > 1e-3)) throw new UffError(`Line ${set.first}: two data sets 164 state different units.`);
      [length, force, stated] = [l, f, true];
    }
  }
  for (const set of sets) {
    if (set.name === "55") {
      const one = modeOf(set, modes.length + 1);
      if (typeof one === "string") left.set(one, (left.get(one) ?? 0) + 1); else modes.push(one);
      if (modes.length > MOST_MODES) throw new UffError(`The file has more than ${MOST_MODES} modes.`);
    } else if (set.name === "58") {
      // factors of data set 164 are divided by to get SI
      const one = functionOf(set, force / length);
      if (typeof one === "string") left.set(one, (left.get(one) ?? 0) + 1);
      else { functions.push(one); values += one.freq.length; }
      if (functions.length > MOST_FUNCTIONS || values > MOST_VALUES) throw new UffError(`The file has more than ${MOST_FUNCTIONS} FRFs or ${MOST_VALUES.toExponential(0)} values.`);
    }
  }
  for (const [why, count] of [...left].slice(0, SHOWN)) notices.push(`${count} data set${count > 1 ? "s" : ""} left out: ${why}.`);
  if (!modes.length && !functions.length) throw new UffError(`The file has no modes (data set 55) and no FRFs (data set 58) that can be read.${notices.length ? ` ${notices.join(" ")}` : sets.length ? ` It has the data sets ${[...new Set(sets.map((s) => s.name))].slice(0, 8).join(", ")}.` : " It has no data sets at all: is it a Universal File?"}`);
  if (functions.length && !stated) notices.push("The file states no units (data set 164): its FRFs are taken to be in SI units.");
  return { modes, functions, notices };
}

function dataSets(text: string): DataSet[] {
  const lines = text.split(/\r\n|\n|\r/), out: DataSet[] = [];
  for (let i = 0; i < lines.length; i++) {
    if (lines[i].trim() !== "-1") continue;
    const name = lines[i + 1]?.trim() ?? "";
    if (name === "-1" || name === "") continue;
    let end = i + 2;
    while (end < lines.length && lines[end].trim() !== "-1") end++;
    // the first number of the header of 58b is part of its line
    const set = { name: /^58b/.test(name) ? "58b" : name.slice(0, 10), lines: lines.slice(i + 2, end), first: i + 2 };
    if (end >= lines.length && ["55", "58", "164"].includes(set.name)) throw new UffError(`Line ${set.first}: data set ${set.name} does not end; the file is cut off.`);
    out.push(set);
    i = end;
  }
  return out;
}

const NUMBER = /[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?/g;

/** Numbers of some lines of a data set; all of them must be finite numbers. */
function numbers(set: DataSet, from: number, to: number): number[] {
  const out: number[] = [];
  for (let i = from; i < to; i++) {
    const line = set.lines[i];
    if (line === undefined) throw new UffError(`Line ${set.first + i + 1}: data set ${set.name} ends too early.`);
    let rest = 0, finite = true;
    for (const found of line.matchAll(NUMBER)) {
      const value = Number(found[0].replace(/[Dd]/, "E"));
      finite &&= Number.isFinite(value);
      out.push(value);
      rest += found[0].length;
    }
    // signs and digits alone: NaN, infinities and asterisks are no values
    if (!finite || rest !== line.replace(/\s/g, "").length) throw new UffError(`Line ${set.first + i + 1}: "${line.trim().slice(0, 40)}" has something that is no finite number.`);
  }
  return out;
}

const whole = (set: DataSet, line: number, value: number | undefined): number => {
  if (value === undefined || !Number.isInteger(value)) throw new UffError(`Line ${set.first + line + 1}: a whole number is missing in data set ${set.name}.`);
  return value;
};

function modeOf(set: DataSet, number: number): UffMode | string {
  const head = numbers(set, 5, 6), analysis = whole(set, 5, head[1]), type = whole(set, 5, head[4]), count = whole(set, 5, head[5]), complex = type === 5 || type === 6;
  if (![2, 3, 7].includes(analysis)) return "results that are no modes";
  if (count !== 3 && count !== 6) return `shapes with ${count} values a point`;
  if (type !== 2 && type !== 4 && !complex) throw new UffError(`Line ${set.first + 6}: data type ${type} is unknown.`);
  const ints = numbers(set, 6, 7), reals = numbers(set, 7, 8);
  const freq_hz = analysis === 2 ? reals[0] : Math.hypot(reals[0], reals[1]) / (2 * Math.PI), at = number;
  if (!(freq_hz >= 0)) throw new UffError(`Line ${set.first + 8}: mode ${at} has no frequency.`);
  const shape = new Map<string, [number, number]>(), width = complex ? 2 : 1, needed = count * width;
  for (let i = 8; i < set.lines.length;) {
    if (!set.lines[i].trim()) { i++; continue; }
    const node = whole(set, i, numbers(set, i, i + 1)[0]);
    const values: number[] = [];
    for (i++; values.length < needed; i++) values.push(...numbers(set, i, i + 1));
    if (values.length !== needed) throw new UffError(`Line ${set.first + i}: point ${node} has ${values.length} values instead of ${needed}.`);
    for (let k = 0; k < count; k++) {
      const name = `${node}${LETTERS[k + 1]}`;
      if (shape.has(name)) throw new UffError(`Line ${set.first + i}: point ${node} stands twice in mode ${at}.`);
      shape.set(name, [values[k * width], complex ? values[k * width + 1] : 0]);
    }
  }
  if (!shape.size) throw new UffError(`Line ${set.first}: mode ${at} has no points.`);
  return { label: String(ints[3] ?? at), freq_hz, shape: inPhase(shape) };
}

/** The real shape that is nearest to a complex one. */
function inPhase(shape: Map<string, [number, number]>): Map<string, number> {
  let re = 0, im = 0;
  for (const [a, b] of shape.values()) { re += a * a - b * b; im += 2 * a * b; }
  const turn = 0.5 * Math.atan2(im, re), c = Math.cos(turn), s = Math.sin(turn);
  return new Map([...shape].map(([name, [a, b]]) => [name, a * c + b * s]));
}

const MOTION: Record<number, number> = { 8: 0, 11: 1, 12: 2 };

function functionOf(set: DataSet, factor: number): UffFunction | string {
  const line = set.lines[5] ?? "", kind = Number(line.slice(0, 5));
  if (kind !== 4) return "functions that are no FRFs";
  const of = (from: number, dir: number) => ({ node: Number(line.slice(from, dir) || NaN), direction: Number(line.slice(dir, dir + 4) || NaN) });
  const response = of(41, 51), reference = of(66, 76);
  for (const { node, direction } of [response, reference]) if (!Number.isInteger(node) || !Number.isInteger(direction)) throw new UffError(`Line ${set.first + 6}: the points of an FRF cannot be read.`);
  if ([response, reference].some(({ direction }) => Math.abs(direction) < 1 || Math.abs(direction) > 3)) return "FRFs of rotations or without a direction";
  const form = numbers(set, 6, 7), type = whole(set, 6, form[0]), count = whole(set, 6, form[1]), even = whole(set, 6, form[2]);
  if (count < 1 || count > MOST_LINES) throw new UffError(`Line ${set.first + 7}: an FRF with ${count} lines; up to ${MOST_LINES.toLocaleString("en")} are read.`);
  if (type !== 5 && type !== 6) return "FRFs that are not complex";
  const axes = [7, 8, 9].map((k) => Number((set.lines[k] ?? "").slice(0, 10)));
  if (axes[0] !== 18) return "FRFs over something that is no frequency";
  const power = MOTION[axes[1]];
  if (power === undefined || (axes[2] !== 13 && axes[2] !== 9)) return "FRFs of something else than motion over force";
  const values = numbers(set, 11, set.lines.length - trailing(set.lines)), each = even === 1 ? 2 : 3;
  if (values.length !== each * count) throw new UffError(`Line ${set.first + 12}: an FRF has ${values.length} values instead of ${each * count}.`);
  const freq = new Float64Array(count), real = new Float64Array(count), imaginary = new Float64Array(count);
  for (let i = 0; i < count; i++) {
    freq[i] = even === 1 ? form[3] + i * form[4] : values[each * i];
    if (i && !(freq[i] > freq[i - 1])) throw new UffError(`Line ${set.first + 7}: the frequencies of an FRF do not rise.`);
    real[i] = factor * values[each * i + each - 2];
    imaginary[i] = factor * values[each * i + each - 1];
    if (!(Math.hypot(real[i], imaginary[i]) < LARGEST && Math.abs(freq[i]) < LARGEST)) throw new UffError(`Line ${set.first + 12}: an FRF has values beyond ${LARGEST.toExponential()}.`);
  }
  if (!(freq[0] >= 0)) throw new UffError(`Line ${set.first + 7}: an FRF begins below 0 Hz.`);
  const name = (p: { node: number; direction: number }) => `${p.node}${LETTERS[Math.abs(p.direction)]}`;
  return { output: name(response), input: name(reference), sign: Math.sign(response.direction) * Math.sign(reference.direction), power, freq, real, imaginary };
}

function trailing(lines: string[]): number {
  let count = 0;
  while (count < lines.length && !lines[lines.length - 1 - count].trim()) count++;
  return count;
}
