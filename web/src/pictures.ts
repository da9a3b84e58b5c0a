// Pictures of the page can be saved as they are (SVG) or as an image (PNG).

import { fileName, h, png, save } from "./dom.ts";

const HEAD = "data:image/svg+xml;base64,";

export function enhancePicture(figure: HTMLElement): void {
  const image = figure.querySelector("img");
  if (!image || !image.src.startsWith(HEAD)) return;
  const title = image.alt.slice(0, 60);
  const source = () => new TextDecoder().decode(Uint8Array.from(atob(image.src.slice(HEAD.length)), (c) => c.charCodeAt(0)));
  const buttons = pictureButtons(title, source, () => [image.naturalWidth, image.naturalHeight]);
  figure.append(h("p", { class: "tools" }, ...buttons));
}

/** Buttons that save a drawing. */
export function pictureButtons(title: string, source: () => string, size: () => [number, number]): HTMLButtonElement[] {
  const asSvg = () => save(fileName(title, "svg"), new Blob([source()], { type: "image/svg+xml" }));
  const asPng = async () => save(fileName(title, "png"), await png(source(), ...size()));
  return [
    h("button", { type: "button", click: asSvg, "aria-label": `Save picture as SVG: ${title}` }, "SVG"),
    h("button", { type: "button", click: () => void asPng(), "aria-label": `Save picture as PNG: ${title}` }, "PNG"),
  ];
}
