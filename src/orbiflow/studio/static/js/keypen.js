/** A pen that arrow keys move over a canvas, and Space or Enter puts down and lifts. No page is needed here. */

import { ARROWS } from "../../../drawing/js/turned.js";

export class KeyPen {
  /** @type {Point | null} */
  at = null; // in the middle at first
  isDown = false;

  /**
   * `size()`: [width, height] of the canvas; `step(far)`: how far a key moves the pen, with Shift `far`. Heard are
   * down(at), whether the pen stays down, move(at), up(), and past(distance) of what is beyond an edge.
   *
   * @param {{ size(): number[], step(far: boolean): number, down(at: Point): boolean, move(at: Point): void, up(): void, past?(distance: Point): void }} on
   */
  constructor(on) {
    this.on = on;
  }

  /** Whether it hears a key. @param {KeyboardEvent} event */
  key({ key, shiftKey }) {
    const way = ARROWS[key];
    if (!way && key !== " " && key !== "Enter") return false;
    const size = this.on.size();
    this.at ??= [size[0] / 2, size[1] / 2];
    if (!way) {
      if (this.isDown) this.lift();
      else this.isDown = this.on.down(this.at);
      return true;
    }
    const step = this.on.step(shiftKey);
    const goal = this.at.map((value, k) => value + step * way[k]);
    const [x, y] = goal.map((value, k) => Math.min(size[k], Math.max(0, value)));
    this.at = [x, y];
    this.on.past?.([x - goal[0], y - goal[1]]);
    if (this.isDown) this.on.move(this.at);
    return true;
  }

  lift() {
    if (!this.isDown) return;
    this.isDown = false;
    this.on.up();
  }
}
