/** Whether an outline can be one of a tile. No page is needed here. */

/** Whether an outline x0, y0, x1, y1 ... crosses itself. @param {ArrayLike<number>} ring */
export function crosses(ring) {
  const count = ring.length / 2;
  const order = Array.from({ length: count }, (_, k) => k);
  const [low, high] = [new Float64Array(count), new Float64Array(count)];
  for (let k = 0; k < count; k += 1) {
    const [x, u] = [ring[2 * k], ring[2 * ((k + 1) % count)]];
    low[k] = Math.min(x, u);
    high[k] = Math.max(x, u);
  }
  order.sort((a, b) => low[a] - low[b]);
  for (let i = 0; i < count; i += 1) {
    for (let j = i + 1; j < count && low[order[j]] <= high[order[i]]; j += 1) {
      if (meet(ring, count, order[i], order[j])) return true;
    }
  }
  return false;
}

function meet(ring, count, a, b) {
  const apart = Math.abs(a - b);
  if (apart <= 1 || apart === count - 1) return false;
  const point = (k) => [ring[2 * (k % count)], ring[2 * (k % count) + 1]];
  const [p, q, r, s] = [point(a), point(a + 1), point(b), point(b + 1)];
  if (Math.max(p[1], q[1]) < Math.min(r[1], s[1]) || Math.max(r[1], s[1]) < Math.min(p[1], q[1])) {
    return false;
  }
  const side = (o, u, v) => (u[0] - o[0]) * (v[1] - o[1]) - (u[1] - o[1]) * (v[0] - o[0]);
  return side(p, q, r) * side(p, q, s) <= 0 && side(r, s, p) * side(r, s, q) <= 0;
}
