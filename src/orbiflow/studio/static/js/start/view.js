/** What of a picture is seen on a canvas: all of it, or a part that is nearer. */

const NEAREST = 12; // times that the picture may be larger than the whole

/** Lengths are in pixels of the picture, as are those of the canvas, which is as wide as the whole. */
export class View {
  nearer = 1;
  x = 0;
  y = 0;

  constructor(width, height) {
    this.width = width;
    this.height = height;
  }

  /** The point of the picture at a point of the canvas. @param {Point} point @returns {Point} */
  at([x, y]) {
    return [this.x + x / this.nearer, this.y + y / this.nearer];
  }

  /**
   * Come nearer by a factor; what is at a point of the canvas, by default its middle, stays there.
   *
   * @param {number} by
   * @param {Point} [point]
   */
  zoom(by, point = [this.width / 2, this.height / 2]) {
    const [x, y] = this.at(point);
    this.nearer = Math.min(NEAREST, Math.max(1, this.nearer * by));
    this.pan([point[0] - this.nearer * (x - this.x), point[1] - this.nearer * (y - this.y)]);
  }

  /**
   * Move the picture by a distance on the canvas; its edges stay outside.
   *
   * @param {Point} distance
   */
  pan([u, v]) {
    const most = 1 - 1 / this.nearer;
    this.x = Math.min(this.width * most, Math.max(0, this.x - u / this.nearer));
    this.y = Math.min(this.height * most, Math.max(0, this.y - v / this.nearer));
  }
}
