/** The controls for colours, outline, artwork and symmetry. */

import {
  aside,
  button,
  check,
  choice,
  FEW_PALETTES,
  h,
  put,
  slider,
  soft,
  stack,
  unique,
} from "../dom.js";
import { kindsOf, signInto } from "./signs.js";

export const HELP = {
  look: ["Drag to move, scroll or pinch to zoom.", "arrows, + and −, 0 fits."],
  pull: [
    "Drag beside the outline, or hold Shift and drag, to move the view. Scroll or pinch to zoom.",
    "+ and −, 0 fits.",
  ],
  draw: [
    "Hold Shift and drag, or use two fingers, to move the view. Scroll or pinch to zoom.",
    "+ and −, 0 fits.",
  ],
};
const PEN_COLOURS = [
  ["#1b1b1b", "Black"],
  ["#ffffff", "White"],
  ["#c8322b", "Red"],
  ["#e9a13b", "Yellow"],
  ["#2f7d4f", "Green"],
  ["#2563a8", "Blue"],
];
/** @type {[string, string, any][]} */
const TOOLS = [
  ["pencil", "Pencil", "pencil"],
  ["line", "Line", "line"],
  ["fill", "Fill", "fill"],
  ["eye", "Eye", "eye"],
  ["rubber", "Rubber", "rub"],
];
/** What can be chosen for each. */
const USES = {
  pencil: ["colour", "size", "mirror"],
  line: ["colour", "size", "mirror"],
  fill: ["colour", "fill"],
  eye: ["eye", "mirror"],
  rubber: [],
};
const PERCENT = (value) => `${Math.round(100 * value)} %`;

/**
 * Palettes as rows of swatches, and one of the user's own.
 *
 * @param {About} about
 * @param {any} look
 * @param {number} needed
 * @param {(what: object) => void} change
 */
export function colourPanel(about, look, needed, change) {
  const name = unique("palette");
  const own = () =>
    look.custom ?? { colours: [...about.palettes[0].colours], outline: about.palettes[0].outline };
  const chips = (colours) =>
    h(
      "span",
      { class: "chips" },
      colours.slice(0, 5).map((colour) => h("span", { style: { background: colour } })),
    );
  const wells = h("div", { class: "wells" });
  const drawWells = () => {
    const custom = own();
    const labels = [...Array(Math.max(needed, 1)).keys()].map((
      k,
    ) => [`Colour ${k + 1}`, custom.colours[k] ?? "#cccccc", (colour) => {
      custom.colours[k] = colour;
    }]);
    labels.push(["Lines", custom.outline, (colour) => {
      custom.outline = colour;
    }]);
    put(
      wells,
      labels.map(([words, value, set]) =>
        h(
          "label",
          h("input", {
            type: "color",
            value,
            oninput: ({ target }) => {
              set(target.value);
              look.custom = custom;
              change({ palette: "own" });
            },
          }),
          h("span", words),
        )
      ),
    );
    wells.hidden = look.palette !== "own";
  };
  const radio = (value, words, colours = null) =>
    h(
      "label",
      { class: colours ? "palette" : "palette own", title: words },
      h("input", {
        type: "radio",
        name,
        value,
        checked: look.palette === value,
        "aria-label": words,
        onchange: () => {
          if (value === "own") look.custom = own();
          change({ palette: value });
          drawWells();
        },
      }),
      colours ? chips(colours) : h("span", words),
    );
  const radios = about.palettes.map((own) => radio(own.name, own.name, own.colours));
  const made = h(
    "fieldset",
    h("legend", "Colours"),
    h(
      "div",
      { class: "palettes" },
      radios.slice(0, FEW_PALETTES),
      radio("own", "My own"),
    ),
    h(
      "details",
      { open: about.palettes.slice(FEW_PALETTES).some((own) => own.name === look.palette) },
      h("summary", "More colours"),
      h("div", { class: "palettes" }, radios.slice(FEW_PALETTES)),
    ),
    wells,
  );
  drawWells();
  return made;
}

/**
 * From silhouette to tile, outline, artwork.
 *
 * @param {any} look
 * @param {{ count: number, hasMap: boolean, hasArt: boolean }} has
 * @param {(what: object) => void} change
 */
export function shapePanel(look, { count, hasMap, hasArt }, change) {
  const pictures = count > 1 ? "pictures" : "picture";
  const tint = slider("Colour over it", {
    min: 0,
    max: 1,
    step: 0.05,
    value: look.tint,
    said: (v) => (v ? PERCENT(v) : "none"),
  }, (share) => change({ tint: share }));
  tint.hidden = !look.art;
  return stack(
    hasMap &&
      slider(`From your ${pictures} to the tile`, {
        min: 0,
        max: 1,
        step: 0.01,
        value: 1,
        said: (v) => (v >= 1 ? "the tile" : v <= 0 ? `your ${pictures}` : PERCENT(v)),
      }, (share) => change({ share })),
    slider("Outline", {
      min: 0,
      max: 6,
      step: 0.2,
      value: look.line,
      said: (v) => (v ? `${v} px` : "none"),
    }, (line) => change({ line })),
    hasArt && check(`Show my ${pictures} on the tiles`, look.art, (art) => {
      tint.hidden = !art;
      change({ art });
    }),
    hasArt && tint,
  );
}

/**
 * The symmetry, with a sentence for each kind; `light(key)` when one is pointed at or focused.
 *
 * @param {Elements} elements
 * @param {any} look
 * @param {(what: object) => void} change
 * @param {(key: string | null) => void} light
 */
export function signPanel(elements, look, change, light) {
  const list = h("ul", { class: "signs", hidden: !look.signs });
  const ratio = 2;
  for (const { key, name, says, colour } of kindsOf(elements)) {
    const canvas = h("canvas", { width: 28 * ratio, height: 28 * ratio, "aria-hidden": "true" });
    const draw = () => {
      const context = canvas.getContext("2d");
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      const ink = colour === "currentcolor" ? getComputedStyle(canvas).color : colour;
      signInto(context, key, 14, 14, 9, ink);
    };
    const row = h(
      "button",
      {
        type: "button",
        class: "sign",
        "data-key": key,
        onfocus: () => light(key),
        onblur: () => light(null),
        onpointerenter: () => light(key),
        onpointerleave: () => light(null),
        onclick: () => light(key),
      },
      canvas,
      h("span", h("strong", name), h("span", { class: "small" }, says)),
    );
    list.append(h("li", row));
    requestAnimationFrame(draw);
  }
  const made = h(
    "div",
    check("Show the symmetry", look.signs, (signs) => {
      list.hidden = !signs;
      change({ signs });
    }),
    list,
  );
  /** @param {string | null} key */
  const lit = (key) =>
    list.querySelectorAll(".sign").forEach((row) =>
      row.classList.toggle("lit", row.getAttribute("data-key") === key)
    );
  return Object.assign(made, { light: lit });
}

/**
 * How a point is pulled.
 *
 * @param {{ what: string, reach: number, lattice: boolean, gives: boolean }} pull
 * @param {(what: object) => void} change
 * @param {() => void} back
 * @param {boolean} hasInside whether something lies inside that can be pulled
 * @param {false | (() => void)} lay what lays the copies another way, if it can
 */
export function pullPanel(pull, change, back, hasInside, lay) {
  if (!hasInside) pull.what = "outline";
  const inside = pull.what === "inside";
  return stack(
    hasInside &&
      choice(
        "What to pull",
        [["outline", "The outline"], ["inside", "The inside"]],
        pull.what,
        (what) => change({ what }),
        { unseen: true },
      ),
    soft(
      inside
        ? "Take hold of an eye, a fin or anything inside and pull. The tile stays a tile."
        : "Take hold of any point of the outline and pull: all copies follow, without a gap.",
    ),
    slider("How far the pull reaches", {
      min: 0.1,
      max: 2,
      step: 0.05,
      value: pull.reach,
      said: (
        v,
      ) => (v < 0.3 ? "a little" : v < 0.8 ? "a part" : v < 1.5 ? "most of it" : "all of it"),
    }, (reach) => change({ reach })),
    inside && check("The outline gives way", pull.gives, (gives) => change({ gives })),
    check("The grid may change, too", pull.lattice, (lattice) => change({ lattice })),
    !inside && h(
      "p",
      { class: "small soft by-keys" },
      "By keyboard: click the picture or go to it with ",
      h("kbd", "Tab"),
      ", choose a point with ",
      h("kbd", "←"),
      " ",
      h("kbd", "→"),
      ", move it with ",
      h("kbd", "Shift"),
      " and arrows.",
    ),
    lay && button("Lay the copies another way …", lay),
    button("Put it back", back, { kind: "quiet" }),
  );
}

/**
 * What is drawn with.
 *
 * @param {{ tool: string, colour: string, size: number, eye: number, mirror: boolean }} pen
 * @param {(what: object) => void} change
 * @param {() => void} clear
 * @param {boolean} drawn whether the drawing is shown
 * @param {(drawn: boolean) => void} show
 */
export function penPanel(pen, change, clear, drawn, show) {
  const name = unique("pen");
  const well = h("input", {
    type: "color",
    value: pen.colour,
    "aria-label": "Another colour",
    oninput: ({ target }) => change({ colour: target.value }),
  });
  const swatches = h(
    "fieldset",
    h("legend", "Colour"),
    h(
      "div",
      { class: "swatches" },
      PEN_COLOURS.map(([colour, words]) =>
        h(
          "label",
          { title: words },
          h("input", {
            type: "radio",
            name,
            checked: pen.colour === colour,
            "aria-label": words,
            onchange: () => change({ colour }),
          }),
          h("span", { style: { background: colour } }),
        )
      ),
      well,
    ),
  );
  const size = (title, name, min, max) =>
    slider(title, {
      min,
      max,
      step: 0.001,
      value: pen[name],
      said: (v) => `${(100 * v).toFixed(1)} % of a tile`,
    }, (value) => change({ [name]: value }));
  const parts = {
    colour: swatches,
    size: size("Size of the brush", "size", 0.004, 0.12),
    eye: size("Size of an eye", "eye", 0.015, 0.15),
    fill: aside("It fills what your lines and the outline bound, and covers the picture there."),
    mirror: check("The same on the other side", pen.mirror, (mirror) => change({ mirror })),
  };
  const fit = (tool) => {
    for (const [name, part] of Object.entries(parts)) part.hidden = !USES[tool].includes(name);
  };
  fit(pen.tool);
  return stack(
    soft("Draw inside any tile: the same appears in all of them."),
    choice("Draw with", TOOLS, pen.tool, (tool) => {
      fit(tool);
      change({ tool });
    }),
    Object.values(parts),
    check("Show the drawing", drawn, show),
    h(
      "p",
      { class: "small soft by-keys" },
      "By keyboard: move the pen with arrows, put it down and up with ",
      h("kbd", "Space"),
      ".",
    ),
    button("Clear the drawing", clear, { kind: "quiet", image: "bin" }),
  );
}
