/** Strokes on a canvas by mouse, touch or pen, and by keyboard: arrows move a cross, Space draws. */

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/**
 * Hear strokes. `size()`: [width, height] of the canvas in its own units. `heard`: begin(point),
 * move(points), end(), and hover(point or null) for the cross or the brush under the pointer.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {() => [number, number]} size
 * @param {{ begin(at: Point): void, move(points: Point[]): void, end(): void, hover(at: Point | null): void }} heard
 */
export function pointing(canvas, size, heard) {
  let held = null; // the pointer that draws, or "keys"
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
  const listen = {
    pointerdown(event) {
      if (event.button || held !== null) return;
      held = event.pointerId;
      canvas.setPointerCapture(held);
      heard.begin(at(event));
    },
    pointermove(event) {
      cross = at(event);
      heard.hover(cross);
      if (event.pointerId !== held) return;
      const all = event.getCoalescedEvents?.() ?? [];
      heard.move((all.length ? all : [event]).map(at));
    },
    pointerup(event) {
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
      heard.hover(cross);
      if (held === "keys") heard.move([cross]);
    },
  };
  for (const [name, act] of Object.entries(listen)) canvas.addEventListener(name, act);
}
