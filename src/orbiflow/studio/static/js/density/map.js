/** The flat map of a density, with the table's rows as dots, a region that stands out, and a line that is held. */

import { unpack } from "../../api/scripts/surface.js";
import { atNextFrame, placeOn, sized } from "../../../../drawing/js/turned.js";
import { meridians } from "./grid.js";

const PALENESS = 0.85; // as the surface has it
export const dark = matchMedia("(prefers-color-scheme: dark)");
/** The grey of what lies outside a region. */
export const pale = () => (dark.matches ? 0.25 : 0.8);
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/**
 * Draw a canvas, and again when its size or the colours of the page change; returns what asks for it.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {AbortSignal} signal
 * @param {(pen: CanvasRenderingContext2D, width: number, height: number, ratio: number) => void} paint
 */
export function painted(canvas, signal, paint) {
  const soon = atNextFrame(() => {
    if (!canvas.clientWidth || signal.aborted) return;
    const { width, height, ratio } = sized(canvas);
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    paint(context, width, height, ratio);
  });
  new ResizeObserver(soon).observe(canvas);
  dark.addEventListener("change", soon, { signal });
  return soon;
}

export class FlatMap {
  /** `frame` is what `flat_frame` gives; `pick(u, v)` hears of pointers on the map. */
  constructor(canvas, signal, frame, pick) {
    this.frame = frame;
    this.colours = unpack(frame.colours, Uint8Array);
    this.points = unpack(frame.points, Float32Array);
    this.least = -Infinity;
    this.dots = true;
    this.held = null;
    this.redraw = painted(canvas, signal, (...given) => this.paint(...given));
    const heard = (event) => {
      if (!event.buttons || !this.box) return;
      const { x, y, w, h } = this.box, [a, b] = placeOn(canvas, event);
      const [u, v] = [(a - x) / w, 1 - (b - y) / h];
      pick(Math.max(0, Math.min(1, u)), Math.max(0, Math.min(1, v)));
    };
    for (const name of ["pointerdown", "pointermove"]) canvas.addEventListener(name, heard);
  }

  /** Show a grid of two axes, across and up. */
  show(grid, axes) {
    this.grid = grid;
    this.axes = axes;
    this.cache = null;
    this.redraw();
  }

  /** The place of the picture in the canvas: beside ticks on squares. */
  room(width, height) {
    const { map, onGlobe } = this.grid, pad = onGlobe ? [2, 2, 2, 2] : [54, 8, 20, 44];
    const [left, top, right, below] = pad,
      w = Math.min(width - left - right, (height - top - below) * map.aspect);
    return { x: left + (width - left - right - w) / 2, y: top, w, h: w / map.aspect };
  }

  paint(pen, width, height, ratio) {
    if (!this.grid) return;
    const box = this.room(width, height);
    this.box = box;
    if (box.w < 10) return;
    pen.drawImage(
      this.picture(Math.round(box.w * ratio), Math.round(box.h * ratio), ratio),
      box.x,
      box.y,
      box.w,
      box.h,
    );
    this.lines(pen, box);
    if (this.dots) this.draw(pen, box);
    if (this.held) this.hold(pen, box);
  }

  /** The colours of all pixels, inside of regions and outside, which are kept while the size stays. */
  pixels(w, h) {
    if (
      this.cache?.w === w && this.cache.h === h && this.cache.grid === this.grid &&
      this.cache.grey === pale()
    ) return this.cache;
    const { grid, colours } = this,
      logs = new Float32Array(w * h),
      strong = new Uint32Array(w * h),
      weak = new Uint32Array(w * h),
      grey = pale();
    const pack = (rgb) => (255 << 24) | (rgb[2] << 16) | (rgb[1] << 8) | rgb[0];
    const ramp = Array.from({ length: 256 }, (_, k) => colours.subarray(4 * k, 4 * k + 3));
    const full = ramp.map(pack),
      faint = ramp.map((rgb) =>
        pack([0, 1, 2].map((k) => Math.round(rgb[k] + PALENESS * (255 * grey - rgb[k]))))
      );
    for (let j = 0; j < h; j += 1) {
      for (let i = 0; i < w; i += 1) {
        const k = j * w + i, place = grid.map.place((i + 0.5) / w, 1 - (j + 0.5) / h);
        logs[k] = NaN;
        if (!place) continue;
        logs[k] = grid.at(place[0], place[1]);
        const tone = Math.round(255 * grid.tone(logs[k]));
        strong[k] = full[tone];
        weak[k] = faint[tone];
      }
    }
    this.cache = { w, h, grid, grey, logs, strong, weak };
    return this.cache;
  }

  picture(w, h, ratio) {
    const { logs, strong, weak } = this.pixels(w, h),
      made = new OffscreenCanvas(w, h),
      image = new ImageData(w, h);
    const out = new Uint32Array(image.data.buffer),
      { least } = this,
      wide = Math.max(1, Math.round(0.8 * ratio));
    for (let k = 0; k < out.length; k += 1) {
      const inside = logs[k] >= least;
      out[k] = inside || least === -Infinity ? strong[k] : weak[k];
      const edge = inside !== logs[k + wide] >= least || inside !== logs[k + wide * w] >= least;
      if (
        edge && least > -Infinity && strong[k] && (k % w) + wide < w && k + wide * w < out.length &&
        strong[k + wide] && strong[k + wide * w]
      ) out[k] = dark.matches ? 0xffffffff : 0xff1a1a1a;
    }
    made.getContext("2d").putImageData(image, 0, 0);
    return made;
  }

  lines(pen, box) {
    const at = ([x, y]) => [box.x + x * box.w, box.y + (1 - y) * box.h];
    pen.lineWidth = 1;
    if (this.grid.onGlobe) {
      pen.strokeStyle = "rgb(255 255 255 / 35%)";
      for (const line of meridians(this.grid)) {
        pen.stroke(new Path2D(`M${line.map(at).join("L")}`));
      }
      pen.strokeStyle = ink("--edge");
      pen.beginPath();
      pen.ellipse(box.x + box.w / 2, box.y + box.h / 2, box.w / 2, box.h / 2, 0, 0, 7);
      pen.stroke();
      return;
    }
    pen.strokeStyle = ink("--edge");
    pen.strokeRect(box.x - 0.5, box.y - 0.5, box.w + 1, box.h + 1);
    pen.fillStyle = ink("--ink");
    pen.font = "13px system-ui, sans-serif";
    const [across, up] = this.axes.map((axis) => this.frame.axes[axis]);
    pen.textAlign = "center";
    across.at.forEach((t, k) =>
      pen.fillText(across.texts[k], box.x + t * box.w, box.y + box.h + 18)
    );
    pen.fillText(across.label, box.x + box.w / 2, box.y + box.h + 38);
    pen.textAlign = "right";
    up.at.forEach((t, k) => pen.fillText(up.texts[k], box.x - 6, box.y + (1 - t) * box.h + 4));
    pen.save();
    pen.translate(box.x - 42, box.y + box.h / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(up.label, 0, 0);
    pen.restore();
  }

  /** The rows: places in the window, or degrees north and east. */
  draw(pen, box) {
    const { points, grid, axes } = this,
      wide = grid.onGlobe ? 2 : this.frame.axes.length,
      many = this.frame.shown > 500;
    pen.fillStyle = many
      ? `rgb(255 255 255 / ${dark.matches ? 40 : 60}%)`
      : "rgb(255 255 255 / 85%)";
    pen.strokeStyle = "rgb(26 26 26 / 75%)";
    pen.lineWidth = many ? 0.3 : 0.7;
    for (let k = 0; k < points.length; k += wide) {
      const own = (axis) => points[k + axis];
      const [x, y] = grid.onGlobe
        ? grid.map.spot(0.5 + own(1) / 360, 0.5 + own(0) / 180)
        : axes.map(own);
      pen.beginPath();
      pen.arc(box.x + x * box.w, box.y + (1 - y) * box.h, many ? 1.1 : 2, 0, 7);
      pen.fill();
      pen.stroke();
    }
  }

  /** The line along which one axis is held. */
  hold(pen, box) {
    const { axis, place } = this.held, x = box.x + place * box.w, y = box.y + (1 - place) * box.h;
    const [from, to] = axis === 0
      ? [[x, box.y], [x, box.y + box.h]]
      : [[box.x, y], [box.x + box.w, y]];
    for (const [colour, width] of [["#fff", 5], ["#c81e5a", 2.5]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.stroke(new Path2D(`M${from}L${to}`));
    }
  }
}

/**
 * A bar of colours with its ticks, from left to right.
 *
 * @param {CanvasRenderingContext2D} pen
 * @param {number} width
 * @param {any} frame
 * @param {any} data
 */
export function drawBar(pen, width, frame, data) {
  const colours = unpack(frame.colours, Uint8Array), left = 8, across = width - 2 * left;
  for (let k = 0; k < 256; k += 1) {
    pen.fillStyle = `rgb(${colours.subarray(4 * k, 4 * k + 3)})`;
    pen.fillRect(left + (k * across) / 256, 0, across / 256 + 1, 12);
  }
  pen.fillStyle = ink("--ink");
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "center";
  let end = -Infinity;
  for (const { at, text } of data.ticks) {
    const half = pen.measureText(text).width / 2,
      x = Math.max(half, Math.min(width - half, left + at * across));
    if (x - half < end + 6) continue;
    pen.fillText(text, x, 27);
    end = x + half;
  }
  pen.fillText(data.measure, width / 2, 46);
}

/**
 * A curve over an axis of the window, filled down to its foot, with what is inside a region filled strongly.
 *
 * @param {CanvasRenderingContext2D} pen
 * @param {number} width
 * @param {number} height
 * @param {{ values: number[], axis: any, least?: number }} curve
 */
export function drawCurve(pen, width, height, { values, axis, least = -Infinity }) {
  const [left, top, right, below] = [14, 10, 14, 44],
    w = width - left - right,
    h = height - top - below,
    foot = top + h,
    peak = Math.max(...values);
  const x = (k) => left + ((k + 0.5) / values.length) * w,
    y = (value) => foot - (value / peak / 1.06) * h;
  const fill = (colour, inside) => {
    pen.fillStyle = colour;
    const wide = w / values.length;
    values.forEach((value, k) => {
      if (inside(value)) pen.fillRect(x(k) - wide / 2, y(value), wide + 0.7, foot - y(value));
    });
  };
  fill(ink("--line"), () => true);
  fill(ink("--accent"), (value) => least > -Infinity && Math.log(value) >= least);
  pen.strokeStyle = ink("--accent");
  pen.lineWidth = 2.5;
  pen.lineJoin = "round";
  pen.stroke(new Path2D(`M${values.map((value, k) => [x(k), y(value)]).join("L")}`));
  pen.strokeStyle = ink("--edge");
  pen.lineWidth = 1;
  pen.stroke(new Path2D(`M${left} ${foot + 0.5}h${w}`));
  pen.fillStyle = ink("--ink");
  pen.font = "13px system-ui, sans-serif";
  axis.at.forEach((t, k) => {
    pen.textAlign = t === 0 ? "left" : t === 1 ? "right" : "center";
    pen.fillText(axis.texts[k], left + t * w + (t === 0 ? -10 : t === 1 ? 10 : 0), foot + 18);
  });
  pen.textAlign = "center";
  pen.fillText(axis.label, left + w / 2, foot + 38);
}
