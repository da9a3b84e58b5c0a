// What the page can do besides moving shapes: tables, pictures, functions and iterations.

import { Chooser } from "./choices.ts";
import { readView } from "./data.ts";
import { h } from "./dom.ts";
import { fixed, FunctionPlot } from "./functions.ts";
import { Iterations } from "./iterations.ts";
import { enhancePicture } from "./pictures.ts";
import { StabilisationPlot } from "./stabilisation.ts";
import { enhance } from "./tables.ts";

/** Rows of the tables of modes show their pair in the window of moving shapes. */
function linkPairs(configurations: string[]): void {
  for (const table of document.querySelectorAll<HTMLTableElement>("#modes table")) {
    const configuration = table.caption?.textContent?.trim() ?? "";
    if (!configurations.includes(configuration)) continue;
    for (const row of table.tBodies[0].rows) {
      const head = row.cells[0], label = head.textContent!.trim();
      const show = () => document.dispatchEvent(new CustomEvent("femtune:pair", { detail: { configuration, label } }));
      const button = h("button", { type: "button", class: "show", "aria-label": `Show the shapes of test mode ${label}`, title: "Show the shapes", click: show }, label);
      head.replaceChildren(button);
    }
  }
}

/** Something that answers, at the head of the first of these sections that the page has. */
function atHead(ids: string[], ...elements: HTMLElement[]): void {
  const section = ids.map((id) => document.getElementById(id)).find((s) => s !== null);
  const last = Array.from(section?.children ?? []).find((c) => c.tagName === "FIGURE" || c.tagName === "H3" || c.classList.contains("scroll"));
  if (section) section.insertBefore(h("div", { class: "live" }, ...elements), last ?? section.children[1] ?? null);
}

const view = readView();
for (const table of document.querySelectorAll<HTMLTableElement>(".scroll table")) enhance(table);
for (const figure of document.querySelectorAll<HTMLElement>("figure")) enhancePicture(figure);
if (view?.scenes.length) linkPairs(view.scenes.filter((s) => s.test).map((s) => s.configuration));
for (const section of new Set(view?.functions.map((f) => f.section))) {
  const own = view!.functions.filter((f) => f.section === section);
  const plots = own.flatMap((f) => [...(own.length > 1 ? [h("h3", {}, f.configuration)] : []), new FunctionPlot(fixed(f)).element]);
  atHead(section === "responses" ? ["responses", "frequency_responses"] : [section], h("h3", {}, "Look closer"), ...plots);
}
if (view?.stabilisation) atHead(["poles"], h("h3", {}, "Pick poles"), new StabilisationPlot(view.stabilisation, view.functions.find((f) => f.section === "fit")).element);
if (view?.choices) atHead(["mac", "compared"], h("h3", {}, "Choose by hand"), new Chooser(view.choices, view.scenes).element);
if (view?.history) atHead(["convergence"], new Iterations(view.history).element);
