/**
 * Pulling a tile: the outline moves in the linear space of the polygons that tile as it does, and its
 * inside as rigidly as it can. No page is needed here, so that node can test and time it.
 *
 * All points are linear in the unknowns: x = B z, where z are the parameters of the space and the points
 * inside. Minimised is what triangles lack of rotations (as-rigid-as-possible: Sorkine and Alexa, 2007;
 * Liu et al., 2008), with springs that hold what lies beyond the reach, and one to the pointer. Rotations
 * and points are found in turns, the latter by conjugate gradients from where they are.
 */

import { measured } from "../../../../drawing/js/tiling.js";
import { everyPoint, weigh } from "./body.js";
import { crosses } from "./crossing.js";
import { dot, multiply, multiplyBack } from "./sparse.js";

const GRAB = 600; // strength of the spring to the pointer; that of a triangle is about one
const GRIP = 0.3; // width of the hand, in reaches
const FAINTEST = 0.05; // weight of what is held
const HOLD = 4; // of those beyond the reach
const LEAST_HOLD = 1e-3; // of all others, so that the whole does not float away
const AFTER = [1, 2, 0, 1]; // corners of a triangle after corner 0, 1, 2
const STRIDE = 0.04; // of a hand that is followed, in sizes of the tile
const SLACK = 1.02; // times the way from rest that must be free as well, so that sides do not touch
const FLATTEST = 0.05; // of a triangle's area, which is left of it at least where the inside is pulled
const HALVINGS = 6; // by which the last good place is found
const ENOUGH = 1e-4; // of the residual, at which conjugate gradients stop

export class Puller {
  /** `space` is what the server tells of a tile's space; see space_json in pulled_tiles.py. */
  constructor(space) {
    this.maps = space.maps;
    this.count = space.rows / 2; // vertices
    this.rings = space.rings;
    /** @type {number[][]} what must not cross itself: figures, and the outline of several */
    this.simple = space.rings;
    if (space.rings.length > 1) {
      this.simple = [...space.rings, Array.from({ length: space.outer }, (_, k) => k)];
    }
    this.parametersCount = space.cols;
    this.group = space.cols - space.maps.length - 2; // first of the parameters that move the group
    this.start = Float64Array.from(space.start);
    this.rest = Float64Array.from(space.body.points.flat());
    this.triangles = Int32Array.from(space.body.triangles.flat());
    this.size = this.rest.length / 2; // points
    this.area = 0;
    this.middle = [0, 0];
    this.#measure(space.rings.map((ring) => ring.map((k) => space.polygon[k])));
    const { points, tied } = everyPoint(space, this.middle, this.group);
    this.points = points;
    this.tied = tied;
    const { cotangents, stiffness, laplacian } = weigh(this.triangles, this.rest, this.area);
    this.cotangents = cotangents;
    this.stiffness = stiffness;
    this.laplacian = laplacian;
    this.#findOrbits();
    const columns = this.points.cols;
    this.z = new Float64Array(columns);
    this.reset();
    this.free = new Float64Array(columns).fill(1);
    const fresh = () => new Float64Array(columns);
    this.residual = fresh();
    this.step = fresh();
    this.image = fresh();
    this.goal = fresh();
    this.scaled = fresh();
    this.diagonal = fresh();
    this.x = new Float64Array(2 * this.size);
    this.y = new Float64Array(2 * this.size);
    this.hold = new Float64Array(this.size);
    this.pin = null;
    this.inside = false; // whether what is held lies inside
  }

  /** The mean area of the figures, and the middle of the first. */
  #measure(polygons) {
    const all = polygons.map(measured);
    this.area = all.reduce((sum, { area }) => sum + area / all.length, 0);
    this.middle = [all[0].x, all[0].y];
  }

  /** Which vertices are images of one free vertex: they move together. */
  #findOrbits() {
    const { start, at } = this.points;
    this.orbit = Int32Array.from({ length: this.count }, (_, vertex) => {
      for (let row = 2 * vertex; row < 2 * vertex + 2; row += 1) {
        for (let k = start[row]; k < start[row + 1]; k += 1) {
          if (at[k] < this.group) return at[k] >> 1;
        }
      }
      return -1 - vertex; // held by a centre
    });
  }

  /** Back to the tile as it is. */
  reset() {
    this.ahead = null;
    this.z.set(this.start);
    this.z.set(this.middle, this.parametersCount - 2);
    for (let i = this.tied; i < 2 * this.size; i += 1) {
      this.z[this.parametersCount + i - this.tied] = this.rest[i];
    }
  }

  /** Whether a vertex of a figure is the centre of a rotation, and so stays where it is. */
  isHeld(vertex, figure = 0) {
    const ring = this.rings[figure];
    return this.orbit[ring[vertex % ring.length]] < 0;
  }

  /**
   * Take hold of a figure's outline, `share` of the way from a vertex to the next. Beyond `reach`, a distance,
   * all stays; with `lattice` the way in which copies lie may change as well.
   */
  grab(vertex, share, reach, { lattice = true, figure = 0 } = {}) {
    const ring = this.rings[figure];
    const next = ring[(vertex + 1) % ring.length];
    this.inside = false;
    this.pin = { vertex: ring[vertex], next, share, parts: null, target: null };
    const from = lattice ? this.parametersCount : this.group;
    this.#take(this.#along(ring, vertex, GRIP * reach), this.#apart(), reach, from);
  }

  /**
   * Take hold of the inside at a place of the tile. The outline stays where it is, or `gives` way; `lattice` as
   * above.
   */
  grabInside([x, y], reach, { gives = false, lattice = true } = {}) {
    const { rest } = this;
    this.inside = true;
    this.pin = { parts: null, target: null };
    const apart = Array.from(this.hold, (_, i) => Math.hypot(rest[2 * i] - x, rest[2 * i + 1] - y));
    const width = Math.max(GRIP * reach, 1.5 * Math.min(...apart));
    const near = apart.map((far, i) => [i, Math.exp(-3 * (far / width) ** 2)]);
    const from = gives ? (lattice ? this.parametersCount : this.group) : 0;
    this.#take(near.filter(([, own]) => own > FAINTEST), apart, reach, from);
  }

  /** Hold points by their weights, and what is `apart` from them; parameters `from` some on stay as they are. */
  #take(parts, apart, reach, from) {
    const total = parts.reduce((sum, [, own]) => sum + own, 0);
    this.ahead = null;
    this.pin.parts = parts.map(([i, own]) => [i, own / total]);
    this.pin.target = this.held();
    this.free.fill(1).fill(0, from, this.parametersCount);
    apart.forEach((far, i) => {
      this.hold[i] = LEAST_HOLD + HOLD * Math.min(1, far / reach) ** 4;
    });
    this.#measureDiagonal();
  }

  /** The hand is soft: it holds the mean of the outline nearby, so that no spike comes out. */
  #along(ring, place, width) {
    const { pin: { vertex, next, share }, rest } = this;
    const count = ring.length;
    const [x, y] = this.grip();
    const found = new Map([[vertex, 1 - share], [next, share]]);
    for (const [from, step] of [[place, -1], [place + 1, 1]]) {
      for (let k = 0; k < count / 4; k += 1) {
        const i = ring[(from + step * k + count) % count];
        const far = Math.hypot(rest[2 * i] - x, rest[2 * i + 1] - y);
        const own = Math.exp(-3 * (far / width) ** 2);
        if (k > 1 && own < FAINTEST) break;
        found.set(i, (found.get(i) ?? 0) + own);
      }
    }
    return [...found];
  }

  /** How far points are from what is held of the outline, or from where the same vertex is elsewhere. */
  #apart() {
    const { rest, orbit, count, pin: { vertex, next, share } } = this;
    const target = this.grip();
    const nearest = share < 0.5 ? vertex : next;
    const from = (i, x, y) => Math.hypot(rest[2 * i] - x, rest[2 * i + 1] - y);
    const places = [target];
    const near = new Map(); // the least distance in each orbit
    for (let i = 0; i < count; i += 1) {
      if (orbit[i] === orbit[nearest] && i !== nearest) places.push([rest[2 * i], rest[2 * i + 1]]);
      near.set(orbit[i], Math.min(near.get(orbit[i]) ?? Infinity, from(i, ...target)));
    }
    return Array.from(this.hold, (_, i) => {
      const apart = Math.min(...places.map((place) => from(i, ...place)));
      return Math.min(apart, i < count ? near.get(orbit[i]) : Infinity);
    });
  }

  /** The point of the outline that was taken hold of, where it is now. @returns {Point} */
  grip() {
    if (this.inside) return this.held();
    const { vertex, next, share } = this.pin;
    const x = this.polygon();
    const at = (k) => (1 - share) * x[2 * vertex + k] + share * x[2 * next + k];
    return [at(0), at(1)];
  }

  /** What the hand holds, the mean of the outline nearby, where it is now. */
  held() {
    return this.#mean(this.body());
  }

  /** @returns {Point} */
  #mean(x) {
    const along = (k) => this.pin.parts.reduce((sum, [i, part]) => sum + part * x[2 * i + k], 0);
    return [along(0), along(1)];
  }

  /** The diagonal of the quadratic form, for which conjugate gradients are scaled; exact for the group. */
  #measureDiagonal() {
    const { start, at, value } = this.points;
    const own = this.stiffness.map((stiff, i) => stiff + this.hold[i]);
    for (const [i, part] of this.pin.parts) own[i] += GRAB * part ** 2;
    this.diagonal.fill(0);
    for (let i = 0; i < 2 * this.size; i += 1) {
      for (let k = start[i]; k < start[i + 1]; k += 1) {
        this.diagonal[at[k]] += value[k] ** 2 * Math.max(own[i >> 1], 1e-6);
      }
    }
    const unit = new Float64Array(this.z.length);
    for (let column = this.group; column < this.parametersCount; column += 1) {
      unit[column] = 1;
      this.diagonal[column] = this.#form(unit, this.image)[column];
      unit[column] = 0;
    }
    for (let i = 0; i < this.diagonal.length; i += 1) this.diagonal[i] ||= 1;
  }

  /** out = B' (L + holds + grab) B given */
  #form(given, out) {
    const { x, y, hold } = this;
    multiply(this.points, given, x);
    multiply(this.laplacian, x, y);
    for (let i = 0; i < y.length; i += 1) y[i] += hold[i >> 1] * x[i];
    this.#addGrab(y, this.#mean(x));
    return multiplyBack(this.points, y, out);
  }

  #addGrab(y, [u, v]) {
    for (const [i, part] of this.pin.parts) {
      y[2 * i] += GRAB * part * u;
      y[2 * i + 1] += GRAB * part * v;
    }
  }

  /** The right side: B' of what rotated triangles, holds and the grab want. */
  #wanted(out) {
    const { x, y, rest, triangles, cotangents, hold, pin } = this;
    multiply(this.points, this.z, x);
    for (let i = 0; i < 2 * this.size; i += 1) y[i] = hold[i >> 1] * rest[i];
    for (let t = 0; t < triangles.length; t += 3) {
      let cos = 0;
      let sin = 0;
      for (let k = 0; k < 3; k += 1) {
        const b = 2 * triangles[t + AFTER[k]];
        const c = 2 * triangles[t + AFTER[k + 1]];
        const u = rest[b] - rest[c];
        const v = rest[b + 1] - rest[c + 1];
        const p = x[b] - x[c];
        const q = x[b + 1] - x[c + 1];
        cos += cotangents[t + k] * (u * p + v * q);
        sin += cotangents[t + k] * (u * q - v * p);
      }
      const long = Math.sqrt(cos * cos + sin * sin);
      cos = long ? cos / long : 1;
      sin = long ? sin / long : 0;
      for (let k = 0; k < 3; k += 1) {
        const b = 2 * triangles[t + AFTER[k]];
        const c = 2 * triangles[t + AFTER[k + 1]];
        const u = cotangents[t + k] *
          (cos * (rest[b] - rest[c]) - sin * (rest[b + 1] - rest[c + 1]));
        const v = cotangents[t + k] *
          (sin * (rest[b] - rest[c]) + cos * (rest[b + 1] - rest[c + 1]));
        y[b] += u;
        y[b + 1] += v;
        y[c] -= u;
        y[c + 1] -= v;
      }
    }
    this.#addGrab(y, pin.target);
    return multiplyBack(this.points, y, out);
  }

  /** Move what is held towards a target; returns how far the outline still moved, in sizes of the tile. */
  pull(target, { turns = 2, steps = 20 } = {}) {
    this.pin.target = target;
    const before = this.polygon();
    for (let turn = 0; turn < turns; turn += 1) this.#solve(steps);
    const after = this.polygon();
    let most = 0;
    for (let i = 0; i < after.length; i += 1) most = Math.max(most, Math.abs(after[i] - before[i]));
    return most / Math.sqrt(this.area);
  }

  /**
   * As `pull`, stride by stride: {left, stopped}. The tile stays at the last place where its outline does
   * not cross itself; what would follow the hand (`ahead`) goes on unseen, so that it finds back.
   */
  follow([x, y]) {
    const good = this.z.slice();
    const first = !this.ahead;
    if (this.ahead) this.z.set(this.ahead);
    const [from, to] = this.pin.target;
    const share = Math.min(1, (STRIDE * Math.sqrt(this.area)) / Math.hypot(x - from, y - to) || 1);
    const left = this.pull([from + share * (x - from), to + share * (y - to)]);
    const stopped = this.#blocked();
    this.ahead = stopped ? this.z.slice() : null;
    if (stopped) this.#between(good, first ? HALVINGS : 0);
    return { left: share < 1 ? STRIDE : left, stopped };
  }

  /** From a good place as far ahead as is free. */
  #between(good, halvings) {
    let free = 0;
    const part = (own) =>
      good.forEach((value, k) => {
        this.z[k] = value + own * (this.ahead[k] - value);
      });
    for (let k = 1; k <= halvings; k += 1) {
      part(free + 2 ** -k);
      if (!this.#blocked()) free += 2 ** -k;
    }
    part(free);
  }

  /** Whether an outline crosses itself here or a little farther. */
  #blocked() {
    const here = this.polygon();
    const farther = here.map((value, k) => this.rest[k] + SLACK * (value - this.rest[k]));
    const along = (points, ring) => ring.flatMap((k) => [points[2 * k], points[2 * k + 1]]);
    if (this.inside && this.#isFolded()) return true;
    return this.simple.some((ring) => crosses(along(here, ring)) || crosses(along(farther, ring)));
  }

  /** Whether a triangle of the body is turned over, or nearly. */
  #isFolded() {
    const { triangles, rest } = this;
    const x = this.body();
    const size = (at, k) => {
      const [a, b, c] = [2 * triangles[k], 2 * triangles[k + 1], 2 * triangles[k + 2]];
      return (at[b] - at[a]) * (at[c + 1] - at[a + 1]) - (at[b + 1] - at[a + 1]) * (at[c] - at[a]);
    };
    for (let k = 0; k < triangles.length; k += 3) {
      if (size(x, k) < FLATTEST * size(rest, k)) return true;
    }
    return false;
  }

  #solve(steps) {
    const { z, residual, step, image, scaled, goal, diagonal, free } = this;
    this.#wanted(goal);
    this.#form(z, image);
    for (let i = 0; i < z.length; i += 1) {
      residual[i] = free[i] * (goal[i] - image[i]);
      scaled[i] = residual[i] / diagonal[i];
      step[i] = scaled[i];
    }
    let strength = dot(residual, scaled);
    const enough = ENOUGH ** 2 * this.area * LEAST_HOLD;
    for (let k = 0; k < steps && strength > enough; k += 1) {
      this.#form(step, image);
      const length = strength / dot(step, image);
      for (let i = 0; i < z.length; i += 1) {
        z[i] += length * step[i];
        residual[i] -= length * free[i] * image[i];
        scaled[i] = residual[i] / diagonal[i];
      }
      const next = dot(residual, scaled);
      const share = next / strength;
      strength = next;
      for (let i = 0; i < z.length; i += 1) step[i] = scaled[i] + share * step[i];
    }
  }

  /** All vertices: x0, y0, x1, y1 ... */
  polygon() {
    return multiply(this.points, this.z, new Float64Array(2 * this.count));
  }

  /** The outline of each figure. @returns {Point[][]} */
  outlines() {
    const points = this.polygon();
    return this.rings.map((ring) => ring.map((k) => [points[2 * k], points[2 * k + 1]]));
  }

  /** How far anything is from where it rests, at most, in sizes of the tile. */
  moved() {
    return this.body().reduce(
      (most, value, k) => Math.max(most, Math.abs(value - this.rest[k])),
      0,
    ) / Math.sqrt(this.area);
  }

  /** All points of the body, for what lies on the tile. */
  body() {
    return multiply(this.points, this.z, new Float64Array(2 * this.size));
  }

  /** How the group has moved: p -> linear p + shift, as {linear: [[a, b], [c, d]], shift}. */
  placement() {
    const linear = [[0, 0], [0, 0]];
    const shift = [...this.z.subarray(this.parametersCount - 2, this.parametersCount)];
    const [x, y] = this.middle;
    this.maps.forEach((map, m) => {
      const own = this.z[this.group + m];
      for (const i of [0, 1]) {
        for (const j of [0, 1]) linear[i][j] += own * map[i][j];
        shift[i] -= own * (map[i][0] * x + map[i][1] * y);
      }
    });
    return { linear, shift };
  }

  /** The parameters as the server takes them. */
  parameters() {
    const found = Array.from(this.z.subarray(0, this.parametersCount));
    found.splice(-2, 2, ...this.placement().shift);
    return found;
  }

  /** The points inside, x0, y0, x1, y1 ..., if these are what was pulled. */
  insides() {
    return this.inside ? Array.from(this.z.subarray(this.parametersCount)) : [];
  }
}
