/** The symmetry of a tiling, drawn over it and said in plain sentences. */

import { inverse, moved, pathOf, times } from "../../../../drawing/js/tiling.js";
import { beside } from "./lines.js";

const COLOURS = { 2: "#c2410c", 3: "#6d28d9", 4: "#0f766e", 6: "#b91c1c" };
const LINES = "#b91c1c";
const NEAREST = 26; // pixels between signs below which they are left out
const AT_MOST = 1500;
const MOST_LINES = 200;
const NEAR_VIEW = 40; // pixels around the view in which signs may begin

const TURNS = {
  2: ["Half", "half way"],
  3: ["Third", "a third of the way"],
  4: ["Quarter", "a quarter of the way"],
  6: ["Sixth", "a sixth of the way"],
};

/**
 * The kinds of symmetry that a tiling has: [{key, name, says, colour}].
 *
 * @param {Elements} elements
 */
export function kindsOf(elements) {
  const orders = [...new Set(elements.centres.map((centre) => centre.order))].sort();
  const kinds = [{
    key: "cell",
    name: "The repeat",
    says:
      "Slide the whole pattern along a side of this box: it looks just the same. One box holds all of the pattern.",
    colour: "currentcolor",
  }];
  for (const order of orders) {
    const [name, way] = TURNS[order];
    kinds.push({
      key: `turn${order}`,
      name: `${name}-turn points`,
      says: `Turn the whole pattern ${way} round this point: it looks just the same.`,
      colour: COLOURS[order],
    });
  }
  if (elements.mirrors.length) {
    kinds.push({
      key: "mirrors",
      name: "Mirror lines",
      says: "What is on one side of this line is the mirror image of the other side.",
      colour: LINES,
    });
  }
  if (elements.glides.length) {
    kinds.push({
      key: "glides",
      name: "Glide lines",
      says:
        "Flip the pattern over this line and slide it along: like footprints in the snow, it looks just the same.",
      colour: LINES,
    });
  }
  return kinds;
}

/**
 * A small picture of a kind's sign, for a list.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {string} key
 * @param {number} x
 * @param {number} y
 * @param {number} size
 * @param {string} colour
 */
export function signInto(context, key, x, y, size, colour) {
  context.save();
  context.translate(x, y);
  context.strokeStyle = colour;
  context.fillStyle = colour;
  context.lineWidth = 2;
  if (key.startsWith("turn")) {
    centre(context, Number(key.slice(4)), size);
    context.fill();
  } else if (key === "cell") {
    context.strokeRect(-size, -0.7 * size, 2 * size, 1.4 * size);
  } else {
    context.setLineDash(key === "glides" ? [4, 3] : []);
    context.stroke(new Path2D(`M${-size} 0H${size}`));
  }
  context.restore();
}

/** The usual signs: a lens, a triangle, a square, a hexagon. */
function centre(context, order, size) {
  context.beginPath();
  if (order === 2) {
    context.ellipse(0, 0, 0.62 * size, 1.1 * size, 0, 0, 2 * Math.PI);
    return;
  }
  const turn = order === 4 ? Math.PI / 4 : Math.PI / 2;
  for (let k = 0; k < order; k += 1) {
    const angle = turn + (2 * Math.PI * k) / order;
    context.lineTo(1.15 * size * Math.cos(angle), -1.15 * size * Math.sin(angle));
  }
  context.closePath();
}

/**
 * All signs in view: centres [{key, at}], lines [{key, from, to}] and the cell, in pixels.
 *
 * @param {Elements} elements
 * @param {import("./live.js").LiveTiling} tiling
 * @param {import("../../../../drawing/js/tiling.js").Camera} camera
 * @param {number} width
 * @param {number} height
 */
export function placed(elements, tiling, camera, width, height) {
  const view = camera.matrix(width, height);
  const to = (point) => moved(view, tiling.carried(point));
  const [a, b, c, d] = times(view, tiling.lattice); // steps of the lattice
  const back = inverse([a, b, c, d, 0, 0]);
  const reach = Math.hypot(width, height);
  /** @type {(point: Point) => Point} */
  const fromMiddle = ([x, y]) => moved(back, [width / 2 - x, height / 2 - y]);
  /** @type {(point: Point, m: number, n: number) => Point} */
  const shifted = ([x, y], m, n) => [x + m * a + n * c, y + m * b + n * d];
  /** The places to which the lattice takes a point, in view or near it. */
  const copies = (point) => {
    const far = reach / 2 + NEAR_VIEW;
    const [m, n] = fromMiddle(point);
    const [dm, dn] = [far * Math.hypot(back[0], back[2]), far * Math.hypot(back[1], back[3])];
    const found = [];
    for (let i = Math.floor(m - dm); i <= m + dm; i += 1) {
      for (let j = Math.floor(n - dn); j <= n + dn; j += 1) found.push(shifted(point, i, j));
    }
    return found;
  };
  const isSeen = ([x, y]) => x > -20 && y > -20 && x < width + 20 && y < height + 20;
  const area = Math.abs(a * d - b * c);
  const crowded = Math.sqrt(area / Math.max(1, elements.centres.length)) < NEAREST;
  const centres = (crowded ? [] : elements.centres).flatMap(({ order, at }) =>
    copies(to(at)).filter(isSeen).map((at) => ({ key: `turn${order}`, at }))
  ).slice(0, AT_MOST);
  /** @type {Map<string, { key: string, from: Point, to: Point, along: Point }>} */
  const lines = new Map();
  for (const key of ["mirrors", "glides"]) {
    for (const line of elements[key]) {
      const [start, end] = [
        to(line.at),
        to([line.at[0] + line.along[0], line.at[1] + line.along[1]]),
      ];
      const long = Math.hypot(end[0] - start[0], end[1] - start[1]);
      const [u, v] = [(end[0] - start[0]) / long, (end[1] - start[1]) / long];
      for (const [x, y] of copies(start)) {
        const off = (x - width / 2) * v - (y - height / 2) * u;
        if (Math.abs(off) > reach / 2) continue;
        const [p, q] = [width / 2 + off * v, height / 2 - off * u];
        lines.set(`${key} ${Math.round(v * 100)} ${Math.round(off)}`, {
          key,
          from: [p - reach * u, q - reach * v],
          to: [p + reach * u, q + reach * v],
          along: [u, v],
        });
      }
    }
  }
  const ring = elements.cell.map(to);
  const middle = (j) => ring.reduce((sum, at) => sum + at[j] / 4, 0);
  const [m, n] = fromMiddle([middle(0), middle(1)]).map(
    Math.round,
  );
  return {
    centres,
    lines: [...lines.values()].slice(0, MOST_LINES),
    cell: ring.map((at) => shifted(at, m, n)),
  };
}

/**
 * Draw the signs; those of the kind `lit` stand out.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {ReturnType<typeof placed>} signs
 * @param {string | null} lit
 */
export function paintSigns(context, signs, lit) {
  const strong = (key) => !lit || lit === key;
  const both = (path, width, colour) => {
    for (const [ink, wide] of [["rgb(255 255 255 / 85%)", width + 2.5], [colour, width]]) {
      context.strokeStyle = ink;
      context.lineWidth = wide;
      context.stroke(path);
    }
  };
  for (const { key, from, to } of signs.lines) {
    context.globalAlpha = strong(key) ? 1 : 0.25;
    context.setLineDash(key === "glides" ? [9, 6] : []);
    both(new Path2D(`M${from}L${to}`), lit === key ? 3 : 2, LINES);
  }
  context.setLineDash([]);
  context.globalAlpha = strong("cell") ? 1 : 0.25;
  both(pathOf(signs.cell), lit === "cell" ? 4 : 2.5, "#111111");
  for (const { key, at } of signs.centres) {
    context.globalAlpha = strong(key) ? 1 : 0.25;
    context.save();
    context.translate(...at);
    centre(context, Number(key.slice(4)), lit === key ? 11 : 8.5);
    context.restore();
    context.fillStyle = COLOURS[key.slice(4)];
    context.lineWidth = 2.5;
    context.strokeStyle = "#ffffff";
    context.stroke();
    context.fill();
  }
  context.globalAlpha = 1;
}

/**
 * The kind of the sign at a place, or null.
 *
 * @param {ReturnType<typeof placed>} signs
 * @param {Point} place
 */
export function signAt(signs, [x, y]) {
  for (const { key, at } of signs.centres) if (Math.hypot(at[0] - x, at[1] - y) < 14) return key;
  for (const { key, from, along } of signs.lines) {
    if (Math.abs((x - from[0]) * along[1] - (y - from[1]) * along[0]) < 7) return key;
  }
  return signs.cell.some((a, k) => beside([x, y], a, signs.cell[(k + 1) % 4]).apart < 7)
    ? "cell"
    : null;
}
