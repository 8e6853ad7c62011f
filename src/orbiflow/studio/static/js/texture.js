/** A picture laid on triangles pixel by pixel: each pixel is of one triangle, so no seam can show. */

const FRINGE = 1.5; // pixels of the picture, inside an outline, that have mixed with what was around it
const BEYOND = 3; // pixels by which what is laid goes on past its outline
const NEVER = 255;

/** @type {WeakMap<object, ImageData[]>} pictures, each half as fine as the one before */
const known = new WeakMap();

/** The pixels of a picture with `ratio` or fewer of its own pixels along one of them. */
function pixelsOf(picture, ratio) {
  if (!known.has(picture)) known.set(picture, []);
  const levels = known.get(picture);
  const level = Math.max(0, Math.floor(Math.log2(Math.max(ratio, 1)) + 0.3));
  if (!levels[level]) {
    const [wide, high] = [
      picture.naturalWidth || picture.width,
      picture.naturalHeight || picture.height,
    ];
    const canvas = document.createElement("canvas");
    canvas.width = Math.max(1, Math.round(wide / 2 ** level));
    canvas.height = Math.max(1, Math.round(high / 2 ** level));
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.imageSmoothingQuality = "high";
    context.drawImage(picture, 0, 0, canvas.width, canvas.height);
    levels[level] = context.getImageData(0, 0, canvas.width, canvas.height);
  }
  return levels[level];
}

const doubled = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);

/** Fill the pixels of one triangle with what of a source lies there. */
function fillTriangle(out, laid, source, images, places) {
  const [[a, b, c], [p, q, r]] = [images, places];
  const size = doubled(a, b, c);
  if (!size) return;
  const along = (j) => {
    const [u, v] = [q[j] - p[j], r[j] - p[j]];
    const x = (u * (c[1] - a[1]) - v * (b[1] - a[1])) / size;
    const y = (v * (b[0] - a[0]) - u * (c[0] - a[0])) / size;
    return [x, y, p[j] - x * a[0] - y * a[1]];
  };
  const [[ux, uy, u0], [vx, vy, v0]] = [along(0), along(1)];
  const { width, height, data } = out;
  const { width: wide, height: high, data: from } = source;
  const sides = [[a, b], [b, c], [c, a]].filter(([s, e]) => s[1] !== e[1]);
  const first = Math.max(0, Math.ceil(Math.min(a[1], b[1], c[1]) - 0.5));
  const last = Math.min(height - 1, Math.floor(Math.max(a[1], b[1], c[1]) - 0.5));
  for (let row = first; row <= last; row += 1) {
    const y = row + 0.5;
    let [left, right] = [Infinity, -Infinity];
    for (const [s, e] of sides) {
      if (y < Math.min(s[1], e[1]) || y > Math.max(s[1], e[1])) continue;
      const x = s[0] + (y - s[1]) / (e[1] - s[1]) * (e[0] - s[0]);
      left = Math.min(left, x);
      right = Math.max(right, x);
    }
    const end = Math.min(width - 1, Math.floor(right - 0.5 + 1e-6));
    for (let column = Math.max(0, Math.ceil(left - 0.5 - 1e-6)); column <= end; column += 1) {
      const x = column + 0.5;
      const u = Math.min(wide - 1, Math.max(0, ux * x + uy * y + u0 - 0.5));
      const v = Math.min(high - 1, Math.max(0, vx * x + vy * y + v0 - 0.5));
      const [i, j] = [Math.floor(u), Math.floor(v)];
      const [s, t] = [u - i, v - j];
      const at = 4 * (j * wide + i);
      const [across, down] = [i + 1 < wide ? 4 : 0, j + 1 < high ? 4 * wide : 0];
      // what is transparent has no colour
      const k = (1 - s) * (1 - t) * from[at + 3];
      const l = s * (1 - t) * from[at + across + 3];
      const m = (1 - s) * t * from[at + down + 3];
      const n = s * t * from[at + across + down + 3];
      const whole = k + l + m + n;
      const to = 4 * (row * width + column);
      for (let h = 0; h < 3; h += 1) {
        data[to + h] = whole &&
          (k * from[at + h] + l * from[at + across + h] + m * from[at + down + h] +
              n * from[at + across + down + h]) / whole;
      }
      data[to + 3] = whole;
      laid[row * width + column] = 1;
    }
  }
}

/** How far each pixel is from one that is `from`, in steps to neighbours, up to `most`; `step` sees each. */
function swept(from, width, most, step = (_here, _there) => {}) {
  const apart = from.map((is) => (is ? 0 : NEVER));
  const count = apart.length;
  const look = (here, there) => {
    if (there >= 0 && there < count && apart[there] < most && apart[there] + 1 < apart[here]) {
      apart[here] = apart[there] + 1;
      step(here, there);
    }
  };
  for (let k = 0; k < count; k += 1) {
    look(k, k - 1);
    look(k, k - width);
  }
  for (let k = count - 1; k >= 0; k -= 1) {
    look(k, k + 1);
    look(k, k + width);
  }
  return apart;
}

/**
 * A canvas with a picture on triangles: `images` are their points in its pixels, `shares` the same points in
 * the picture, 0 to 1. Colours go on a little past the outline; its own, mixed with what was around, do not.
 *
 * @param {HTMLImageElement | HTMLCanvasElement} picture
 * @param {{ images: Point[], shares: Point[], list: number[][] }} triangles
 * @param {number} width
 * @param {number} height
 */
export function laidOn(picture, { images, shares, list }, width, height) {
  const wide = "naturalWidth" in picture ? picture.naturalWidth : picture.width;
  const high = "naturalHeight" in picture ? picture.naturalHeight : picture.height;
  const areas = (points) =>
    list.reduce((sum, [a, b, c]) => sum + Math.abs(doubled(points[a], points[b], points[c])), 0);
  const ratio = Math.sqrt(areas(shares) * wide * high / (areas(images) || 1));
  const source = pixelsOf(picture, ratio);
  const places = shares.map(([u, v]) => [u * source.width, v * source.height]);
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  const out = context.createImageData(width, height);
  const laid = new Uint8Array(width * height);
  for (const corners of list) {
    fillTriangle(out, laid, source, corners.map((k) => images[k]), corners.map((k) => places[k]));
  }
  const colours = new Uint32Array(out.data.buffer);
  const fringe = Math.min(20, Math.ceil(FRINGE / ratio));
  const depth = swept(laid.map((is) => 1 - is), width, fringe + 1);
  const own = laid.map((is, k) => Number(is && depth[k] > fringe));
  swept(own, width, fringe + BEYOND, (here, there) => {
    colours[here] = colours[there];
  });
  context.putImageData(out, 0, 0);
  return canvas;
}
