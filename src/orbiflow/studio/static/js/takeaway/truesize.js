/** The tile as large as it will be, by the millimetres of the browser, and what is narrow of it. */

import { h } from "../dom.js";
import { measure } from "../lengths.js";
import { boxOf, figuresOf, measured as areaOf } from "../../../../drawing/js/tiling.js";

const WIDEST_NECK = 0.5; // in square roots of the area: what is wider is no neck, but the whole tile

/**
 * A view of a card's tile: {root, show(size in mm, the width in mm below which a neck is told)}.
 *
 * @param {Card} tile
 * @param {Point[][]} rectangles the smallest ones around its figures, by which files measure a tile
 */
export function trueSize(tile, rectangles) {
  const figures = figuresOf(tile);
  const far = ([a, b], [c, d]) => Math.hypot(c - a, d - b);
  const sized = rectangles.map((corners) => {
    const [p, q, r] = corners;
    const [short, long] = [far(p, q), far(q, r)].sort((a, b) => a - b);
    return { short, long, corners };
  });
  const { long, short, corners } = sized.reduce((a, b) => (b.long > a.long ? b : a));
  const polygon = figures.flatMap((figure) => figure.polygon);
  const neck = figures.filter((own) =>
    own.neck && far(...own.neck) <= WIDEST_NECK * Math.sqrt(areaOf(own.polygon).area)
  ).map((own) => own.neck).reduce((a, b) => (a && far(...a) <= far(...b) ? a : b), null);
  const { left, top, wide, high } = boxOf([...polygon, ...corners]);
  const lying = boxOf(polygon);
  const box = [left, tile.y_down ? top : -top - high, wide, high];
  const outlines = figures.map((figure) => `M${figure.polygon.join("L")}Z`).join("");
  const place = h("div.true-place", {
    tabindex: "0",
    role: "group",
    "aria-label": "The tile in its true size",
  });
  place.innerHTML = `<svg class="true-tile" role="img" viewBox="${box.join(" ")}">
    <g transform="scale(1 ${tile.y_down ? 1 : -1})"><path d="${outlines}"/>
    <path class="around" d="M${corners.join("L")}Z"/>
    <path class="neck" d="${neck ? `M${neck.join("L")}` : ""}"/></g></svg>`;
  const drawing = place.querySelector("svg");
  const said = h("p.soft.small");
  const thin = h("p.small", { hidden: !neck });
  const [lie, around] = figures.length > 1 ? ["they lie", "the larger one"] : ["it lies", "it"];

  /** Show how large it is; a neck below `limit` may break. */
  function show(size, limit = 0) {
    const scale = size / long;
    drawing.style.setProperty("width", `${wide * scale}mm`);
    drawing.style.setProperty("height", `${high * scale}mm`);
    const sides = (...lengths) => measure(...lengths.map((side) => side * scale));
    said.textContent =
      `${sides(lying.wide, lying.high)} as ${lie}; the smallest rectangle around ${around} has ` +
      `${sides(long, short)}. Screens differ a little.`;
    drawing.setAttribute("aria-label", said.textContent);
    if (!neck) return;
    const narrow = far(...neck) * scale < limit;
    drawing.classList.toggle("narrow", narrow);
    thin.classList.toggle("notice", narrow);
    thin.textContent = `Its narrowest neck between two parts, which is marked, is ${
      sides(far(...neck))
    } wide${narrow ? ": it may break there. Choose a longer tile." : "; tips may be thinner."}`;
  }
  return { root: h("div.stack", place, thin, said), show };
}
