/** Strokes on a canvas by mouse, touch or pen, and by keyboard: arrows move a cross, Space draws. */

import { byHand, placeOn } from "../../../../drawing/js/turned.js";
import { KeyPen } from "../keypen.js";

/**
 * Hear strokes. `size()`: [width, height] of the canvas in its own units. `heard`: begin(point), move(points), end(),
 * stop() of a stroke that was none, hover(point or null) for the cross or the brush under the pointer, and zoom and pan.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {() => [number, number]} size
 * @param {{ begin(at: Point): void, move(points: Point[]): void, end(): void, hover(at: Point | null): void, stop(): void, zoom?(by: number, at?: Point): boolean, pan?(distance: Point): void }} heard
 */
export function pointing(canvas, size, heard) {
  /** @type {(place: Point) => Point} */
  const inside = ([x, y]) => {
    const scale = size()[0] / canvas.offsetWidth;
    return [scale * x, scale * y];
  };
  /** @param {Point} at */
  const begun = (at) => {
    heard.begin(at);
    return true;
  };
  const keys = new KeyPen({
    size,
    step: (far) => Math.max(...size()) * (far ? 0.05 : 0.01),
    down: begun,
    move: (at) => heard.move([at]),
    up: heard.end,
    past: heard.pan,
  });
  const show = (at) => {
    keys.at = at;
    heard.hover(at);
  };
  byHand(canvas, {
    down: (place) => begun(inside(place)),
    move(place, event) {
      show(inside(place));
      const all = event.getCoalescedEvents?.() ?? [];
      heard.move((all.length ? all : [event]).map((each) => inside(placeOn(canvas, each))));
    },
    up: heard.end,
    cancel: heard.stop,
    drag(from, to) {
      const [[a, b], [c, d]] = [inside(from), inside(to)];
      heard.pan?.([c - a, d - b]);
    },
    zoom: (by, at) => heard.zoom?.(by, at && inside(at)) ?? false,
    hover: (place) => (place ? show(inside(place)) : heard.hover(null)),
    key(event) {
      const heardIt = keys.key(event);
      if (heardIt) heard.hover(keys.at);
      return heardIt;
    },
  }, { keys: { 0: () => heard.zoom?.(0) } });
  canvas.addEventListener("blur", () => {
    keys.lift();
    heard.hover(null);
  });
}
