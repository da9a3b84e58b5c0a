import assert from "node:assert/strict";
import test from "node:test";
import { crc32, xlsx } from "../src/xlsx.ts";

test("the checksum of ZIP files, by its published check value", () => assert.equal(crc32(new TextEncoder().encode("123456789")), 0xcbf43926));

test("numbers are numbers, and texts stay texts, also those that look like formulas or markup", () => {
  const text = new TextDecoder().decode(xlsx([["Mode", "a & <b>"], ["−1.5e−3", "=1+1"], ["3.2 ± 0.1", "12Z+"]]));
  assert.deepEqual(Array.from(text.matchAll(/<v>([^<]*)<\/v>/g), (m) => m[1]), ["-0.0015"]);
  assert.deepEqual(Array.from(text.matchAll(/<t [^>]*>([^<]*)<\/t>/g), (m) => m[1]), ["Mode", "a &amp; &lt;b&gt;", "=1+1", "3.2 ± 0.1", "12Z+"]);
  assert.ok(!text.includes("<f>"));
});
