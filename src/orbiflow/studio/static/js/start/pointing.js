/**
 * Strokes on a canvas by mouse, touch or pen, and by keyboard: arrows move a cross, Space draws. With `zoom` and `pan`
 * also a wheel, two fingers, the middle button, and the keys + and -.
 */

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/**
 * Hear strokes. `size()`: [width, height] of the canvas in its own units. `heard`: begin(point),
 * move(points), end(), and hover(point or null) for the cross or the brush under the pointer.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {() => [number, number]} size
 * @param {{ begin(at: Point): void, move(points: Point[]): void, end(): void, hover(at: Point | null): void, stop?(): void, zoom?(by: number, at?: Point): boolean, pan?(distance: Point): void }} heard
 */
export function pointing(canvas, size, heard) {
  let held = null; // the pointer that draws, or "keys"
  /** @type {Map<number, Point>} */
  const down = new Map(); // where fingers are, or the mouse that drags by its middle button
  /** @type {Point | null} */
  let cross = null;
  /** @type {(event: PointerEvent) => Point} */
  const at = (event) => {
    const box = canvas.getBoundingClientRect();
    const [width, height] = size();
    return [
      ((event.clientX - box.left) / box.width) * width,
      ((event.clientY - box.top) / box.height) * height,
    ];
  };
  /** Move by what is dragged, and come nearer as two fingers part. */
  const gesture = (event) => {
    const before = [...down.values()];
    down.set(event.pointerId, at(event));
    const now = [...down.values()];
    const middle = (k, points) => points.reduce((sum, point) => sum + point[k], 0) / points.length;
    const [u, v] = [middle(0, now), middle(1, now)];
    heard.pan([u - middle(0, before), v - middle(1, before)]);
    if (now.length < 2) return;
    const apart = (points) => Math.hypot(points[1][0] - points[0][0], points[1][1] - points[0][1]);
    heard.zoom(apart(now) / Math.max(apart(before), 1), [u, v]);
  };
  const listen = {
    pointerdown(event) {
      if (heard.zoom && (event.pointerType === "touch" || event.button === 1)) {
        down.set(event.pointerId, at(event));
        if (down.size > 1 && held !== null) {
          held = null;
          heard.stop();
        }
        if (event.button === 1) event.preventDefault();
        if (down.size > 1 || event.button === 1) return canvas.setPointerCapture(event.pointerId);
      }
      if (event.button || held !== null) return undefined;
      held = event.pointerId;
      canvas.setPointerCapture(held);
      return heard.begin(at(event));
    },
    pointermove(event) {
      if (down.has(event.pointerId) && event.pointerId !== held) return gesture(event);
      cross = at(event);
      heard.hover(cross);
      if (event.pointerId !== held) return undefined;
      const all = event.getCoalescedEvents?.() ?? [];
      return heard.move((all.length ? all : [event]).map(at));
    },
    wheel(event) {
      if (!heard.zoom) return;
      const lines = event.deltaMode ? 18 : 1;
      if (heard.zoom(Math.exp(-0.0015 * lines * event.deltaY), at(event))) event.preventDefault();
    },
    pointerup(event) {
      down.delete(event.pointerId);
      if (event.pointerId !== held) return;
      held = null;
      heard.end();
    },
    pointercancel(event) {
      listen.pointerup(event);
    },
    pointerleave() {
      if (held === null) heard.hover(null);
    },
    blur() {
      if (held === "keys") {
        held = null;
        heard.end();
      }
      heard.hover(null);
    },
    keydown(event) {
      if (event.key === " " || event.key === "Enter") {
        event.preventDefault();
        cross ??= [size()[0] / 2, size()[1] / 2];
        if (held === "keys") {
          held = null;
          heard.end();
        } else if (held === null) {
          held = "keys";
          heard.begin(cross);
        }
        heard.hover(cross);
      }
      const by = { "+": 1.35, "=": 1.35, "-": 1 / 1.35, 0: 0 }[event.key];
      if (heard.zoom && by !== undefined && !event.ctrlKey && !event.metaKey) {
        heard.zoom(by, cross ?? undefined);
      }
      if (!STEPS[event.key]) return;
      event.preventDefault();
      const [width, height] = size();
      const far = Math.max(width, height) * (event.shiftKey ? 0.05 : 0.01);
      const [x, y] = cross ?? [width / 2, height / 2];
      const [u, v] = STEPS[event.key];
      cross = [
        Math.min(width, Math.max(0, x + u * far)),
        Math.min(height, Math.max(0, y + v * far)),
      ];
      heard.pan?.([cross[0] - x - u * far, cross[1] - y - v * far]); // beyond an edge
      heard.hover(cross);
      if (held === "keys") heard.move([cross]);
    },
  };
  for (const [name, act] of Object.entries(listen)) canvas.addEventListener(name, act);
}
