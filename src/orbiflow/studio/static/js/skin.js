/** What lies on a tile, as one picture of the prototile: the artwork, lines and eyes. */

import { laidOn } from "./texture.js";
import { boxOf, inverse, moved } from "../../../drawing/js/tiling.js";
import { Skin } from "../../../drawing/js/tinted.js";

const MOST = 1400; // pixels along a side
const PAD = 4; // pixels around a figure

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
  points.forEach(([x, y]) => context.lineTo(x, y));
  if (points.length === 1) context.lineTo(points[0][0] + 1e-3 * width, points[0][1]);
  context.stroke();
}

/** Draw a line, or fill a part with its `rings`. */
export function markInto(context, { points, colour, width, rings }) {
  if (!rings) return lineInto(context, points, colour, width);
  context.fillStyle = colour;
  context.fill(new Path2D(rings.map((ring) => `M${ring.join("L")}Z`).join("")), "evenodd");
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
 * @param {{ art: any, marks: any, palette: Palette, tint?: number }} what
 * @param {number} scale
 */
export function paintSkin(figure, { art, marks, palette, tint = 0 }, scale) {
  if (!art && !marks.lines.length && !marks.eyes.length) return null;
  const { left, top, wide, high } = boxOf(figure.polygon);
  const own = Math.min(scale, MOST / Math.max(wide, high));
  const pad = PAD / own;
  const canvas = document.createElement("canvas");
  canvas.width = Math.ceil((wide + 2 * pad) * own);
  canvas.height = Math.ceil((high + 2 * pad) * own);
  const context = canvas.getContext("2d");
  /** @type {Matrix} */
  const matrix = [own, 0, 0, own, (pad - left) * own, (pad - top) * own];
  if (art) {
    const [from, to] = art.covered;
    const shares = art.map.rest.map(([x, y]) => {
      const v = (y - from[1]) / (to[1] - from[1]);
      return [(x - from[0]) / (to[0] - from[0]), art.yDown ? v : 1 - v];
    });
    const images = art.map.images.map((point) => moved(matrix, point));
    const triangles = { images, shares, list: art.map.triangles };
    const laid = laidOn(art.picture, triangles, canvas.width, canvas.height);
    // a little past the outline, or what is below would show between two copies
    context.setTransform(...matrix);
    context.fill(figure.path);
    context.lineWidth = 1.4 / own;
    context.lineJoin = "round";
    context.stroke(figure.path);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.globalCompositeOperation = "source-in";
    context.drawImage(laid, 0, 0);
    context.globalCompositeOperation = "source-over";
  }
  context.setTransform(...matrix);
  context.save();
  context.clip(figure.path); // a line ends where its tile does
  for (const line of marks.lines) markInto(context, line);
  context.restore();
  for (const { at, radius, light } of marks.eyes) eyeInto(context, at, radius, palette, light);
  return new Skin(canvas, inverse(matrix), art ? tint : 0);
}

/**
 * The address of the picture that can be laid on a figure of a tile, if there is one.
 *
 * @param {Project} project
 * @param {FigureView} figure
 * @param {number} k its number
 */
export function backdropOf(project, { map, covered }, k) {
  const { silhouette } = (k ? project.second : project) ?? {};
  return map && covered && silhouette?.backdrop;
}

/**
 * The skins of a tile's figures at a scale.
 *
 * @param {Project} project
 * @param {FigureView[]} figures
 * @param {Figure[]} outlines how the figures lie
 * @param {{ look: any, palette: Palette, pictures: Pictures, marks?: any[], share?: number }} how
 * @param {number} scale
 */
export function skinsOf(project, figures, outlines, how, scale) {
  const { look, palette, pictures, marks, share = 1 } = how;
  return figures.map((figure, k) => {
    const url = look.art && backdropOf(project, figure, k);
    const picture = url && pictures.at(url);
    const map = picture && between(figure, share);
    const art = map && { picture, map, covered: figure.covered, yDown: figure.y_down };
    const own = { art, marks: marks?.[k] ?? { lines: [], eyes: [] }, palette, tint: look.tint };
    return paintSkin(outlines[k], own, scale);
  });
}
