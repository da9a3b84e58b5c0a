// The view document of the page: types as in femtune.steps.report.view, and how its arrays are unpacked.

export interface Packed { type: "u1" | "u2" | "u4" | "i1" | "i2" | "f4" | "f8"; shape: number[]; data: string; scale: number[]; offset: number[] }
export interface Pair { test: number; column: number; modes: number[]; weights: number[]; factor: [number, number] }
export interface Stage {
  title: string; numbers: number[]; freq_hz: number[]; stored: number[]; motion: Packed; mac: Packed | null;
  seen: Packed | null; factors: Packed | null; expanded: Packed | null; pairs: Pair[];
  energy: Packed | null; line_energy: Packed | null; damping_ratio: (number | null)[]; motion_imaginary: Packed | null; seen_imaginary: Packed | null;
}
export interface SceneData {
  configuration: string; note: string; points: Packed; faces: Packed; edges: Packed; lines: Packed; rigid: Packed;
  stages: Stage[]; places: Packed | null; wire: Packed | null; test: Packed | null; test_imaginary: Packed | null;
  test_labels: string[]; test_freq_hz: number[]; test_only: boolean;
  parameters: string[]; slopes: number[][]; live: { vectors: Packed; weights: Packed } | null;
  line_parts: Packed | null; face_parts: Packed | null; part_fields: string[][]; point_numbers: Packed | null; place_numbers: Packed | null;
}
export interface Curve { look: string; freq_hz: Packed; real: Packed; imaginary: Packed; phase: boolean }
export interface Operating { rows: number[]; directions: Packed; inputs: string[] }
export interface Functions { configuration: string; ordinate: string; titles: string[]; curves: Curve[]; note: string; section: string; operating: Operating | null }
export interface IterationMode {
  configuration: string; test_label: string; test_freq_hz: number; freq_hz: (number | null)[]; mac: (number | null)[];
}
export interface IterationFunctions {
  configuration: string; ordinate: string; titles: string[]; phase: boolean; freq_hz: Packed; real: Packed; imaginary: Packed;
  test_real: Packed; test_imaginary: Packed; test_look: string; beside: Curve[]; note: string;
}
export interface History {
  iterations: number[]; objective_percent: number[]; parameters: string[]; units: string[]; nominal: number[];
  values: number[][]; modes: IterationMode[]; functions: IterationFunctions[];
}
export interface Stabilisation {
  methods: string[]; method: Packed; order: Packed; freq_hz: Packed; damping_ratio: Packed; stable: Packed;
  picked: { row: number; name: string; fit_only: boolean }[]; curve_hz: Packed; curve_db: Packed; words: string;
  singular_db: Packed; power: Packed; derivatives: number; decay: number; functions: number; band_hz: [number, number];
  inputs: { path: string; sha256: string }[];
}
export interface LiveParameter {
  name: string; unit: string; nominal: number; updated: number; lower: number; upper: number; scale: number; interval: [number, number] | null;
}
export interface LiveRegion { moving: number[]; at: number[]; rows: number[]; offset: number[]; limit: number; centre: number[]; precision: number[]; radius_square: number }
export interface LiveDraws { source: "posterior" | "linear"; x: Packed; linear: number[] | null; degrees: number | null; factors: Record<string, number>; reason: string }
export interface LiveTerm { kind: "stiffness" | "mass"; parameters: number[]; shape: number[]; coefficients: number[]; scale: number }
export interface LivePart {
  kind: string; quantity: "frequency" | "shape" | "mac"; form: string; test: number; sd: number; sensors: number[]; weights: number[] | null; common: number;
}
export interface LiveCertificate { other: string; points: number; corners: number; without_modes: number; frequency_percent: number; mac: number | null; chi_square_percent: number | null }
export interface LiveFunctions {
  kind: string; ordinate: string; look: string; outputs: string[]; inputs: string[]; freq_hz: Packed; test_real: Packed; test_imaginary: Packed;
  output_rows: Packed; input_rows: Packed; modes: number; ratios: number[]; ratios_hz: number[]; hysteretic: boolean; loss_factor: number;
  si: number; label: string; form: string; every: number; sd: Packed | null; shift: Packed | null; note: string; errors: [string, number, number, string][];
}
export interface LiveCriterion { name: string; quantity: string; at_most: boolean; limit: number; unit: string; measured: number | null; verdict: string; remark: string }
export interface LiveConfiguration {
  configuration: string; order: number; count: number; shift: number; theta: number[]; terms: LiveTerm[]; triangles: Packed; sensors: Packed;
  test_labels: string[]; test_freq_hz: number[]; test_shapes: Packed; sensor_labels: string[]; mass_points: string[]; mass_reason: string; mass_rows: Packed | null; pairs: [number, number, number[]][]; parts: LivePart[];
  region: LiveCertificate[]; bounds: LiveCertificate[]; checks: { x: number[]; eigenvalues: number[]; chi_square: number; functions: number[] }[];
  functions: LiveFunctions[]; functions_reason: string; criteria: LiveCriterion[]; mass: { updated: number; slopes: number[]; weighed: [number, number][] } | null; mass_sensors: number[];
}
export interface Live {
  parameters: LiveParameter[]; narrowed: boolean; rejected: boolean; mass_unit: string; x: number[]; region: LiveRegion | null; draws: LiveDraws | null; configurations: LiveConfiguration[]; others: { kind: string; chi_square: number }[];
}
export interface ModeChoices {
  configuration: string; test_labels: string[]; test_freq_hz: number[]; numbers: number[]; model_freq_hz: number[]; mac: Packed;
  pairs: [string, number][]; fixed: [string, number][]; never: [string, number][]; close: number[][]; left_out: [string, string][]; sensors: string[]; off: string[];
}
export interface FieldChoice { name: string; field: string; what: string; value: number; lower: number; upper: number; chosen: boolean; further: string[] }
export interface Choices { inputs: { path: string; sha256: string }[]; configurations: ModeChoices[]; fields: FieldChoice[]; kept: string[] }
export interface View { scenes: SceneData[]; functions: Functions[]; history: History | null; stabilisation: Stabilisation | null; live: Live | null; choices: Choices | null }

const BYTES = { u1: 1, u2: 2, u4: 4, i1: 1, i2: 2, f4: 4, f8: 8 };

/** The numbers of an array in C order, scaled along its last axis. */
export function unpack(packed: Packed): Float32Array { return filled(packed, (count) => new Float32Array(count)); }

/** The same in double precision. */
export function unpackDouble(packed: Packed): Float64Array { return filled(packed, (count) => new Float64Array(count)); }

function filled<T extends Float32Array | Float64Array>(packed: Packed, made: (count: number) => T): T {
  const text = atob(packed.data);
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const from = new DataView(bytes.buffer);
  const size = BYTES[packed.type];
  const count = bytes.length / size;
  if (count !== packed.shape.reduce((a, b) => a * b, 1)) throw new Error("an array of the page has the wrong length");
  const out = made(count);
  const last = packed.shape[packed.shape.length - 1] || 1;
  for (let i = 0; i < count; i++) {
    const at = i * size;
    const raw = packed.type === "f4" ? from.getFloat32(at, true)
      : packed.type === "f8" ? from.getFloat64(at, true)
      : packed.type === "i1" ? from.getInt8(at)
      : packed.type === "i2" ? from.getInt16(at, true)
      : packed.type === "u1" ? from.getUint8(at)
      : packed.type === "u2" ? from.getUint16(at, true)
      : from.getUint32(at, true);
    const k = i % last;
    out[i] = (packed.offset.length ? packed.offset[k] : 0) + (packed.scale.length ? packed.scale[k] : 1) * raw;
  }
  return out;
}

/** Rows of points, as whole numbers. */
export function unpackRows(packed: Packed): Uint32Array {
  return Uint32Array.from(unpack({ ...packed, scale: [], offset: [] }));
}

/** Column `k` of the last axis. */
export function column(values: Float32Array, shape: number[], k: number): Float32Array {
  const last = shape[shape.length - 1];
  const out = new Float32Array(values.length / last);
  for (let i = 0; i < out.length; i++) out[i] = values[i * last + k];
  return out;
}

/** The view document of the page; null where the page has none. */
export function readView(): View | null {
  const text = document.getElementById("view")?.textContent;
  return text ? (JSON.parse(text) as View) : null;
}
