/** The symmetry of a tiling, drawn over it and said in plain sentences. */

import { moved } from "../../../../drawing/js/tiling.js";
import { beside } from "./lines.js";

const COLOURS = { 2: "#c2410c", 3: "#6d28d9", 4: "#0f766e", 6: "#b91c1c" };
const LINES = "#b91c1c";
const NEAREST = 26; // pixels between signs below which they are left out
const AT_MOST = 1500;

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
    context.beginPath();
    context.moveTo(-size, 0);
    context.lineTo(size, 0);
    context.stroke();
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
  const [p, q, r, s] = tiling.basis;
  const to = (point) => moved(view, tiling.carried(point));
  /** @type {[Point, Point]} */
  const steps = [[view[0] * p + view[2] * q, view[1] * p + view[3] * q], [
    view[0] * r + view[2] * s,
    view[1] * r + view[3] * s,
  ]];
  const flat = Math.abs(steps[0][0] * steps[1][1] - steps[0][1] * steps[1][0]);
  const reach = Math.hypot(width, height);
  const cells = (point) => {
    // the cells whose copy of a point is in view
    const far = reach / 2 + 40;
    const [m, n] = inSteps(steps, [width / 2 - point[0], height / 2 - point[1]]);
    const [dm, dn] = [
      (far * Math.hypot(...steps[1])) / flat,
      (far * Math.hypot(...steps[0])) / flat,
    ];
    return [Math.floor(m - dm), Math.ceil(m + dm), Math.floor(n - dn), Math.ceil(n + dn)];
  };
  /** @type {{ key: string, at: Point }[]} */
  const centres = [];
  const crowded = Math.sqrt(flat / Math.max(1, elements.centres.length)) < NEAREST;
  for (const element of crowded ? [] : elements.centres) {
    const at = to(element.at);
    const [m0, m1, n0, n1] = cells(at);
    for (let m = m0; m <= m1; m += 1) {
      for (let n = n0; n <= n1 && centres.length < AT_MOST; n += 1) {
        const [x, y] = [
          at[0] + m * steps[0][0] + n * steps[1][0],
          at[1] + m * steps[0][1] + n * steps[1][1],
        ];
        if (x > -20 && y > -20 && x < width + 20 && y < height + 20) {
          centres.push({ key: `turn${element.order}`, at: [x, y] });
        }
      }
    }
  }
  /** @type {Map<string, { key: string, from: Point, to: Point, along: Point }>} */
  const lines = new Map();
  for (const key of /** @type {const} */ (["mirrors", "glides"])) {
    for (const line of elements[key]) {
      const at = to(line.at);
      const end = to([line.at[0] + line.along[0], line.at[1] + line.along[1]]);
      const long = Math.hypot(end[0] - at[0], end[1] - at[1]);
      /** @type {Point} */
      const along = [(end[0] - at[0]) / long, (end[1] - at[1]) / long];
      const [m0, m1, n0, n1] = cells(at);
      for (let m = m0; m <= m1; m += 1) {
        for (let n = n0; n <= n1 && lines.size < 200; n += 1) {
          const [x, y] = [
            at[0] + m * steps[0][0] + n * steps[1][0],
            at[1] + m * steps[0][1] + n * steps[1][1],
          ];
          const off = (x - width / 2) * along[1] - (y - height / 2) * along[0];
          if (Math.abs(off) > reach / 2) continue;
          const name = `${key} ${Math.round(along[1] * 100)} ${Math.round(off)}`;
          const middle = [width / 2 + off * along[1], height / 2 - off * along[0]];
          /** @type {Point} */
          const at0 = [middle[0] - reach * along[0], middle[1] - reach * along[1]];
          if (!lines.has(name)) {
            lines.set(name, {
              key,
              from: at0,
              to: [middle[0] + reach * along[0], middle[1] + reach * along[1]],
              along,
            });
          }
        }
      }
    }
  }
  return {
    centres,
    lines: [...lines.values()],
    cell: cellNear(elements, to, steps, width, height),
  };
}

/**
 * A vector as multiples of the two steps of the lattice.
 *
 * @param {[Point, Point]} steps
 * @param {Point} vector
 */
function inSteps([[a, b], [c, d]], [x, y]) {
  const size = a * d - b * c;
  return [(x * d - y * c) / size, (a * y - b * x) / size];
}

/**
 * @param {Elements} elements
 * @param {(point: Point) => Point} to
 * @param {[Point, Point]} steps
 * @param {number} width
 * @param {number} height
 */
function cellNear(elements, to, steps, width, height) {
  const ring = elements.cell.map(to);
  const middle = [0, 1].map((j) => ring.reduce((sum, point) => sum + point[j] / 4, 0));
  const [m, n] = inSteps(steps, [width / 2 - middle[0], height / 2 - middle[1]]).map(Math.round);
  /** @type {(point: Point) => Point} */
  const shifted = ([u, v]) => [
    u + m * steps[0][0] + n * steps[1][0],
    v + m * steps[0][1] + n * steps[1][1],
  ];
  return ring.map(shifted);
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
  const both = (draw, width, colour) => {
    for (const [ink, wide] of [["rgb(255 255 255 / 85%)", width + 2.5], [colour, width]]) {
      context.strokeStyle = ink;
      context.lineWidth = wide;
      draw();
    }
  };
  for (const { key, from, to } of signs.lines) {
    context.globalAlpha = strong(key) ? 1 : 0.25;
    context.setLineDash(key === "glides" ? [9, 6] : []);
    both(
      () => {
        context.beginPath();
        context.moveTo(...from);
        context.lineTo(...to);
        context.stroke();
      },
      lit === key ? 3 : 2,
      LINES,
    );
  }
  context.setLineDash([]);
  context.globalAlpha = strong("cell") ? 1 : 0.25;
  both(
    () => {
      context.beginPath();
      signs.cell.forEach((point) => context.lineTo(...point));
      context.closePath();
      context.stroke();
    },
    lit === "cell" ? 4 : 2.5,
    "#111111",
  );
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
