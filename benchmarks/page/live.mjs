// Change a parameter of the live model in headless Chromium: node live.mjs web-folder page inputs; prints the times in ms with
// and without software in place of a graphics card, and the processor time of the main thread for an input, which other
// work on the machine does not lengthen.
import { execFileSync } from "node:child_process";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [web, path, inputs] = process.argv.slice(2);
const { chromium } = createRequire(pathToFileURL(resolve(web, "package.json")))("playwright-core");
const found = process.env.FEMTUNE_CHROMIUM ?? execFileSync("sh", ["-c", "command -v chromium || command -v chromium-browser || command -v google-chrome"]).toString().trim();
const software = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
// without 3D the page shows the numbers alone, and nothing is drawn by software in place of a graphics card
const plain = ["--no-sandbox", "--disable-gpu", "--disable-3d-apis"];

async function measured(args) {
  const browser = await chromium.launch({ executablePath: found, args });
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(pathToFileURL(path).href);
  await page.waitForSelector(".livemodel[data-solved]", { timeout: 60000 });
  const times = [Number(await page.locator(".livemodel").getAttribute("data-ms"))], shapes = [];
  const devtools = await context.newCDPSession(page);
  await devtools.send("Performance.enable", { timeDomain: "threadTicks" });
  const busy = async () => {
    const { metrics } = await devtools.send("Performance.getMetrics"), of = (name) => metrics.find((m) => m.name === name).value;
    return 1000 * (of("TaskDuration") - of("DevToolsCommandDuration"));
  };
  let spent = 0;
  const sliders = page.locator(".slider input[type=range]"), count = await sliders.count();
  for (let i = 0; i < Number(inputs); i++) {
    const before = await page.locator(".livemodel").getAttribute("data-solved"), start = await busy();
    await sliders.nth(i % count).focus();
    await page.keyboard.press(i % 2 ? "PageDown" : "PageUp");
    await page.waitForFunction((id) => document.querySelector(".livemodel").dataset.solved !== id, before);
    spent += await busy() - start;
    times.push(Number(await page.locator(".livemodel").getAttribute("data-ms")));
    shapes.push(Number((await page.locator(".livemodel").getAttribute("data-shape-ms")) ?? NaN));
  }
  await browser.close();
  return { times, shapes, main_ms: spent / Number(inputs) };
}

const drawn = await measured(software), numbers = await measured(plain);
console.log(JSON.stringify({ times: drawn.times, shapes: drawn.shapes, main_ms: drawn.main_ms, numbers: numbers.times }));
