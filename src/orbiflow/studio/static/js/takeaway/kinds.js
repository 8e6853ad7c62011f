/** What can be made of a tile: which settings matter most, and what they are called here. */

export const KINDS = {
  export: {
    title: "Print or cut",
    image: "cut",
    solid: true,
    first: ["purpose", "format", "tile_size", "area", "clip", "palette"],
    start: { purpose: "print" },
    words: {
      purpose: {
        title: "What is it for?",
        about: "This sets everything else so that it suits.",
        options: {
          laser: "Laser cutter", print: "Poster or mug", paper: "Figure in a text", web: "Web page", plotter: "Pen plotter",
          template: "Template to trace by hand", colouring: "Colouring page", stickers: "Stickers",
        },
      },
      format: { about: "", title: "Kind of file", usual: "What suits it", options: { svg: "SVG", pdf: "PDF", dxf: "DXF", png: "PNG", json: "JSON (numbers)" } },
      tile_size: { title: "How long is one tile?" },
      area: { title: "How large is the page?", about: "Such as A4, letter, mug, phone or 300x200mm." },
      clip: { title: "Fill the page to its edge", about: "Tiles at the edge are cut. Otherwise only whole tiles are on the page." },
      palette: {
        about: "",
        title: "Colours",
        not: { purpose: ["laser", "plotter", "template", "colouring"], cut: ["skeleton", "jigsaw", "template"], filled: [false] },
      },
      cut: { title: "What is drawn", about: "", options: { none: "every tile, filled", skeleton: "each line once", pieces: "tiles apart", jigsaw: "a jigsaw", template: "one tile, by hand" } },
    },
  },
  art: {
    title: "Picture",
    image: "picture",
    first: ["size", "tile_size", "palette", "colour"],
    words: {
      size: { title: "Width x height", about: "Pixels such as 3000x2000, or lengths such as 300x200mm." },
      tile_size: { title: "How long is one tile?" },
      palette: { about: "", title: "Colours" },
      colour: { about: "", title: "Which tiles share a colour", options: { neighbour: "neighbours differ", aspect: "those that lie alike", one: "all" } },
    },
  },
  solid: {
    title: "3D print",
    image: "solid",
    solid: true,
    first: ["kind", "tile_size", "height", "format"],
    words: {
      kind: { about: "", title: "What kind of thing?", options: { tile: "Tile", cutter: "Cookie cutter", stamp: "Stamp", mould: "Mould", puzzle: "Puzzle in a tray" } },
      tile_size: { title: "How long is one tile?" },
      format: { about: "", title: "Kind of file", usual: "What suits it", options: { stl: "STL", "3mf": "3MF" } },
    },
  },
  animate: {
    title: "Animation",
    image: "film",
    first: ["kind", "seconds", "shape", "palette", "format"],
    words: {
      kind: { about: "", title: "What happens?", options: { morph: "a plain tiling becomes animals", bend: "the animal bends into the tile", grow: "the tiling grows" } },
      seconds: { title: "How long?" },
      palette: { about: "", title: "Colours" },
      format: { about: "", title: "Kind of file", usual: "What suits it", options: { gif: "GIF", mp4: "MP4", svg: "SVG" } },
    },
  },
};

const UNITS = { mm: 1, cm: 10, m: 1000, in: 25.4, pt: 25.4 / 72 };

/** A length in mm from a number or a text such as "4 cm"; undefined if it is none. */
export function lengthIn(value) {
  const found = /^\s*([\d.]+)\s*(mm|cm|m|in|pt)?\s*$/.exec(String(value ?? ""));
  const length = found ? Number(found[1]) * UNITS[found[2] ?? "mm"] : NaN;
  return length > 0 ? length : undefined;
}

const OWN = "My own colours";

/**
 * The colours that were chosen in this project: {palette, value, options}: to draw with, as a setting,
 * and the words of all that can be chosen, by value.
 */
export function colours({ view }, { palettes }) {
  const { palette: name, custom } = view?.closeup?.look ?? {};
  const found = [name, view?.search?.palette].map((wanted) => palettes.find((own) => own.name === wanted));
  const palette = found.find(Boolean) ?? palettes[0];
  const options = Object.fromEntries(palettes.map((own) => [own.name, undefined]));
  if (name !== "own" || !custom) return { palette, value: palette.name, options };
  const value = [...custom.colours, `outline=${custom.outline}`].join(",");
  return { palette: { ...palette, ...custom }, value, options: { [value]: OWN, ...options } };
}
