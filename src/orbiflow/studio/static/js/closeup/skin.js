/** What lies on a tile, as one picture of the prototile: the artwork, lines and eyes. */

import { inverse, moved } from "../tiling.js";

const MOST = 1400; // pixels along a side
const BLEED = 0.7; // pixels by which triangles overlap, so that no seam shows

/**
 * An eye as exports draw it: white, dark ring, pupil and a light.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {Point} at
 * @param {number} radius
 * @param {Palette} palette
 * @param {Point} light where its light is, in radii from its middle
 */
export function eyeInto(context, [x, y], radius, palette, light) {
  const disc = (u, v, r, colour) => {
    context.fillStyle = colour;
    context.beginPath();
    context.arc(u, v, r, 0, 2 * Math.PI);
    context.fill();
  };
  disc(x, y, 1.1 * radius, palette.outline);
  disc(x, y, 0.9 * radius, palette.paper ?? "#ffffff");
  disc(x, y, 0.58 * radius, palette.outline);
  disc(
    x + light[0] * radius,
    y + light[1] * radius,
    0.2 * radius,
    palette.paper ?? "#ffffff",
  );
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {Point[]} points
 * @param {string} colour
 * @param {number} width
 */
export function lineInto(context, points, colour, width) {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.lineCap = "round";
  context.lineJoin = "round";
  context.beginPath();
  points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
  if (points.length === 1) context.lineTo(points[0][0] + 1e-3 * width, points[0][1]);
  context.stroke();
}

/** Pictures by their addresses; `came()` when one is there. */
export class Pictures {
  constructor(came) {
    this.came = came;
    /** @type {Map<string, HTMLImageElement>} */
    this.known = new Map();
  }

  /** The picture at an address, null until it is there. */
  at(url) {
    if (!this.known.has(url)) {
      const image = new Image();
      image.onload = this.came;
      image.src = url;
      this.known.set(url, image);
    }
    const image = this.known.get(url);
    return image.complete && image.naturalWidth > 0 ? image : null;
  }
}

/** Lay triangles of a picture onto their images. `shares` are places in the picture, 0 to 1. */
function triangles(context, picture, { images, shares, list }, scale) {
  const [wide, high] = [
    picture.naturalWidth || picture.width,
    picture.naturalHeight || picture.height,
  ];
  const base = context.getTransform();
  for (const corners of list) {
    const [a, b, c] = corners.map((k) => images[k]);
    const [p, q, r] = corners.map((k) => [shares[k][0] * wide, shares[k][1] * high]);
    const size = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    if (Math.abs(size) < 1e-9) continue;
    const part = (j) => {
      const [u, v] = [b[j] - a[j], c[j] - a[j]];
      const x = (u * (r[1] - p[1]) - v * (q[1] - p[1])) / size;
      const y = (v * (q[0] - p[0]) - u * (r[0] - p[0])) / size;
      return [x, y, a[j] - x * p[0] - y * p[1]];
    };
    const [[ax, ay, ae], [bx, by, be]] = [part(0), part(1)];
    const middle = [(a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3];
    context.save();
    context.beginPath();
    for (const [x, y] of [a, b, c]) {
      const [u, v] = [x - middle[0], y - middle[1]];
      const grow = 1 + BLEED / Math.max(1, scale * Math.hypot(u, v));
      context.lineTo(middle[0] + grow * u, middle[1] + grow * v);
    }
    context.clip();
    context.transform(ax, bx, ay, by, ae, be);
    context.drawImage(picture, 0, 0);
    context.restore();
    context.setTransform(base);
  }
}

/**
 * The map to what lies a share of the way from a figure's silhouette, in its place, to the tile.
 *
 * @param {{ map: TileMap | null, place?: Matrix }} figure
 * @param {number} share
 * @returns {TileMap | null}
 */
export function between({ map, place = [1, 0, 0, 1, 0, 0] }, share) {
  if (!map || share >= 1) return map;
  /** @type {(image: Point, k: number) => Point} */
  const there = ([x, y], k) => {
    const [u, v] = moved(place, map.rest[k]);
    return [u + share * (x - u), v + share * (y - v)];
  };
  return { ...map, images: map.images.map(there) };
}

/**
 * Paint a figure's skin at a scale (pixels a unit), or null if nothing lies on it.
 * `art`: {picture, map, covered, yDown} or null; `marks`: {lines: [{points, colour, width}], eyes: [{at, radius,
 * light}]}.
 *
 * @param {Figure} figure
 * @param {{ art: any, marks: any, palette: Palette }} what
 * @param {number} scale
 */
export function paintSkin(figure, { art, marks, palette }, scale) {
  if (!art && !marks.lines.length && !marks.eyes.length) return null;
  const xs = figure.polygon.map((p) => p[0]);
  const ys = figure.polygon.map((p) => p[1]);
  const [low, high] = [[Math.min(...xs), Math.min(...ys)], [Math.max(...xs), Math.max(...ys)]];
  const size = Math.max(high[0] - low[0], high[1] - low[1]);
  const own = Math.min(scale, MOST / size);
  const pad = 2 / own;
  const canvas = document.createElement("canvas");
  canvas.width = Math.ceil((high[0] - low[0] + 2 * pad) * own);
  canvas.height = Math.ceil((high[1] - low[1] + 2 * pad) * own);
  const context = canvas.getContext("2d");
  /** @type {Matrix} */
  const matrix = [own, 0, 0, own, (pad - low[0]) * own, (pad - low[1]) * own];
  context.setTransform(...matrix);
  if (art) {
    const [from, to] = art.covered;
    const shares = art.map.rest.map(([x, y]) => {
      const v = (y - from[1]) / (to[1] - from[1]);
      return [(x - from[0]) / (to[0] - from[0]), art.yDown ? v : 1 - v];
    });
    triangles(
      context,
      art.picture,
      { images: art.map.images, shares, list: art.map.triangles },
      own,
    );
    context.globalCompositeOperation = "destination-in";
    context.fill(figure.path);
    context.globalCompositeOperation = "source-over";
  }
  context.save();
  context.clip(figure.path); // a line ends where its tile does
  for (const { points, colour, width } of marks.lines) lineInto(context, points, colour, width);
  context.restore();
  for (const { at, radius, light } of marks.eyes) eyeInto(context, at, radius, palette, light);
  return { canvas, matrix: inverse(matrix), scale: own };
}
