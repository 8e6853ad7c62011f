/** The body of a tile that is pulled: how its points hang on the unknowns, and how stiff it is. */

import { sparse, sparseOf } from "./sparse.js";

const STEEPEST = 8; // largest weight of a triangle's side: slivers would be too stiff

/** Every point of the body as rows of one matrix; the group moves about the middle of the tile. */
export function everyPoint(space, middle, group) {
  const { body, cols, maps } = space;
  const size = body.points.length;
  const own = sparse(space, cols);
  const rows = [];
  for (let i = 0; i < space.rows; i += 1) {
    const row = new Map();
    for (let k = own.start[i]; k < own.start[i + 1]; k += 1) row.set(own.at[k], own.value[k]);
    // p -> M p + b is M (p - middle) + middle + b', so that M does not shift what is far from 0
    maps.forEach((map, m) => {
      const by = [0, 1].map((j) => map[j][0] * middle[0] + map[j][1] * middle[1]);
      const [u, v] = [cols - 2, cols - 1].map((column) => row.get(column) ?? 0);
      const shift = u * by[0] + v * by[1];
      if (shift) row.set(group + m, (row.get(group + m) ?? 0) - shift);
    });
    rows.push(row);
  }
  body.sides.forEach(([from, to], k) => {
    const share = body.shares[k];
    for (const j of [0, 1]) {
      const row = new Map();
      for (const [vertex, part] of [[from, 1 - share], [to, share]]) {
        for (const [column, value] of rows[2 * vertex + j]) {
          row.set(column, (row.get(column) ?? 0) + part * value);
        }
      }
      rows.push(row);
    }
  });
  const tied = rows.length;
  for (let i = tied; i < 2 * size; i += 1) rows.push(new Map([[cols + i - tied, 1]]));
  return { points: sparseOf(rows, cols + 2 * size - tied), tied };
}

/** The cotangent of each corner of each triangle, the Laplacian that they make of both coordinates, and its diagonal. */
export function weigh(triangles, rest, area) {
  const size = rest.length / 2;
  const cotangents = new Float64Array(triangles.length);
  const stiffness = new Float64Array(size);
  const near = Array.from({ length: 2 * size }, () => new Map());
  for (let t = 0; t < triangles.length; t += 3) {
    const corners = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const cot = corners.map((a, k) => {
      const [b, c] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
      const [ux, uy] = [rest[2 * b] - rest[2 * a], rest[2 * b + 1] - rest[2 * a + 1]];
      const [vx, vy] = [rest[2 * c] - rest[2 * a], rest[2 * c + 1] - rest[2 * a + 1]];
      return (ux * vx + uy * vy) / Math.max(Math.abs(ux * vy - uy * vx), 1e-12 * area);
    });
    const share = 0.5 * Math.min(1, STEEPEST / Math.max(...cot.map(Math.abs)));
    corners.forEach((_, k) => {
      const [b, c] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
      const weight = cotangents[t + k] = share * cot[k]; // of the side opposite of corner k
      for (
        const [i, j, own] of [[b, c, -weight], [c, b, -weight], [b, b, weight], [c, c, weight]]
      ) {
        if (i === j) stiffness[i] += own;
        for (const x of [0, 1]) {
          near[2 * i + x].set(2 * j + x, (near[2 * i + x].get(2 * j + x) ?? 0) + own);
        }
      }
    });
  }
  return { cotangents, stiffness, laplacian: sparseOf(near, 2 * size) };
}
