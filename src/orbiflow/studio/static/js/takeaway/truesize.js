/** The tile as large as it will be, on a screen that was measured with a bank card. */

import { button, h, put, row, slider } from "../dom.js";
import { measure as inUnit } from "../lengths.js";
import { figuresOf, measured as areaOf, pathOf } from "../../../../drawing/js/tiling.js";

const CARD = [85.6, 53.98]; // mm: ISO/IEC 7810 ID-1
const KEY = "orbiflow.px-per-mm";
const USUAL = 96 / 25.4; // what CSS takes a millimetre for
const WIDEST_NECK = 0.5; // in square roots of the area: what is wider is no neck, but the whole tile
const NECK = 9; // pixels of the circle around a narrow place
const ROOM = 150; // pixels of a tile beside whose circle there is room for words

export const pixels = () => Number(localStorage.getItem(KEY)) || USUAL;

/** The least coordinates and the sides of the upright box around points: [left, top, width, height]. */
function upright(points) {
  const [xs, ys] = [0, 1].map((k) => points.map((point) => point[k]));
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  return [left, top, Math.max(...xs) - left, Math.max(...ys) - top];
}

/** Put a circle round a narrow place, and its width beside it where there is room. */
function markNeck(context, [x, y], words, wide, look) {
  const left = x > wide / 2;
  const at = [x + (left ? -1 : 1) * (NECK + 6), y];
  Object.assign(context, {
    font: "600 13px system-ui, sans-serif",
    textAlign: left ? "right" : "left",
    textBaseline: "middle",
  });
  context.setLineDash([]);
  for (const [colour, width] of [[look("--surface"), 5], [look("--ink"), 2]]) {
    Object.assign(context, { strokeStyle: colour, fillStyle: colour, lineWidth: width });
    context.beginPath();
    context.arc(x, y, NECK, 0, 2 * Math.PI);
    context.stroke();
    if (wide < ROOM) continue;
    if (width > 2) context.strokeText(words, ...at);
    else context.fillText(words, ...at);
  }
}

/**
 * A view of a card's tile: {root, show(size in mm, the width in mm below which a neck is told)}.
 *
 * @param {Card} tile
 * @param {Point[][]} rectangles the smallest ones around its figures, by which files measure a tile
 */
export function trueSize(tile, rectangles) {
  const yDown = tile.y_down;
  const figures = figuresOf(tile);
  const far = ([a, b], [c, d]) => Math.hypot(c - a, d - b);
  const measured = rectangles.map((corners) => {
    const [p, q, r] = corners;
    const [short, long] = [far(p, q), far(q, r)].sort((a, b) => a - b);
    return { short, long, corners };
  });
  const { long, short, corners } = measured.reduce((a, b) => (b.long > a.long ? b : a));
  const polygon = figures.flatMap((figure) => figure.polygon);
  const neck = figures.filter((own) =>
    own.neck && far(...own.neck) <= WIDEST_NECK * Math.sqrt(areaOf(own.polygon).area)
  ).map((own) => own.neck).reduce((a, b) => (a && far(...a) <= far(...b) ? a : b), null);
  const canvas = h("canvas", { class: "true-tile", role: "img" });
  const said = h("p", { class: "soft small" });
  const thin = h("p", { class: "small", hidden: !neck });
  const card = h("div", { class: "bank-card", "aria-hidden": "true" }, h("span", "bank card"));
  let [size, least] = [40, 0];
  const fit = slider("Make this as large as a bank card held to the screen", {
    min: 2,
    max: 9,
    step: 0.01,
    value: pixels(),
    said: (value) => `${Math.round((value / USUAL) * 100)} %`,
  }, (value) => {
    localStorage.setItem(KEY, String(value));
    draw();
  });
  const tools = h(
    "div",
    { class: "stack", hidden: true },
    card,
    fit,
    row(button("That fits", () => {
      tools.hidden = true;
    }, {})),
  );
  const measure = button("Measure my screen", () => {
    tools.hidden = !tools.hidden;
    draw();
  });

  function draw() {
    const scale = pixels();
    card.style.setProperty("width", `${CARD[0] * scale}px`);
    card.style.setProperty("height", `${CARD[1] * scale}px`);
    const [left, top, wide, high] = upright([...polygon, ...corners]);
    const unit = (size * scale) / long;
    const ratio = globalThis.devicePixelRatio || 1;
    const [width, height] = [wide * unit + 4, high * unit + 4].map((side) =>
      Math.min(side, 4000 / ratio)
    );
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    canvas.style.setProperty("width", `${width}px`);
    canvas.style.setProperty("height", `${height}px`);
    const context = canvas.getContext("2d");
    const flip = yDown ? 1 : -1;
    context.setTransform(
      unit * ratio,
      0,
      0,
      flip * unit * ratio,
      (2 - left * unit) * ratio,
      (2 - (yDown ? top : -(top + high)) * unit) * ratio,
    );
    const look = getComputedStyle(canvas);
    context.strokeStyle = look.color;
    context.lineWidth = 1.5 / unit;
    context.lineJoin = "round";
    context.fillStyle = look.getPropertyValue("--accent-soft");
    for (const path of figures.map((figure) => pathOf(figure.polygon))) {
      context.fill(path);
      context.stroke(path);
    }
    context.setLineDash([4 / unit, 4 / unit]);
    context.lineWidth = 1 / unit;
    context.stroke(pathOf(corners));
    if (neck) tellNeck(context, context.getTransform(), ratio, width);
    const sides = (...lengths) => inUnit(...lengths.map((side) => (side * size) / long));
    const [rectangle, lying] = [sides(long, short), sides(...upright(polygon).slice(2))];
    const lie = figures.length > 1 ? "they lie" : "it lies";
    const around = figures.length > 1 ? "the larger one" : "it";
    canvas.setAttribute(
      "aria-label",
      `The tile in its true size, ${lying} as ${lie}, in a rectangle of ${rectangle}`,
    );
    said.textContent =
      `${lying} as ${lie}; the smallest rectangle around ${around} has ${rectangle}. ${
        localStorage.getItem(KEY)
          ? "Your screen is measured."
          : "Screens differ: measure yours once."
      }`;
  }

  function tellNeck(context, at, ratio, wide) {
    const [[a, b], [c, d]] = neck;
    const neckWidth = (Math.hypot(c - a, d - b) * size) / long;
    const words = inUnit(neckWidth);
    const narrow = neckWidth < least;
    const { x, y } = at.transformPoint({ x: (a + c) / 2, y: (b + d) / 2 });
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    markNeck(
      context,
      [x / ratio, y / ratio],
      words,
      wide,
      (name) =>
        getComputedStyle(canvas).getPropertyValue(narrow && name === "--ink" ? "--bad" : name),
    );
    thin.classList.toggle("notice", narrow);
    thin.textContent = `Its narrowest neck between two parts, in the circle, is ${words} wide${
      narrow ? ": it may break there. Choose a longer tile." : "; tips may be thinner."
    }`;
  }
  const root = h("div", { class: "stack" });
  put(
    root,
    h("div", {
      class: "true-place",
      tabindex: "0",
      role: "group",
      "aria-label": "The tile in its true size",
    }, canvas),
    thin,
    said,
    h("div", measure),
    tools,
  );
  return {
    root,
    show(millimetres, limit = 0) {
      [size, least] = [millimetres, limit];
      draw();
    },
  };
}
