/** What is turned by hand on a canvas, such as a surface or a stack of solids: view, mouse, touch and keys. */

const STEP = 0.1; // radians that an arrow key turns
const ZOOM = 1.15; // of + and -

/**
 * The numbers in a base64 text.
 *
 * @template Kind
 * @param {string} text
 * @param {new (buffer: ArrayBuffer) => Kind} kind
 */
export function unpack(text, kind) {
  const raw = atob(text);
  return new kind(Uint8Array.from(raw, (letter) => letter.charCodeAt(0)).buffer);
}

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Give a canvas as many pixels as the screen has there: [width, height, pixels of CSS's one]. */
export function sharpened(canvas) {
  const scale = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) =>
    Math.max(1, Math.round(side * scale))
  );
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  return [width, height, scale];
}

/** A function that paints at the next frame, once. */
export function atNextFrame(paint) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame((now) => {
      asked = false;
      paint(now);
    });
  };
}

/**
 * Let a canvas be turned: what is done by hand changes `yaw`, `pitch` and `zoom` of a view, and is then redrawn.
 *
 * @param {HTMLCanvasElement} canvas
 * @param { { yaw: number, pitch: number, zoom: number } } view
 * @param {() => void} redraw
 * @param { { keys?: Record<string, () => void>, scrolls?: boolean } } more further keys; whether the page scrolls: then
 *   the wheel zooms only with the Ctrl key
 */
export function turnedByHand(canvas, view, redraw, { keys = {}, scrolls = false }) {
  const turn = (dx, dy) => {
    view.yaw -= dx;
    view.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + dy));
    redraw();
  };
  const zoom = (factor) => {
    view.zoom = Math.max(0.4, Math.min(8, view.zoom * factor));
    redraw();
  };
  const held = new Map();
  const spread = () => {
    const [[a, b], [c, d]] = [...held.values()];
    return Math.hypot(a - c, b - d);
  };
  canvas.addEventListener("pointerdown", ({ pointerId, clientX, clientY }) => {
    canvas.setPointerCapture(pointerId);
    held.set(pointerId, [clientX, clientY]);
  });
  canvas.addEventListener("pointermove", ({ pointerId, clientX, clientY }) => {
    const last = held.get(pointerId);
    if (!last) return;
    const before = held.size === 2 ? spread() : 0;
    const per = 3 / canvas.clientHeight / Math.sqrt(view.zoom);
    if (held.size === 1) turn((clientX - last[0]) * per, (clientY - last[1]) * per);
    held.set(pointerId, [clientX, clientY]);
    if (before > 0) zoom(spread() / before);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(
      name,
      (event) => held.delete(/** @type {PointerEvent} */ (event).pointerId),
    );
  }
  canvas.addEventListener("wheel", (event) => {
    if (scrolls && !event.ctrlKey) return;
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY));
  }, { passive: false });
  /** @type {Record<string, () => void>} */
  const moves = {
    ArrowLeft: () => turn(-STEP, 0),
    ArrowRight: () => turn(STEP, 0),
    ArrowUp: () => turn(0, -STEP),
    ArrowDown: () => turn(0, STEP),
    "+": () => zoom(ZOOM),
    "=": () => zoom(ZOOM),
    "-": () => zoom(1 / ZOOM),
    ...keys,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!moves[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    moves[event.key]();
  });
}
