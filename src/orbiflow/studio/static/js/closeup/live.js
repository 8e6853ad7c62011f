/** A tiling whose tile and group move. */

import { moved, pathOf, Tiling, times } from "../../../../drawing/js/tiling.js";

const COARSE = 0.6; // pixels below which a side of the outline is left out

export class LiveTiling extends Tiling {
  /** @param {TileView} view */
  constructor(view) {
    super(view);
    this.home = { aspects: this.aspects, basis: this.basis };
    /** @type {Matrix} */
    this.map = [1, 0, 0, 1, 0, 0]; // where the group has moved
    /** @type {{ scale: number, path: Path2D }[]} */
    this.simple = [];
  }

  /**
   * Move the group by p -> M p + b, where M commutes with its turns.
   *
   * @param {{ linear: [Point, Point], shift: Point }} by
   */
  place({ linear, shift }) {
    const [[a, c], [b, d]] = linear;
    this.map = [a, b, c, d, ...shift];
    const [p, q, r, s] = this.home.basis;
    this.basis = [...times(this.map, [p, q, r, s, 0, 0]).slice(0, 4)];
    const [u, v] = shift;
    /** @type {(aspect: Matrix) => Matrix} */
    const placed = ([a, b, c, d, e, f]) => {
      const [x, y] = moved(this.map, [e, f]);
      return [a, b, c, d, x - a * u - c * v, y - b * u - d * v];
    };
    this.aspects = this.home.aspects.map(placed);
  }

  /** Where a point that the group has gone to has come to. @param {Point} point */
  carried(point) {
    return moved(this.map, point);
  }

  /** Take the outline of each figure; `exact` measures them as well. */
  outlines(rings, { exact = true } = {}) {
    rings.forEach((points, k) => {
      if (exact) this.change(points, k);
      else Object.assign(this.figures[k], { polygon: points, path: pathOf(points) });
    });
    this.simple = [];
  }

  /** @override */
  pathAt(scale, figure) {
    const known = this.simple[figure];
    if (known && Math.abs(Math.log2(known.scale / scale)) < 0.5) return known.path;
    const least = COARSE / scale;
    const { polygon } = this.figures[figure];
    let last = polygon[0];
    const kept = polygon.filter((point, k) => {
      const far = k === 0 || Math.hypot(point[0] - last[0], point[1] - last[1]) >= least;
      if (far) last = point;
      return far;
    });
    this.simple[figure] = { scale, path: pathOf(kept) };
    return this.simple[figure].path;
  }
}
