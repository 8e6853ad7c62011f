/** What was drawn on a silhouette, where it lies on a tile. No page is needed here. */

import { beside } from "./lines.js";

const ROOM = 0.75; // share of the distance to the outline that an eye may fill

/** What is drawn on a figure. */
export const drawnOn = (drawing, figure) => {
  const { strokes = [], eyes = [] } = (figure ? drawing?.second : drawing) ?? {};
  return { strokes, eyes };
};

/**
 * The lines and eyes on each figure of a tiling, {lines, eyes}, in the tile's units.
 *
 * @param {any} drawing
 * @param {import("./carry.js").Carry[]} carries the map of each figure
 * @param {{ area: number, figures: { polygon: Point[] }[] }} tiling
 */
export function marksOf(drawing, carries, { area, figures }) {
  return carries.map((carry, figure) => {
    const { strokes, eyes } = drawnOn(drawing, figure);
    const there = (points) => points.map((point) => carry.forward(point));
    const ring = figures[figure].polygon;
    const room = (at) =>
      Math.min(...ring.map((a, k) => beside(at, a, ring[(k + 1) % ring.length]).apart));
    return {
      lines: strokes.map(({ points, colour, width, rings }) => ({
        points: there(points),
        colour,
        width: width * carry.scale, // as exports keep it
        rings: rings?.map(there),
      })),
      eyes: eyes.map(([x, y, radius]) => {
        const at = carry.forward([x, y]);
        const grown = radius * carry.growth([x, y], 0.02 * Math.sqrt(area) / carry.scale);
        return { at, radius: Math.min(grown, ROOM * room(at)), light: carry.light };
      }),
    };
  });
}
