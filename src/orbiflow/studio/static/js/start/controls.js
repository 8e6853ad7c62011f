/** The controls beside the picture: how it is read, and with what it is painted on. */

import { check, controlsOf, slider } from "../controls.js";
import { aside, h, row } from "../dom.js";

/** @type {[tool: string, words: string, image: any][]} */
const TOOLS = [
  ["add", "Add", "more"],
  ["remove", "Remove", "cut"],
  ["pins", "Keep its shape", "pin"],
  ["emphasis", "Matters most", "star"],
  ["rub", "Rub out", "rub"],
];
/** @type {[string, string, any][]} */
const SHAPES = [["brush", "brush", "brush"], ["lasso", "lasso", "lasso"]];
const MEANINGS = {
  add: "Paint over what belongs to the animal and was missed.",
  remove: "Paint over what does not belong to it.",
  pins: "Paint over a part that must not bend, such as a head. The rest bends more.",
  emphasis: "Paint over a part by which one knows the animal, such as ears or a tail.",
  rub: "Rub out what you painted.",
};

/**
 * Sliders and choices for `reading`, which they change and tell: {root, take(reading)}.
 *
 * @param {Reading} reading
 * @param {() => void} changed
 */
export function readingControls(reading, changed) {
  /** Take other values, and show them. */
  const take = (part) => {
    Object.assign(reading, part);
    level.set(reading.threshold ?? 0.5);
    auto.set(reading.threshold === null);
    controls.show();
    changed();
  };
  const level = slider(
    "Where it ends",
    [0, 1, 0.01],
    reading.threshold ?? 0.5,
    (value) => (reading.threshold === null ? "found by itself" : value.toFixed(2)),
    (threshold) => take({ threshold }),
  );
  const auto = check(
    "Find the edge of the animal by itself",
    reading.threshold === null,
    (found) => take({ threshold: found ? null : 0.5 }),
  );
  const controls = controlsOf(reading, take);
  const width = (value) => (value ? `at least ${(100 * value).toFixed(0)} % wide` : "as they are");
  const amount = (value) => (value ? `${(100 * value).toFixed(1)} %` : "none");
  const sides = [[null, "found by itself"], [false, "dark"], [true, "light"]];
  const root = h("section.panel.stack", { "aria-label": "How the picture is read" }, [
    controls.choice("invert", "The animal is", sides),
    auto,
    level,
    controls.slider("smooth", "Smoothing", [0, 0.06, 0.002], amount),
    controls.slider("thicken", "Thin parts", [0, 0.12, 0.01], width),
  ]);
  return { root, take };
}

/**
 * The choice of `pen`, which it changes and tells; `buttons` stand below.
 *
 * @param {{ tool: string, shape: string, size: number }} pen
 */
export function paintingControls(pen, changed, buttons) {
  const meaning = aside(MEANINGS[pen.tool]);
  const controls = controlsOf(pen, (what) => {
    Object.assign(pen, what);
    meaning.textContent = MEANINGS[pen.tool];
    size.hidden = pen.shape === "lasso";
    changed();
  });
  const tools = controls.choice("tool", "Paint on the picture", TOOLS);
  tools.classList.add("tools");
  const size = controls.slider("size", "Size of the brush", [1, 20, 0.5], (value) => `${value} %`);
  const shapes = controls.choice("shape", "With a", SHAPES, { unseen: true });
  return h("section.panel.stack", { "aria-label": "Paint on the picture" }, [
    tools,
    meaning,
    shapes,
    size,
    row(buttons),
  ]);
}
