// The report in headless Chromium, as a reader uses it. FEMTUNE_PAGES names the pages (the first has a test and an update),
// FEMTUNE_PICTURES a folder for the pictures that are taken, FEMTUNE_CHROMIUM the browser. With FEMTUNE_FIREFOX, the path of a
// Firefox, the tests of both browsers run there: without a graphics card it has no WebGL, and shows still pictures.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, dirname, join, resolve } from "node:path";
import both, { after, before } from "node:test";
import { pathToFileURL } from "node:url";
import { chromium, firefox } from "playwright-core";

const pages = (process.env.FEMTUNE_PAGES || "../examples/01_building/run/report.html").split(":").map((p) => resolve(p));
const pictures = resolve(process.env.FEMTUNE_PICTURES ?? "../build/pictures");
const axe = readFileSync("node_modules/axe-core/axe.min.js", "utf8");
const inFirefox = process.env.FEMTUNE_FIREFOX;
/** A test of Chromium; `both` is one of both browsers. */
const test = inFirefox ? () => {} : both;
const found = inFirefox || process.env.FEMTUNE_CHROMIUM || execFileSync("sh", ["-c", "command -v chromium || command -v chromium-browser || command -v google-chrome"]).toString().trim();
const software = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
/** Firefox takes from its preferences what Chromium is told for each page. */
const fire = (dark) => firefox.launch({ channel: "moz-firefox", executablePath: found, firefoxUserPrefs: { "ui.prefersReducedMotion": 1, "layout.css.prefers-color-scheme.content-override": dark ? 0 : 1 } });
let browser, darkness;
before(async () => { browser = await (inFirefox ? fire(false) : chromium.launch({ executablePath: found, args: software })); mkdirSync(pictures, { recursive: true }); });
after(async () => { await browser.close(); await darkness?.close(); });
const AS_IT_IS = { colorScheme: null, reducedMotion: null, forcedColors: null, contrast: null };

const named = (path) => `${basename(dirname(dirname(path)))}-${basename(path, ".html")}`;

/** A page that fails the test for anything on the console and for any request but its own file. */
async function open(path, options = {}, from = browser) {
  const size = { viewport: { width: 1280, height: 900 } }, { hasTouch, isMobile, colorScheme, ...others } = options;
  if (inFirefox && colorScheme === "dark") from = darkness ??= await fire(true);
  const context = await from.newContext(inFirefox ? { ...size, ...others, ...AS_IT_IS } : { ...size, acceptDownloads: true, reducedMotion: "reduce", ...options });
  const page = await context.newPage();
  const complaints = [];
  page.on("console", (m) => { if (!/GPU stall due to ReadPixels/.test(m.text())) complaints.push(`console: ${m.text()}`); });
  page.on("pageerror", (e) => complaints.push(`error: ${e.message}`));
  page.on("request", (r) => { if (!/^(file|data|blob):/.test(r.url())) complaints.push(`request: ${r.url()}`); });
  await page.goto(pathToFileURL(path).href);
  const close = async () => { await context.close(); assert.deepEqual(complaints, []); };
  return { page, close };
}

const canvas = (page) => page.locator(".viewer canvas");
const settled = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));
async function still(page) {
  await settled(page);
  return canvas(page).evaluate((c) => c.toDataURL());
}
/** A picture of an element that is drawn to its end: a loaded machine may draw parts of the page later than others. */
async function drawn(element) {
  await element.page().mouse.move(0, 0);
  let before, now = await element.screenshot();
  for (let i = 0; i < 20 && !before?.equals(now); i++) {
    await element.page().waitForTimeout(200);
    [before, now] = [now, await element.screenshot()];
  }
  return now;
}
/** Fails unless the element soon looks as it did: a browser may draw a part of the page a few frames late. */
async function looks(element, picture) {
  // a picture scrolls the element into view: a button that comes to lie under the pointer looks different
  await element.page().mouse.move(0, 0);
  for (let i = 0; i < 20; i++) {
    if (picture.equals(await element.screenshot())) return;
    await element.page().waitForTimeout(200);
  }
  assert.fail("the element looks different");
}
/** A picture of a page or a part of it. Not in Firefox, where it needs a style in the page, which the policy of the page refuses. */
const photograph = async (of, name) => { if (!inFirefox) await of.screenshot({ path: join(pictures, `${name}.png`) }); };
/** What is typed into a field in place of its text. */
async function enter(field, text) {
  await field.focus();
  await field.evaluate((e) => e.select());
  await field.page().keyboard.press("Delete");
  await field.page().keyboard.type(text);
}
/** The next file that is saved; of Firefox, which tells nobody of its downloads, the text that the page saves. */
function saving(page) {
  if (!inFirefox) return page.waitForEvent("download");
  return page.evaluate(() => new Promise((done) => {
    const own = URL.createObjectURL;
    URL.createObjectURL = (blob) => { URL.createObjectURL = own; void blob.text().then(done); return own.call(URL, blob); };
  }));
}
const viewOf = (page) => page.evaluate(() => JSON.parse(document.getElementById("view").textContent));
const contents = async (download) => { const saved = await download; return (typeof saved === "string" ? saved : readFileSync(await saved.path(), "utf8")).replace(/^\ufeff/, ""); };

/** Fields of CSV (RFC 4180). */
function fields(text) {
  const rows = [[]];
  for (const [, quoted, plain, end] of text.matchAll(/(?:"((?:[^"]|"")*)"|([^",\r\n]*))(,|\r\n)/g)) {
    rows[rows.length - 1].push(quoted === undefined ? plain : quoted.replaceAll('""', '"'));
    if (end !== ",") rows.push([]);
  }
  return rows.slice(0, -1);
}

test("a cell of the MAC matrix shows its pair, the rest of the page stays", async () => {
  const { page, close } = await open(pages[0]);
  const data = await viewOf(page);
  const stage = data.scenes[0].stages.at(-1);
  assert.equal(await page.locator(".viewer").getAttribute("data-shown"), `${stage.pairs[0].test}|${stage.pairs[0].column}`);
  await page.locator(".viewer").scrollIntoViewIfNeeded();
  const before = await still(page);
  const [table, nav] = [await drawn(page.locator("#modes")), await drawn(page.locator("nav"))];
  const pair = stage.pairs[2];
  await page.locator("table.mac button.pair").nth(2).click();
  assert.equal(await page.locator(".viewer").getAttribute("data-shown"), `${pair.test}|${pair.column}`);
  assert.match(await page.locator(".viewer .shown").textContent(), new RegExp(`Test mode ${data.scenes[0].test_labels[pair.test]}, .*model mode ${stage.numbers[pair.column]}`));
  assert.notEqual(await still(page), before);
  await looks(page.locator("#modes"), table);
  await looks(page.locator("nav"), nav);
  await close();
});

test("shapes move while it plays, and stand when it is paused", async () => {
  const { page, close } = await open(pages[0]);
  await page.locator(".viewer").scrollIntoViewIfNeeded();
  const standing = await still(page);
  await page.waitForTimeout(300);
  assert.equal(await still(page), standing, "reduced motion is asked for, so that nothing moves by itself");
  await page.getByRole("button", { name: "Play" }).click();
  await page.waitForTimeout(500);
  const first = await still(page);
  await page.waitForTimeout(300);
  assert.notEqual(await still(page), first);
  await page.getByRole("button", { name: "Pause" }).click();
  const paused = await still(page);
  await page.waitForTimeout(300);
  assert.equal(await still(page), paused);
  await close();
});

test("the pointer shows number and motion of a point, and so do keys", async () => {
  const { page, close } = await open(pages[0]);
  await canvas(page).scrollIntoViewIfNeeded();
  await settled(page);
  const box = await canvas(page).boundingBox(), tip = page.locator(".viewer .tip"), told = new Set(), scene = (await viewOf(page)).scenes[0];
  for (let i = 1; i < 20; i++) for (const y of [0.12, 0.25, 0.5]) {
    await page.mouse.move(box.x + (i * box.width) / 20, box.y + y * box.height);
    if (await tip.isVisible()) told.add(await tip.textContent());
  }
  assert.ok(told.size > 1, "points are found by the pointer");
  for (const text of told) assert.match(text, /^(Test point \d+|Point \d+|Test): [\d.]+ % of the largest displacement$/);
  await canvas(page).focus();
  const stepped = new Set();
  for (let i = 0; i < scene.points.shape[0]; i++) { await page.keyboard.press("n"); stepped.add((await tip.textContent()).split(":")[0]); }
  assert.equal(stepped.size, scene.points.shape[0], "every point has a number of its own");
  assert.ok(Array.from(stepped).every((name) => /^Point \d+$/.test(name)));
  await close();
});

test("the motion is saved as a film and as pictures", async (t) => {
  const { page, close } = await open(pages[0]);
  await canvas(page).scrollIntoViewIfNeeded();
  let download = page.waitForEvent("download");
  await page.getByRole("button", { name: "Save the motion as PNG frames" }).click();
  const archive = readFileSync(await (await download).path());
  const names = archive.toString("latin1").match(/frame-\d\d\.png/g);
  assert.equal(new Set(names).size, 36);
  const starts = Array.from(archive.toString("latin1").matchAll(/\x89PNG/g), (m) => m.index);
  assert.equal(starts.length, 36);
  const pictures_ = new Set(starts.slice(0, 10).map((at, k) => archive.subarray(at, starts[k + 1] - 50).toString("base64").slice(0, 4000)));
  assert.equal(pictures_.size, 10, "the pictures differ");
  const maker = page.getByRole("button", { name: "Save the motion as a film" });
  if (await maker.count()) {
    download = page.waitForEvent("download");
    await maker.click();
    const film = readFileSync(await (await download).path());
    assert.ok(film.length > 5000);
    assert.ok(film.subarray(0, 4).equals(Buffer.from([0x1a, 0x45, 0xdf, 0xa3])) || film.subarray(4, 8).toString() === "ftyp");
  } else t.diagnostic("this browser makes no films");
  await close();
});

test("a cursor reads functions, as magnitude and phase and as a Nyquist plot, and shows the operating shape", async (t) => {
  const path = pages.find((p) => /"operating":\{/.test(readFileSync(p, "utf8")));
  if (!path) return t.skip("no page has functions at points of a geometry");
  const { page, close } = await open(path);
  const box = page.locator("#fit .functions"), plot = box.locator("svg.plot"), read = box.locator(".readout");
  await plot.scrollIntoViewIfNeeded();
  const frame = await plot.boundingBox();
  await page.mouse.click(frame.x + 0.5 * frame.width, frame.y + 0.4 * frame.height);
  const first = await read.textContent();
  assert.match(first, /^[\d.]+ Hz: test [\d.e−]+ at −?[\d.]+°; identified test [\d.e−]+ at −?[\d.]+°$/);
  assert.match(await page.locator(".viewer .shown").textContent(), /^Operating shape at [\d.]+ Hz, force at \S+: \d+ measured functions$/);
  const shape = await still(page);
  await plot.focus();
  await page.keyboard.press("ArrowRight");
  assert.notEqual(await read.textContent(), first);
  for (let i = 0; i < 3; i++) await page.keyboard.press("Shift+ArrowRight");
  assert.notEqual(await still(page), shape);
  const d = await plot.locator("path[data-look=test]").first().getAttribute("d");
  await box.getByRole("combobox", { name: /^Plot/ }).selectOption("Nyquist");
  assert.notEqual(await plot.locator("path[data-look=test]").first().getAttribute("d"), d);
  assert.equal(await plot.locator("circle.cursor").count(), 2);
  assert.match(await plot.getAttribute("aria-label"), /Nyquist/);
  await plot.focus();
  await page.keyboard.press("Escape");
  assert.equal(await read.textContent(), "");
  assert.match(await page.locator(".viewer .shown").textContent(), /mode/i);
  await close();
});

/** A browser of a telephone: fingers, and no mouse. */
async function telephone(path, act) {
  const own = await chromium.launch({ executablePath: found, args: [...software, "--blink-settings=primaryPointerType=2,availablePointerTypes=2,primaryHoverType=1,availableHoverTypes=1"] });
  const opened = await open(path, { viewport: { width: 390, height: 800 }, hasTouch: true, isMobile: true }, own);
  const session = await opened.page.context().newCDPSession(opened.page);
  const touch = (type, ...points) => session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  try {
    await act({ ...opened, touch });
    await opened.close();
  } finally { await own.close(); }
}

for (const path of pages) {
  test(`${named(path)}: targets of 44 px, two fingers that zoom, swipes that scroll`, async () => {
    await telephone(path, async ({ page, touch }) => {
      await page.waitForTimeout(1500);
      const small = await page.evaluate(() => Array.from(document.querySelectorAll("button, select, summary, nav a, input[type=number], input[type=text]")).filter((e) => e.checkVisibility?.() ?? e.offsetParent).map((e) => [e.getBoundingClientRect(), e])
        .filter(([r]) => r.width > 0 && (r.width < 43.5 || r.height < 43.5)).map(([r, e]) => `${e.outerHTML.slice(0, 90)} ${r.width}×${r.height}`));
      assert.deepEqual(small.slice(0, 5), []);
      assert.equal(await page.evaluate(() => document.documentElement.scrollWidth - innerWidth), 0);
      for (const one of [".viewer canvas", "svg.plot"]) {
        const place = page.locator(one).first();
        if (!(await place.count())) continue;
        await place.evaluate((e) => e.scrollIntoView({ block: "center", behavior: "instant" }));
        await settled(page);
        const r = await place.boundingBox(), [x, y] = [r.x + r.width / 2, r.y + r.height / 2], at = await page.evaluate(() => scrollY);
        const looks_ = () => place.evaluate((e) => (e.tagName === "CANVAS" ? e.toDataURL() : e.innerHTML)), before = await looks_();
        await touch("touchStart", [x - 30, y], [x + 30, y]);
        for (let k = 1; k < 8; k++) await touch("touchMove", [x - 30 - 8 * k, y], [x + 30 + 8 * k, y]);
        await touch("touchEnd");
        await settled(page);
        assert.notEqual(await looks_(), before, `${one}: two fingers zoom`);
        assert.equal(await page.evaluate(() => visualViewport.scale), 1);
        await touch("touchStart", [x, y]);
        for (let k = 1; k < 10; k++) { await touch("touchMove", [x, y - 25 * k]); await page.waitForTimeout(20); }
        await touch("touchEnd");
        await page.waitForTimeout(300);
        assert.ok((await page.evaluate(() => scrollY)) > at + 60, `${one}: a swipe scrolls the page`);
      }
    });
  });
}

test("it plays by itself where nothing speaks against motion", async () => {
  const { page, close } = await open(pages[0], { reducedMotion: "no-preference" });
  await canvas(page).scrollIntoViewIfNeeded();
  await page.waitForTimeout(500);
  const first = await still(page);
  await page.waitForTimeout(300);
  assert.notEqual(await still(page), first);
  await close();
});

test("pointer, wheel, phase, scale, windows, colours and arrows change the picture", async () => {
  const { page, close } = await open(pages[0]);
  await canvas(page).scrollIntoViewIfNeeded();
  let last = await still(page);
  const changes = async (what, act) => {
    await act();
    const now = await still(page);
    assert.notEqual(now, last, what);
    last = now;
  };
  const box = await canvas(page).boundingBox();
  const set = (label, value) => page.getByLabel(label, { exact: true }).fill(String(value));
  await changes("turn", async () => {
    await page.mouse.move(box.x + 100, box.y + 100);
    await page.mouse.down();
    await page.mouse.move(box.x + 180, box.y + 130);
    await page.mouse.up();
  });
  await changes("zoom", async () => { await canvas(page).focus(); await page.mouse.move(box.x + 100, box.y + 100); await page.mouse.wheel(0, -300); });
  await changes("reset", () => page.locator(".viewer").getByRole("button", { name: "reset" }).click());
  await changes("phase", () => set("Phase", 180));
  await changes("scale", () => set("Scale", 2));
  await changes("view", () => page.locator(".viewer").getByRole("button", { name: "View along z" }).click());
  await changes("overlaid", () => page.getByLabel("Windows").selectOption("overlaid"));
  await changes("arrows", () => page.getByLabel("Arrows").uncheck());
  await changes("difference", () => page.getByRole("combobox", { name: /^Colour/ }).selectOption("difference to the test"));
  await changes("model before", () => page.locator(".viewer").getByLabel(/^Model/).selectOption("before"));
  await close();
});

test("the keyboard alone is enough", async () => {
  const { page, close } = await open(pages[0]);
  await page.locator("table.mac button[aria-pressed=true]").focus();
  const chosen = await page.locator(".viewer").getAttribute("data-shown");
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Enter");
  assert.notEqual(await page.locator(".viewer").getAttribute("data-shown"), chosen);
  let stops = 0;
  while (!(await page.evaluate(() => document.activeElement.tagName === "CANVAS"))) {
    await page.keyboard.press("Tab");
    assert.ok(++stops < 30, "the picture cannot be reached by the tab key");
  }
  let last = await still(page);
  for (const key of ["ArrowLeft", "ArrowUp", "+", "0"]) {
    await page.keyboard.press(key);
    const now = await still(page);
    assert.notEqual(now, last, key);
    last = now;
  }
  await page.keyboard.press(" ");
  assert.equal(await page.locator(".viewer .play").textContent(), "Pause");
  await close();
});

test("a row of the table of modes shows its pair", async () => {
  const { page, close } = await open(pages[0]);
  const data = await viewOf(page), stage = data.scenes[0].stages.at(-1), pair = stage.pairs[1];
  await page.getByRole("button", { name: `Show the shapes of test mode ${data.scenes[0].test_labels[pair.test]}`, exact: true }).first().click();
  assert.equal(await page.locator(".viewer").getAttribute("data-shown"), `${pair.test}|${pair.column}`);
  await close();
});

both("the slider goes through the iterations", async () => {
  const { page, close } = await open(pages[0]);
  const { history } = await viewOf(page);
  const cell = (row, column) => page.locator(".iterations table").first().locator("tbody tr").nth(row).locator("td").nth(column).textContent();
  const number = (text) => Number(text.replaceAll("−", "-"));
  for (const k of [0, 1, history.iterations.length - 1]) {
    await page.getByLabel("Iteration", { exact: true }).fill(String(k));
    for (const i of [0, history.parameters.length - 1]) assert.ok(Math.abs(number(await cell(i, 2)) / history.values[k][i] - 1) < 1e-4);
  }
  if (history.modes.length) {
    await page.getByLabel("Iteration", { exact: true }).fill("0");
    const shown = await page.locator(".iterations table").nth(1).locator("tbody tr").first().locator("td").nth(1).textContent();
    assert.ok(Math.abs(number(shown) / history.modes[0].freq_hz[0] - 1) < 1e-3);
  }
  await close();
});

both("tables sort, and their CSV is what they show", async () => {
  const { page, close } = await open(pages[0]);
  const table = page.locator("#parameters table").first();
  const shown = () => table.evaluate((t) => Array.from(t.tBodies[0].rows, (r) => Array.from(r.cells, (c) => c.textContent.replace(/\s+/g, " ").trim())));
  const plain = (text) => (/^[−+]?[\d.]/.test(text) ? text.replaceAll("−", "-") : text);
  const saved = saving(page);
  await page.locator("#parameters").getByRole("button", { name: "Save table as CSV" }).first().click();
  const rows = fields(await contents(saved));
  assert.deepEqual(rows.slice(1), (await shown()).map((r) => r.map(plain)));
  const book = saving(page);
  await page.locator("#parameters").getByRole("button", { name: "Save table as XLSX" }).first().click();
  // parts of the file are stored as they are
  const sheet = /<sheetData>(.*)<\/sheetData>/s.exec(await contents(book))[1];
  const cells = Array.from(sheet.matchAll(/<row>(.*?)<\/row>/gs), ([, row]) => Array.from(row.matchAll(/<c(?: t="inlineStr")?>(?:<v>(.*?)<\/v>|<is><t [^>]*>(.*?)<\/t><\/is>)<\/c>/gs), ([, number, text]) => number ?? text));
  const number = (text) => (/^[−+]?[\d.]+(e[−+]?\d+)?$/.test(text) ? String(Number(text.replaceAll("−", "-"))) : text.replaceAll("&", "&amp;").replaceAll("<", "&lt;"));
  assert.deepEqual(cells.slice(1), (await shown()).map((r) => r.map(number)));
  const before = await shown();
  await table.locator("th .sort").first().click();
  await table.locator("th .sort").first().click();
  assert.equal(await table.locator("thead tr").last().locator("th").first().getAttribute("aria-sort"), "descending");
  assert.notDeepEqual(await shown(), before);
  assert.deepEqual((await shown()).map(String).sort(), before.map(String).sort());
  await close();
});

test("pictures are saved as they are, and as images", async () => {
  const { page, close } = await open(pages[0]);
  const figure = page.locator("#mac figure").first();
  const source = await figure.locator("img").evaluate((i) => new TextDecoder().decode(Uint8Array.from(atob(i.src.split(",")[1]), (c) => c.charCodeAt(0))));
  let saved = page.waitForEvent("download");
  await figure.getByRole("button", { name: "Save picture as SVG" }).click();
  assert.equal(await contents(saved), source);
  saved = page.waitForEvent("download");
  await figure.getByRole("button", { name: "Save picture as PNG" }).click();
  const png = readFileSync(await (await saved).path());
  assert.deepEqual([...png.subarray(1, 4)], [...Buffer.from("PNG")]);
  await close();
});

both("functions zoom, and their CSV is what the page holds", async (t) => {
  const path = pages.find((p) => /"functions":\[\{"configuration":"[^"]*","ordinate":"[^"]*","titles":\[[^\]]*\],"curves"/.test(readFileSync(p, "utf8")));
  if (!path) return t.skip("no page has frequency response functions");
  const { page, close } = await open(path);
  const plot = page.locator(".live > .functions svg.plot").first();
  await plot.scrollIntoViewIfNeeded();
  const range = async () => (await plot.getAttribute("data-range")).split(" ").map(Number);
  const whole = await range(), box = await plot.boundingBox();
  await page.mouse.move(box.x + 0.4 * box.width, box.y + 80);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.6 * box.width, box.y + 90);
  await page.mouse.up();
  const closer = await range();
  assert.ok(closer[0] > whole[0] && closer[1] < whole[1]);
  await plot.focus();
  await page.keyboard.press("0");
  assert.deepEqual(await range(), whole);
  const saved = saving(page);
  await page.locator(".live > .functions").getByRole("button", { name: "Save the curves as CSV" }).first().click();
  const rows = fields(await contents(saved)).slice(1);
  const values = (await viewOf(page)).functions[0].curves.at(-1);
  const real = new Float32Array(Uint8Array.from(Buffer.from(values.real.data, "base64")).buffer);
  const last = rows.slice(-values.freq_hz.shape[0]).map((r) => Number(r[2]));
  assert.deepEqual(last, Array.from(real.subarray(0, values.freq_hz.shape[0])));
  await close();
});

both("one picture has the test as measured, as identified and with equal damping, and the model before and after", async (t) => {
  const path = pages.find((p) => /"look":"equalised"/.test(readFileSync(p, "utf8")));
  if (!path) return t.skip("no page has a test with equal damping");
  const { page, close } = await open(path);
  const data = await viewOf(page), held = data.functions.find((f) => f.section === "measured_damping");
  const words = { test: "test", identified: "identified test", equalised: "test, equal damping", before: "model before", after: "model after", model: "model" };
  const f4 = (packed) => new Float32Array(Uint8Array.from(Buffer.from(packed.data, "base64")).buffer);
  for (const [place, looks] of [["#measured_damping", ["test", "identified", "equalised", "before", "after"]], [".iterations", ["test", "identified", "equalised", "before", "model"]]]) {
    const plot = page.locator(`${place} .functions`).first();
    assert.deepEqual(await plot.locator("[data-look]").evaluateAll((all) => all.map((e) => e.dataset.look).sort()), looks.toSorted());
    assert.deepEqual((await plot.locator(".looks label").allTextContents()).toSorted(), looks.map((look) => words[look]).toSorted());
  }
  const plot = page.locator("#measured_damping .functions").first();
  const csv = page.waitForEvent("download");
  await plot.getByRole("button", { name: "Save the curves as CSV" }).click();
  const rows = fields(await contents(csv)).slice(1);
  for (const curve of held.curves) {
    const [hz, real, imaginary] = [curve.freq_hz, curve.real, curve.imaginary].map(f4);
    const own = Array.from(hz, (f, i) => [f, real[i], imaginary[i]]).filter(([, a, b]) => a || b);
    assert.ok(own.length > 10, curve.look);
    assert.deepEqual(rows.filter((r) => r[0] === words[curve.look]).map((r) => r.slice(1).map(Number)), own);
  }
  const book = page.waitForEvent("download");
  await plot.getByRole("button", { name: "Save the curves as XLSX" }).click();
  const cells = Array.from((await contents(book)).matchAll(/<row>(.*?)<\/row>/gs), ([, row]) => Array.from(row.matchAll(/<c(?: t="inlineStr")?>(?:<v>(.*?)<\/v>|<is><t [^>]*>(.*?)<\/t><\/is>)<\/c>/gs), ([, number, text]) => number ?? text));
  assert.deepEqual(cells.slice(1).map(([look, ...values]) => [look, ...values.map(Number)]), rows.map(([look, ...values]) => [look, ...values.map(Number)]));
  await plot.getByRole("checkbox", { name: "test, equal damping" }).uncheck();
  assert.equal(await plot.locator("[data-look=equalised]").count(), 0);
  await close();
});

for (const path of pages.slice(1)) {
  test(`${named(path)}: modes, motion and fields of colour`, async (t) => {
    const { page, close } = await open(path);
    if (!(await canvas(page).count())) { await close(); return t.skip("the page has no shapes"); }
    await page.locator(".viewer").scrollIntoViewIfNeeded();
    let last = await still(page);
    const changes = async (what, act) => {
      await act();
      const now = await still(page);
      assert.notEqual(now, last, what);
      last = now;
    };
    const cells = page.locator(".viewer .modes button, .viewer table.mac button.pair");
    await changes("mode", () => cells.last().click());
    await changes("phase", () => page.getByLabel("Phase", { exact: true }).fill("90"));
    await changes("phase", () => page.getByLabel("Phase", { exact: true }).fill("20"));
    const colour = page.getByRole("combobox", { name: /^Colour/ });
    const fields = await colour.count() ? await colour.locator("option:not([disabled])").allTextContents() : [];
    for (const field of fields.slice(1)) {
      await changes(field, () => colour.selectOption(field));
      const told = await page.locator(".viewer .legend").textContent();
      assert.match(told, new RegExp(field.split(" ")[0], "i"));
      assert.match(told, /%/);
      assert.match(await canvas(page).getAttribute("aria-label"), new RegExp(`Colour: ${field.split(" ")[0]}`, "i"));
    }
    await close();
  });
}

test("a complex mode moves also a quarter of a period later, when a real one stands", async (t) => {
  const path = pages.find((p) => /"motion_imaginary":\{/.test(readFileSync(p, "utf8")));
  if (!path) return t.skip("no page has complex modes");
  const { page, close } = await open(path);
  await canvas(page).scrollIntoViewIfNeeded();
  const at = async (phase, scale) => {
    await page.getByLabel("Phase", { exact: true }).fill(String(phase));
    await page.getByLabel("Scale", { exact: true }).fill(String(scale));
    return still(page);
  };
  assert.equal(await at(0, 0), await at(90, 0));
  assert.notEqual(await at(90, 3), await at(90, 0));
  assert.match(await page.locator(".viewer .shown").textContent(), /[Cc]omplex model mode .*damping/);
  await close();
});

both("the slider moves the compared functions, and their CSV is what the page holds", async (t) => {
  // a live model has functions of a test too, and no iterations
  const path = pages.find((p) => [/"history":\{/, /"test_real":\{/].every((has) => has.test(readFileSync(p, "utf8"))));
  if (!path) return t.skip("no page compares functions");
  const { page, close } = await open(path);
  const { history } = await viewOf(page);
  const functions = history.functions[0], last = history.iterations.length - 1;
  const curve = (look) => page.locator(`.iterations svg.plot path[data-look=${look}]`).first().getAttribute("d");
  const slide = (k) => page.getByLabel("Iteration", { exact: true }).fill(String(k));
  await slide(0);
  const start = await curve("model");
  assert.equal(start, await curve("before"));
  await slide(last);
  assert.notEqual(await curve("model"), start);
  const saved = page.waitForEvent("download");
  await page.locator(".iterations").getByRole("button", { name: "Save the curves as CSV" }).first().click();
  const rows = fields(await contents(saved)).slice(1), lines = functions.freq_hz.shape[0];
  const stored = [functions.real, functions.imaginary].map(({ data }) =>
    new Float32Array(Uint8Array.from(Buffer.from(data, "base64")).buffer).subarray(last * lines, (last + 1) * lines));
  // zeros stand for lines that are not compared
  const compared = Array.from(stored[0], (real, i) => [real, stored[1][i]]).filter(([real, imaginary]) => real || imaginary);
  assert.ok(compared.length > 10);
  assert.deepEqual(rows.slice(-compared.length).map((r) => [Number(r[2]), Number(r[3])]), compared);
  await close();
});

test("without scripts and without WebGL the still pictures are there", async () => {
  const plain = await browser.newContext({ javaScriptEnabled: false, viewport: { width: 1280, height: 900 } });
  const page = await plain.newPage();
  await page.goto(pathToFileURL(pages[0]).href);
  assert.ok(await page.locator("#mode_shapes figure img").first().isVisible());
  assert.equal(await page.locator(".viewer, .tools, .live").count(), 0);
  await plain.close();
  const without = await chromium.launch({ executablePath: found, args: ["--no-sandbox", "--disable-gpu", "--disable-3d-apis"] });
  const other = await (await without.newContext()).newPage();
  await other.goto(pathToFileURL(pages[0]).href);
  assert.ok(await other.locator("#mode_shapes figure img").first().isVisible());
  assert.equal(await other.locator(".viewer").count(), 0);
  await without.close();
});

for (const path of pages) {
  // both schemes and both widths of the first page, of others the one where most can go wrong
  const looked = path === pages[0] ? [["light", 1280], ["dark", 800], ["light", 390]] : inFirefox ? [] : [["dark", 800]];
  for (const [scheme, width] of looked) {
    both(`${named(path)}, ${scheme}, ${width} pixels: no serious finding of axe-core, no line wider than the window`, async () => {
      const { page, close } = await open(path, { colorScheme: scheme, viewport: { width, height: 900 } });
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
      for (const place of ["header", ".viewer", ".live .iterations", ".chooser .by-part", ".stabilisation", "svg.plot", "#parameters"]) {
        const part = page.locator(place).first();
        if (!(await part.count())) continue;
        await part.evaluate((e) => e.scrollIntoView({ block: "start", behavior: "instant" }));
        await settled(page);
        await photograph(page, `${named(path)}-${scheme}-${width}-${place.replace(/\W+/g, "")}`);
      }
      assert.equal(wide, 0);
      await page.evaluate(axe);
      const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
      const serious = violations.filter((v) => ["serious", "critical"].includes(v.impact));
      assert.deepEqual(serious.map((v) => `${v.id}: ${v.help}: ${v.nodes.slice(0, 3).map((n) => n.html.slice(0, 120)).join(" | ")}`), []);
      await close();
    });
  }
  test(`${named(path)}: print shows stills and no controls`, async () => {
    const { page, close } = await open(path);
    await page.emulateMedia({ media: "print" });
    assert.equal(await page.locator(".viewer:visible, .tools:visible, .live:visible").count(), 0);
    if (await page.locator(".stills").count()) assert.ok(await page.locator(".stills figure img").first().isVisible());
    await page.pdf({ path: join(pictures, `${named(path)}.pdf`), preferCSSPageSize: true });
    await close();
  });
}

both("poles are picked, named and dropped by pointer and keys, and saved as a choice", async (t) => {
  const path = pages.find((p) => /"stabilisation":\{/.test(readFileSync(p, "utf8")));
  if (!path) return t.skip("no page has a stabilisation diagram");
  const { page, close } = await open(path);
  const data = (await viewOf(page)).stabilisation, box = page.locator(".stabilisation"), rows = box.locator("tbody tr");
  const count = data.picked.length;
  assert.equal(await rows.count(), count);
  const saved = async () => {
    const download = saving(page);
    await box.getByRole("button", { name: "Save choices.toml" }).click();
    return (await contents(download)).split("[[mode]]").slice(1);
  };
  const before = await saved();
  assert.equal(before.length, count);
  await box.locator(`[data-pole="${data.picked[0].row}"]`).click();
  assert.equal(await rows.count(), count - 1);
  assert.deepEqual(await saved(), before.slice(1));
  await rows.first().locator("input").fill('a "name"');
  assert.match((await saved())[0], /name = "a \\"name\\""/);
  await box.locator("svg.plot[role=application]").focus();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Enter");
  const after = await rows.count();
  assert.ok(Math.abs(after - (count - 1)) === 1, "the pole under the cursor was picked or dropped");
  await box.getByRole("button", { name: "as identified" }).click();
  assert.deepEqual(await saved(), before);
  await close();
});

const femtune = resolve(process.env.FEMTUNE_COMMAND ?? "../.venv/bin/femtune");
/** Runs femtune; its result is in the files that it writes. A verdict that is not a pass is a result too. */
function run(...arguments_) {
  try { execFileSync(femtune, [...arguments_, "--quiet"], { encoding: "utf8", stdio: "pipe", env: { ...process.env, OMP_NUM_THREADS: "1" } }); }
  catch (error) { if (error.status > 3) throw new Error(`${arguments_.join(" ")}: ${error.stderr}`); }
}

test("poles: the synthesis follows what is picked, and the saved file gives the same modes to the command", async (t) => {
  const path = pages.find((p) => /"stabilisation":\{/.test(readFileSync(p, "utf8")));
  if (!path) return t.skip("no page has a stabilisation diagram");
  const { page, close } = await open(path);
  const data = (await viewOf(page)).stabilisation, box = page.locator(".stabilisation"), told = box.locator("p", { hasText: "Synthesis of the picked poles" });
  const error = async () => Number(/error ([\d.]+) % in the median/.exec(await told.textContent())[1]);
  const curve = (look) => box.locator(`[data-curve=${look}]`), first = await error(), drawn = await curve("synthesis").getAttribute("d");
  assert.ok(first < 10);
  assert.equal(await box.locator(".functions [data-look=picked]").count(), 1);
  await box.locator(`[data-pole="${data.picked.at(-1).row}"]`).click();
  assert.ok((await error()) > 1.5 * first, "a mode less is missed");
  assert.notEqual(await curve("synthesis").getAttribute("d"), drawn);
  await box.getByLabel("synthesis of the picked poles").uncheck();
  assert.equal(await curve("synthesis").count(), 0);
  await box.getByLabel("Behind the poles").selectOption("singular values (CMIF)");
  assert.equal(await curve("measured").count(), data.singular_db.shape[0]);
  await box.getByRole("button", { name: "as identified" }).click();
  assert.ok(Math.abs((await error()) / first - 1) < 1e-6);
  await box.locator("tbody input").first().fill("lowest");
  const download = page.waitForEvent("download");
  await box.getByRole("button", { name: "Save choices.toml" }).click();
  const folder = mkdtempSync(join(tmpdir(), "femtune-")), file = join(folder, "choices.toml"), measured = join(dirname(path), "..", data.inputs[0].path);
  await (await download).saveAs(file);
  await close();
  if (existsSync(femtune) && existsSync(measured)) {
    run("identify", measured, "--order", String(Math.max(...Buffer.from(data.order.data, "base64"))), "--choices", file, "--output", join(folder, "again"));
    const modesOf = (where) => JSON.parse(readFileSync(join(where, "identified.json"), "utf8")).modes;
    const modes = modesOf(join(folder, "again")), then = modesOf(dirname(path));
    assert.deepEqual(modes.map((m) => m.freq_hz), then.map((m) => m.freq_hz));
    assert.deepEqual(modes.map((m) => m.damping_ratio), then.map((m) => m.damping_ratio));
    assert.equal(modes[0].label, "lowest");
  } else t.diagnostic("the command was not run: it or the measured file is not there");
  rmSync(folder, { recursive: true });
});

test("a parameter by a click on a part, and a pair, come back to the study by the saved file", async (t) => {
  const { page, close } = await open(pages[0]);
  const view = await viewOf(page), scene = view.scenes.find((s) => s.line_parts);
  if (!scene) { await close(); return t.skip("no part of the structure has fields"); }
  const box = page.locator(".chooser"), picture = box.locator(".parts canvas"), own = box.locator(".of-part");
  await picture.scrollIntoViewIfNeeded();
  const frame = await picture.boundingBox(), seen = new Set();
  // clicks all over the picture find every part that can be chosen
  for (let i = 1; i < 10; i++) for (let k = 1; k < 10; k++) {
    await page.mouse.click(frame.x + (i * frame.width) / 10, frame.y + (k * frame.height) / 10);
    seen.add(await picture.getAttribute("data-part"));
  }
  assert.ok(seen.size > 2, `parts that clicks have found: ${Array.from(seen)}`);
  const boxes = own.locator("input[type=checkbox]");
  const open_ = await boxes.evaluateAll((all) => all.findIndex((b) => !b.checked));
  assert.ok(open_ >= 0);
  await boxes.nth(open_).check();
  const field = (await own.locator("label").nth(open_).textContent()).split(" = ")[0];
  const text = box.locator("textarea");
  assert.ok((await text.inputValue()).includes(`field = "${field}"`));
  // the same by keys: the list of parts, and Space on the box
  await box.getByRole("combobox", { name: /^Part/ }).selectOption({ index: 1 });
  await boxes.first().focus();
  const was = await boxes.first().isChecked();
  await page.keyboard.press("Space");
  assert.notEqual(await boxes.first().isChecked(), was);
  await page.keyboard.press("Space");
  const of = view.choices.configurations[0], [test_, model] = of.pairs[0];
  await box.locator("table.mac button.of-run").first().click();
  const download = page.waitForEvent("download");
  await box.getByRole("button", { name: "Save choices.toml" }).click();
  const folder = mkdtempSync(join(tmpdir(), "femtune-")), file = join(folder, "choices.toml"), study = join(dirname(pages[0]), "..", "study.toml");
  await (await download).saveAs(file);
  await close();
  if (existsSync(femtune) && existsSync(study)) {
    run("run", study, "--choices", file, "--output", join(folder, "again"));
    const results = JSON.parse(readFileSync(join(folder, "again", "results.json"), "utf8"));
    assert.ok(results.parameters.some((p) => p.fields.includes(field)), field);
    const pair = results.correlations.find((c) => c.stage === "before" && c.configuration === of.configuration).pairs.find((p) => p.fixed_by_hand);
    assert.deepEqual([pair.test_label, pair.model_number], [test_, model]);
    // the page of the run with the choices begins with them
    const again = await open(join(folder, "again", "report.html")), chosen = (await viewOf(again.page)).choices;
    assert.deepEqual(chosen.configurations[0].fixed, [[test_, model]]);
    assert.ok(chosen.fields.find((f) => f.field === field).chosen);
    await again.close();
  } else t.diagnostic("the command was not run: it or the study is not there");
  rmSync(folder, { recursive: true });
});

/** The live model once it has checked its points and solved the update. */
async function live(options) {
  const opened = await open(pages[0], options);
  await opened.page.waitForSelector(".livemodel[data-solved]");
  return { ...opened, panel: opened.page.locator(".livemodel") };
}
/** The numbers of the table of frequencies: rows of updated, now, error and MAC. */
const frequencies = (panel) => panel.locator("table").first().locator("tbody tr").evaluateAll((rows) => rows.map((r) => Array.from(r.cells).slice(2).map((c) => Number.parseFloat(c.textContent.replace("−", "-")))));
/** Acts, and waits until the answer to it is shown. */
async function answered(panel, act) {
  const before = await panel.getAttribute("data-solved");
  await act();
  await panel.page().waitForFunction((id) => document.querySelector(".livemodel").dataset.solved !== id, before);
}

both("the live model begins at the update, and the policy lets it start its worker and nothing else", async () => {
  const { page, panel, close } = await live();
  const policy = await page.locator("meta[http-equiv=Content-Security-Policy]").getAttribute("content");
  assert.match(policy, /default-src 'none'.*worker-src blob:/);
  assert.equal(await panel.locator(".answers > .shown").textContent(), "These are the updated values.");
  const data = await viewOf(page), rows = await frequencies(panel);
  const stage = data.scenes[0].stages.at(-1), paired = data.live.configurations[0].pairs;
  assert.ok(paired.length > 3);
  for (const [test, mode] of paired) {
    assert.equal(rows[test][0], rows[test][1]);
    // the deck as written has rounded values
    assert.ok(Math.abs(rows[test][1] / stage.freq_hz[mode] - 1) < 1e-3);
    assert.ok(Math.abs(rows[test][2] - 100 * (stage.freq_hz[mode] / data.live.configurations[0].test_freq_hz[test] - 1)) < 0.15);
    assert.ok(rows[test][3] > 0.5 && rows[test][3] <= 1);
  }
  assert.match(await panel.locator(".answers > .certificate").textContent(), /^Largest differences that were found from the full model at 50 points of the 95 % region: frequencies <\s0\.001 %, MAC <\s0\.001, χ² <\s0\.001 %\.$/);
  await close();
});

test("a slider moves frequencies, χ² and the shape, and goes back to the update", async () => {
  const { page, panel, close } = await live();
  assert.equal(await panel.locator("canvas").count(), 0, "the window opens when something is asked");
  await answered(panel, () => panel.locator("button.show").first().click());
  await panel.locator("canvas").waitFor();
  const picture = async () => { await settled(page); return panel.locator("canvas").evaluate((c) => c.toDataURL()); };
  const [first, shape] = [await frequencies(panel), await picture()], total = () => panel.locator("table").nth(1).locator("tbody tr").last().locator("td").allTextContents();
  const slider = panel.locator("input[type=range]").first();
  await slider.scrollIntoViewIfNeeded();
  const box = await slider.boundingBox();
  await answered(panel, () => page.mouse.click(box.x + 0.9 * box.width, box.y + box.height / 2));
  await page.waitForTimeout(100);
  assert.match(await panel.locator(".answers > .shown").textContent(), /Outside the 95 % region/);
  assert.match(await panel.locator(".answers > .certificate").textContent(), /points within the bounds, 32 of them corners/);
  const moved = await frequencies(panel);
  assert.ok(moved.some((row, i) => Math.abs(row[1] / first[i][1] - 1) > 0.05));
  const [before, now] = (await total()).map((t) => Number(t.replace("−", "-")));
  assert.ok(now > before);
  const shapes = new Set([shape]);
  for (const button of await panel.locator("button.show").all()) { await answered(panel, () => button.click()); shapes.add(await picture()); }
  assert.equal(shapes.size, 1 + (await panel.locator("button.show").count()));
  await answered(panel, () => panel.getByRole("button", { name: "Back to the update" }).click());
  await page.waitForTimeout(100);
  assert.deepEqual(await frequencies(panel), first);
  assert.equal(await panel.locator(".answers > .shown").textContent(), "These are the updated values.");
  await close();
});

both("the live model by keyboard: slider, number within the bounds, lines for a study", async () => {
  const { page, panel, close } = await live();
  const [p] = (await viewOf(page)).live.parameters, number = panel.getByLabel(`${p.name}, value`);
  await panel.locator("input[type=range]").first().focus();
  await answered(panel, () => page.keyboard.press("ArrowRight"));
  assert.ok(Math.abs(Number(await number.inputValue()) - p.updated) < 0.01 * (p.upper - p.lower));
  await enter(number, String(2 * p.upper));
  await answered(panel, () => page.keyboard.press("Tab"));
  assert.equal(Number(await number.inputValue()), p.upper);
  // a field that is emptied keeps its value
  await enter(number, "");
  await page.keyboard.press("Tab");
  await page.waitForTimeout(200);
  assert.equal(Number(await number.inputValue()), p.upper);
  await panel.locator("summary").first().click();
  assert.match(await panel.locator("textarea").inputValue(), new RegExp(`name = "${p.name}"\nnominal = ${p.upper}\n`));
  await close();
});

both("the page answers questions about the region", async () => {
  const { page, panel, close } = await live();
  const { region, draws } = (await viewOf(page)).live, told = panel.locator(".asks > .note");
  const hz = {};
  for (const which of ["Lowest", "Highest"]) {
    await panel.getByRole("button", { name: new RegExp(`^${which} frequency`) }).click();
    await told.filter({ hasText: `${which} frequency of test mode` }).waitFor();
    await page.waitForTimeout(500);
    hz[which] = (await frequencies(panel))[0];
    assert.doesNotMatch(await panel.locator(".answers > .shown").textContent(), /Outside/);
  }
  assert.ok(hz.Lowest[1] < hz.Lowest[0] && hz.Highest[1] > hz.Highest[0]);
  assert.ok(region && draws);
  await panel.getByRole("button", { name: /^Lowest MAC/ }).click();
  await told.filter({ hasText: "Lowest MAC of test mode" }).waitFor({ timeout: 60000 });
  const [, lowest, updated] = /: ([\d.]+); updated ([\d.]+)\./.exec(await told.textContent());
  assert.ok(Number(lowest) <= Number(updated));
  await panel.getByRole("button", { name: /^Models (that the data allow|within the limit)$/ }).click();
  await told.filter({ hasText: /Model 1 of|no source of such models/ }).waitFor({ timeout: 60000 });
  await close();
});

both("a mass lowers frequencies, and a sensor that is left out changes the MAC alone", async () => {
  const { page, panel, close } = await live();
  const first = await frequencies(panel), c = (await viewOf(page)).live.configurations[0];
  await panel.locator("summary", { hasText: "MAC without" }).click();
  await answered(panel, () => panel.getByLabel(c.sensor_labels[0], { exact: true }).uncheck());
  const without = await frequencies(panel);
  assert.deepEqual(without.map((r) => r.slice(0, 3)), first.map((r) => r.slice(0, 3)));
  await answered(panel, () => panel.getByRole("button", { name: "All sensors" }).click());
  assert.deepEqual(await frequencies(panel), first);
  const mac = c.pairs.map(([test]) => test).filter((test) => without[test][3] !== first[test][3]);
  assert.ok(mac.length, "the MAC of some pair changes");
  assert.ok(c.mass_points.length);
  await panel.locator("summary", { hasText: "A mass at" }).click();
  await enter(panel.getByLabel(/^Mass/), "1000");
  await answered(panel, () => page.keyboard.press("Tab"));
  const heavy = await frequencies(panel);
  for (const [test] of c.pairs) assert.ok(heavy[test][1] <= first[test][1] && heavy[test][0] === first[test][0]);
  assert.ok(c.pairs.some(([test]) => heavy[test][1] < 0.999 * first[test][1]), "some frequency falls");
  assert.match(await panel.locator(".answers > .shown").textContent(), /A mass of 1000 .* is added at grid/);
  assert.equal(await panel.locator("table").nth(1).locator("tbody tr").last().locator("td").last().textContent(), "–");
  await panel.getByRole("button", { name: /^Lowest frequency/ }).click();
  await panel.locator(".asks > .note").filter({ hasText: /with a mass of 1000 .* at grid .*: .* Hz; updated without the mass/ }).waitFor();
  await close();
});

/** The page with other data of its live model. */
async function changed(name, change) {
  const path = join(pictures, name), text = readFileSync(pages[0], "utf8"), start = text.indexOf(">", text.indexOf('id="view"')) + 1, end = text.indexOf("</script>", start);
  const view = JSON.parse(text.slice(start, end));
  change(view.live);
  writeFileSync(path, text.slice(0, start) + JSON.stringify(view).replaceAll("<", "\\u003c") + text.slice(end));
  const opened = await open(path);
  await opened.page.waitForSelector(".livemodel[data-solved]");
  return { ...opened, panel: opened.page.locator(".livemodel") };
}

both("configurations have numbers of their own", async () => {
  const { panel, close } = await changed("configurations.html", (live) => {
    const [one] = live.configurations;
    live.configurations = [{ ...one, configuration: "first" }, { ...one, configuration: "second", test_freq_hz: one.test_freq_hz.map((f) => 2 * f), parts: [], checks: one.checks.map((c) => ({ ...c, chi_square: 0 })) }];
  });
  const before = await frequencies(panel);
  await answered(panel, () => panel.getByRole("combobox", { name: "Configuration" }).selectOption({ index: 1 }));
  const after = await frequencies(panel);
  assert.deepEqual(after.map((r) => r[1]), before.map((r) => r[1]));
  assert.ok(after[0][2] < -40 && before[0][2] > -40, "the errors are those beside its own test");
  await close();
});

both("models that pass by, of a posterior and of a rejected fit", async () => {
  const { page, panel, close } = await changed("models.html", (live) => { live.draws = { ...live.draws, source: "posterior", linear: null }; live.rejected = true; });
  const { parameters, draws } = (await viewOf(page)).live, told = panel.locator(".asks > .note");
  const value = () => panel.getByLabel(`${parameters[0].name}, value`).inputValue();
  await panel.getByRole("button", { name: "Models within the limit" }).click();
  await told.filter({ hasText: /^Model 1 of 20: a sample of the posterior distribution\. The fit of the update was rejected/ }).waitFor();
  const before = await value();
  await panel.getByRole("button", { name: "Next" }).click();
  await told.filter({ hasText: /^Model 2 of 20/ }).waitFor();
  assert.ok(draws.x.shape[0] >= 20);
  assert.notEqual(await value(), before);
  assert.doesNotMatch(await panel.textContent(), /the data allow these values/);
  await close();
});

both("a browser that finds other numbers shows none", async () => {
  const path = join(pictures, "spoiled.html");
  writeFileSync(path, readFileSync(pages[0], "utf8").replace(/("checks":\[\{"x":\[[^\]]*\],"eigenvalues":\[)([0-9.e+]+)/, (_, head, value) => head + 1.001 * Number(value)));
  const { page, close } = await open(path);
  await page.locator("#live .alert").waitFor();
  assert.match(await page.locator("#live .alert").textContent(), /not shown: the numbers at the check points are not those/);
  assert.equal(await page.locator(".livemodel").count(), 0);
  await close();
});

both("pairs, modes, sensors and parameters are chosen by pointer and keys, and saved as a file", async (t) => {
  const path = pages.find((p) => /"choices":\{/.test(readFileSync(p, "utf8")));
  if (!path) return t.skip("no page has choices");
  for (const width of [1280, 390]) {
    const { page, close } = await open(path, { viewport: { width, height: 800 } });
    const data = (await viewOf(page)).choices, box = page.locator(".chooser"), of = data.configurations[0];
    const cells = box.locator("table.mac button"), text = box.locator("textarea"), columns = of.numbers.length;
    assert.equal(await cells.count(), of.test_labels.length * columns);
    const begun = await text.inputValue();
    // the pointer on one cell, the keys on its neighbour
    await cells.nth(0).click();
    const pair = `[[pair]]\nconfiguration = "${of.configuration}"\ntest = "${of.test_labels[0]}"\nmodel = ${of.numbers[0]}\n`;
    assert.ok((await text.inputValue()).includes(pair));
    await page.keyboard.press("ArrowRight");
    await page.keyboard.press("Enter");
    await page.keyboard.press("Enter");
    assert.match(await box.locator("[role=status]").textContent(), /: never a pair\.$/);
    const never = `[[never_pair]]\nconfiguration = "${of.configuration}"\ntest = "${of.test_labels[0]}"\nmodel = ${of.numbers[1]}\n`;
    assert.ok((await text.inputValue()).includes(never));
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-label").includes("never a pair")), true);
    // a mode that is left out needs a reason
    await box.locator(".omitted input[type=checkbox]").last().uncheck();
    await box.locator(".omitted input[type=checkbox]").first().check();
    assert.match(await box.locator("[role=status]").textContent(), /State the reason/);
    await page.keyboard.type('a "local" mode');
    assert.ok((await text.inputValue()).includes('reason = "a \\"local\\" mode"'));
    await box.locator(".boxes input").first().focus();
    await page.keyboard.press("Space");
    assert.ok((await text.inputValue()).includes(`sensor = "${of.sensors[0]}"`));
    const download = saving(page);
    await box.getByRole("button", { name: "Save choices.toml" }).click();
    assert.equal(await contents(await download), await text.inputValue());
    await box.getByRole("button", { name: "As in the study" }).click();
    assert.equal(await text.inputValue(), begun);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "the page does not scroll sideways");
    await close();
  }
});

/** The page whose live model has FRFs. */
const functionsPage = () => pages.find((p) => /"functions":\[\{"kind"/.test(readFileSync(p, "utf8")));

both("FRFs of the live model follow the sliders, beside those of the test and of the update", async (t) => {
  const path = functionsPage();
  if (!path) { t.skip("no page with FRFs of a live model"); return; }
  const { page, close } = await open(path), panel = page.locator(".livemodel"), plot = panel.locator(".livefrfs svg.plot");
  await page.waitForSelector(".livemodel[data-solved]");
  const drawn = (look) => plot.locator(`path[data-look=${look}]`).first().getAttribute("d"), [test_, after, now] = await Promise.all(["test", "after", "live"].map(drawn));
  assert.ok(test_.length > 500 && after.length > 500);
  assert.equal(now, after, "at the update both are the same");
  const total = () => panel.locator("table").nth(1).locator("tbody tr", { hasText: "frf" }).locator("td").allTextContents(), squares = await total();
  assert.equal(squares[0], squares[1]);
  await panel.locator("input[type=range]").first().focus();
  await answered(panel, () => page.keyboard.press("PageUp"));
  assert.notEqual(await drawn("live"), await drawn("after"));
  assert.notDeepEqual(await total(), squares);
  const which = panel.locator(".livefrfs select").first();
  await answered(panel, () => which.selectOption({ index: 1 }));
  assert.notEqual(await drawn("after"), after);
  assert.match(await panel.locator(".livefrfs .note").last().evaluate((e) => e.parentElement.textContent), /Largest difference of a function from that of the full model .* % \(\S+ by \S+\) at 4 points within the bounds/);
  await close();
});

both("the page answers with the worst level of a function, at the frequency of the cursor and at its peak", async (t) => {
  const path = functionsPage();
  if (!path) { t.skip("no page with FRFs of a live model"); return; }
  const { page, close } = await open(path), panel = page.locator(".livemodel"), told = panel.locator(".questions .told"), field = panel.getByLabel("Level at, Hz");
  await page.waitForSelector(".livemodel[data-solved]");
  assert.ok(Number(await field.inputValue()) > 0, "the highest line");
  await panel.locator(".livefrfs svg.plot").focus();
  await page.keyboard.press("c");
  const hz = Number(await panel.locator(".livefrfs svg.plot").getAttribute("data-cursor"));
  assert.ok(Math.abs(Number(await field.inputValue()) / hz - 1) < 1e-5, "the cursor");
  const level = {};
  for (const which of ["Lowest", "Highest"]) {
    await panel.getByRole("button", { name: new RegExp(`^${which} level there`) }).click();
    await told.filter({ hasText: `${which} level of ` }).waitFor({ timeout: 60000 });
    const found = /: ([\d.e−]+) [^ ]+, ([+−][\d.]+) dB from that of the update/.exec(await told.textContent());
    assert.ok(found, await told.textContent());
    level[which] = [Number(found[1].replace("−", "-")), Number(found[2].replace("−", "-"))];
  }
  assert.ok(level.Lowest[0] < level.Highest[0] && level.Lowest[1] <= 0 && level.Highest[1] >= 0);
  await panel.getByRole("button", { name: /^Highest peak/ }).click();
  await told.filter({ hasText: /^Highest peak of \S+ by \S+ in .* at [\d.]+ Hz, \+/ }).waitFor({ timeout: 60000 });
  assert.doesNotMatch(await panel.locator(".answers > .shown").textContent(), /Outside/);
  await field.fill("");
  await panel.getByRole("button", { name: /^Lowest level there/ }).click();
  assert.equal(await told.textContent(), "Enter a frequency, or click on the plot.");
  await close();
});

/** A Universal File of the test modes of a configuration of the page, with changes. */
async function universal(page, { factor = 1, point = (n) => n } = {}) {
  const c = (await viewOf(page)).live.configurations[0], bytes = Buffer.from(c.test_shapes.data, "base64"), modes = c.test_labels.length;
  const value = (s, m) => bytes.readDoubleLE(8 * (s * modes + m)), rows = new Map();
  c.sensor_labels.forEach((label, s) => { const [, node, axis, sign] = /^(\d+)(R?[XYZ])([+-])$/.exec(label), at = rows.get(node) ?? Array(6).fill(null); at[["X", "Y", "Z", "RX", "RY", "RZ"].indexOf(axis)] = { s, sign: sign === "-" ? -1 : 1 }; rows.set(node, at); });
  const sets = c.test_freq_hz.map((f, m) => ["    -1", "    55", "t", "NONE", "NONE", "NONE", "NONE", "         1         2         3         8         2         6", `         2         4         1${String(m + 1).padStart(10)}`,
    ` ${(factor * f).toExponential(5)} 1.0 0.0 0.0`, ...[...rows].flatMap(([node, at]) => [String(point(Number(node))).padStart(10), at.map((one) => (one ? (one.sign * (value(one.s, m) || 0)).toExponential(5) : "0.0")).join(" ")]), "    -1"].join("\n"));
  return { c, text: `${sets.join("\n")}\n` };
}

both("a test that is dropped on the page is compared with the live model, and a bad file is a message", async () => {
  const { page, panel, close } = await live();
  const { c, text } = await universal(page), said = panel.locator(".dropped [role=status]"), rows = panel.locator(".dropped tbody tr");
  const drop = (name, content) => page.evaluate(([n, t]) => { const data = new DataTransfer(); data.items.add(new File([t], n)); document.body.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true })); }, [name, content]);
  await answered(panel, () => drop("own.uff", text));
  await rows.first().waitFor();
  const first = await frequencies(panel), found = await rows.evaluateAll((all) => all.map((r) => Array.from(r.cells, (e) => e.textContent)));
  assert.equal(found.length, c.test_labels.length);
  assert.match(await said.textContent(), /^own\.uff: \d+ modes\./);
  // the same modes as the test of the report: the same partners, frequencies and MAC
  for (const [test, mode] of c.pairs) {
    assert.equal(found[test][2], String(mode + 1));
    assert.ok(Math.abs(Number(found[test][5]) - first[test][3]) < 0.0011, `${test}: ${found[test][5]} ${first[test][3]}`);
  }
  await panel.locator("input[type=range]").first().focus();
  await answered(panel, () => page.keyboard.press("PageUp"));
  assert.notDeepEqual(await rows.evaluateAll((all) => all.map((r) => r.cells[3].textContent)), found.map((r) => r[3]));
  for (const [name, content, wanted] of [
    ["nan.uff", text.replace(/\n *-?\d\.\d+e[+-]\d+ /, "\nNaN "), /nan\.uff: Line \d+: .* no finite number/],
    ["cut.uff", text.slice(0, text.length / 2), /cut\.uff: Line \d+: data set 55 does not end/],
    ["<img src=x onerror=alert(1)>.png", "\x89PNG", /<img src=x onerror=alert\(1\)>\.png: The file has no modes/],
    // the doubt stands where the file was dropped
    ["rad.uff", (await universal(page, { factor: 2 * Math.PI * 20 })).text, /^rad\.uff: .*(rad\/s|no partner)/],
    ["points.uff", (await universal(page, { point: (n) => n + 50000 })).text, /None of the points of the file is a sensor here\. The file has 50\d+X/],
  ]) {
    await drop(name, content);
    await said.filter({ hasText: wanted }).waitFor({ timeout: 5000 });
  }
  await panel.locator(".dropped summary").scrollIntoViewIfNeeded();
  await panel.locator(".dropped input[type=file]").setInputFiles({ name: "chosen.uff", mimeType: "text/plain", buffer: Buffer.from(text) });
  await said.filter({ hasText: /^chosen\.uff/ }).waitFor();
  await panel.getByRole("button", { name: "Remove the test" }).click();
  assert.equal(await panel.locator(".dropped table:visible").count(), 0);
  await close();
});

both("criteria follow the sliders, and say what keeps the values of the update", async () => {
  const { panel, close } = await changed("criteria.html", (live) => {
    const [c] = live.configurations, at = (quantity, limit, measured, at_most) => ({ name: `${quantity}, own criterion`, quantity, at_most, limit, unit: at_most ? "%" : "", measured, verdict: "pass", remark: "" });
    // what the page finds at the update is what it must be told
    c.criteria = [at("frequency", 1e3, c.wanted ?? 0, true), { ...at("", 0.9, 0.95, false), name: "cross-orthogonality" }];
  });
  assert.equal(await panel.getByRole("region", { name: "Criteria now" }).isVisible(), false, "a value that the page finds otherwise is not followed");
  await close();
  const worst = Math.max(...(await (async () => { const one = await live(), rows = await frequencies(one.panel); await one.close(); return rows.map((r) => Math.abs(r[2])).filter(Number.isFinite); })()));
  const other = await changed("criteria2.html", (live) => {
    live.configurations[0].criteria = [{ name: "frequency error, own criterion", quantity: "frequency", at_most: true, limit: worst + 1, unit: "%", measured: worst, verdict: "pass", remark: "" }, { name: "cross-orthogonality", quantity: "", at_most: false, limit: 0.9, unit: "", measured: 0.95, verdict: "pass", remark: "" }];
  });
  const region = other.panel.getByRole("region", { name: "Criteria now" });
  assert.equal(await region.locator("tbody tr").count(), 1);
  assert.equal(await region.locator("tbody td").last().textContent(), "pass");
  assert.match(await other.panel.locator(".answers").textContent(), /One other criterion, the score and neighbour tests of the judge and the verdict of the report keep the values of the update\./);
  await other.panel.locator("input[type=range]").first().focus();
  await answered(other.panel, () => other.page.keyboard.press("End"));
  assert.equal(await region.locator("tbody td").last().textContent(), "fail");
  await other.close();
});

for (const [width, scheme, touch] of [[390, "light", !inFirefox], [800, "dark", !inFirefox], [1280, "light", false]]) {
  both(`the live model with all of its parts open, ${width} pixels, ${scheme}${touch ? ", by touch" : ""}: fits, and axe-core finds nothing serious`, async () => {
    const path = functionsPage() ?? pages[0], { page, close } = await open(path, { viewport: { width, height: 844 }, colorScheme: scheme, hasTouch: touch, isMobile: touch && width < 500 });
    await page.waitForSelector(".livemodel[data-solved]");
    const panel = page.locator(".livemodel");
    for (const summary of await panel.locator("summary:visible").all()) await (touch ? summary.tap() : summary.click());
    const slider = panel.locator("input[type=range]").first();
    await slider.scrollIntoViewIfNeeded();
    const box = await slider.boundingBox();
    await answered(panel, () => (touch ? page.touchscreen : page.mouse)[touch ? "tap" : "click"](box.x + 0.8 * box.width, box.y + box.height / 2));
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth), 0);
    await photograph(page.locator("#live"), `live-${scheme}-${width}`);
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => globalThis.axe.run(document.getElementById("live"), { resultTypes: ["violations"] }));
    assert.deepEqual(violations.filter((v) => ["serious", "critical"].includes(v.impact)).map((v) => `${v.id}: ${v.nodes.slice(0, 2).map((n) => n.html.slice(0, 120)).join(" | ")}`), []);
    await close();
  });
}
