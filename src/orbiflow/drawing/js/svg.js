/** What a view shows of a tiling as an SVG drawing: to keep, to paste, to print. */

import { fill, shaded } from "./tiling.js";

const known = new Map();

/** A colour of CSS as red, green and blue, 0 to 255. @param {string} colour @returns {number[]} */
export function rgbOf(colour) {
  if (!known.has(colour)) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 1;
    const context = canvas.getContext("2d");
    context.fillStyle = colour;
    context.fillRect(0, 0, 1, 1);
    known.set(colour, [...context.getImageData(0, 0, 1, 1).data].slice(0, 3));
  }
  return known.get(colour);
}

/** A colour of CSS as "#rrggbb". @param {string} colour */
export const hex = (colour) =>
  "#" + rgbOf(colour).map((v) => v.toString(16).padStart(2, "0")).join("");

const plain = (text) => text.replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);

const short = (number, digits = 3) => String(Number(number.toFixed(digits)));

/** @param {number[]} matrix */
const matrixWords = ([a, b, c, d, e, f]) =>
  `matrix(${[a, b, c, d].map((v) => short(v, 6)).join(" ")} ${short(e)} ${short(f)})`;

/**
 * A tiling as an SVG drawing of a width and height in pixels, with what lies on its tiles; as `paint` draws it.
 *
 * @param {import("./tiling.js").Tiling} tiling
 * @param {import("./tiling.js").Camera} camera
 * @param {Palette} palette
 * @param {{ width: number, height: number, line?: number, skins?: any[], title?: string }} how
 */
export function svgOf(tiling, camera, palette, { width, height, line = 1.2, skins, title = "" }) {
  const own = shaded(palette, tiling.colours);
  const copies = tiling.copies(camera, width, height);
  /** @type {Map<string, string>} */
  const symbols = new Map();
  const uses = copies.map((copy) => {
    const name = `t${copy.figure}c${copy.colour}`;
    if (!symbols.has(name)) {
      const colour = fill(own, copy.colour);
      const { polygon } = tiling.figures[copy.figure];
      const points = polygon.map((p) => p.map((v) => short(v * camera.scale)).join()).join(" ");
      const ink = line ? hex(palette.outline) : hex(colour);
      const edge = `stroke="${ink}" stroke-width="${line || 0.7}" stroke-linejoin="round"`;
      const skin = skins?.[copy.figure];
      const parts = [`<polygon points="${points}" fill="${hex(colour)}" ${edge}/>`];
      if (skin) {
        const matrix = skin.matrix.map((v) => v * camera.scale);
        const canvas = skin.in(colour);
        parts.push(
          `<image width="${canvas.width}" height="${canvas.height}" transform="${
            matrixWords(matrix)
          }" href="${canvas.toDataURL()}"/>`,
        );
        if (line) parts.push(`<polygon points="${points}" fill="none" ${edge}/>`);
      }
      symbols.set(name, `<g id="${name}">${parts.join("")}</g>`);
    }
    const [a, b, c, d, e, f] = copy.matrix;
    const turned = [a, b, c, d].map((v) => v / camera.scale);
    return `<use href="#${name}" transform="${matrixWords([...turned, e, f])}"/>`;
  });
  return [
    `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" ` +
    `viewBox="0 0 ${width} ${height}">`,
    title && `<title>${plain(title)}</title>`,
    `<defs>${[...symbols.values()].join("")}</defs>`,
    `<rect width="${width}" height="${height}" fill="${hex(palette.paper ?? "#ffffff")}"/>`,
    ...uses,
    "</svg>",
  ].filter(Boolean).join("\n");
}

/** Put a text on the clipboard. @param {string} text */
export async function copied(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const box = document.createElement("textarea");
    box.value = text;
    document.body.append(box);
    box.select();
    const done = document.execCommand("copy");
    box.remove();
    if (!done) throw new Error("The browser does not let the page use the clipboard.");
  }
}

/**
 * Let the browser print nothing of the page but a tiling, which fills the sheet; returns what ends this.
 *
 * @param {() => string | null} drawn gives the SVG of a square
 */
export function printed(drawn) {
  const box = document.createElement("div");
  box.className = "printed";
  const before = () => {
    box.innerHTML = drawn() ?? "";
    const svg = box.querySelector("svg");
    svg?.setAttribute("preserveAspectRatio", "xMidYMid slice");
    document.documentElement.classList.toggle("prints", Boolean(svg));
    document.body.append(box);
  };
  const after = () => {
    box.remove();
    document.documentElement.classList.remove("prints");
  };
  addEventListener("beforeprint", before);
  addEventListener("afterprint", after);
  return () => {
    after();
    removeEventListener("beforeprint", before);
    removeEventListener("afterprint", after);
  };
}
