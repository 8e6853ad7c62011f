/** The tool that pulls a point of the outline. */

import { inverse, moved } from "../../../../drawing/js/tiling.js";
import { isSame } from "./stage.js";
import { ARROWS } from "../../../../drawing/js/turned.js";
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
    const found = this.settings.what === "inside"
      ? this.stage.copyAt(place)
      : this.stage.outlineAt(place, event.pointerType === "touch" ? FINGER : GRIP);
    if (!found) return false;
    this.#take(found);
    const [[x, y], [u, v]] = [this.puller.held(), this.#inTile(place)];
    this.hand.offset = [x - u, y - v];
    this.move(place);
    return true;
  }

  /** Take hold of the outline, or of what lies inside `at` a place of the tile. */
  #take({ copy, at, vertex, share }) {
    const { reach, gives, lattice } = this.settings;
    const far = reach * this.size;
    this.hand = { copy, offset: [0, 0] };
    if (at) return this.puller.grabInside(at, far, { gives, lattice });
    if (this.puller.isHeld(share < 0.5 ? vertex : vertex + 1, copy.figure)) {
      this.on.said(
        "This point is a turning point of the pattern. It moves when the grid does, or pull next to it.",
      );
    }
    return this.puller.grab(vertex, share, far, { lattice, figure: copy.figure });
  }

  /** Where a place of the canvas is in the tile whose copy is in hand. */
  #inTile(place) {
    return moved(inverse(this.stage.matrixOf(this.hand.copy)), place);
  }

  move(place) {
    this.aim = place;
    this.#follow();
  }

  hover(place) {
    const inside = this.settings.what === "inside";
    const found = (place && this.ready && !inside && this.stage.outlineAt(place, GRIP)) || null;
    this.stage.canvas.style.cursor = found || inside ? "grab" : "";
    if (found || this.near) this.stage.redraw();
    this.near = found;
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
    if (!pulled) return this.back();
    this.waiting = true;
    return this.on.released(this.puller.parameters(), this.puller.insides());
  }

  /** Let the outline follow the pointer. */
  #follow() {
    this.stage.before = () => {
      if (!this.hand || !this.aim) return this.stage.before = null;
      const left = this.#step();
      this.#show();
      return left > STILL && setTimeout(() => this.stage.redraw());
    };
    this.stage.redraw();
  }

  #step() {
    const [[x, y], [u, v]] = [this.#inTile(this.aim), this.hand.offset];
    const { left, stopped } = this.puller.follow([x + u, y + v]);
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
    const way = ARROWS[event.key];
    if (way) {
      if (event.shiftKey) this.#nudge(way);
      else this.#choose(way[0] + way[1] || 0);
      return true;
    }
    if (!this.hand || !["Enter", "Escape"].includes(event.key)) return false;
    clearTimeout(this.timer);
    if (event.key === "Enter") this.up();
    else {
      this.back();
      this.on.said("Put back.");
    }
    return true;
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
    const copy = known?.figure === figure && this.stage.copies.find((own) => isSame(own, known));
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
    const colour = this.stopped ? STOPPED : FREE;
    const stroke = (path, wide, ink, dash = []) => {
      context.setLineDash(dash);
      context.lineWidth = wide;
      context.strokeStyle = ink;
      context.stroke(path);
    };
    const ring = (radius) => {
      const path = new Path2D();
      path.arc(x, y, radius, 0, 2 * Math.PI);
      return path;
    };
    if (this.stopped) stroke(new Path2D(`M${x} ${y}L${this.aim}`), 2, STOPPED);
    stroke(ring(reach), 4, "rgb(255 255 255 / 70%)");
    stroke(ring(reach), 1.6, colour, [7, 5]);
    context.fillStyle = colour;
    context.fill(ring(6));
    stroke(ring(6), 2.5, "#ffffff");
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
