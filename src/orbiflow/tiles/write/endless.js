/** The page of one tiling without an end: colours, lines and pictures to change, and what to keep of it. */

import { copied, hex, printed, rgbOf, svgOf } from "../../drawing/js/svg.js";
import { Camera, fill, paint, Tiling } from "../../drawing/js/tiling.js";
import { Skin } from "../../drawing/js/tinted.js";
import { View } from "../../drawing/js/view.js";

const ACROSS = 5; // tiles along the longer side at first
const LINE = 1.6; // pixels of the outline at first
const PICTURE = 3000; // pixels along the longer side of a picture to keep
const PRINTED = 1.25; // longer sides of the view that a print shows at least

/** @type {(id: string) => any} */
const at = (id) => document.getElementById(id);

/** How light a colour looks, 0 to 1. */
function lightness(colour) {
  const [red, green, blue] = rgbOf(colour).map((v) => (v / 255) ** 2.2);
  return (0.2126 * red + 0.7152 * green + 0.0722 * blue) ** (1 / 2.2);
}

/** A picture by its address, once it is there. */
async function loaded(address) {
  const image = new Image();
  image.src = address;
  await image.decode();
  return image;
}

/** The pictures that lie on the figures: their canvases, masks of ink and places. */
function skinsLoaded(skins) {
  return Promise.all(skins.map(async (skin) => {
    if (!skin) return null;
    const picture = await loaded(skin.picture);
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: picture.naturalWidth, height: picture.naturalHeight });
    canvas.getContext("2d").drawImage(picture, 0, 0);
    return { canvas, matrix: skin.matrix, ink: skin.ink && await loaded(skin.ink) };
  }));
}

/** Show a tiling that `write_html` has described. @param {any} data */
export async function showEndless({ title, tile, palettes, tint, outline, skins }) {
  const tiling = new Tiling(tile);
  const used = 1 + Math.max(...tile.colours.table.flat(2));
  const layers = await skinsLoaded(skins);
  const view = new View(at("view"));
  const state = { colours: [], palette: null, line: 0, skin: true, tint };
  const start = () => {
    at("palette").value = "0";
    Object.assign(state, { line: outline ? LINE : 0, skin: true, tint });
    choose(0);
    [at("turn").value, at("line").value, at("tint").value] = ["0", state.line, tint];
    at("skin").checked = true;
    view.fit(ACROSS);
  };
  const look = () => {
    const palette = { ...state.palette, colours: state.colours };
    const colour = (own) => {
      const light = lightness(own);
      const apart = (other) => Math.abs(light - lightness(other));
      return apart(palette.outline) >= apart(palette.paper) ? palette.outline : palette.paper;
    };
    const own = layers.map((layer) =>
      layer && state.skin
        ? new Skin(
          layer.canvas,
          layer.matrix,
          state.tint,
          layer.ink && { picture: layer.ink, colour },
        )
        : null
    );
    Object.assign(view.options, { palette, line: state.line, skins: () => own });
    view.redraw();
  };
  /** Show a field for each colour that tiles have. */
  const swatches = () => {
    const boxes = Array.from({ length: used }, (_, k) => {
      const box = document.createElement("input");
      box.type = "color";
      box.value = hex(fill({ ...state.palette, colours: state.colours }, k));
      box.setAttribute("aria-label", `Colour ${k + 1}`);
      box.oninput = () => {
        state.colours[k] = box.value;
        look();
      };
      return box;
    });
    at("colours").replaceChildren(...boxes);
  };
  const take = (colours) => {
    state.colours = colours;
    swatches();
    look();
  };
  const choose = (k) => {
    state.palette = palettes[k];
    const count = Math.max(used, palettes[k].colours.length);
    take(Array.from({ length: count }, (_, j) => fill(palettes[k], j)));
  };
  at("palette").append(
    ...palettes.map(({ name }, k) => new Option(name[0].toUpperCase() + name.slice(1), String(k))),
  );
  at("palette").onchange = () => choose(Number(at("palette").value));
  at("order").onclick = () => take([...state.colours.slice(1), state.colours[0]]);
  at("turn").oninput = () => {
    view.camera.turn = at("turn").valueAsNumber * Math.PI / 180;
    view.redraw();
  };
  /** @type {(name: string, read: (box: HTMLInputElement) => any) => void} */
  const listen = (name, read) => {
    at(name).oninput = () => {
      state[name] = read(at(name));
      look();
    };
  };
  listen("line", (box) => box.valueAsNumber);
  listen("tint", (box) => box.valueAsNumber);
  listen("skin", (box) => box.checked);
  at("has-skin").hidden = at("has-tint").hidden = !layers.some(Boolean);
  at("nearer").onclick = () => view.zoom(1.35);
  at("farther").onclick = () => view.zoom(1 / 1.35);
  at("fit").onclick = () => view.fit(ACROSS);
  at("again").onclick = start;
  at("panel").open = innerWidth > 600;
  view.show(tiling);
  start();
  keeping(view, title);
}

/** Let what is seen be kept: as a picture, an SVG, on the clipboard or on paper. */
function keeping(view, title) {
  const name = title.replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "").slice(0, 60) ||
    "tiling";
  const size = () => ({ width: view.canvas.clientWidth, height: view.canvas.clientHeight });
  const seen = () => ({ line: view.options.line, skins: view.options.skins(), title });
  const drawing = () =>
    svgOf(view.tiling, view.camera, view.options.palette, { ...size(), ...seen() });
  const said = (words) => {
    at("said").textContent = words;
  };
  const save = (blob, ending) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `${name}.${ending}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
    said(`Saved ${link.download}.`);
  };
  at("png").onclick = () => {
    const { width, height } = size();
    const ratio = PICTURE / Math.max(width, height);
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    const context = canvas.getContext("2d");
    context.fillStyle = view.options.palette.paper;
    context.fillRect(0, 0, canvas.width, canvas.height);
    paint(context, view.tiling, view.camera, view.options.palette, {
      width,
      height,
      ratio,
      ...seen(),
    });
    canvas.toBlob((blob) => save(blob, "png"));
  };
  at("svg").onclick = () => save(new Blob([drawing()], { type: "image/svg+xml" }), "svg");
  at("copy").onclick = () =>
    copied(drawing()).then(
      () => said("Copied. Paste it into a drawing program."),
      (error) => said(error.message),
    );
  at("print").onclick = () => print();
  printed(() => {
    const side = PRINTED * Math.max(...Object.values(size()));
    const { palette } = view.options;
    const camera = Object.assign(new Camera(), view.camera);
    return svgOf(view.tiling, camera, palette, { width: side, height: side, ...seen() });
  });
}
