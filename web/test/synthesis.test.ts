import assert from "node:assert/strict";
import test from "node:test";
import { nearestLine } from "../src/functions.ts";
import { pinched } from "../src/gestures.ts";
import { misfit, synthesised, synthesisedPower, together, type Complex, type Mode } from "../src/synthesis.ts";

const freq = Float64Array.from({ length: 300 }, (_, k) => 1 + 0.05 * k);
const modes: Mode[] = [{ freq: 4, damping: 0.01 }, { freq: 4.3, damping: 0.02 }, { freq: 11, damping: 0.005 }];
/** (iω)^d (Σ R/(iω + σ − λ) + conjugate + 0.3 − 2/ω²). */
function made(residues: [number, number][], d: number, sigma = 0): Complex {
  const out = { real: new Float64Array(freq.length), imaginary: new Float64Array(freq.length) };
  freq.forEach((f, k) => {
    const w = 2 * Math.PI * f;
    let [re, im] = [0.3 - 2 / (w * w), 0];
    modes.forEach((mode, j) => {
      const wn = 2 * Math.PI * mode.freq, a = -mode.damping * wn - sigma, [p, q] = residues[j];
      for (const sign of [1, -1]) {
        const b = sign * wn * Math.sqrt(1 - mode.damping ** 2), x = -a, y = w - b, n = x * x + y * y;
        re += (p * x + sign * q * y) / n;
        im += (sign * q * x - p * y) / n;
      }
    });
    for (let i = 0; i < d; i++) [re, im] = [-w * im, w * re];
    out.real[k] = re;
    out.imaginary[k] = im;
  });
  return out;
}

test("functions of known poles are synthesised without error, of every kind and with a window", () => {
  for (const [d, sigma] of [[0, 0], [1, 0], [2, 0], [2, 0.7]]) {
    const measured = [made([[1, 2], [-0.5, 0.2], [0.1, -3]], d, sigma), made([[0, 1], [0.4, 4], [-2, 1]], d, sigma)];
    const found = synthesised(freq, measured, d, modes, sigma);
    measured.forEach((one, k) => assert.ok(misfit(one, found[k]) < 1e-6, `${d} ${sigma}: ${misfit(one, found[k])}`));
    // a pole less is an error that is seen
    const fewer = synthesised(freq, measured, d, modes.slice(0, 2), sigma);
    assert.ok(misfit(measured[0], fewer[0]) > 0.1);
    // one that is picked twice changes nothing
    const twice = synthesised(freq, measured, d, [...modes, modes[0]], sigma);
    assert.ok(misfit(measured[0], twice[0]) < 1e-4);
  }
});

test("a sum of auto spectra of the poles is synthesised without error", () => {
  const power = freq.map((f) => {
    const w = 2 * Math.PI * f;
    return modes.reduce((sum, { freq: at, damping }) => { const wn = 2 * Math.PI * at; return sum + 1e6 / ((wn * wn - w * w) ** 2 + (2 * damping * wn * w) ** 2); }, 0.2);
  });
  const sum = synthesisedPower(freq, power, modes);
  for (let k = 0; k < freq.length; k++) assert.ok(Math.abs(sum[k] / power[k] - 1) < 1e-4, `${freq[k]} Hz`);
  const without = synthesisedPower(freq, power, modes.slice(0, 2));
  assert.ok(Math.max(...freq.map((_, k) => Math.abs(Math.log10(Math.max(without[k], 1e-9) / power[k])))) > 0.5);
});

test("functions together are the root of the sum of squares", () => {
  assert.deepEqual(Array.from(together([{ real: [3], imaginary: [0] }, { real: [0], imaginary: [4] }], 1)), [5]);
});

test("frequencies stay under two fingers", () => {
  const [low, high] = pinched([20, 40], [0.25, 0.75]);
  assert.ok(Math.abs(low - 10) < 1e-9 && Math.abs(high - 50) < 1e-9);
  assert.ok(pinched([20, 40], [0.5, 0.5]).every(Number.isNaN));
});

test("the line nearest to a frequency", () => {
  assert.deepEqual([0, 1.4, 1.6, 9].map((hz) => nearestLine([1, 2, 3], hz)), [0, 0, 1, 2]);
});
