/** The canvas of the close-up: what lies under a place of it. */

import { inverse, moved } from "../../../../drawing/js/tiling.js";
import { View } from "../../../../drawing/js/view.js";
/** @import { LiveTiling } from "./live.js" */
import { h, zooms } from "../dom.js";
import { beside } from "./lines.js";

export class Stage extends View {
  /** `tool()` gives the tool in hand, as a view takes it. */
  constructor({ label, help, tool }) {
    const canvas = h("canvas", {
      class: "closeup-canvas",
      tabindex: "0",
      role: "application",
      "aria-label": label,
      "aria-describedby": help,
    });
    super(canvas, tool);
    /** @type {LiveTiling} */
    this.tiling = undefined;
    this.box = h("div", { class: "closeup-stage" }, canvas);
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
    const view = this.camera.matrix(this.width, this.height);
    const own = this.tiling.copy(aspect, ...cell);
    return [
      view[0] * own[0] + view[2] * own[1],
      view[1] * own[0] + view[3] * own[1],
      view[0] * own[2] + view[2] * own[3],
      view[1] * own[2] + view[3] * own[3],
      view[0] * own[4] + view[2] * own[5] + view[4],
      view[1] * own[4] + view[3] * own[5] + view[5],
    ];
  }
}
