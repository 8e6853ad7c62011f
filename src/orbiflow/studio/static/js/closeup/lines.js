/** Lines that were drawn: made simple, rubbed out. No page is needed here. */

/**
 * Where on a side from a to b, 0 to 1, a point is nearest, and how far away.
 *
 * @param {Point} point
 * @param {Point} a
 * @param {Point} b
 */
export function beside([x, y], a, b) {
  const [u, v] = [b[0] - a[0], b[1] - a[1]];
  const share = Math.max(0, Math.min(1, ((x - a[0]) * u + (y - a[1]) * v) / (u * u + v * v || 1)));
  return { share, apart: Math.hypot(a[0] + share * u - x, a[1] + share * v - y) };
}

/**
 * A line through fewer points, nowhere farther than `near` from the one given, no side above `longest`.
 *
 * @param {Point[]} points
 * @param {number} near
 * @param {number} longest
 */
export function simplified(points, near, longest) {
  if (points.length < 3) return points;
  const keep = new Uint8Array(points.length);
  keep[0] = 1;
  keep[points.length - 1] = 1;
  const open = [[0, points.length - 1]];
  while (open.length) {
    const [from, to] = open.pop();
    const [a, b] = [points[from], points[to]];
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
    let [far, at] = [near, -1];
    for (let k = from + 1; k < to; k += 1) {
      const { apart } = beside(points[k], a, b);
      if (apart > far) [far, at] = [apart, k];
    }
    if (at < 0 && length > longest && to > from + 1) at = (from + to) >> 1;
    if (at > 0) {
      keep[at] = 1;
      open.push([from, at], [at, to]);
    }
  }
  return points.filter((_, k) => keep[k]);
}

/**
 * The parts of a line that are left when a rubber of this radius was at a place; null if all is.
 *
 * @param {Point[]} points
 * @param {Point} place
 * @param {number} radius
 */
export function rubbed(points, place, radius) {
  const away = ([x, y]) => Math.hypot(x - place[0], y - place[1]) > radius;
  const near = (a, b) => beside(place, a, b).apart <= radius;
  if (points.every(away) && !points.some((p, k) => k > 0 && near(points[k - 1], p))) return null;
  const parts = [[]];
  points.forEach((point, k) => {
    if (k > 0 && near(points[k - 1], point) && parts.at(-1).length) parts.push([]);
    if (away(point)) parts.at(-1).push(k);
  });
  return parts.filter((part) => part.length > 1);
}

/**
 * A number with as many digits as show, for what is kept.
 *
 * @param {number} value
 * @param {number} size
 */
export const short = (value, size) =>
  Number((Math.round((value / size) * 2e4) / 2e4 * size).toPrecision(7));
