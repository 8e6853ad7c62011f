/** The map from the silhouette to the tile, affine on triangles, both ways. No page is needed here. */

import { boxOf } from "../../../../drawing/js/tiling.js";

const CELLS = 40; // of the grid that finds triangles, along each side

/** One direction: where points of `from` go. */
class Way {
  /**
   * @param {Point[]} from
   * @param {Point[]} to
   * @param {[number, number, number][]} triangles
   */
  constructor(from, to, triangles) {
    this.from = from;
    this.to = to;
    this.triangles = triangles;
    const { left, top, wide, high } = boxOf(from);
    this.low = [left, top];
    this.step = Math.max(wide, high) / CELLS || 1;
    this.cells = new Map();
    triangles.forEach((triangle, t) => {
      const corners = triangle.map((k) => this.#cell(from[k]));
      const { left, top, wide, high } = boxOf(corners);
      for (let i = left; i <= left + wide; i += 1) {
        for (let j = top; j <= top + high; j += 1) {
          const key = i * 4096 + j;
          if (!this.cells.has(key)) this.cells.set(key, []);
          this.cells.get(key).push(t);
        }
      }
    });
  }

  /** @returns {Point} */
  #cell([x, y]) {
    return [Math.floor((x - this.low[0]) / this.step), Math.floor((y - this.low[1]) / this.step)];
  }

  /** The shares of a triangle's corners in a point. */
  #shares(t, [x, y]) {
    const [a, b, c] = this.triangles[t].map((k) => this.from[k]);
    const size = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    const v = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / size;
    const w = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / size;
    return [1 - v - w, v, w];
  }

  /** {triangle, shares} of a point; of one outside, by the triangle that it is least outside of. */
  locate(point) {
    const [i, j] = this.#cell(point);
    let best = { triangle: -1, least: -Infinity };
    const look = (t) => {
      const shares = this.#shares(t, point);
      const least = Math.min(...shares);
      if (least > best.least) best = { triangle: t, shares, least };
    };
    (this.cells.get(i * 4096 + j) ?? []).forEach(look);
    if (best.least < -1e-9) {
      for (let k = -1; k <= 1; k += 1) {
        for (let l = -1; l <= 1; l += 1) {
          (this.cells.get((i + k) * 4096 + j + l) ?? []).forEach(look);
        }
      }
    }
    if (best.triangle < 0) this.triangles.forEach((_, t) => look(t));
    return best;
  }

  move(point) {
    const { triangle, shares } = this.locate(point);
    const corners = this.triangles[triangle].map((k) => this.to[k]);
    return [0, 1].map((j) => shares.reduce((sum, share, k) => sum + share * corners[k][j], 0));
  }
}

const LIGHT = [-0.27, -0.315]; // of an eye, in its radius, where y points down

/** From a figure's silhouette to the tile (`forward`) and back (`inverse`); without a map all stays. */
export class Carry {
  /** @param {{ map: TileMap | null, place?: Matrix, y_down: boolean }} figure */
  constructor({ map, place: [a, b, c, d] = [1, 0, 0, 1, 0, 0], y_down: yDown }) {
    this.map = map;
    /** How much larger lengths of the silhouette are in the tile. */
    this.scale = Math.sqrt(Math.abs(a * d - b * c));
    const [x, y] = [LIGHT[0], yDown ? LIGHT[1] : -LIGHT[1]];
    /** Where the light of an eye is, seen from its middle. */
    this.light = [(a * x + c * y) / this.scale, (b * x + d * y) / this.scale];
    /** @type {Way | undefined} */
    this.ahead = undefined;
    /** @type {Way | undefined} */
    this.behind = undefined;
  }

  get there() {
    return (this.ahead ??= new Way(this.map.rest, this.map.images, this.map.triangles));
  }

  get back() {
    return (this.behind ??= new Way(this.map.images, this.map.rest, this.map.triangles));
  }

  forward(point) {
    return this.map ? this.there.move(point) : point;
  }

  inverse(point) {
    return this.map ? this.back.move(point) : point;
  }

  /** How much larger things become near a point of the silhouette. */
  growth(point, reach) {
    if (!this.map) return 1;
    const [x, y] = this.forward(point);
    const around = [[1, 0], [0, 1], [-1, 0], [0, -1]].map(([u, v]) =>
      this.forward([point[0] + reach * u, point[1] + reach * v])
    );
    return around.reduce((sum, [u, v]) => sum + Math.hypot(u - x, v - y), 0) / (4 * reach);
  }
}

/** Points that ride on a triangulation: where each is when its corners have moved. */
export class Riders {
  constructor(body) {
    this.triangles = body.triangles;
    this.way = new Way(body.points, body.points, body.triangles);
  }

  seat(point) {
    const { triangle, shares } = this.way.locate(point);
    return { corners: this.triangles[triangle], shares };
  }

  /** Where a seat is when the points of the body are x0, y0, x1, y1 ... */
  static at({ corners, shares }, moved) {
    let [x, y] = [0, 0];
    corners.forEach((k, i) => {
      x += shares[i] * moved[2 * k];
      y += shares[i] * moved[2 * k + 1];
    });
    return [x, y];
  }
}
