/** What people make of a tile: the operation that makes it, what it begins with, and its three fields. */

import { KINDS } from "./kinds.js";

/**
 * @typedef {object} Thing
 * @property {string} title
 * @property {string} image
 * @property {keyof typeof KINDS} makes the operation
 * @property {string[]} first the fields of its own; all others are folded away
 * @property {Record<string, any>} [start] values to begin with
 * @property {string[]} [fixed] settings that are the thing itself
 * @property {Record<string, object>} [words] what its fields are called here
 * @property {Record<string, any>} [shown] what its preview has instead
 * @property {boolean} [machine] whether machines are kept with their settings
 */

/** @returns {Thing} */
const printed = (title, image, start, first) => ({
  title,
  image,
  start,
  first,
  makes: "export",
  fixed: ["purpose", "cut"],
});
/** @returns {Thing} */
const solid = (title, image, kind, first) => ({
  title,
  image,
  first,
  makes: "solid",
  start: { kind },
  fixed: ["kind"],
});

/** @type {Record<string, Thing>} */
export const THINGS = {
  laser: {
    ...printed("Pieces for a laser", "laser", { purpose: "laser", cut: "pieces" }, [
      "tile_size",
      "kerf",
      "area",
    ]),
    words: {
      area: { title: "How large is your sheet?", about: "Such as 300x200mm, 12x8in or A4." },
    },
    machine: true,
  },
  jigsaw: {
    ...printed("Jigsaw", "jigsaw", { purpose: "laser", cut: "jigsaw" }, [
      "area",
      "tile_size",
      "tray",
    ]),
    machine: true,
  },
  poster: {
    ...printed("Poster", "poster", { purpose: "print", area: "A2", bed: "A4" }, [
      "area",
      "bed",
      "tile_size",
    ]),
    words: {
      area: { title: "How large is the poster?", about: "Such as A2, A3, 600x400mm or 24x16in." },
      bed: {
        title: "Which paper does your printer take?",
        about:
          "Such as A4 or letter. A larger poster is several sheets to put together, in one PDF.",
      },
    },
    shown: { bed: null }, // all of it, and not its first sheet
  },
  fabric: {
    title: "Fabric that repeats",
    image: "fabric",
    makes: "art",
    start: { repeat: "basic" },
    first: ["repeat", "tile_size", "palette"],
    words: { repeat: { ...KINDS.art.words.repeat, title: "How does it repeat?", usual: false } },
  },
  mug: printed("Mug", "mug", { purpose: "print", area: "mug" }, ["tile_size", "palette", "format"]),
  stickers: printed("Stickers", "sticker", { purpose: "stickers" }, [
    "tile_size",
    "offset",
    "area",
  ]),
  colouring: printed("Colouring page", "pencil", { purpose: "colouring" }, [
    "tile_size",
    "outline",
    "area",
  ]),
  lesson: printed("Lesson with scissors", "cut", { purpose: "lesson" }, ["tile_size", "area"]),
  stamp: solid("Stamp", "stamp", "stamp", ["tile_size", "height", "format"]),
  cutter: solid("Cookie cutter", "cutter", "cutter", ["tile_size", "blade", "format"]),
  ball: {
    title: "Ball or lamp",
    image: "ball",
    makes: "solid",
    start: { kind: "ball" },
    first: ["kind", "diameter", "format"],
  },
  film: { ...KINDS.animate, makes: "animate", title: "Film", first: ["kind", "seconds", "format"] },
  share: printed("Page to share", "page", { purpose: "share" }, ["palette", "colour", "outline"]),
  art: { ...KINDS.art, makes: "art" },
  export: { ...KINDS.export, makes: "export", machine: true },
  solid: { ...KINDS.solid, makes: "solid" },
};
