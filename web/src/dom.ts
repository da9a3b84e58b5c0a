// Elements of the page, texts of numbers, and files to save.

type Child = Node | string | null;
type Attributes = Record<string, string | number | boolean | ((event: any) => void) | undefined>;

/** An element with attributes (functions are listeners) and children; texts are never read as markup. */
export function h<K extends keyof HTMLElementTagNameMap>(tag: K, attributes: Attributes = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  set(element, attributes);
  element.append(...children.filter((c): c is Node | string => c !== null));
  return element;
}

/** An element of a drawing. */
export function svg(tag: string, attributes: Attributes = {}, ...children: Child[]): SVGElement {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  set(element, attributes);
  element.append(...children.filter((c): c is Node | string => c !== null));
  return element;
}

function set(element: Element, attributes: Attributes): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== undefined) element.setAttribute(name, String(value));
  }
}

/** A number with four digits and a true minus sign; a dash for none. */
export function shown(value: number | null | undefined, digits = 4): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(digits - 1) : String(Number(value.toPrecision(digits)));
  return text.replace(/-/g, "−");
}

/** Rounding lifts the frequencies of rigid-body modes from zero, not as far as this. */
export const RIGID_HZ = 1e-3;

/** A frequency with five digits everywhere, so that one value does not look like two; zeros at its end stay. */
export const cycles = (hz: number | null | undefined): string =>
  hz === null || hz === undefined || !Number.isFinite(hz) ? "–" : hz <= RIGID_HZ ? "0" : hz >= 1e5 ? shown(hz, 6) : hz.toPrecision(5);

/** The frequency of a model mode. */
export const hertz = (hz: number): string => hz > RIGID_HZ ? `${cycles(hz)} Hz` : "0 Hz (rigid body)";

/** Offer a file to the reader. */
export function save(name: string, content: Blob): void {
  const address = URL.createObjectURL(content);
  const link = h("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

/** A title as the name of a file. */
export function fileName(title: string, ending: string): string {
  const kept = title.normalize("NFKD").replace(/[^\w]+/g, "-").replace(/^-+|-+$/g, "").toLowerCase().slice(0, 60);
  return `${kept || "femtune"}.${ending}`;
}

/** The drawing as an image of twice its size on white ground. */
export async function png(drawing: string, width: number, height: number): Promise<Blob> {
  const image = new Image();
  image.src = "data:image/svg+xml;base64," + base64(drawing);
  await image.decode();
  const canvas = h("canvas", { width: 2 * width, height: 2 * height });
  const on = canvas.getContext("2d")!;
  on.fillStyle = "#fff";
  on.fillRect(0, 0, canvas.width, canvas.height);
  on.drawImage(image, 0, 0, canvas.width, canvas.height);
  return await new Promise((resolve, reject) => canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png"));
}

function base64(text: string): string {
  return btoa(Array.from(new TextEncoder().encode(text), (byte) => String.fromCharCode(byte)).join(""));
}

/** A labelled control. */
export function labelled(text: string, control: HTMLElement): HTMLLabelElement {
  return h("label", {}, h("span", {}, text), control);
}

/** A choice among texts; null where there is nothing to choose. */
export function choice(text: string, options: string[], chosen: (k: number) => void): { select: HTMLSelectElement; label: HTMLLabelElement } {
  const select = h("select", { change: () => chosen(select.selectedIndex) }, ...options.map((o) => h("option", {}, o)));
  const label = labelled(text, select);
  label.hidden = options.length < 2;
  return { select, label };
}
