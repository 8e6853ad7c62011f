/** The endless tiling of a card: which copies are in view, their colours, and how they are drawn. */

import { sized } from "./turned.js";

const MOST_COPIES = 6000;

/** A camera shows the input's point (x, y) in the middle, `scale` pixels a unit, turned by `turn`. */
export class Camera {
  constructor({ x = 0, y = 0, scale = 1, turn = 0, yDown = true } = {}) {
    this.x = x;
    this.y = y;
    this.scale = scale;
    this.turn = turn;
    this.yDown = yDown;
  }

  /**
   * The camera that shows about `across` tiles along the longer side of a canvas.
   *
   * @param {Tiling} tiling
   * @param {number} width
   * @param {number} height
   */
  static fit(tiling, width, height, across = 5) {
    const { x, y } = tiling.middle;
    const scale = Math.max(width, height) / (across * Math.sqrt(tiling.area));
    return new Camera({ x, y, scale, yDown: tiling.yDown });
  }

  /**
   * The matrix from the input to a canvas of this size.
   *
   * @param {number} width
   * @param {number} height
   * @returns {Matrix}
   */
  matrix(width, height) {
    const cos = this.scale * Math.cos(this.turn);
    const sin = this.scale * Math.sin(this.turn);
    const flip = this.yDown ? 1 : -1;
    const [a, b, c, d] = [cos, sin, -sin * flip, cos * flip];
    return [a, b, c, d, width / 2 - a * this.x - c * this.y, height / 2 - b * this.x - d * this.y];
  }
}

/**
 * The product of two canvas matrices: first `second`, then `first`.
 *
 * @param {Matrix} first
 * @param {Matrix} second
 * @returns {Matrix}
 */
export function times(first, second) {
  const [a, b, c, d, e, f] = first;
  const [g, h, i, j, k, l] = second;
  return [
    a * g + c * h,
    b * g + d * h,
    a * i + c * j,
    b * i + d * j,
    a * k + c * l + e,
    b * k + d * l + f,
  ];
}

/**
 * Where a canvas matrix takes a point.
 *
 * @param {Matrix} matrix
 * @param {Point} point
 * @returns {Point}
 */
export function moved([a, b, c, d, e, f], [x, y]) {
  return [a * x + c * y + e, b * x + d * y + f];
}

/** The inverse of a canvas matrix. @param {Matrix} matrix @returns {Matrix} */
export function inverse([a, b, c, d, e, f]) {
  const size = a * d - b * c;
  return [
    d / size,
    -b / size,
    -c / size,
    a / size,
    (c * f - d * e) / size,
    (b * e - a * f) / size,
  ];
}

/** The upright box around points: the least coordinates, and its sides. @param {Point[]} points */
export function boxOf(points) {
  const [xs, ys] = [0, 1].map((k) => points.map((point) => point[k]));
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  return { left, top, wide: Math.max(...xs) - left, high: Math.max(...ys) - top };
}

/** The area of a polygon, and the coordinates of its centroid. @param {Point[]} polygon */
export function measured(polygon) {
  let [area, x, y] = [0, 0, 0];
  polygon.forEach(([x0, y0], k) => {
    const [x1, y1] = polygon[(k + 1) % polygon.length];
    const cross = x0 * y1 - x1 * y0;
    area += cross / 2;
    x += ((x0 + x1) * cross) / 6;
    y += ((y0 + y1) * cross) / 6;
  });
  return { area: Math.abs(area), x: x / area, y: y / area };
}

/** @param {Group["cosets"][0]} coset @returns {Matrix} */
const asMatrix = ({ linear: [[a, c], [b, d]], translation: [e, f] }) => [a, b, c, d, e, f];

/**
 * The figures that divide a tile; one that is whole is its own.
 *
 * @template {{ figures?: any[] }} C
 * @param {C} card
 * @returns {C[]}
 */
export const figuresOf = (card) => card.figures ?? [card];

/**
 * The shades of a palette that a tiling's colours are, if each of several figures has some of its own.
 *
 * @param {Palette} palette
 * @param {{ shares?: number[] }} [colours]
 * @returns {Palette}
 */
export function shaded(palette, { shares = [] } = {}) {
  if (shares.length < 2 || !palette.shades) return palette;
  const own = (count, k) => palette.shades[k][count - 1] ?? palette.shades[k].at(-1);
  return { ...palette, colours: shares.flatMap(own) };
}

/** Polygons and their group, ready to be drawn. */
export class Tiling {
  /** @param {Outlined} card */
  constructor(card) {
    const { lattice, cosets, figures } = card.group;
    this.yDown = card.y_down;
    this.basis = [lattice[0][0], lattice[1][0], lattice[0][1], lattice[1][1]]; // columns are vectors
    this.aspects = cosets.map(asMatrix);
    this.kinds = figures ?? cosets.map(() => 0); // the figure of each aspect
    this.colours = card.colours;
    /** @type {Figure[]} */
    this.figures = [];
    figuresOf(card).forEach(({ polygon }, k) => this.change(polygon, k));
  }

  /** The matrix of a step along each vector of the lattice. @returns {Matrix} */
  get lattice() {
    const [p, q, r, s] = this.basis;
    return [p, q, r, s, 0, 0];
  }

  /** Take another polygon of a figure for the same group. @param {Point[]} polygon */
  change(polygon, figure = 0) {
    const { area, x, y } = measured(polygon);
    const radius = Math.max(...polygon.map(([u, v]) => Math.hypot(u - x, v - y)));
    this.figures[figure] = { polygon, area, middle: { x, y }, radius, path: pathOf(polygon) };
  }

  /** The outline of a figure, with as many points as are seen at a scale. */
  pathAt(_scale, figure) {
    return this.figures[figure].path;
  }

  /** The mean area of the figures. */
  get area() {
    return this.figures.reduce((sum, { area }) => sum + area / this.figures.length, 0);
  }

  /** The centroid of all figures together. */
  get middle() {
    const whole = this.area * this.figures.length;
    const mean = (of) => this.figures.reduce((sum, own) => sum + own.area * of(own) / whole, 0);
    return { x: mean(({ middle }) => middle.x), y: mean(({ middle }) => middle.y) };
  }

  /**
   * The number of the colour of the copy of an aspect in the lattice cell (m, n).
   *
   * @param {number} aspect
   * @param {number} m
   * @param {number} n
   */
  colour(aspect, m, n) {
    if (!this.colours) return aspect % 3;
    const [a, b, c] = this.colours.sublattice;
    const wraps = Math.floor(n / c);
    const first = (((m - wraps * b) % a) + a) % a;
    return this.colours.table[aspect][first][n - wraps * c];
  }

  /**
   * The matrix, from the prototile to the input, of the copy of an aspect in a cell.
   *
   * @param {number} aspect
   * @param {number} m
   * @param {number} n
   * @returns {Matrix}
   */
  copy(aspect, m, n) {
    const [a, b, c, d, e, f] = this.aspects[aspect];
    const [p, q, r, s] = this.basis;
    return [a, b, c, d, e + p * m + r * n, f + q * m + s * n];
  }

  /**
   * All copies that meet a canvas.
   *
   * @param {Camera} camera
   * @param {number} width
   * @param {number} height
   */
  copies(camera, width, height) {
    const view = camera.matrix(width, height);
    const back = inverse(view);
    const [p, q, r, s] = this.basis;
    const cells = inverse(this.lattice);
    /** @type {Copy[]} */
    const found = [];
    this.aspects.forEach((element, aspect) => {
      const figure = this.kinds[aspect];
      const { middle, radius } = this.figures[figure];
      const reach = radius * camera.scale;
      const [right, bottom] = [width + reach, height + reach];
      /** @type {Point[]} */
      const edge = [[-reach, -reach], [right, -reach], [right, bottom], [-reach, bottom]];
      const corners = edge.map((corner) => moved(back, corner));
      const [x, y] = moved(element, [middle.x, middle.y]);
      const at = corners.map(([u, v]) => moved(cells, [u - x, v - y]));
      const along = (k) => at.map((point) => point[k]);
      const low = [0, 1].map((k) => Math.ceil(Math.min(...along(k))));
      const high = [0, 1].map((k) => Math.floor(Math.max(...along(k))));
      for (let m = low[0]; m <= high[0]; m += 1) {
        for (let n = low[1]; n <= high[1]; n += 1) {
          const [u, v] = moved(view, [x + p * m + r * n, y + q * m + s * n]);
          if (u < -reach || v < -reach || u > width + reach || v > height + reach) continue;
          if (found.length >= MOST_COPIES) return;
          const matrix = times(view, this.copy(aspect, m, n));
          found.push({ aspect, figure, cell: [m, n], colour: this.colour(aspect, m, n), matrix });
        }
      }
    });
    return found;
  }
}

/** A closed polygon as a path. @param {Point[]} polygon */
export const pathOf = (polygon) => new Path2D(`M${polygon.join("L")}Z`);

/**
 * Colour number `index` of a palette; after the last they start again, paler.
 *
 * @param {Palette} palette
 * @param {number} index
 */
export function fill(palette, index) {
  const count = palette.colours.length;
  const colour = palette.colours[index % count];
  const turn = Math.floor(index / count);
  return turn
    ? `color-mix(in srgb, ${colour} ${100 * 0.5 ** turn}%, ${palette.paper ?? "#fff"})`
    : colour;
}

/**
 * Draw a tiling over the whole of a canvas, `ratio` device pixels a CSS pixel, with what lies on its tiles.
 * `line`: width of the outline in CSS pixels, 0 for none. `skins`: of each figure null, or what `skinsOf` returns.
 * `over(context, copy)` draws more on each copy, in the tile's own coordinates. Returns the copies.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {Tiling} tiling
 * @param {Camera} camera
 * @param {Palette} palette
 * @param {{ width: number, height: number, ratio?: number, line?: number, skins?: any[], over?: any }} how
 */
export function paint(
  context,
  tiling,
  camera,
  palette,
  { width, height, ratio = 1, line = 1.2, skins, over },
) {
  const paths = tiling.figures.map((_, k) => tiling.pathAt(camera.scale * ratio, k));
  const own = shaded(palette, tiling.colours);
  const copies = tiling.copies(camera, width, height);
  context.lineJoin = "round";
  for (const copy of copies) {
    const [path, skin] = [paths[copy.figure], skins?.[copy.figure]];
    const [a, b, c, d, e, f] = copy.matrix;
    /** @type {Matrix} */
    const matrix = [a * ratio, b * ratio, c * ratio, d * ratio, e * ratio, f * ratio];
    context.setTransform(...matrix);
    context.fillStyle = context.strokeStyle = fill(own, copy.colour);
    context.fill(path);
    context.lineWidth = (line || 0.7) / camera.scale;
    if (!line) context.stroke(path); // hide the seam
    if (skin) {
      context.setTransform(...times(matrix, skin.matrix));
      context.drawImage(skin.in(context.fillStyle), 0, 0);
      context.setTransform(...matrix);
    }
    over?.(context, copy);
    context.strokeStyle = palette.outline;
    if (line) context.stroke(path);
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return copies;
}

/**
 * Draw a card's tiling into a canvas as large as it lies in the page; `skins(tiling, scale)` gives what lies on it.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {Outlined} card
 * @param {Palette} palette
 * @param {{ across?: number, line?: number, skins?: (tiling: Tiling, scale: number) => any[] }} how
 */
export function paintCard(canvas, card, palette, { across = 5, line = 1.2, skins } = {}) {
  const { width, height, ratio } = sized(canvas);
  const tiling = new Tiling(card);
  const camera = Camera.fit(tiling, width, height, across);
  const own = skins?.(tiling, camera.scale * ratio);
  const context = canvas.getContext("2d");
  paint(context, tiling, camera, palette, { width, height, ratio, line, skins: own });
}
