// Change a parameter of the live model in headless Chromium: node live.mjs web-folder page inputs; prints the times in ms.
import { execFileSync } from "node:child_process";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [web, path, inputs] = process.argv.slice(2);
const { chromium } = createRequire(pathToFileURL(resolve(web, "package.json")))("playwright-core");
const found = process.env.FEMTUNE_CHROMIUM ?? execFileSync("sh", ["-c", "command -v chromium || command -v chromium-browser || command -v google-chrome"]).toString().trim();
const software = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const browser = await chromium.launch({ executablePath: found, args: software });
const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, reducedMotion: "reduce" });
const page = await context.newPage();
await page.goto(pathToFileURL(path).href);
await page.waitForSelector(".livemodel[data-solved]", { timeout: 60000 });
const times = [Number(await page.locator(".livemodel").getAttribute("data-ms"))];
const sliders = page.locator(".slider input[type=range]"), count = await sliders.count();
for (let i = 0; i < Number(inputs); i++) {
  const before = await page.locator(".livemodel").getAttribute("data-solved");
  await sliders.nth(i % count).focus();
  await page.keyboard.press(i % 2 ? "PageDown" : "PageUp");
  await page.waitForFunction((id) => document.querySelector(".livemodel").dataset.solved !== id, before);
  times.push(Number(await page.locator(".livemodel").getAttribute("data-ms")));
}
await browser.close();
console.log(JSON.stringify(times));
