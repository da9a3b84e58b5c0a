import assert from "node:assert/strict";
import test from "node:test";
import { unpack, column, type Packed } from "../src/data.ts";
import { combined, energyOf, measuredMotion, minus, moved, shownFactor, sizes, strongest, times, triangles } from "../src/motion.ts";
import { homeOf, Orbit } from "../src/orbit.ts";

const pack = (type: Packed["type"], shape: number[], numbers: ArrayBufferView, scale: number[] = [], offset: number[] = []): Packed =>
  ({ type, shape, data: Buffer.from(numbers.buffer).toString("base64"), scale, offset });
const near = (a: ArrayLike<number>, b: number[], within = 1e-6) => {
  assert.equal(a.length, b.length);
  b.forEach((v, i) => assert.ok(Math.abs(a[i] - v) <= within, `${a[i]} is not ${v}`));
};

test("arrays are unpacked with the scale and offset of the last axis", () => {
  near(unpack(pack("i2", [2, 2], Int16Array.of(1, -2, 32767, 4), [0.5, 10])), [0.5, -20, 16383.5, 40]);
  near(unpack(pack("u2", [1, 3], Uint16Array.of(0, 65535, 1), [1, 2, 3], [5, 6, 7])), [5, 131076, 10]);
  near(unpack(pack("f4", [2], Float32Array.of(1.5, -2.25))), [1.5, -2.25]);
  near(unpack(pack("u4", [1], Uint32Array.of(70000))), [70000]);
});

test("an array of another length is refused", () => {
  assert.throws(() => unpack(pack("u1", [3], Uint8Array.of(1, 2))), /wrong length/);
});

test("a column of the last axis", () => near(column(Float32Array.of(1, 2, 3, 4, 5, 6), [3, 2], 1), [2, 4, 6]));

test("a real shape stands still at 90°, and is turned round at 180°", () => {
  const rest = Float32Array.of(1, 1, 1), out = new Float32Array(3), motion = { real: Float32Array.of(1, 2, 3), imaginary: null };
  moved(rest, motion, 2, Math.PI / 2, out);
  near(out, [1, 1, 1]);
  moved(rest, motion, 2, Math.PI, out);
  near(out, [-1, -3, -5]);
});

test("a complex shape travels: Re(u · e^{iφ})", () => {
  const rest = new Float32Array(3), out = new Float32Array(3);
  const motion = times({ real: Float32Array.of(1, 0, 0), imaginary: Float32Array.of(0, 1, 0) }, [0, 1]);
  for (const phase of [0, 0.3, 2]) {
    moved(rest, motion, 1, phase, out);
    // i·(1 + 0i) = i and i·(0 + 1i) = −1
    near(out, [-Math.sin(phase), -Math.cos(phase), 0]);
  }
  near(sizes(motion), [Math.SQRT2]);
});

test("motions are combined and subtracted", () => {
  const sum = combined([Float32Array.of(1, 2, 3), Float32Array.of(10, 20, 30)], [2, -1]);
  near(sum.real, [-8, -16, -24]);
  const left = minus(sum, { real: Float32Array.of(-8, -16, 0), imaginary: Float32Array.of(0, 0, 7) });
  near(left.real, [0, 0, -24]);
  near(left.imaginary!, [0, 0, -7]);
});

test("unlike shapes are scaled to the same largest motion, alike ones by the modal scale factor", () => {
  const test_ = { real: Float32Array.of(0, 4, 0), imaginary: null }, seen = { real: Float32Array.of(0, 0, 2), imaginary: null };
  near(shownFactor([0.3, 0.4], 0.9, test_, seen), [0.3, 0.4]);
  near(shownFactor([-0.003, 0], 0.01, test_, seen), [-0.5, 0]);
  near(shownFactor([0, 0], 0, test_, seen), [0.5, 0]);
});

test("a quadrilateral has two triangles, a triangle one", () => {
  assert.deepEqual([...triangles(Uint32Array.of(0, 1, 2, 3, 4, 5, 6, 6))], [0, 1, 2, 0, 2, 3, 4, 5, 6]);
});

test("the axes of the view are at right angles, and keys turn it", () => {
  const orbit = new Orbit(homeOf([1, 1, 2]));
  assert.ok(orbit.key("ArrowLeft") && orbit.key("ArrowUp") && !orbit.key("x"));
  const axes = orbit.axes();
  for (const a of axes) for (const b of axes) {
    const product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    assert.ok(Math.abs(product - (a === b ? 1 : 0)) < 1e-12);
  }
  orbit.key("+");
  assert.ok(orbit.zoom > 1);
  orbit.key("0");
  assert.equal(orbit.zoom, 1);
});

test("parts of a complex shape are combined with the same weights", () => {
  const found = combined([Float32Array.of(1, 2), Float32Array.of(3, 4)], [2, -1], [Float32Array.of(5, 6), Float32Array.of(7, 9)]);
  near(found.real, [-1, 0]);
  near(found.imaginary!, [3, 3]);
});

test("the strain energy of a sum of modes is theirs, weighted by squares", () => near(energyOf([Float32Array.of(10, 0), Float32Array.of(0, 50)], [3, -4]), [3.6, 32]));

test("the parameters that move a frequency most, without those that hardly do", () =>
  assert.deepEqual(strongest(["a", "b", "c", "d"], [0.1, -0.4, 0.003, NaN], 3), [["b", -0.4], ["a", 0.1]]));

test("the motion of a point is the shortest that its measured directions agree with", () => {
  const directions = [1, 0, 0, 0, 0, -1, 0, Math.SQRT1_2, Math.SQRT1_2, 0, 1, 0];
  const found = measuredMotion(3, [0, 0, 2, -1], directions, [2, 3, Math.SQRT2, 9], [0, 1, 0, 9]);
  const near = (values: ArrayLike<number>, wanted: number[]) => wanted.forEach((v, i) => assert.ok(Math.abs(values[i] - v) < 1e-6, `${i}: ${values[i]}`));
  near(found.real, [2, 0, -3, 0, 0, 0, 0, 1, 1]);
  near(found.imaginary!, [0, 0, -1, 0, 0, 0, 0, 0, 0]);
});
