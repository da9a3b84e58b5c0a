// A motion as a file: a film of one period after the other, or the pictures of a period.

import { zip } from "./xlsx.ts";

/** Pictures of a period, and how long it lasts in the film. */
export const FRAMES = 36, PERIOD_S = 1.8;
const PERIODS = 2, TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];

/** The type of film that the browser can make; undefined where it makes none. */
export const filmType = (): string | undefined => (typeof MediaRecorder === "undefined" ? undefined : TYPES.find((type) => MediaRecorder.isTypeSupported(type)));

/** The picture of a canvas at each phase, as `draw` makes it; without ground a film and a picture would be black. */
function painted(canvas: HTMLCanvasElement, ground: string, draw: (phase: number) => void): { on: HTMLCanvasElement; paint: (k: number) => void } {
  const on = document.createElement("canvas");
  // films need even sizes
  [on.width, on.height] = [canvas.width & ~1, canvas.height & ~1];
  const context = on.getContext("2d")!;
  const paint = (k: number) => {
    draw((360 * (k % FRAMES)) / FRAMES);
    context.fillStyle = ground;
    context.fillRect(0, 0, on.width, on.height);
    context.drawImage(canvas, 0, 0);
  };
  return { on, paint };
}

/** Some periods as a film. */
export async function film(canvas: HTMLCanvasElement, ground: string, draw: (phase: number) => void): Promise<Blob> {
  const { on, paint } = painted(canvas, ground, draw), type = filmType()!;
  paint(0);
  const recorder = new MediaRecorder(on.captureStream(FRAMES / PERIOD_S), { mimeType: type, videoBitsPerSecond: 4e6 });
  const parts: Blob[] = [];
  recorder.ondataavailable = (e) => { parts.push(e.data); };
  const done = new Promise<void>((resolve) => { recorder.onstop = () => resolve(); });
  recorder.start();
  const begin = performance.now(), whole = 1000 * PERIOD_S * PERIODS;
  await new Promise<void>((resolve) => {
    // by the clock: a slow browser leaves pictures out, and the motion keeps its speed
    const next = () => {
      const passed = performance.now() - begin;
      if (passed >= whole) return resolve();
      paint(Math.floor((passed / 1000 / PERIOD_S) * FRAMES));
      setTimeout(next, (1000 * PERIOD_S) / FRAMES);
    };
    next();
  });
  recorder.stop();
  await done;
  return new Blob(parts, { type: type.split(";")[0] });
}

/** The pictures of a period as PNG in a ZIP file. */
export async function frames(canvas: HTMLCanvasElement, ground: string, draw: (phase: number) => void): Promise<Blob> {
  const { on, paint } = painted(canvas, ground, draw), files: [string, Uint8Array][] = [];
  for (let k = 0; k < FRAMES; k++) {
    paint(k);
    const blob = await new Promise<Blob>((resolve, reject) => on.toBlob((b) => (b ? resolve(b) : reject(new Error("no picture"))), "image/png"));
    files.push([`frame-${String(k + 1).padStart(2, "0")}.png`, new Uint8Array(await blob.arrayBuffer())]);
  }
  return new Blob([zip(files)], { type: "application/zip" });
}
