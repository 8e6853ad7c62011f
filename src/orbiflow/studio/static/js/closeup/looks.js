/** The controls for colours, outline, artwork and symmetry. */

import { check, controlsOf, FEW_PALETTES } from "../controls.js";
import { aside, button, h, put, soft, stack, unique } from "../dom.js";
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

/** One of the radio buttons `name`, as what it stands for looks; `words` are its name. */
const looking = (name, words, checked, onchange, shown, kind = null) =>
  h("label", { class: kind, title: words }, [
    h("input", { type: "radio", name, checked, "aria-label": words, onchange }),
    shown,
  ]);

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
  const chip = (colour) => h("span", { style: { background: colour } });
  const chips = (colours) => h("span.chips", colours.slice(0, 5).map(chip));
  const wells = h("div.wells");
  const drawWells = () => {
    const custom = own();
    const well = (words, values, key) =>
      h("label", [
        h("input", {
          type: "color",
          value: values[key] ?? "#cccccc",
          oninput: ({ target }) => {
            values[key] = target.value;
            look.custom = custom;
            change({ palette: "own" });
          },
        }),
        h("span", words),
      ]);
    const colours = Array.from(
      { length: needed },
      (_, k) => well(`Colour ${k + 1}`, custom.colours, k),
    );
    put(wells, colours, well("Lines", custom, "outline"));
    wells.hidden = look.palette !== "own";
  };
  const radio = (value, words, shown, kind) =>
    looking(
      name,
      words,
      look.palette === value,
      () => {
        if (value === "own") look.custom = own();
        change({ palette: value });
        drawWells();
      },
      shown,
      kind,
    );
  const radios = about.palettes.map((own) =>
    radio(own.name, own.name, chips(own.colours), "palette")
  );
  const rest = about.palettes.slice(FEW_PALETTES);
  const made = h("fieldset", [
    h("legend", "Colours"),
    h("div.palettes", [
      radios.slice(0, FEW_PALETTES),
      radio("own", "My own", h("span", "My own"), "palette own"),
    ]),
    h("details", { open: rest.some((own) => own.name === look.palette) }, [
      h("summary", "More colours"),
      h("div.palettes", radios.slice(FEW_PALETTES)),
    ]),
    wells,
  ]);
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
  const controls = controlsOf(look, change);
  const share = (v) => (v >= 1 ? "the tile" : v <= 0 ? `your ${pictures}` : PERCENT(v));
  const tint = controls.slider(
    "tint",
    "Colour over it",
    [0, 1, 0.05],
    (v) => v ? PERCENT(v) : "none",
  );
  tint.hidden = !look.art;
  return stack(
    hasMap && controls.slider("share", `From your ${pictures} to the tile`, [0, 1, 0.01], share),
    controls.slider("line", "Outline", [0, 6, 0.2], (v) => (v ? `${v} px` : "none")),
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
  const list = h("ul.signs", { hidden: !look.signs });
  const ratio = 2;
  for (const { key, name, says, colour } of kindsOf(elements)) {
    const canvas = h("canvas", { width: 28 * ratio, height: 28 * ratio, "aria-hidden": "true" });
    const draw = () => {
      const context = canvas.getContext("2d");
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      const ink = colour === "currentcolor" ? getComputedStyle(canvas).color : colour;
      signInto(context, key, 14, 14, 9, ink);
    };
    const row = h("button.sign", {
      type: "button",
      "data-key": key,
      onfocus: () => light(key),
      onblur: () => light(null),
      onpointerenter: () => light(key),
      onpointerleave: () => light(null),
      onclick: () => light(key),
    }, [canvas, h("span", h("strong", name), h("span.small", says))]);
    list.append(h("li", row));
    requestAnimationFrame(draw);
  }
  const made = h("div", [
    check("Show the symmetry", look.signs, (signs) => {
      list.hidden = !signs;
      change({ signs });
    }),
    list,
  ]);
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
  const controls = controlsOf(pull, change);
  const kinds = [["outline", "The outline"], ["inside", "The inside"]];
  const reach = (
    v,
  ) => (v < 0.3 ? "a little" : v < 0.8 ? "a part" : v < 1.5 ? "most of it" : "all of it");
  return stack(
    hasInside && controls.choice("what", "What to pull", kinds, { unseen: true }),
    soft(
      inside
        ? "Take hold of an eye, a fin or anything inside and pull. The tile stays a tile."
        : "Take hold of any point of the outline and pull: all copies follow, without a gap.",
    ),
    controls.slider("reach", "How far the pull reaches", [0.1, 2, 0.05], reach),
    inside && controls.check("gives", "The outline gives way"),
    controls.check("lattice", "The grid may change, too"),
    !inside &&
      h("p.small.soft.by-keys", [
        "By keyboard: click the picture or go to it with ",
        h("kbd", "Tab"),
        ", choose a point with ",
        h("kbd", "←"),
        " ",
        h("kbd", "→"),
        ", move it with ",
        h("kbd", "Shift"),
        " and arrows.",
      ]),
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
  const parts = {};
  const fit = (tool) => {
    for (const [name, part] of Object.entries(parts)) part.hidden = !USES[tool].includes(name);
  };
  const controls = controlsOf(pen, (what) => {
    if (what.tool) fit(what.tool);
    change(what);
  });
  const size = (v) => `${(100 * v).toFixed(1)} % of a tile`;
  parts.colour = h("fieldset", [
    h("legend", "Colour"),
    h("div.swatches", [
      PEN_COLOURS.map(([colour, words]) =>
        looking(
          name,
          words,
          pen.colour === colour,
          () => change({ colour }),
          h("span", { style: { background: colour } }),
        )
      ),
      h("input", {
        type: "color",
        value: pen.colour,
        "aria-label": "Another colour",
        oninput: ({ target }) => change({ colour: target.value }),
      }),
    ]),
  ]);
  parts.size = controls.slider("size", "Size of the brush", [0.004, 0.12, 0.001], size);
  parts.eye = controls.slider("eye", "Size of an eye", [0.015, 0.15, 0.001], size);
  parts.fill = aside(
    "It fills what your lines and the outline bound, and covers the picture there.",
  );
  parts.mirror = controls.check("mirror", "The same on the other side");
  fit(pen.tool);
  return stack(
    soft("Draw inside any tile: the same appears in all of them."),
    controls.choice("tool", "Draw with", TOOLS),
    Object.values(parts),
    check("Show the drawing", drawn, show),
    h("p.small.soft.by-keys", [
      "By keyboard: move the pen with arrows, put it down and up with ",
      h("kbd", "Space"),
      ".",
    ]),
    button("Clear the drawing", clear, { kind: "quiet", image: "bin" }),
  );
}
