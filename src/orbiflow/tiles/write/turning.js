/**
 * A sphere or the hyperbolic plane full of copies of a tile, to be turned by hand.
 *
 * Points are vectors of three numbers, motions are nine, row by row. Copies are found from neighbour to neighbour,
 * from the one in the middle, as long as they can be seen.
 */

import { atNextFrame, byHand, sized } from "../../drawing/js/turned.js";

const LEAST = [4, 9]; // pixels of the smallest copies, at rest and in the hand
const DRAWN = [40, 110]; // pixels of those that carry their drawing, at rest and in the hand
const FARTHEST = 1e3; // hyperbolic cosine of the distance at which copies are counted anew
const MOST = 6000; // copies
const SAVED = 2400; // pixels of a picture to keep

/** @type {(id: string) => any} */
const at = (id) => document.getElementById(id);
const times = (a, b) =>
  Array.from({ length: 9 }, (_, k) => {
    const [i, j] = [3 * Math.floor(k / 3), k % 3];
    return a[i] * b[j] + a[i + 1] * b[j + 3] + a[i + 2] * b[j + 6];
  });
/** @type {(m: number[], v: number[]) => number[]} */
const moved = (m, [x, y, z]) => [0, 3, 6].map((i) => m[i] * x + m[i + 1] * y + m[i + 2] * z);

/** The world of `data`, as `turning_page` describes it. */
class World {
  constructor(data) {
    this.data = data;
    this.sign = data.sign;
    this.start();
  }

  /** As it was at first. */
  start() {
    this.motion = this.data.view; // of the copy in the middle
    this.colours = this.data.moves?.[0].map((_, k) => k) ?? [];
    this.chosen = new Map(); // the colours of copies, where the group does not permute them
    this.own = [1, 0, 0, 0, 1, 0, 0, 0, 1]; // its motion from the first copy
    this.radius = 0.47;
  }

  /** What moves one place of the picture to another; both in radii from its middle, y upwards. */
  turn(from, to) {
    const [a, b] = [from, to].map((place) => this.#lifted(place));
    this.motion = this.#kept(times(this.#shift(b), times(this.#shift(a, -1), this.motion)));
    for (let best = true; best;) { // the copy in the middle is another one now
      best = false;
      const here = moved(this.motion, this.data.middle)[2];
      this.data.near.forEach((near, k) => {
        const motion = times(this.motion, near);
        const closer = this.sign * (moved(motion, this.data.middle)[2] - here) > 1e-9;
        if (best || !closer) return;
        this.motion = motion;
        this.own = times(this.own, near);
        this.colours = this.data.moves?.[k].map((c) => this.colours[c]) ?? [];
        best = true;
      });
    }
    if (!this.data.moves && Math.abs(this.own[8]) > FARTHEST) this.#anchor();
  }

  /** Far from the first copy places can no longer be told apart: count from the one in the middle. */
  #anchor() {
    const [a, b, c, d, e, f, g, h, i] = this.own;
    const back = [a, d, -g, b, e, -h, -c, -f, i]; // the inverse, by the form
    const known = new Map();
    for (const { own, colour } of this.copies(this.scale)) {
      known.set(this.#key(times(back, own)), colour);
    }
    this.chosen = known;
    this.own = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  }

  #key(own) {
    return moved(own, this.data.middle).map((v) => Math.round(100 * v)).join();
  }

  #lifted([x, y]) {
    const far = Math.hypot(x, y);
    if (this.sign > 0) {
      const most = Math.min(1, 0.98 / (far || 1));
      return [x * most, y * most, Math.sqrt(1 - (far * most) ** 2)];
    }
    const most = Math.min(1, 0.95 / (far || 1));
    const square = (far * most) ** 2;
    return [2 * x * most, 2 * y * most, 1 + square].map((v) => v / (1 - square));
  }

  /** The motion along a line from the middle to a point, or `way` -1 back. */
  #shift(point, way = 1) {
    const [x, y, z] = point;
    const far = Math.hypot(x, y);
    if (!far) return [1, 0, 0, 0, 1, 0, 0, 0, 1];
    const [c, s] = [x / far, y / far];
    const [p, q] = [z, way * far];
    const turn = [c, -s, 0, s, c, 0, 0, 0, 1];
    const back = [c, s, 0, -s, c, 0, 0, 0, 1];
    return times(turn, times([p, 0, q, 0, 1, 0, -this.sign * q, 0, p], back));
  }

  /** A motion without the rounding that has gathered. */
  #kept(m) {
    const sign = [1, 1, this.sign];
    const columns = [2, 0, 1].map((k) => [m[k], m[k + 3], m[k + 6]]);
    const dot = (a, b) => a.reduce((sum, v, k) => sum + sign[k] * v * b[k], 0);
    const found = [];
    for (const column of columns) {
      let own = column;
      for (const other of found) {
        const share = dot(own, other) / dot(other, other);
        own = own.map((v, k) => v - share * other[k]);
      }
      const long = Math.sqrt(Math.abs(dot(own, own)));
      found.push(own.map((v) => v / long));
    }
    const [z, x, y] = found;
    return [0, 1, 2].flatMap((k) => [x[k], y[k], z[k]]);
  }

  /** Where a vector is seen, in radii; what is behind a sphere lies on its edge. */
  place(vector) {
    const [x, y, z] = vector;
    if (this.sign < 0) return [x / (1 + z), y / (1 + z)];
    if (z >= 0) return [x, y];
    const far = Math.hypot(x, y) || 1;
    return [x / far, y / far];
  }

  /** All copies that are seen at so many pixels a radius: {motion, colour, size}. */
  copies(scale, least = LEAST[0]) {
    const { near, moves, middle, around } = this.data;
    const key = (motion) =>
      moved(motion, middle).map((v, k, all) =>
        Math.round(1e4 * (this.sign < 0 && k < 2 ? v / (1 + all[2]) : k < 2 ? v : Math.sign(v)))
      ).join();
    const found = [];
    const known = new Set([key(this.motion)]);
    let level = [{ motion: this.motion, colours: this.colours, own: this.own }];
    while (level.length > 0 && found.length < MOST) {
      const next = [];
      for (const { motion, colours, own } of level) {
        const places = around.map((v) => this.place(moved(motion, v)));
        const [x, y] = [0, 1].map((k) => places.map((p) => p[k]));
        const size = scale *
          Math.max(Math.max(...x) - Math.min(...x), Math.max(...y) - Math.min(...y));
        if (this.sign < 0 && size < least) continue;
        found.push({ motion, own, colour: moves ? colours[0] : this.#colour(own), size });
        near.forEach((step, k) => {
          const ahead = times(motion, step);
          const name = key(ahead);
          if (known.has(name)) return;
          known.add(name);
          next.push(
            moves
              ? { motion: ahead, colours: moves[k].map((c) => colours[c]), own }
              : { motion: ahead, colours, own: times(own, step) },
          );
        });
      }
      level = next;
    }
    return found;
  }

  /** The colour of a copy by its motion from the first one: one that its neighbours do not have. */
  #colour(own) {
    const name = this.#key(own);
    if (!this.chosen.has(name)) {
      const taken = this.data.near.map((step) => this.chosen.get(this.#key(times(own, step))));
      let colour = 0;
      while (taken.includes(colour)) colour += 1;
      this.chosen.set(name, colour % this.data.count);
    }
    return this.chosen.get(name);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number} width
   * @param {number} height
   * @param {boolean} [quick] whether it is in the hand
   */
  paint(context, width, height, quick) {
    const { data, sign } = this;
    const scale = this.radius * Math.min(width, height);
    const drawn = DRAWN[Number(Boolean(quick))];
    this.scale = scale;
    const path = (motion, vectors, closed) => {
      const found = new Path2D();
      vectors.forEach((v, k) => {
        const [x, y] = this.place(moved(motion, v));
        found[k ? "lineTo" : "moveTo"](width / 2 + scale * x, height / 2 - scale * y);
      });
      if (closed) found.closePath();
      return found;
    };
    const hidden = ({ motion }) => sign > 0 && data.around.every((v) => moved(motion, v)[2] < 0);
    context.fillStyle = data.paper;
    context.fillRect(0, 0, width, height);
    context.lineJoin = "round";
    const copies = this.copies(scale, LEAST[Number(Boolean(quick))]).filter((own) => !hidden(own));
    const outlines = copies.map(({ motion, size }) => {
      const step = size > DRAWN[0] ? 1 : size > 12 ? 4 : 10;
      return data.rings.map((ring) => path(motion, ring.filter((_, k) => k % step === 0), true));
    });
    copies.forEach(({ colour }, k) => {
      context.lineWidth = 0.6;
      outlines[k].forEach((outline, kind) => {
        context.fillStyle = context.strokeStyle = data.fills[kind * data.count + colour];
        context.fill(outline);
        context.stroke(outline);
      });
    });
    copies.forEach(({ motion, size, colour }) => {
      if (size < drawn) return;
      data.parts.forEach((part) => {
        context.globalAlpha = part.opacity;
        const whole = new Path2D();
        part.curves.forEach(([vectors, closed]) => whole.addPath(path(motion, vectors, closed)));
        const number = part.kind * data.count + colour;
        const ink = (own) => (own === "currentColor" ? data.inks[number] : own);
        if (part.fill) {
          context.fillStyle = ink(part.fill);
          context.fill(whole, "evenodd");
        }
        if (part.stroke) {
          context.strokeStyle = ink(part.stroke);
          context.lineWidth = Math.max(0.5, part.width * size);
          context.stroke(whole);
        }
      });
      context.globalAlpha = 1;
    });
    context.strokeStyle = data.outline;
    copies.forEach(({ size }, k) => {
      context.lineWidth = Math.min(1.6, size / 60);
      outlines[k].forEach((outline) => context.stroke(outline));
    });
    context.lineWidth = 1.6;
    context.beginPath();
    context.arc(width / 2, height / 2, scale, 0, 2 * Math.PI);
    context.stroke();
  }
}

/** Show a world, and let it be turned. @param {any} data */
export function showWorld(data) {
  const world = new World(data);
  const canvas = at("view");
  let inHand = false;
  const draw = atNextFrame(() => {
    sized(canvas);
    world.paint(canvas.getContext("2d"), canvas.width, canvas.height, inHand);
    canvas.dataset.drawn = "yes";
  });
  const zoom = (by) => {
    world.radius = Math.min(20, Math.max(0.1, world.radius * by));
    draw();
  };
  byHand(canvas, {
    drag(from, to) {
      const scale = world.radius * Math.min(canvas.clientWidth, canvas.clientHeight);
      const places = [from, to].map(([x, y]) => [
        (x - canvas.clientWidth / 2) / scale,
        (canvas.clientHeight / 2 - y) / scale,
      ]);
      inHand = true;
      world.turn(...places);
      draw();
    },
    zoom,
    rest() {
      inHand = false;
      draw();
    },
  });
  at("nearer").onclick = () => zoom(1.2);
  at("farther").onclick = () => zoom(1 / 1.2);
  at("fit").onclick = () => {
    world.start();
    draw();
  };
  at("png").onclick = () => {
    const made = document.createElement("canvas");
    Object.assign(made, { width: SAVED, height: SAVED });
    world.paint(made.getContext("2d"), SAVED, SAVED);
    const link = document.createElement("a");
    Object.assign(link, { download: `${data.name}.png`, href: made.toDataURL("image/png") });
    link.click();
  };
  addEventListener("resize", draw);
  draw();
}
