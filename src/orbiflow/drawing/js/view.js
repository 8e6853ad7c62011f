/** A tiling without an end on a canvas: how it is moved by mouse, touch and keys, and when it is painted. */

import { Camera, inverse, moved, paint, sized } from "./tiling.js";

const LEAST_TILE = 26; // pixels of a tile when far away
const MOST_TILE = 3; // canvases that a tile fills when near
const STEP = 48; // pixels that an arrow key pans

export class View {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => any} tool gives the tool in hand: {down, move, up, cancel, hover, key, paint}, all optional
   */
  constructor(canvas, tool = () => null) {
    this.canvas = canvas;
    this.tool = tool;
    /** @type {((now: number) => void) | null} */
    this.before = null;
    /** @type {((place: Point | null) => void) | null} */
    this.onhover = null;
    /** @type {any} */
    this.tiling = undefined;
    /** @type {Camera} */
    this.camera = undefined;
    /** @type {Copy[]} */
    this.copies = [];
    this.pointers = new Map();
    this.layers = [];
    /** @type {{ line: number, palette: Palette, skins?: () => any[], over?: any }} */
    this.options = { line: 1.4, palette: null };
    this.frames = 0;
    this.#listen();
    this.watcher = new ResizeObserver(() => this.redraw());
    this.watcher.observe(this.canvas);
  }

  close() {
    this.watcher.disconnect();
    this.closed = true;
  }

  /** Show a tiling; the camera stays if there is one. */
  show(tiling) {
    this.tiling = tiling;
    this.redraw();
  }

  fit(across = 4) {
    const { width, height } = this.#size();
    this.camera = Camera.fit(this.tiling, width, height, across);
    this.redraw();
  }

  #size() {
    return { width: this.canvas.clientWidth || 1, height: this.canvas.clientHeight || 1 };
  }

  /** Paint at the next frame, once. */
  redraw() {
    if (this.asked || this.closed) return;
    this.asked = true;
    requestAnimationFrame((now) => {
      this.asked = false;
      if (this.closed || !this.tiling || !this.options.palette) return;
      if (!this.camera) this.fit();
      this.before?.(now);
      this.paint();
    });
  }

  paint() {
    const { context, width, height, ratio } = sized(this.canvas);
    const { line, palette, skins, over } = this.options;
    this.width = width;
    this.height = height;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = palette.paper ?? "#ffffff";
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    this.copies = paint(context, this.tiling, this.camera, palette, {
      width,
      height,
      ratio,
      line,
      skins: skins?.(),
      over,
    });
    for (const layer of this.layers) layer(context);
    this.tool()?.paint?.(context);
    this.frames += 1;
  }

  /** Keep a place of the canvas still while the scale changes. */
  zoom(by, [x, y] = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2]) {
    const { width, height } = this.#size();
    const size = Math.sqrt(this.tiling.area);
    const scale = Math.min(
      (MOST_TILE * Math.max(width, height)) / size,
      Math.max(LEAST_TILE / size, this.camera.scale * by),
    );
    const [u, v] = moved(inverse(this.camera.matrix(width, height)), [x, y]);
    this.camera.scale = scale;
    const [a, b] = moved(inverse(this.camera.matrix(width, height)), [x, y]);
    this.camera.x += u - a;
    this.camera.y += v - b;
    this.changed();
  }

  /** Move the picture by pixels. */
  pan(x, y) {
    const { width, height } = this.#size();
    const [u, v] = moved(inverse(this.camera.matrix(width, height)), [
      width / 2 - x,
      height / 2 - y,
    ]);
    Object.assign(this.camera, { x: u, y: v });
    this.changed();
  }

  changed() {
    this.redraw();
  }

  /**
   * @param {MouseEvent} event
   * @returns {Point}
   */
  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  #listen() {
    const { canvas, pointers } = this;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const step = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
      this.zoom(Math.exp(-step * (event.ctrlKey ? 0.01 : 0.0016)), this.place(event));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button > 1) return;
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, this.place(event));
      if (pointers.size === 2) {
        this.tool()?.cancel?.();
        this.busy = false;
      } else if (pointers.size === 1) {
        this.busy = Boolean(
          event.button === 0 && !event.shiftKey && this.tool()?.down?.(this.place(event), event),
        );
      }
    });
    canvas.addEventListener("pointermove", (event) => {
      const at = this.place(event);
      if (!pointers.has(event.pointerId)) {
        this.tool()?.hover?.(at, event);
        this.onhover?.(at);
        return;
      }
      this.#drag(event, at);
    });
    const end = (event) => {
      if (!pointers.delete(event.pointerId)) return;
      if (this.busy && !pointers.size) this.tool()?.up?.(this.place(event), event);
      this.busy = false;
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("pointerleave", () => {
      this.onhover?.(null);
      this.tool()?.leave?.();
    });
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  #drag(event, at) {
    const before = this.pointers.get(event.pointerId);
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      this.zoom(apart(at) / apart(before), other);
      this.pan((at[0] - before[0]) / 2, (at[1] - before[1]) / 2);
    } else if (this.busy) this.tool().move?.(at, event);
    else this.pan(at[0] - before[0], at[1] - before[1]);
    this.pointers.set(event.pointerId, at);
  }

  #key(event) {
    if (event.altKey || event.metaKey || event.ctrlKey) return;
    if (this.tool()?.key?.(event)) {
      event.preventDefault();
      return;
    }
    const pans = {
      ArrowLeft: [STEP, 0],
      ArrowRight: [-STEP, 0],
      ArrowUp: [0, STEP],
      ArrowDown: [0, -STEP],
    };
    if (pans[event.key]) this.pan(...pans[event.key]);
    else if (event.key === "+" || event.key === "=") this.zoom(1.25);
    else if (event.key === "-") this.zoom(0.8);
    else if (event.key === "0") this.fit();
    else return;
    event.preventDefault();
  }
}
