/** The controls beside the picture: how it is read, and with what it is painted on. */

import { aside, choice, h, row, slider } from "../dom.js";

/** @type {[tool: string, words: string, image: any][]} */
const TOOLS = [
  ["add", "Add", "more"],
  ["remove", "Remove", "cut"],
  ["pins", "Keep its shape", "pin"],
  ["emphasis", "Matters most", "star"],
  ["rub", "Rub out", "rub"],
];
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
  const change = (part) => {
    Object.assign(reading, part);
    changed();
  };
  const level = slider("Where it ends", {
    min: 0,
    max: 1,
    step: 0.01,
    value: reading.threshold ?? 0.5,
    said: (value) => (reading.threshold === null ? "found by itself" : value.toFixed(2)),
  }, (value) => {
    auto.checked = false;
    change({ threshold: value });
    level.set(value);
  });
  const auto = h("input", {
    type: "checkbox",
    checked: reading.threshold === null,
    onchange: () => {
      change({ threshold: auto.checked ? null : 0.5 });
      level.set(0.5);
    },
  });
  const smoothing = slider("Smoothing", {
    min: 0,
    max: 0.06,
    step: 0.002,
    value: reading.smooth,
    said: (value) => (value ? `${(100 * value).toFixed(1)} %` : "none"),
  }, (value) => change({ smooth: value }));
  const growing = slider("Thin parts", {
    min: 0,
    max: 0.12,
    step: 0.01,
    value: reading.thicken,
    said: (value) => (value ? `at least ${(100 * value).toFixed(0)} % wide` : "as they are"),
  }, (value) => change({ thicken: value }));
  const side = choice(
    "The animal is",
    [[null, "found by itself"], [false, "dark"], [true, "light"]],
    reading.invert,
    (value) => change({ invert: value }),
  );
  const root = h(
    "section",
    { class: "panel stack", "aria-label": "How the picture is read" },
    side,
    h("label", { class: "check" }, auto, "Find the edge of the animal by itself"),
    level,
    smoothing,
    growing,
  );
  /** Take other values, and show them. */
  const take = (part) => {
    change(part);
    auto.checked = reading.threshold === null;
    level.set(reading.threshold ?? 0.5);
    smoothing.set(reading.smooth);
    growing.set(reading.thicken);
    side.set(reading.invert);
  };
  return { root, take };
}

/**
 * The choice of `pen`, which it changes and tells; `buttons` stand below.
 *
 * @param {{ tool: string, shape: string, size: number }} pen
 */
export function paintingControls(pen, changed, buttons) {
  const meaning = aside(MEANINGS[pen.tool]);
  const tools = choice("Paint on the picture", TOOLS, pen.tool, (tool) => {
    pen.tool = tool;
    meaning.textContent = MEANINGS[tool];
    changed();
  });
  tools.classList.add("tools");
  const size = slider("Size of the brush", {
    min: 1,
    max: 20,
    step: 0.5,
    value: pen.size,
    said: (value) => `${value} %`,
  }, (value) => {
    pen.size = value;
    changed();
  });
  const shapes = choice(
    "With a",
    [["brush", "brush", "brush"], ["lasso", "lasso", "lasso"]],
    pen.shape,
    (shape) => {
      pen.shape = shape;
      size.hidden = shape === "lasso";
      changed();
    },
    { unseen: true },
  );
  return h(
    "section",
    { class: "panel stack", "aria-label": "Paint on the picture" },
    tools,
    meaning,
    shapes,
    size,
    row(buttons),
  );
}
