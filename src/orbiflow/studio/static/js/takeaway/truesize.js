/** The tile as large as it will be, on a screen that was measured with a bank card. */

import { button, h, put, slider } from "../dom.js";
import { pathOf } from "../tiling.js";

const CARD = [85.6, 53.98]; // mm: ISO/IEC 7810 ID-1
const KEY = "orbiflow.px-per-mm";
const USUAL = 96 / 25.4; // what CSS takes a millimetre for

export const pixels = () => Number(localStorage.getItem(KEY)) || USUAL;

/** A view of a polygon: {root, show(size in mm)}; `yDown`: how its y lies. */
export function trueSize(polygon, yDown) {
  const canvas = h("canvas", { class: "true-tile", role: "img" });
  const said = h("p", { class: "soft small" });
  const card = h("div", { class: "bank-card", "aria-hidden": "true" }, h("span", {}, "bank card"));
  let size = 40;
  const fit = slider("Make this as large as a bank card held to the screen", { min: 2, max: 9, step: 0.01, value: pixels(), said: (value) => `${Math.round((value / USUAL) * 100)} %` }, (value) => {
    localStorage.setItem(KEY, value);
    draw();
  });
  const tools = h("div", { class: "stack", hidden: true }, card, fit, h("div", { class: "row" }, button("That fits", () => { tools.hidden = true; }, {})));
  const measure = button("Measure my screen", () => { tools.hidden = !tools.hidden; draw(); }, { kind: "quiet" });

  function draw() {
    const scale = pixels();
    card.style.setProperty("width", `${CARD[0] * scale}px`);
    card.style.setProperty("height", `${CARD[1] * scale}px`);
    const [xs, ys] = [0, 1].map((k) => polygon.map((point) => point[k]));
    const [left, top] = [Math.min(...xs), Math.min(...ys)];
    const [wide, high] = [Math.max(...xs) - left, Math.max(...ys) - top];
    const unit = (size * scale) / Math.max(wide, high);
    const ratio = globalThis.devicePixelRatio || 1;
    const [width, height] = [wide * unit + 4, high * unit + 4].map((side) => Math.min(side, 4000 / ratio));
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    canvas.style.setProperty("width", `${width}px`);
    canvas.style.setProperty("height", `${height}px`);
    const context = canvas.getContext("2d");
    const flip = yDown ? 1 : -1;
    context.setTransform(unit * ratio, 0, 0, flip * unit * ratio, (2 - left * unit) * ratio, (2 - (yDown ? top : -(top + high)) * unit) * ratio);
    const look = getComputedStyle(canvas);
    context.strokeStyle = look.color;
    context.lineWidth = 1.5 / unit;
    context.lineJoin = "round";
    const path = pathOf(polygon);
    context.fillStyle = look.getPropertyValue("--accent-soft");
    context.fill(path);
    context.stroke(path);
    const measured = [wide, high].map((side) => ((side * size) / Math.max(wide, high)).toFixed(1));
    canvas.setAttribute("aria-label", `The tile in its true size, ${measured[0]} by ${measured[1]} mm`);
    said.textContent = `${measured[0]} × ${measured[1]} mm. ${localStorage.getItem(KEY) ? "Your screen is measured." : "Screens differ: measure yours once."}`;
  }
  const root = h("div", { class: "stack" });
  put(root, h("div", { class: "true-place", tabindex: "0", role: "group", "aria-label": "The tile in its true size" }, canvas), h("div", { class: "row" }, said, h("span", { class: "grow" }), measure), tools);
  return { root, show(millimetres) { size = millimetres; draw(); } };
}
