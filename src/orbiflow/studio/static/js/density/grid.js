/** A density on a grid: its colours, the masses that its regions hold, and maps to draw it on. */

import { unpack } from "../../api/scripts/surface.js";

const turn = (t) => t - Math.floor(t);

/** Maps from a picture, x to the right and y up from 0 to 1, to places, and back. `null` is outside. */
const flat = { aspect: 1, outline: null, place: (x, y) => [x, y], spot: (u, v) => [u, v] };

/** Hammer's map of the sphere, equal in area. Places are shares of 360 and 180 degrees. */
const globe = {
  aspect: 2,
  place(x, y) {
    const a = 2 * Math.SQRT2 * (2 * x - 1),
      b = Math.SQRT2 * (2 * y - 1),
      square = 1 - (a / 4) ** 2 - (b / 2) ** 2;
    if (square < 0.5) return null;
    const z = Math.sqrt(square), lon = 2 * Math.atan2(z * a, 2 * (2 * square - 1));
    return [0.5 + lon / 2 / Math.PI, 0.5 + Math.asin(Math.max(-1, Math.min(1, z * b))) / Math.PI];
  },
  spot(u, v) {
    const lon = 2 * Math.PI * (u - 0.5),
      lat = Math.PI * (v - 0.5),
      z = Math.sqrt(1 + Math.cos(lat) * Math.cos(lon / 2));
    return [0.5 + Math.cos(lat) * Math.sin(lon / 2) / z / 2, 0.5 + Math.sin(lat) / z / 2];
  },
};

/** One half of the sphere from above its pole, equal in area: each axis once. */
const disc = {
  aspect: 1,
  place(x, y) {
    const a = 2 * x - 1, b = 2 * y - 1, r = a * a + b * b;
    return r > 1
      ? null
      : [turn(0.5 + Math.atan2(a, -b) / 2 / Math.PI), 0.5 + Math.asin(1 - r) / Math.PI];
  },
  spot(u, v) {
    const lon = 2 * Math.PI * (v < 0.5 ? u : u - 0.5),
      r = Math.sqrt(1 - Math.sin(Math.abs(Math.PI * (v - 0.5))));
    return [0.5 + r * Math.sin(lon) / 2, 0.5 - r * Math.cos(lon) / 2];
  },
};

export class Grid {
  /** `data` is what `flat_data` gives, `space` the name of the space. */
  constructor(data, space) {
    this.logs = unpack(data.logs, Float32Array);
    this.cells = data.cells;
    this.shade = data.shade;
    this.data = data;
    this.onGlobe = data.kind === "globe";
    this.wraps = space === "torus";
    this.map = !this.onGlobe ? flat : space === "sphere" ? globe : disc;
    this.#rank();
  }

  /** Sort the cells, densest first, with the mass and the area of all up to each; `top` is where it is densest. */
  #rank() {
    const [rows, columns = 1] = this.cells, order = Uint32Array.from(this.logs.keys());
    const area = (
      k,
    ) => (this.onGlobe ? Math.cos(Math.PI * ((Math.floor(k / columns) + 0.5) / rows - 0.5)) : 1);
    order.sort((a, b) => this.logs[b] - this.logs[a]);
    this.order = order;
    this.mass = new Float64Array(order.length);
    this.area = new Float64Array(order.length);
    let mass = 0, whole = 0;
    order.forEach((cell, k) => {
      this.mass[k] = mass += Math.exp(this.logs[cell]) * area(cell);
      this.area[k] = whole += area(cell);
    });
    this.top = [
      (Math.floor(order[0] / columns) + 0.5) / rows,
      ((order[0] % columns) + 0.5) / columns,
    ];
  }

  /** The smallest region that holds a share of the mass: its least log density, and its share of the area. */
  region(share) {
    const wanted = share * this.mass.at(-1);
    let low = 0, high = this.mass.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.mass[middle] < wanted) low = middle + 1;
      else high = middle;
    }
    return {
      least: share >= 1 ? -Infinity : this.logs[this.order[low]],
      area: share >= 1 ? 1 : this.area[low] / this.area.at(-1),
    };
  }

  /** The log density at a place: on squares the first axis, then the second; interpolated. */
  at(u, v) {
    const [across, up] = this.onGlobe ? [this.cells[1], this.cells[0]] : this.cells;
    const x = u * across - 0.5,
      y = v * up - 0.5,
      i = Math.floor(x),
      j = Math.floor(y),
      s = x - i,
      t = y - j;
    const bound = (k, n, wraps) => (wraps ? ((k % n) + n) % n : Math.max(0, Math.min(n - 1, k)));
    const [i0, i1] = [i, i + 1].map((k) => bound(k, across, this.wraps || this.onGlobe));
    const [j0, j1] = [j, j + 1].map((k) => bound(k, up, this.wraps));
    const value = this.onGlobe
      ? (a, b) => this.logs[b * across + a]
      : (a, b) => this.logs[a * up + b];
    return (1 - s) * ((1 - t) * value(i0, j0) + t * value(i0, j1)) +
      s * ((1 - t) * value(i1, j0) + t * value(i1, j1));
  }

  /** Where a log density is on the bar of colours, from 0 to 1. */
  tone(log) {
    const { low, high, log: scaled } = this.shade;
    const place = scaled ? (log - Math.log(low)) / Math.log(high / low) : Math.exp(log) / high;
    return Math.max(0, Math.min(1, place));
  }

  /** The density along the other axis where one is held at a place from 0 to 1; it integrates to 1. */
  slice(axis, held, count = 360) {
    const values = Array.from(
      { length: count },
      (_, k) =>
        Math.exp(this.at(...(axis ? [(k + 0.5) / count, held] : [held, (k + 0.5) / count]))),
    );
    const mean = values.reduce((sum, value) => sum + value, 0) / count;
    return values.map((value) => value / mean);
  }
}

/** Lines of a globe or disc, as pieces of places. @param {any} grid */
export function meridians(grid) {
  const steps = Array.from({ length: 61 }, (_, k) => k / 60), north = grid.map === disc;
  const upright = Array.from(
    { length: 12 },
    (_, k) => steps.map((t) => [k / 12, north ? 0.5 + t / 2 : t]),
  );
  const level = [1, 2, 3, 4, 5].filter((k) => !north || k > 2).map((k) =>
    steps.map((t) => [t, k / 6])
  );
  return [...upright, ...level].map((line) => line.map(([u, v]) => grid.map.spot(u, v)));
}
