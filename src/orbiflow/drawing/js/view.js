/** A tiling without an end on a canvas: how it is moved by mouse, touch and keys, and when it is painted. */

import { Camera, inverse, moved, paint } from "./tiling.js";
import { ARROWS, atNextFrame, byHand, sized } from "./turned.js";

const LEAST_TILE = 26; // pixels of a tile when far away
const MOST_TILE = 3; // canvases that a tile fills when near
const PAN = 48; // pixels that an arrow key pans

export class View {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => any} tool gives the tool in hand: {down, move, up, cancel, hover, key, paint}, all optional, as `byHand` has them
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
  redraw = atNextFrame((now) => {
    if (this.closed || !this.tiling || !this.options.palette) return;
    if (!this.camera) this.fit();
    this.before?.(now);
    this.paint();
  });

  paint() {
    const context = this.canvas.getContext("2d");
    const { width, height, ratio } = sized(this.canvas);
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

  #listen() {
    const handed = (name) => (...given) => this.tool()?.[name]?.(...given);
    byHand(this.canvas, {
      drag: ([a, b], [c, d]) => this.pan(c - a, d - b),
      zoom: (by, at) => this.zoom(by, at),
      down: handed("down"),
      move: handed("move"),
      up: handed("up"),
      cancel: handed("cancel"),
      hover: (at) => {
        handed("hover")(at);
        this.onhover?.(at);
      },
      key: (event) => {
        const way = ARROWS[event.key];
        if (handed("key")(event)) return true;
        if (way) this.pan(-PAN * way[0], -PAN * way[1]);
        return Boolean(way);
      },
    }, { keys: { 0: () => this.fit() } });
  }
}
