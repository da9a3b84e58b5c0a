// Both sides of a configuration: the model on its mesh, the test on its wire frame.

import { AmbientLight, BufferAttribute, Color, DirectionalLight, Scene, type Object3D } from "three";
import { column, unpack, unpackRows, type Packed, type SceneData, type Stage } from "./data.ts";
import { Arrows, colours, Dots, Faces, thinLines, WideLines } from "./drawing.ts";
import { combined, diagonal, energyOf, largest, minus, moved, shownFactor, sizes, times, triangles, type Motion } from "./motion.ts";

export type Colouring = "displacement" | "energy" | "difference";

/** The colour bar: name, unit, the value of its end, and whether values beyond have the colour of the end. */
export interface ColourBar { name: string; end: number; hot: boolean; open: boolean }
export interface Theme { dark: boolean; ink: string; rest: string; model: string; test: string }

/** What is shown: a row of the test's modes (null without a test) and a column of the model's. */
export interface Chosen { test: number | null; column: number }

/** Strain energy at points and of lines, in %. */
interface Energy { points: Float32Array; lines: Float32Array | null }

export class SceneOf {
  readonly model = new Scene();
  readonly test = new Scene();
  readonly points: Float32Array;
  readonly size: number;
  readonly places: Float32Array | null;
  factor: [number, number] = [1, 0];
  alike = true;
  private readonly shapes = new Map<Packed, Float32Array>();
  private readonly rest: BufferAttribute;
  private modelMotion: Motion | null = null;
  private testMotion: Motion | null = null;
  private expandedMotion: Motion | null = null;
  private energy: Energy | null = null;
  private scale = 0;
  private readonly modelSide: ModelSide;
  private readonly testSide: TestSide | null;
  private readonly expandedSide: ModelSide | null;

  constructor(readonly data: SceneData, private readonly theme: Theme) {
    this.points = unpack(data.points);
    this.size = diagonal(this.points);
    this.rest = new BufferAttribute(this.points.slice(), 3);
    this.places = data.places ? unpack(data.places) : null;
    this.modelSide = new ModelSide(this.points, data, theme, this.model, this.size);
    const expandable = data.stages.some((s) => s.expanded);
    this.expandedSide = expandable ? new ModelSide(this.points, data, theme, this.test, this.size) : null;
    this.testSide = this.places ? new TestSide(this.places, unpackRows(data.wire!), this.size, theme, this.test) : null;
    for (const scene of [this.model, this.test]) this.light(scene);
    this.model.add(this.ghost());
    if (!expandable) this.test.add(this.ghost());
  }

  get hasTest(): boolean { return this.places !== null && this.data.test !== null; }
  get expanded(): boolean { return this.expandedSide !== null; }

  /** Take up a shape. */
  choose(stage: Stage, chosen: Chosen): void {
    const pair = stage.pairs.find((p) => p.test === chosen.test && p.column === chosen.column);
    const [modes, weights] = pair ? [pair.modes.map((n) => n - 1), pair.weights] : [[chosen.column], [1]];
    const stored = modes.map((j) => stage.stored.indexOf(j));
    if (stored.some((k) => k < 0)) throw new Error("the shape is not stored");
    const part = (packed: Packed | null, at: number[]) => packed && at.map((k) => this.column(packed, k));
    this.modelMotion = combined(part(stage.motion, stored)!, weights, part(stage.motion_imaginary, stored));
    const points = part(stage.energy, stored), lines = part(stage.line_energy, stored);
    this.energy = points && { points: energyOf(points, weights), lines: lines && energyOf(lines, weights) };
    this.testMotion = this.expandedMotion = null;
    if (chosen.test !== null && this.hasTest && stage.seen && stage.factors && stage.mac) this.chooseTest(stage, chosen.test, chosen.column, pair?.factor, combined(part(stage.seen, modes)!, weights, part(stage.seen_imaginary, modes)));
    this.expandedSide?.show(this.expandedMotion !== null);
    const most = largest(sizes(this.modelMotion)) || 1;
    this.scale = (0.13 * this.size) / most;
  }

  /** Take up a motion of the points that is no mode. */
  chooseMotion(motion: Motion): void {
    this.modelMotion = motion;
    this.energy = this.testMotion = this.expandedMotion = null;
    this.expandedSide?.show(false);
    this.scale = (0.13 * this.size) / (largest(sizes(motion)) || 1);
  }

  /** Where the points of a side are now. */
  now(side: "model" | "test"): Float32Array | null {
    return side === "model" ? this.modelSide.now : this.testMotion ? this.testSide!.now : null;
  }

  /** The number of a point, its motion in % of the largest of the model, and its strain energy. */
  point(side: "model" | "test", row: number): { number: number; percent: number; energy: number | null } | null {
    const motion = side === "model" ? this.modelMotion : this.testMotion;
    if (!motion) return null;
    const own = (m: Motion) => Math.sqrt([0, 1, 2].reduce((sum, c) => sum + m.real[3 * row + c] ** 2 + (m.imaginary ? m.imaginary[3 * row + c] ** 2 : 0), 0));
    const packed = side === "model" ? this.data.point_numbers : this.data.place_numbers;
    const energy = side === "model" && this.energy ? this.energy.points[row] : null;
    return { number: packed ? this.unpacked(packed)[row] : 0, percent: (100 * own(motion)) / (largest(sizes(this.modelMotion!)) || 1), energy };
  }

  /** Take up a motion of the model that is in no stage, and a test mode with the factor from its shape to it. */
  chooseLive(motion: Float32Array, test: number | null, factor: number): void {
    this.modelMotion = { real: motion, imaginary: null };
    this.energy = this.testMotion = this.expandedMotion = null;
    if (test !== null && this.hasTest) {
      const { data } = this;
      const measured = { real: this.column(data.test!, test), imaginary: data.test_imaginary ? this.column(data.test_imaginary, test) : null };
      this.testMotion = times(measured, [factor, 0]);
      this.testSide!.choose(this.testMotion, this.testMotion);
    }
    this.expandedSide?.show(false);
    this.scale = (0.13 * this.size) / (largest(sizes(this.modelMotion)) || 1);
  }

  private chooseTest(stage: Stage, test: number, at: number, given: [number, number] | undefined, seen: Motion): void {
    const { data } = this;
    const motion = { real: this.column(data.test!, test), imaginary: data.test_imaginary ? this.column(data.test_imaginary, test) : null };
    const factors = this.unpacked(stage.factors!), count = stage.numbers.length, k = 2 * (test * count + at);
    const mac = this.unpacked(stage.mac!)[test * count + at];
    this.alike = given !== undefined || mac >= 0.5;
    this.factor = shownFactor(given ?? [factors[k], factors[k + 1]], given ? 1 : mac, motion, seen);
    this.testMotion = times(motion, this.factor);
    this.testSide!.choose(this.testMotion, minus(seen, this.testMotion));
    if (stage.expanded) {
      const real = [Math.sign(this.factor[0] || 1) * Math.hypot(...this.factor), 0] as [number, number];
      this.expandedMotion = times({ real: this.column(stage.expanded, test), imaginary: null }, real);
    }
  }

  /** What can be shown as colour of the shape that is chosen. */
  can(colouring: Colouring): boolean {
    return colouring === "displacement" || (colouring === "energy" ? this.energy !== null : this.testMotion !== null);
  }

  /** Colour of the model, and of the test where it is expanded or compared at the sensors. */
  paint(colouring: Colouring): ColourBar {
    const { dark } = this.theme, model = this.modelMotion!;
    const amount = sizes(model), most = largest(amount) || 1;
    const relative = (values: Float32Array) => values.map((v) => v / most);
    this.testSide?.paint(colouring === "difference" ? most : null);
    if (colouring === "energy" && this.energy) {
      const { points, lines } = this.energy, end = Math.max(largest(points), lines ? largest(lines) : 0) || 1;
      this.modelSide.paintEnergy(points.map((v) => v / end), lines && lines.map((v) => v / end));
      // the strain energy of a test is not known
      this.expandedSide?.paintPlain();
      return { name: "Strain energy of an element, % of the mode", end, hot: true, open: false };
    }
    const different = colouring === "difference", expanded = this.expandedMotion;
    const values = relative(different && expanded ? sizes(minus(model, expanded)) : amount);
    this.modelSide.paint(colours(values, dark));
    if (expanded) this.expandedSide!.paint(colours(different ? values : relative(sizes(expanded)), dark));
    if (!different) return { name: "Displacement, % of the largest", end: 100, hot: false, open: false };
    return { name: `Difference to the test${expanded ? "" : " at the sensors (dots)"}, % of the largest displacement`, end: 100, hot: false, open: true };
  }

  /** Move all to a phase in radians. */
  move(phase: number, factor: number, arrows: boolean): void {
    const s = factor * this.scale;
    if (this.modelMotion) this.modelSide.follow(this.modelMotion, s, phase, arrows);
    if (this.expandedMotion) this.expandedSide!.follow(this.expandedMotion, s, phase, false);
    if (this.testMotion) this.testSide!.follow(this.testMotion, s, phase, arrows);
  }

  private column(packed: Packed, k: number): Float32Array { return column(this.unpacked(packed), packed.shape, k); }

  private unpacked(packed: Packed): Float32Array {
    if (!this.shapes.has(packed)) this.shapes.set(packed, unpack(packed));
    return this.shapes.get(packed)!;
  }

  private ghost() {
    const { data } = this;
    const rows = [data.edges, data.lines].flatMap((p) => Array.from(unpackRows(p)));
    return thinLines(this.rest, Uint32Array.from(rows), this.theme.rest, data.faces.shape[0] ? 0.35 : 0.9);
  }

  private light(scene: Scene): void {
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.name = "sun";
    scene.add(new AmbientLight(0xffffff, 2.0), sun, sun.target);
  }
}

class ModelSide {
  readonly now: Float32Array;
  private readonly attribute: BufferAttribute;
  private readonly faces: Faces | null;
  private readonly lines: WideLines;
  private readonly rigid: WideLines;
  private readonly objects: Object3D[];

  private readonly rows: Uint32Array;
  private readonly dots: Dots | null;
  private readonly arrows: Arrows | null;

  constructor(private readonly points: Float32Array, data: SceneData, private readonly theme: Theme, scene: Scene, size: number) {
    this.now = points.slice();
    this.attribute = new BufferAttribute(this.now, 3);
    this.faces = data.faces.shape[0] ? new Faces(this.attribute, triangles(unpackRows(data.faces))) : null;
    this.rows = unpackRows(data.lines);
    this.lines = new WideLines(this.rows, this.faces ? 1.6 : 3, null);
    this.rigid = new WideLines(unpackRows(data.rigid), 1, theme.rest);
    if (this.faces) scene.add(this.faces.object, thinLines(this.attribute, unpackRows(data.edges), theme.ink, data.faces.shape[0] > 3000 ? 0.5 : 0.3));
    if (data.lines.shape[0]) scene.add(this.lines.object);
    if (data.rigid.shape[0]) scene.add(this.rigid.object);
    // the geometry of a test may have no lines
    this.dots = data.test_only ? new Dots(this.attribute, 7) : null;
    this.arrows = data.test_only ? new Arrows(points, 0.025 * size, theme.test) : null;
    if (this.dots && this.arrows) scene.add(this.dots.object, this.arrows.object);
    this.objects = scene.children.slice();
  }
  show(on: boolean): void { for (const o of this.objects) o.visible = on; }
  /** Lines take the colours of the motion where there are no faces, on which they would drown. */
  paint(values: Float32Array): void {
    this.faces?.paint(values);
    this.lines.paint(this.faces ? this.plain(this.theme.ink) : values);
    this.dots?.paint(values);
  }
  /** Lines in the colour of their own energy, or of that at their ends, for springs that have no length to be seen. */
  paintEnergy(points: Float32Array, lines: Float32Array | null): void {
    this.faces?.paint(colours(points, this.theme.dark, true));
    const ends = Float32Array.from(this.rows, (row, i) => Math.max(lines ? lines[i >> 1] : 0, points[row]));
    this.lines.paintEnds(colours(ends, this.theme.dark, true));
  }
  paintPlain(): void { this.paint(this.plain(this.theme.rest)); }
  private plain(colour: string): Float32Array {
    const [r, g, b] = new Color(colour).toArray();
    return Float32Array.from(this.points, (_, i) => [r, g, b][i % 3]);
  }
  follow(motion: Motion, scale: number, phase: number, arrows: boolean): void {
    moved(this.points, motion, scale, phase, this.now);
    this.attribute.needsUpdate = true;
    this.lines.follow(this.now);
    this.rigid.follow(this.now);
    if (this.arrows) this.arrows.object.visible = arrows;
    if (arrows) this.arrows?.follow(this.now);
  }
}

class TestSide {
  readonly now: Float32Array;
  private readonly attribute: BufferAttribute;
  private readonly wire: WideLines;
  private readonly dots: Dots;
  private readonly arrows: Arrows;
  private difference: Float32Array = new Float32Array(0);

  constructor(private readonly places: Float32Array, wire: Uint32Array, size: number, private readonly theme: Theme, scene: Scene) {
    this.now = places.slice();
    this.attribute = new BufferAttribute(this.now, 3);
    this.wire = new WideLines(wire, 2.4, theme.test);
    this.dots = new Dots(this.attribute, 6);
    this.arrows = new Arrows(places, 0.025 * size, theme.test);
    if (wire.length) scene.add(this.wire.object);
    scene.add(this.dots.object, this.arrows.object);
  }
  choose(_motion: Motion, difference: Motion): void { this.difference = sizes(difference); }
  /** Dots in the colour of the test, or of the difference to the model relative to the largest motion `most`. */
  paint(most: number | null): void {
    const plain = new Color(this.theme.test);
    const values = most === null
      ? Float32Array.from({ length: this.places.length }, (_, i) => plain.toArray()[i % 3])
      : colours(this.difference.map((v) => v / most), this.theme.dark);
    this.dots.paint(values);
  }
  follow(motion: Motion, scale: number, phase: number, arrows: boolean): void {
    moved(this.places, motion, scale, phase, this.now);
    this.attribute.needsUpdate = true;
    this.wire.follow(this.now);
    this.arrows.object.visible = arrows;
    if (arrows) this.arrows.follow(this.now);
  }
}
