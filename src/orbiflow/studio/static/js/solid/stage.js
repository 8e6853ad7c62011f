/** A figure or a solid that turns, by the script of the pages that `orbiflow fill` writes, and its controls. */

import { showStack } from "../../api/scripts/stack.js";
import { check, choice, slider } from "../controls.js";
import { button, h, handled, put, row, unique } from "../dom.js";

/** @type {[name: string, words: string][]} */
const SHOWN = [["target", "Figure"], ["bent", "Bent"], ["tile", "Tile"], ["stack", "Stack"]];
/** What is right, backwards and up where each axis points up. */
const AXES = {
  x: [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
  y: [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
  z: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
};

export class Stage {
  shown = "stack";
  turning = !matchMedia("(prefers-reduced-motion: reduce)").matches;

  constructor() {
    this.tips = unique("tips");
    this.place = h("div.turned");
    this.kinds = choice("Show", SHOWN, this.shown, (name) => {
      this.shown = name;
      this.view?.show(name);
    }, { unseen: true });
    const moved = (apart) => this.view?.moveApart(apart / 100);
    this.apart = slider("Apart", [0, 100, 1], 0, (apart) => `${apart} %`, moved);
    this.opening = button("Open", () => this.view?.glideApart(this.view.view.apart > 0.5 ? 0 : 1));
    this.turner = check("Turn slowly", false, (turning) => this.view?.keepTurning(turning));
    this.stack = row(this.apart, this.opening);
    this.keys = h("p.soft.small", { id: this.tips });
    this.root = h("figure.panel.stack.stage", [
      this.place,
      this.kinds,
      this.stack,
      row(this.turner, this.keys),
    ]);
  }

  /** Show what `stack_data` or `figure_data` gives. @param {any} data @param {string} label */
  open(data, label) {
    this.close();
    this.alone = !data.copies.length;
    this.kinds.hidden = this.stack.hidden = this.alone;
    this.keys.textContent = "Drag or use the arrow keys to turn; + and − zoom" +
      (this.alone ? "." : ", [ and ] open and close the stack, 0 starts again.");
    const canvas = handled("view", "img", label, this.tips);
    put(this.place, canvas);
    const shown = this.shown, turning = this.turning;
    this.data = data;
    this.view = showStack(canvas, data, { changed: (view) => this.heard(view), scrolls: true });
    if (!this.view) {
      put(this.place, h("p.lonely", "This picture needs WebGL 2."));
      return;
    }
    this.lost = canvas.getContext("webgl2").getExtension("WEBGL_lose_context");
    this.shown = shown;
    this.view.keepTurning(turning);
    this.view.show(this.alone ? "target" : shown);
    this.kinds.set(shown);
  }

  /** Let an axis of the file point up. */
  turnUp(up) {
    if (!this.alone) return;
    this.data.axes = AXES[up];
    this.view?.show("target");
  }

  heard(view) {
    if (this.alone) view.shown = "target";
    else this.shown = view.shown;
    this.turning = view.turning;
    this.turner.set(view.turning);
    this.apart.set(Math.round(100 * view.apart));
    this.opening.textContent = view.apart > 0.5 ? "Close" : "Open";
    this.kinds.set(view.shown);
  }

  close() {
    const { turning } = this;
    this.view?.keepTurning(false);
    this.turning = turning;
    this.view = null;
    this.lost?.loseContext();
    this.lost = null;
  }
}
