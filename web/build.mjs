// Bundles of the page, from their source: node build.mjs [folder]. The same source and lock file give the same bytes.
import { readFileSync, rmSync, mkdirSync } from "node:fs";
import { build } from "esbuild";

const folder = process.argv[2] ?? "../src/femtune/reporting/bundle";
rmSync(folder, { recursive: true, force: true });
mkdirSync(folder, { recursive: true });
const common = { bundle: true, minify: true, format: "iife", target: "es2020", charset: "ascii", legalComments: "none" };
// the worker travels as a text inside the script that starts it
const worker = await build({ ...common, entryPoints: ["src/liveworker.ts"], write: false });
for (const name of ["page", "viewer", "live"]) {
  const outfile = `${folder}/${name}.js`;
  await build({
    ...common, entryPoints: [`src/${name}.ts`], outfile,
    define: name === "live" ? { WORKER: JSON.stringify(worker.outputFiles[0].text) } : {},
    banner: name === "viewer" ? { js: `/*! three.js\n\n${licence()}\n*/` } : {},
  });
  // inside a page such a text would end the script
  if (/<\/script|<!--/i.test(readFileSync(outfile, "utf8"))) throw new Error(`${outfile} cannot stand inside a page`);
}

// the licence must go with every copy of the library
function licence() {
  return readFileSync("node_modules/three/LICENSE", "utf8").trim();
}
