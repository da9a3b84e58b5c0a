// The direction of view, shared by all windows: a turntable with z upwards, turned by pointer and keys.

export class Orbit {
  azimuth = 0;
  elevation = 0;
  zoom = 1;
  pan: [number, number] = [0, 0];

  constructor(private readonly home: [number, number]) { this.reset(); }

  reset(): void {
    [this.azimuth, this.elevation] = this.home;
    this.zoom = 1;
    this.pan = [0, 0];
  }

  look(azimuth: number, elevation: number): void {
    this.azimuth = azimuth;
    this.elevation = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, elevation));
  }

  turn(right: number, up: number): void { this.look(this.azimuth - right, this.elevation + up); }

  magnify(factor: number): void { this.zoom = Math.min(50, Math.max(0.2, this.zoom * factor)); }

  /** Unit vectors: to the right, upwards, and from the structure to the eye. */
  axes(): [number[], number[], number[]] {
    const c = Math.cos(this.azimuth), s = Math.sin(this.azimuth), up = Math.sin(this.elevation), out = Math.cos(this.elevation);
    return [[-s, c, 0], [-up * c, -up * s, out], [out * c, out * s, up]];
  }

  /** What a key does; false where it does nothing. */
  key(name: string): boolean {
    const step = Math.PI / 36;
    const actions: Record<string, () => void> = {
      ArrowLeft: () => this.turn(-step, 0), ArrowRight: () => this.turn(step, 0),
      ArrowUp: () => this.turn(0, step), ArrowDown: () => this.turn(0, -step),
      "+": () => this.magnify(1.2), "=": () => this.magnify(1.2), "-": () => this.magnify(1 / 1.2),
      "0": () => this.reset(), Home: () => this.reset(),
    };
    actions[name]?.();
    return name in actions;
  }
}

/** The structure of these sizes seen from the front and the right, from higher up where it is flat. */
export function homeOf(sizes: number[]): [number, number] {
  const wide = Math.max(sizes[0], sizes[1]);
  const tall = wide > 0 ? Math.min(1, sizes[2] / (0.5 * wide)) : 1;
  return [(-58 * Math.PI) / 180, ((36 - 12 * tall) * Math.PI) / 180];
}

/** Pointer, wheel and keys of an element turn the view; `changed` follows each change. */
export function control(element: HTMLElement, orbit: () => Orbit, changed: () => void): void {
  // fingers, or the mouse; a swipe up or down belongs to the page, which scrolls (touch-action of the style)
  const held = new Map<number, [number, number]>();
  element.addEventListener("pointerdown", (e) => { held.set(e.pointerId, [e.clientX, e.clientY]); element.setPointerCapture(e.pointerId); });
  for (const end of ["pointerup", "pointercancel"] as const) element.addEventListener(end, (e) => { held.delete(e.pointerId); });
  element.addEventListener("pointermove", (e) => {
    const last = held.get(e.pointerId);
    if (!last) return;
    const now = orbit(), before = Array.from(held.values());
    held.set(e.pointerId, [e.clientX, e.clientY]);
    const [dx, dy] = [e.clientX - last[0], e.clientY - last[1]];
    const pan = (x: number, y: number) => { now.pan = [now.pan[0] + (2 * x) / element.clientHeight, now.pan[1] - (2 * y) / element.clientHeight]; };
    if (held.size > 1) {
      const after = Array.from(held.values()), apart = ([a, b]: [number, number][]) => Math.hypot(a[0] - b[0], a[1] - b[1]);
      if (apart(before) > 10) now.magnify(apart(after) / apart(before));
      pan(dx / 2, dy / 2);
    } else if (e.shiftKey || e.buttons === 4) pan(dx, dy);
    else now.turn(0.01 * dx, 0.01 * dy);
    changed();
  });
  element.addEventListener("wheel", (e) => {
    // a page that is scrolled past the picture must not stick to it
    if (document.activeElement !== element) return;
    e.preventDefault();
    orbit().magnify(Math.exp(-0.0015 * e.deltaY));
    changed();
  }, { passive: false });
  element.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || !orbit().key(e.key)) return;
    e.preventDefault();
    changed();
  });
}
