/** The bucket: the part of a tile around a place, up to its outline and the lines that were drawn. */

import { boxOf } from "../../../../drawing/js/tiling.js";
import { lineInto } from "../skin.js";
import { simplified } from "./lines.js";

const CELLS = 520; // along the longer side of a tile
const UNDER = 3; // cells by which a part goes on under the lines around it
const TIP = 60; // of 255, how much of a cell is in the tile, so that sharp tips count

/** Which cells can be reached from one without crossing what is dark, and some around them. */
function reached(light, wide, from) {
  const found = new Uint8Array(light.length);
  const open = [from];
  found[from] = 1;
  while (open.length) {
    const cell = open.pop();
    for (const next of [cell - 1, cell + 1, cell - wide, cell + wide]) {
      if (light[next] && !found[next]) {
        found[next] = 1;
        open.push(next);
      }
    }
  }
  for (let k = 0; k < UNDER; k += 1) {
    const known = found.slice();
    known.forEach((is, cell) => {
      if (is) {
        for (const next of [cell - 1, cell + 1, cell - wide, cell + wide]) found[next] = 1;
      }
    });
  }
  return found;
}

/**
 * The rings around cells, the outer one first.
 *
 * @param {Uint8Array} cells
 * @param {number} wide
 * @returns {Point[][]}
 */
function ringsAround(cells, wide) {
  const after = new Map(); // corner to corner along the border, cells to the right
  const corner = (column, row) => row * (wide + 1) + column;
  cells.forEach((is, cell) => {
    if (!is) return;
    const [x, y] = [cell % wide, Math.floor(cell / wide)];
    const join = (free, from, to) => {
      if (!free) after.set(from, [...(after.get(from) ?? []), to]);
    };
    join(cells[cell - wide], corner(x, y), corner(x + 1, y));
    join(cells[cell + 1], corner(x + 1, y), corner(x + 1, y + 1));
    join(cells[cell + wide], corner(x + 1, y + 1), corner(x, y + 1));
    join(cells[cell - 1], corner(x, y + 1), corner(x, y));
  });
  /** @type {Point[][]} */
  const rings = [];
  for (const start of after.keys()) {
    /** @type {Point[]} */
    const ring = [];
    for (let at = start; after.get(at)?.length; at = after.get(at).pop()) {
      ring.push([at % (wide + 1), Math.floor(at / (wide + 1))]);
    }
    if (ring.length > 6) rings.push(ring);
  }
  return rings.sort((a, b) => b.length - a.length);
}

/**
 * The rings of the part of a figure around a place, in the tile's units; none on a line.
 *
 * @param {Figure} figure
 * @param {{ points: Point[], width: number, rings?: Point[][] }[]} lines
 * @param {Point} place
 * @returns {Point[][]}
 */
export function partAround({ polygon, path }, lines, place) {
  const box = boxOf(polygon);
  const { left, top } = box;
  const scale = CELLS / Math.max(box.wide, box.high);
  const pad = UNDER + 2;
  const [wide, high] = [box.wide, box.high].map((side) => Math.ceil(side * scale) + 2 * pad);
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width: wide, height: high });
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, pad - left * scale, pad - top * scale);
  context.fillStyle = "#fff";
  context.fill(path);
  for (const { points, width, rings } of lines) {
    if (!rings) lineInto(context, points, "#000", Math.max(width, 1.5 / scale));
  }
  const { data } = context.getImageData(0, 0, wide, high);
  const light = new Uint8Array(wide * high).map((_, cell) =>
    Number(data[4 * cell] > 127 && data[4 * cell + 3] > TIP)
  );
  const [x, y] = [[place[0], left], [place[1], top]].map(([at, least]) =>
    Math.floor((at - least) * scale + pad)
  );
  if (!light[y * wide + x]) return [];
  return ringsAround(reached(light, wide, y * wide + x), wide).map((ring) =>
    simplified([...ring, ring[0]], 0.9, Infinity).slice(0, -1).map(([u, v]) => [
      (u - pad) / scale + left,
      (v - pad) / scale + top,
    ])
  );
}
