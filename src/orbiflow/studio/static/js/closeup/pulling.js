/** The tool that pulls a point of the outline. */

import { inverse, moved } from "../../../../drawing/js/tiling.js";
import { Puller } from "./pull.js";

const GRIP = 18; // pixels around the outline in which a mouse takes hold
const FINGER = 34;
const STILL = 2e-5; // movement, in sizes of the tile, below which nothing is left to follow
const LAST = 60; // steps at most after a hand has let go
const SETTLED = 900; // ms after the last key until a tile is checked
const EDGE = 50; // pixels of the picture's edge that a chosen point keeps free
const [FREE, STOPPED] = ["#0b6b66", "#8a5a00"]; // the point in hand
const KEY_STEP = 6; // pixels that a key moves a point

export class Pulling {
  /** `on`: {released(parameters, inside), said(text), changed()}; `settings`: {what, reach, lattice, gives}. */
  constructor(stage, settings, on) {
    this.stage = stage;
    this.settings = settings;
    this.on = on;
    this.chosen = null;
  }

  /** Take the space of the tile that is shown. */
  use(space) {
    this.puller = space ? new Puller(space) : null;
    this.hand = null;
    this.waiting = false;
    if (this.chosen && this.puller) this.chosen = this.#point(this.chosen.number);
  }

  get size() {
    return Math.sqrt(this.puller?.area ?? this.stage.tiling.area);
  }

  get ready() {
    return Boolean(this.puller) && !this.waiting;
  }

  down(place, event) {
    if (!this.ready) return false;
    if (this.settings.what === "inside") return this.#downInside(place);
    const found = this.stage.outlineAt(place, event.pointerType === "touch" ? FINGER : GRIP);
    if (!found) return false;
    this.#take(found);
    const [x, y] = this.puller.held();
    const own = moved(inverse(this.stage.matrixOf(found.copy)), place);
    this.hand.offset = [x - own[0], y - own[1]];
    this.aim = place;
    this.#follow();
    return true;
  }

  #downInside(place) {
    const found = this.stage.copyAt(place);
    if (!found) return false;
    const { reach, gives, lattice } = this.settings;
    this.puller.grabInside(found.at, reach * this.size, { gives, lattice });
    const [x, y] = this.puller.held();
    this.hand = { copy: found.copy, offset: [x - found.at[0], y - found.at[1]] };
    this.aim = place;
    this.#follow();
    return true;
  }

  #take({ copy, vertex, share }) {
    if (this.puller.isHeld(share < 0.5 ? vertex : vertex + 1, copy.figure)) {
      this.on.said(
        "This point is a turning point of the pattern. It moves when the grid does, or pull next to it.",
      );
    }
    this.puller.grab(vertex, share, this.settings.reach * this.size, {
      lattice: this.settings.lattice,
      figure: copy.figure,
    });
    this.hand = { copy, vertex, share, offset: [0, 0] };
  }

  move(place) {
    this.aim = place;
    this.#follow();
  }

  hover(place) {
    const inside = this.settings.what === "inside";
    const found = (this.ready && !inside && this.stage.outlineAt(place, GRIP)) || null;
    this.stage.canvas.style.cursor = found || inside ? "grab" : "";
    if (found || this.near) this.stage.redraw();
    this.near = found;
  }

  leave() {
    this.near = null;
    this.stage.redraw();
  }

  up() {
    if (!this.hand) return;
    // what was still to follow
    for (let k = 0; k < LAST && this.#step() > STILL; k += 1);
    this.#show();
    this.#release();
  }

  cancel() {
    if (this.hand) this.back();
  }

  #release() {
    const pulled = this.puller.moved() > 1e-4;
    this.hand = null;
    this.stopped = false;
    this.aim = null;
    if (!pulled) {
      this.back();
      return;
    }
    this.waiting = true;
    this.on.released(this.puller.parameters(), this.puller.insides());
  }

  /** Let the outline follow the pointer. */
  #follow() {
    this.stage.before = () => {
      if (!this.hand || !this.aim) {
        this.stage.before = null;
        return;
      }
      const left = this.#step();
      this.#show();
      if (left > STILL) setTimeout(() => this.stage.redraw());
    };
    this.stage.redraw();
  }

  #step() {
    const own = moved(inverse(this.stage.matrixOf(this.hand.copy)), this.aim);
    /** @type {Point} */
    const goal = [own[0] + this.hand.offset[0], own[1] + this.hand.offset[1]];
    const { left, stopped } = this.puller.follow(goal);
    this.stopped = stopped;
    return left;
  }

  #show() {
    const { tiling } = this.stage;
    tiling.place(this.puller.placement());
    tiling.outlines(this.puller.outlines(), { exact: false });
    this.on.changed({ stopped: this.stopped, body: this.puller.body() });
  }

  /** Spring back to the tile as it was. */
  back() {
    this.waiting = false;
    this.hand = null;
    this.aim = null;
    this.stopped = false;
    if (!this.puller) return;
    const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const from = this.puller.z.slice();
    this.puller.reset();
    const to = this.puller.z.slice();
    const began = performance.now();
    this.stage.before = (now) => {
      if (this.hand || !this.puller) return;
      const share = calm ? 1 : Math.min(1, Math.max(0, (now - began) / 220));
      const eased = 1 - (1 - share) ** 3;
      this.puller.z.forEach((_, k) => {
        this.puller.z[k] = from[k] + eased * (to[k] - from[k]);
      });
      this.#show();
      if (share < 1) setTimeout(() => this.stage.redraw());
      else {
        this.stage.before = null;
        this.stage.tiling.outlines(this.puller.outlines());
        this.on.changed({ stopped: false, body: null });
      }
    };
    this.stage.redraw();
  }

  /** Arrows choose a point, shift and arrows move it; Enter lets go, Escape springs back. */
  key(event) {
    if (!this.ready || (this.settings.what === "inside" && !this.hand)) return false;
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[event.key];
    if (way && event.shiftKey) {
      this.#nudge(way);
      return true;
    }
    if (way) {
      this.#choose(way[0] + way[1] || 0);
      return true;
    }
    if (event.key === "Enter" && this.hand) {
      clearTimeout(this.timer);
      this.up();
      return true;
    }
    if (event.key === "Escape" && this.hand) {
      clearTimeout(this.timer);
      this.back();
      this.on.said("Put back.");
      return true;
    }
    return false;
  }

  #choose(step) {
    if (this.hand) this.up();
    const { count } = this;
    const stride = Math.max(1, Math.round(count / 120));
    this.chosen = this.#point(this.chosen ? this.chosen.number + step * stride : 0);
    this.#seek();
    const number = this.chosen.number + 1;
    this.on.said(`Point ${number} of ${count}. Hold shift and press an arrow key to move it.`);
  }

  /** How many points can be chosen, of all figures. */
  get count() {
    return this.puller.rings.reduce((sum, ring) => sum + ring.length, 0);
  }

  /** The point of a number, on the copy that is chosen or in the middle. */
  #point(given) {
    const number = (given + this.count) % this.count;
    let [figure, vertex] = [0, number];
    for (; vertex >= this.puller.rings[figure].length; figure += 1) {
      vertex -= this.puller.rings[figure].length;
    }
    const known = this.chosen?.copy;
    const copy = known?.figure === figure &&
      this.stage.copies.find((own) =>
        own.aspect === known.aspect && String(own.cell) === String(known.cell)
      );
    return { number, vertex, copy: copy || this.#middleCopy(figure) };
  }

  /** Bring the chosen point into view. */
  #seek() {
    const { copy, point } = this.#pointOf({ ...this.chosen, share: 0 });
    const [x, y] = moved(this.stage.matrixOf(copy), point);
    const { width, height } = this.stage;
    if (x < EDGE || y < EDGE || x > width - EDGE || y > height - EDGE) {
      this.stage.pan(width / 2 - x, height / 2 - y);
    }
    this.stage.redraw();
  }

  /** The copy of a figure that is nearest to the middle of the canvas. */
  #middleCopy(figure) {
    const { width, height, copies, tiling } = this.stage;
    const { x: u, y: v } = tiling.figures[figure].middle;
    const apart = ({ matrix }) => {
      const [x, y] = moved(matrix, [u, v]);
      return Math.hypot(x - width / 2, y - height / 2);
    };
    return copies.filter((own) => own.figure === figure)
      .reduce((a, b) => (apart(b) < apart(a) ? b : a));
  }

  #nudge([x, y]) {
    if (!this.chosen) this.#choose(0);
    if (!this.hand) {
      this.#take({ ...this.chosen, share: 0 });
      this.aim = moved(this.stage.matrixOf(this.chosen.copy), this.puller.held());
    }
    this.aim = [this.aim[0] + KEY_STEP * x, this.aim[1] + KEY_STEP * y];
    this.#follow();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.hand && this.up(), SETTLED);
  }

  /** The circle of the reach, the point in hand, and a line to a hand that went on. */
  paint(context) {
    const at = this.hand
      ? { copy: this.hand.copy, point: this.puller.grip() }
      : this.near
      ? this.#pointOf(this.near)
      : this.chosen && this.puller
      ? this.#pointOf({ ...this.chosen, share: 0 })
      : null;
    if (!at) return;
    const [x, y] = moved(this.stage.matrixOf(at.copy), at.point);
    const reach = this.settings.reach * this.size * this.stage.camera.scale;
    const ring = (radius, wide, colour, dash = []) => {
      context.setLineDash(dash);
      context.lineWidth = wide;
      context.strokeStyle = colour;
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.stroke();
    };
    if (this.stopped) {
      context.setLineDash([]);
      context.lineWidth = 2;
      context.strokeStyle = STOPPED;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(...this.aim);
      context.stroke();
    }
    ring(reach, 4, "rgb(255 255 255 / 70%)");
    ring(reach, 1.6, this.stopped ? STOPPED : FREE, [7, 5]);
    context.setLineDash([]);
    context.fillStyle = this.stopped ? STOPPED : FREE;
    context.beginPath();
    context.arc(x, y, 6, 0, 2 * Math.PI);
    context.fill();
    ring(6, 2.5, "#ffffff");
  }

  /**
   * @param {{ copy: Copy, vertex: number, share: number }} place
   * @returns {{ copy: Copy, point: Point }}
   */
  #pointOf({ copy, vertex, share }) {
    const ring = this.stage.tiling.figures[copy.figure].polygon;
    const [a, b] = [ring[vertex % ring.length], ring[(vertex + 1) % ring.length]];
    return { copy, point: [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])] };
  }
}
