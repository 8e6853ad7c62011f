/** What can be made of a tile, and what its settings are called here. */

import { FEW_PALETTES } from "../controls.js";

/** Plain names of settings. */
const PLAIN = {
  area: "How large is the tray at most?",
  assembled: "Leave the pieces in the tray",
  bed: "How large is the machine's bed?",
  blade: "Thickness of the cutting edge",
  border: "Cut the edge of the page, too",
  calibrate: "Add a mark that is 100 mm long",
  chamfer: "Width of the sloping upper edge",
  clearance: "Gap between neighbours",
  clip: "Cut tiles at the edge",
  copies: "How many pieces?",
  dpi: "Dots per inch",
  draft: "Slope of the walls",
  dxf: "Version of DXF files",
  engrave: "Draw lines inside, as on a woodcut",
  floor: "Thickness of the floor",
  foot: "Width of the rim for the hand",
  fps: "Pictures per second",
  kerf: "Width of the machine's cut",
  magnet: "Width of magnets in the sides",
  magnet_depth: "Height of magnets",
  margin: "Empty edge of the page",
  marks: "Marks for a cutter's eye",
  nozzle: "Width of the printer's line",
  offset: "Cut this far outside",
  outline: "Width of lines between tiles",
  overlap: "How much sheets of paper share",
  power: "Power of what is engraved",
  relief: "How far lines stand out",
  rotate: "Turn the pattern",
  spacing: "Room between cuts",
  strokes: "Kind of lines",
  tab_width: "Width of such a tab",
  tabs: "Tabs that hold each piece in the sheet",
  tolerance: "How exact?",
  tray: "Add a tray with a rim this wide",
  wall: "Thickness of the wall",
  warn_neck: "Tell me where it is thinner than",
};

/** What shows no colours of tiles. */
export const COLOURLESS = ["laser", "plotter", "template", "lesson", "colouring"];

const SHARED = { neighbour: "neighbours differ", aspect: "those that lie alike", one: "all" };

const FORMAT = { about: "", title: "Kind of file", usual: "The usual kind" };
const PALETTE = { about: "", title: "Colours", few: FEW_PALETTES };

const plain = (words) => ({
  palette: PALETTE,
  colour: { about: "", title: "Which tiles share a colour", options: SHARED },
  tile_size: { title: "How long is one tile?" },
  ...Object.fromEntries(Object.entries(PLAIN).map(([name, title]) => [name, { title }])),
  ...words,
});

export const KINDS = {
  export: {
    title: "Print or cut",
    image: "cut",
    solid: true,
    first: ["purpose", "format", "tile_size", "area", "clip", "palette"],
    start: { purpose: "print" },
    words: plain({
      purpose: {
        title: "What is it for?",
        about: "This sets everything else so that it suits.",
        usual: "Nothing of these",
        sets: true,
        keeps: ["palette"],
        options: {
          laser: "Laser cutter",
          print: "Poster or mug",
          paper: "Figure in a text",
          web: "Picture in a web page",
          share: "A page to share, to play with",
          plotter: "Pen plotter",
          template: "Template to trace by hand",
          lesson: "Lesson with scissors",
          colouring: "Colouring page",
          stickers: "Stickers",
        },
      },
      format: {
        ...FORMAT,
        options: {
          svg: "SVG",
          pdf: "PDF",
          dxf: "DXF",
          png: "PNG",
          html: "HTML (a page without an end)",
          json: "JSON (numbers)",
        },
        few: 5,
      },
      area: {
        title: "How large is the page?",
        about: "Such as A4, letter, mug, phone, 300x200mm or 12x8in.",
        some: "A4 A4-landscape A3 A3-landscape letter letter-landscape mug phone".split(" "),
      },
      clip: {
        title: "Fill the page to its edge",
        about: "Tiles at the edge are cut. Otherwise only whole tiles are on the page.",
      },
      palette: {
        ...PALETTE,
        not: {
          purpose: COLOURLESS,
          cut: (now) => now("cut") !== "none" && now("purpose") !== "stickers",
          filled: [false],
        },
      },
      cut: {
        title: "What is drawn",
        about: "",
        options: {
          none: "every tile, filled",
          skeleton: "each line once",
          pieces: "tiles apart",
          jigsaw: "a jigsaw",
          template: "one tile, by hand",
          lesson: "how it comes of a plain shape",
        },
      },
    }),
  },
  art: {
    title: "Picture",
    image: "picture",
    first: ["world", "metamorphosis", "area", "tile_size", "palette", "colour", "format"],
    words: plain({
      world: {
        about: "",
        title: "In another world?",
        usual: "no",
        options: {
          sphere: "on a ball",
          disc: "in a disc without end",
          "half-plane": "above a line",
          band: "in a band",
          spiral: "around a spiral",
          cylinder: "around a mug",
        },
      },
      metamorphosis: {
        about: "",
        title: "Polygons become animals",
        usual: "no",
        options: { right: "to the right", down: "downwards", middle: "to the middle" },
      },
      repeat: {
        about: "",
        title: "A piece that repeats, as for wallpaper?",
        usual: "no",
        options: {
          basic: "row on row",
          brick: "like bricks",
          "half-drop": "each column half lower",
        },
      },
      order: { title: "How many meet there?" },
      arms: { title: "Steps of a turn" },
      stages: { title: "How many changes?" },
      stretch: { title: "How much it may be stretched" },
      area: {
        title: "Width x height",
        about: "Such as 3000x2000px, 300x200mm, A4, square or story.",
      },
      format: {
        ...FORMAT,
        options: {
          png: "PNG",
          svg: "SVG",
          pdf: "PDF",
          html: "HTML (to turn by hand, without pictures)",
        },
      },
    }),
  },
  solid: {
    title: "3D print",
    image: "solid",
    solid: true,
    first: ["kind", "tile_size", "height", "format"],
    words: plain({
      tray_border: { title: "Edge of the tray" },
      kind: {
        about: "",
        title: "What kind of thing?",
        options: {
          tile: "Tile",
          cutter: "Cookie cutter",
          stamp: "Stamp",
          mould: "Mould",
          puzzle: "Puzzle in a tray",
          ball: "Ball",
          "ball-piece": "Piece of a ball",
          lamp: "Lamp",
        },
      },
      format: {
        ...FORMAT,
        options: { stl: "STL", "3mf": "3MF" },
      },
    }),
  },
  animate: {
    title: "Animation",
    image: "film",
    first: ["kind", "seconds", "area", "palette", "format"],
    words: plain({
      kind: {
        about: "",
        title: "What happens?",
        options: {
          morph: "a plain tiling becomes animals",
          bend: "the animal bends into the tile",
          grow: "the tiling grows",
        },
      },
      seconds: { title: "How long?" },
      area: {
        title: "Width x height",
        about: "Such as 800x534px, square or story.",
        some: ["800x534px", "square", "story"],
      },
      format: {
        ...FORMAT,
        options: { gif: "GIF", mp4: "MP4", svg: "SVG" },
      },
    }),
  },
};

/** Things to print of a solid that fills space. */
export const BUILD = {
  title: "3D print",
  image: "solid",
  first: ["kind", "format", "size", "copies", "clearance"],
  words: plain({
    assembled: { title: "Leave the pieces in the box" },
    copies: { title: "How many copies?", about: "" },
    clearance: {
      title: "Gap between neighbours",
      about: "Copies that are printed need some room.",
    },
    kind: {
      about: "",
      title: "What kind of thing?",
      options: {
        tile: "One solid",
        stack: "A stack, in colours",
        block: "A block to start a stack on",
        puzzle: "A puzzle in a box",
      },
    },
    format: {
      ...FORMAT,
      usual: "3MF",
      options: { "3mf": "3MF, with colours", stl: "STL" },
    },
    size: { title: "How long is its longest side?", about: "" },
  }),
};

export const EVERY_KIND = {
  ...KINDS,
  build: BUILD,
  film: { title: "Film", image: "film", words: {} },
};

const OWN = "My own colours";

/**
 * The colours of a look: {value, options}: as a setting, and the words of all that can be chosen, by value.
 *
 * @param {ReturnType<typeof import("../look.js").lookOf>} look
 * @param {About} about
 */
export function colours({ palette, custom }, { palettes }) {
  const options = Object.fromEntries(palettes.map(({ name }) => [name, undefined]));
  if (!custom) return { value: palette, options };
  const own = [...custom.colours, `outline=${custom.outline}`].join(",");
  return { value: palette === "own" ? own : palette, options: { [own]: OWN, ...options } };
}
