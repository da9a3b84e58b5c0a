// Load a page in headless Chromium and play its shapes: node measure.mjs web-folder page seconds; prints JSON.
import { execFileSync } from "node:child_process";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [web, path, seconds] = process.argv.slice(2);
const { chromium } = createRequire(pathToFileURL(resolve(web, "package.json")))("playwright-core");
const found = process.env.FEMTUNE_CHROMIUM ?? execFileSync("sh", ["-c", "command -v chromium || command -v chromium-browser || command -v google-chrome"]).toString().trim();
const software = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const browser = await chromium.launch({ executablePath: found, args: software });
const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, reducedMotion: "reduce" });
const page = await context.newPage();
await page.goto(pathToFileURL(path).href);
// until the shapes have been drawn once
const load = await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now())))));
await page.locator(".viewer canvas").scrollIntoViewIfNeeded();
await page.getByRole("button", { name: "Play" }).click();
await page.waitForTimeout(1000);
const frames = await page.evaluate((span) => new Promise((done) => {
  const start = performance.now();
  let count = 0;
  const tick = () => {
    const now = performance.now();
    if (now - start >= span) done((1000 * count) / (now - start));
    else { count += 1; requestAnimationFrame(tick); }
  };
  requestAnimationFrame(tick);
}), 1000 * Number(seconds));
await browser.close();
console.log(JSON.stringify({ load_seconds: load / 1000, frames_per_second: frames }));
