// What is drawn of one side, test or model: faces, lines, dots and arrows that follow a motion.

import {
  BufferAttribute, BufferGeometry, Color, ConeGeometry, DoubleSide, DynamicDrawUsage, Group, InstancedMesh, LineBasicMaterial,
  LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, Points, PointsMaterial, Quaternion, Vector3,
} from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

/** From no motion to the largest, as in the still pictures. */
const STOPS = ["#eaf2f8", "#c3d8ea", "#8db6d8", "#4f8cc0", "#1f5a92", "#0b2d52"];
const DARK_STOPS = ["#26384a", "#2f5275", "#3c78ab", "#66a5d8", "#a5d0f2", "#e6f4ff"];

/** From no strain energy to the most. */
const HOT_STOPS = ["#e2d8c6", "#f5c47e", "#f2a055", "#dc672a", "#b0301f", "#6b1020"];
const DARK_HOT_STOPS = ["#2c2a2a", "#5a3320", "#9a4a1c", "#d9752b", "#f6ad55", "#fff0c9"];

/** (n, 3) linear colours of values from 0 to 1. */
export function colours(values: Float32Array, dark: boolean, hot = false): Float32Array {
  const table = scaleStops(dark, hot).map((c) => new Color(c));
  const out = new Float32Array(3 * values.length), one = new Color();
  for (let i = 0; i < values.length; i++) {
    const at = Math.min(1, Math.max(0, values[i])) * (table.length - 1), k = Math.min(Math.floor(at), table.length - 2);
    one.lerpColors(table[k], table[k + 1], at - k).toArray(out, 3 * i);
  }
  return out;
}

export const scaleStops = (dark: boolean, hot = false): string[] => (hot ? (dark ? DARK_HOT_STOPS : HOT_STOPS) : dark ? DARK_STOPS : STOPS);

/** Faces (triangles of points) with a colour at each point. */
export class Faces {
  readonly object: Mesh;
  constructor(private readonly points: BufferAttribute, triangles: Uint32Array) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", points);
    geometry.setAttribute("color", new BufferAttribute(new Float32Array(points.array.length), 3));
    geometry.setIndex(new BufferAttribute(triangles, 1));
    // pushed back a little, so that lines on faces are seen
    const material = new MeshLambertMaterial({ vertexColors: true, side: DoubleSide, flatShading: true, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    this.object = new Mesh(geometry, material);
    this.object.frustumCulled = false;
  }
  paint(values: Float32Array): void {
    const attribute = this.object.geometry.getAttribute("color") as BufferAttribute;
    attribute.set(values);
    attribute.needsUpdate = true;
  }
  follow(): void { this.points.needsUpdate = true; }
}

/** Thin lines between points. */
export function thinLines(points: BufferAttribute, rows: Uint32Array, colour: string, opacity: number): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", points);
  geometry.setIndex(new BufferAttribute(rows, 1));
  const lines = new LineSegments(geometry, new LineBasicMaterial({ color: colour, transparent: opacity < 1, opacity }));
  lines.frustumCulled = false;
  return lines;
}

/** Wide lines between points, each end with its own colour. */
export class WideLines {
  readonly object: LineSegments2;
  private readonly ends: Float32Array;
  constructor(private readonly rows: Uint32Array, width: number, colour: string | null) {
    const geometry = new LineSegmentsGeometry();
    this.ends = new Float32Array(3 * rows.length);
    geometry.setPositions(this.ends);
    geometry.setColors(new Float32Array(3 * rows.length).fill(1));
    this.object = new LineSegments2(geometry, new LineMaterial({ linewidth: width, vertexColors: colour === null, color: colour ?? 0xffffff }));
    this.object.frustumCulled = false;
  }
  follow(points: Float32Array): void { this.fill("instanceStart", points); }
  paint(values: Float32Array): void { this.fill("instanceColorStart", values); }
  /** A colour at each end of each line, (l, 2, 3). */
  paintEnds(colours: Float32Array): void {
    const buffer = (this.object.geometry.getAttribute("instanceColorStart") as any).data;
    (buffer.array as Float32Array).set(colours);
    buffer.needsUpdate = true;
  }
  private fill(name: string, values: Float32Array): void {
    const buffer = (this.object.geometry.getAttribute(name) as any).data;
    const to = buffer.array as Float32Array;
    this.rows.forEach((row, i) => to.set(values.subarray(3 * row, 3 * row + 3), 3 * i));
    buffer.needsUpdate = true;
  }
}

/** Dots of a few pixels, each with its own colour. */
export class Dots {
  readonly object: Points;
  constructor(private readonly points: BufferAttribute, size: number) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", points);
    geometry.setAttribute("color", new BufferAttribute(new Float32Array(points.array.length).fill(1), 3));
    const material = new PointsMaterial({ size, sizeAttenuation: false, vertexColors: true });
    // round ones
    material.onBeforeCompile = (shader) => {
      const begin = "#include <clipping_planes_fragment>";
      shader.fragmentShader = shader.fragmentShader.replace(begin, `if (length(gl_PointCoord - 0.5) > 0.5) discard;\n${begin}`);
    };
    this.object = new Points(geometry, material);
    this.object.frustumCulled = false;
  }
  paint(values: Float32Array): void {
    const attribute = this.object.geometry.getAttribute("color") as BufferAttribute;
    attribute.set(values);
    attribute.needsUpdate = true;
  }
  follow(): void { this.points.needsUpdate = true; }
}

/** An arrow at each point, from where it rests to where it moves. */
export class Arrows {
  readonly object = new Group();
  private readonly shafts: WideLines;
  private readonly heads: InstancedMesh;
  private readonly ends: Float32Array;
  private readonly up = new Vector3(0, 1, 0);
  constructor(private readonly rest: Float32Array, private readonly size: number, colour: string) {
    const count = rest.length / 3;
    this.ends = new Float32Array(2 * rest.length);
    this.shafts = new WideLines(Uint32Array.from({ length: 2 * count }, (_, i) => i), 2.2, colour);
    const cone = new ConeGeometry(0.32, 1, 12);
    cone.translate(0, -0.5, 0);
    this.heads = new InstancedMesh(cone, new MeshBasicMaterial({ color: colour }), count);
    this.heads.instanceMatrix.setUsage(DynamicDrawUsage);
    this.heads.frustumCulled = false;
    this.object.add(this.shafts.object, this.heads);
  }
  follow(tips: Float32Array): void {
    const along = new Vector3(), tip = new Vector3(), turned = new Quaternion(), matrix = new Matrix4(), size = new Vector3();
    for (let i = 0; 3 * i < tips.length; i++) {
      tip.fromArray(tips, 3 * i);
      along.fromArray(this.rest, 3 * i);
      this.ends.set([along.x, along.y, along.z], 6 * i);
      along.subVectors(tip, along);
      const length = along.length();
      if (length > 0) turned.setFromUnitVectors(this.up, along.divideScalar(length));
      matrix.compose(tip, turned, size.setScalar(Math.min(this.size, 0.5 * length)));
      this.heads.setMatrixAt(i, matrix);
      this.ends.set([tip.x, tip.y, tip.z], 6 * i + 3);
    }
    this.heads.instanceMatrix.needsUpdate = true;
    this.shafts.follow(this.ends);
  }
}
