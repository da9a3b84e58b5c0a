// Run the unit tests: they are bundled, since Node does not read TypeScript.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { build } from "esbuild";

const folder = mkdtempSync(join(tmpdir(), "femtune-web-"));
const names = readdirSync("test").filter((name) => name.endsWith(".test.ts"));
await build({ entryPoints: names.map((name) => `test/${name}`), outdir: folder, outExtension: { ".js": ".mjs" }, bundle: true, format: "esm", platform: "node" });
const { status } = spawnSync(process.execPath, ["--test", ...names.map((name) => join(folder, name.replace(".ts", ".mjs")))], { stdio: "inherit" });
rmSync(folder, { recursive: true });
process.exit(status ?? 1);
