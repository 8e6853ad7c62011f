/** The picture with what was read of it, and with what is painted over it. */

import { pathOf } from "../../../../drawing/js/tiling.js";
import { drawStroke } from "./marks.js";

export const COLOURS = {
  add: "#0f8f86",
  remove: "#c2362c",
  pins: "#3a6fd8",
  emphasis: "#e09a1b",
  rub: "#777777",
};
const EDGE = [[4, "#ffffff"], [2, "#0b6b66"]];
const BOLD_EDGE = [[7, "#ffffff"], [4, "#00a878"]]; // it has to show among a picture's own colours
const BRUSH = [[3, "#ffffff"], [1.5, "#1d1c1a"]];

/** Stroke a path, or what was begun, once for each pair of a width in pixels of the screen and a colour. */
function lines(context, pairs, pixel, ...path) {
  for (const [width, colour] of pairs) {
    context.lineWidth = width * pixel;
    context.strokeStyle = colour;
    context.stroke(...path);
  }
}

/**
 * Paint the picture, veiled outside of the silhouette. Lengths are in pixels of the picture, `pixel` is one of the screen.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {HTMLImageElement} picture
 * @param {Silhouette} silhouette
 * @param {number} pixel
 */
export function paintSilhouette(context, picture, silhouette, pixel) {
  const { width, height, outline: ring, left_out: others = [], coloured } = silhouette;
  const outline = pathOf(ring);
  const rest = new Path2D(outline);
  rest.rect(0, 0, width, height);
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, width, height);
  context.drawImage(picture, 0, 0, width, height);
  context.fillStyle = "rgb(255 255 255 / 72%)";
  context.fill(rest, "evenodd");
  if (!coloured) { // what is black and white is tinted, what has colours keeps them
    context.fillStyle = "rgb(15 143 134 / 55%)";
    context.fill(outline);
  }
  context.lineJoin = "round";
  lines(context, coloured ? BOLD_EDGE : EDGE, pixel, outline);
  context.setLineDash([5 * pixel, 4 * pixel]);
  others.forEach((other) => lines(context, [[2, COLOURS.remove]], pixel, pathOf(other)));
  context.setLineDash([]);
}

/**
 * Paint what is not read yet: strokes, the one that is being drawn, and marks, which are tinted pictures.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {{ marks: any[], fresh: any[], stroke: any, tool: string }} what
 */
export function paintStrokes(context, { marks, fresh, stroke, tool }) {
  context.globalAlpha = 0.65;
  marks.forEach((mark) => context.drawImage(mark, 0, 0));
  for (const one of fresh) drawStroke(context, one, COLOURS[one.black ? "remove" : "add"]);
  if (stroke) {
    drawStroke(context, {
      ...stroke,
      erases: false,
      size: stroke.shape === "lasso" ? 1 : stroke.size,
    }, COLOURS[tool]);
  }
  context.globalAlpha = 1;
}

/**
 * Paint where the brush is.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {Point} at
 * @param {number} radius
 * @param {number} pixel
 */
export function paintBrush(context, [x, y], radius, pixel) {
  context.beginPath();
  context.arc(x, y, radius, 0, 7);
  lines(context, BRUSH, pixel);
}

/**
 * A layer of marks in its colour.
 *
 * @param {import("./marks.js").Marks} marks
 * @param {string} layer
 */
export function tinted(marks, layer) {
  const own = marks.layer(layer, () => COLOURS[layer]);
  const context = own.getContext("2d");
  context.globalCompositeOperation = "source-in";
  context.fillStyle = COLOURS[layer];
  context.fillRect(0, 0, own.width, own.height);
  return own;
}
