// Processor time of a solution of the live model in Node: node solve.mjs web-folder page; prints ms by configuration.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [web, path] = process.argv.slice(2);
const { build } = createRequire(pathToFileURL(resolve(web, "package.json")))("esbuild");
const made = await build({ entryPoints: [resolve(web, "src/livemodel.ts")], bundle: true, format: "esm", platform: "node", write: false });
const { LiveModel } = await import(`data:text/javascript;base64,${Buffer.from(made.outputFiles[0].text).toString("base64")}`);
const { live } = JSON.parse(/<script type="application\/json" id="view">([^<]*)</.exec(readFileSync(path, "utf8"))[1]);
const ends = (which) => live.parameters.map((p) => (p[which] - p.nominal) / p.scale);
const [lower, upper] = [ends("lower"), ends("upper")];
const times = live.configurations.map((c) => {
  const model = new LiveModel(c, lower, upper), at = (share) => live.x.map((v, i) => v + share * 0.3 * ((i % 2 ? upper : lower)[i] - v));
  for (let i = 0; i < 10; i++) model.solve(model.modes(at(i / 10)));
  const start = process.cpuUsage(), count = 20;
  for (let i = 0; i < count; i++) model.solve(model.modes(at(i / count)));
  const { user, system } = process.cpuUsage(start);
  return (user + system) / count / 1000;
});
console.log(JSON.stringify(times));
