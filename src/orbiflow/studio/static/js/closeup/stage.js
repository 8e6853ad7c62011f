/** The canvas of the close-up: what lies under a place of it. */

import { inverse, moved, times } from "../../../../drawing/js/tiling.js";
import { View } from "../../../../drawing/js/view.js";
/** @import { LiveTiling } from "./live.js" */
import { h, handled, zooms } from "../dom.js";
import { beside } from "./lines.js";

/** Whether two copies are of the same tile, and not of one beside it. @param {Copy} a @param {Copy} b */
export const isSame = (a, b) => a.aspect === b.aspect && String(a.cell) === String(b.cell);

export class Stage extends View {
  /** `label` and the id of its `help` are for readers of screens; `tool()` gives the tool in hand, as a view takes it. */
  constructor(label, help, tool) {
    const canvas = handled("closeup-canvas", "application", label, help);
    super(canvas, tool);
    /** @type {LiveTiling} */
    this.tiling = undefined;
    this.box = h("div.closeup-stage", canvas);
    this.tester = document.createElement("canvas").getContext("2d");
  }

  /** Buttons to come nearer, go farther and see all. */
  zooms() {
    return zooms((by) => this.zoom(by), () => this.fit());
  }

  /** The copy under a place: {copy, at: the place in the prototile}, or null. */
  copyAt(place) {
    for (let k = this.copies.length - 1; k >= 0; k -= 1) {
      const copy = this.copies[k];
      const at = moved(inverse(copy.matrix), place);
      const { path } = this.tiling.figures[copy.figure];
      if (this.tester.isPointInPath(path, ...at)) return { copy, at };
    }
    return null;
  }

  /** The point of an outline nearest to a place within pixels: {copy, vertex, share, apart}, or null. */
  outlineAt(place, within) {
    let best = null;
    const reach = within / this.camera.scale;
    for (const copy of this.copies) {
      const at = moved(inverse(copy.matrix), place);
      const ring = this.tiling.figures[copy.figure].polygon;
      ring.forEach((a, vertex) => {
        const { share, apart } = beside(at, a, ring[(vertex + 1) % ring.length]);
        if (apart < (best?.apart ?? reach)) best = { copy, vertex, share, apart };
      });
    }
    return best;
  }

  /**
   * The matrix, prototile to canvas, of a copy as it lies now.
   *
   * @param {{ aspect: number, cell: [number, number] }} copy
   * @returns {Matrix}
   */
  matrixOf({ aspect, cell }) {
    return times(this.camera.matrix(this.width, this.height), this.tiling.copy(aspect, ...cell));
  }
}
