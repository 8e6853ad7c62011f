/** What is turned by hand on a canvas, a surface, a stack of solids or a world: mouse, touch and keys. */

const STEP = 30; // pixels by which an arrow key drags
const NEARER = 1.25; // by which + comes nearer

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

/**
 * Give a canvas as many pixels as the screen has where it lies; returns its sides in CSS pixels, and how many of its own
 * one of these has.
 *
 * @param {HTMLCanvasElement} canvas
 */
export function sized(canvas) {
  const ratio = Math.min(devicePixelRatio || 1, 2);
  const [width, height] = [canvas.clientWidth || 1, canvas.clientHeight || 1];
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  return { width, height, ratio };
}

/** A program of WebGL 2 of two shaders. */
export function programOf(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  const fine = gl.getProgramParameter(made, gl.LINK_STATUS) || gl.isContextLost();
  if (!fine) throw new Error(gl.getProgramInfoLog(made));
  return made;
}

/** Let a program take an attribute from what is stored, `size` numbers of a type at a time. */
export function feed(gl, made, name, buffer, size, type, normalised = false, places = [0, 0, 0]) {
  const place = gl.getAttribLocation(made, name), [stride, offset, divisor] = places;
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, size, type, normalised, stride, offset);
  gl.vertexAttribDivisor(place, divisor);
}

/** Numbers in a buffer of the graphics card. */
export function stored(gl, values, target = gl.ARRAY_BUFFER) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(target, buffer);
  gl.bufferData(target, values, gl.STATIC_DRAW);
  return buffer;
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
 * What turns and zooms a view by its `yaw`, `pitch` and `zoom`, for `byHand`.
 *
 * @param {HTMLCanvasElement} canvas
 * @param { { yaw: number, pitch: number, zoom: number } } view
 * @param {() => void} redraw
 * @returns {Hand}
 */
export const byAngles = (canvas, view, redraw) => ({
  drag([a, b], [c, d]) {
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
 * What hears of mouse, fingers, pen and keys; places are in CSS pixels of the canvas. All but `drag` and `zoom` may be
 * left out.
 *
 * @typedef {object} Hand
 * @property {(from: Point, to: Point) => void} drag the view is dragged, or moved by an arrow key
 * @property {(factor: number, at?: Point) => boolean | void} zoom by wheel, two fingers or keys; false if it cannot
 * @property {() => void} [rest] nothing is held any more
 * @property {(at: Point, event: PointerEvent) => boolean} [down] whether a tool takes the pointer, and not the view
 * @property {(at: Point, event: PointerEvent) => void} [move] of the tool
 * @property {(at: Point, event: PointerEvent) => void} [up] of the tool
 * @property {() => void} [cancel] the tool, as a second finger has come
 * @property {(at: Point | null, event: PointerEvent) => void} [hover] with nothing held; null when it leaves
 * @property {(event: KeyboardEvent) => boolean} [key] whether the tool takes a key
 */

/** Ways that arrow keys point, y downwards. */
export const ARROWS = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

/**
 * Where on an element something happens.
 *
 * @param {Element} element
 * @param {MouseEvent} event
 * @returns {Point}
 */
export function placeOn(element, { clientX, clientY }) {
  const { left, top } = element.getBoundingClientRect();
  return [clientX - left, clientY - top];
}

/**
 * Let a canvas be moved by hand.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {Hand} hand
 * @param { { keys?: Record<string, () => void>, scrolls?: boolean } } more further keys; whether the page scrolls: then
 *   the wheel zooms only with the Ctrl key
 */
export function byHand(canvas, hand, { keys = {}, scrolls = false } = {}) {
  /** @type {Map<number, Point>} */
  const held = new Map();
  let busy = false; // whether the tool has the pointer
  const place = (event) => placeOn(canvas, event);
  /** The middle of what is held, and how far that is apart. */
  const grip = () => {
    const [[a, b], [c, d] = [a, b]] = held.values();
    return {
      middle: /** @type {Point} */ ([(a + c) / 2, (b + d) / 2]),
      apart: Math.hypot(a - c, b - d),
    };
  };
  /** @type {Record<string, (event: any) => any>} */
  const heard = {
    pointerdown(event) {
      if (event.button > 1) return;
      if (event.button === 1) event.preventDefault(); // or the page would scroll
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, place(event));
      if (held.size > 1 && busy) hand.cancel?.();
      const free = held.size === 1 && event.button === 0 && !event.shiftKey;
      busy = Boolean(free && hand.down?.(place(event), event));
    },
    pointermove(event) {
      const at = place(event);
      if (!held.has(event.pointerId)) return hand.hover?.(at, event);
      const before = grip();
      held.set(event.pointerId, at);
      if (busy) return hand.move?.(at, event);
      const now = grip();
      hand.drag(before.middle, now.middle);
      if (before.apart) hand.zoom(now.apart / before.apart, now.middle);
    },
    pointerup(event) {
      if (!held.delete(event.pointerId)) return;
      if (busy) hand.up?.(place(event), event);
      busy = false;
      if (!held.size) hand.rest?.();
    },
    pointercancel: (event) => heard.pointerup(event),
    pointerleave: (event) => held.size || hand.hover?.(null, event),
    wheel(event) {
      if (scrolls && !event.ctrlKey) return;
      const step = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
      const speed = event.ctrlKey && !scrolls ? 0.01 : 0.0016; // two fingers on a pad come as Ctrl
      if (hand.zoom(Math.exp(-step * speed), place(event)) !== false) event.preventDefault();
    },
    keydown(event) {
      const { key } = event;
      if (event.altKey || event.ctrlKey || event.metaKey) return;
      if (hand.key?.(event)) return event.preventDefault();
      if (keys[key]) keys[key]();
      else if (key === "+" || key === "=") hand.zoom(NEARER);
      else if (key === "-") hand.zoom(1 / NEARER);
      else if (ARROWS[key]) {
        const [a, b] = [canvas.clientWidth / 2, canvas.clientHeight / 2];
        hand.drag([a, b], [a + ARROWS[key][0] * STEP, b + ARROWS[key][1] * STEP]);
        hand.rest?.();
      } else return;
      event.preventDefault();
    },
  };
  for (const [name, hear] of Object.entries(heard)) {
    canvas.addEventListener(name, hear, { passive: false });
  }
}
