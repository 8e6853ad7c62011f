/** What is turned by hand on a canvas, a surface, a stack of solids or a world: mouse, touch and keys. */

const STEP = 30; // pixels by which an arrow key turns
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
 * What turns and zooms a view by its `yaw`, `pitch` and `zoom`, for `turnedByHand`.
 *
 * @param {HTMLCanvasElement} canvas
 * @param { { yaw: number, pitch: number, zoom: number } } view
 * @param {() => void} redraw
 */
export const byAngles = (canvas, view, redraw) => ({
  turn([a, b], [c, d]) {
    const per = 3 / canvas.clientHeight / Math.sqrt(view.zoom);
    view.yaw -= (c - a) * per;
    view.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + (d - b) * per));
    redraw();
  },
  zoom(factor) {
    view.zoom = Math.max(0.4, Math.min(8, view.zoom * factor));
    redraw();
  },
});

/**
 * Let a canvas be turned: `turn` from one place of it to another, in its pixels, `zoom` by a factor.
 *
 * @param {HTMLCanvasElement} canvas
 * @param { { turn(from: Point, to: Point): void, zoom(factor: number): void, rest?(): void } } hand `rest` hears that
 *   nothing is held any more
 * @param { { keys?: Record<string, () => void>, scrolls?: boolean } } more further keys; whether the page scrolls: then
 *   the wheel zooms only with the Ctrl key
 */
export function turnedByHand(
  canvas,
  { turn, zoom, rest = () => {} },
  { keys = {}, scrolls = false } = {},
) {
  /** @type {Map<number, Point>} */
  const held = new Map();
  const place = ({ clientX, clientY }) => {
    const { left, top } = canvas.getBoundingClientRect();
    return /** @type {Point} */ ([clientX - left, clientY - top]);
  };
  const spread = () => {
    const [[a, b], [c, d]] = [...held.values()];
    return Math.hypot(a - c, b - d);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, place(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = held.get(event.pointerId);
    if (!last) return;
    const before = held.size === 2 ? spread() : 0;
    if (held.size === 1) turn(last, place(event));
    held.set(event.pointerId, place(event));
    if (before > 0) zoom(spread() / before);
  });
  const end = (event) => {
    held.delete(event.pointerId);
    if (!held.size) rest();
  };
  ["pointerup", "pointercancel"].forEach((name) => canvas.addEventListener(name, end));
  canvas.addEventListener("wheel", (event) => {
    if (scrolls && !event.ctrlKey) return;
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY));
  }, { passive: false });
  const by = (x, y) => () => {
    const [a, b] = [canvas.clientWidth / 2, canvas.clientHeight / 2];
    turn([a, b], [a + x * STEP, b + y * STEP]);
    rest();
  };
  /** @type {Record<string, () => void>} */
  const moves = {
    ArrowLeft: by(-1, 0),
    ArrowRight: by(1, 0),
    ArrowUp: by(0, -1),
    ArrowDown: by(0, 1),
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
