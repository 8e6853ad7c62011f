/** Share a tile: by a link that carries it, on the clipboard, on paper. */

import { aside, button, row, section, toast, trying } from "../dom.js";
import { copied, printed, svgOf } from "../../../../drawing/js/svg.js";
import { Camera, Tiling } from "../../../../drawing/js/tiling.js";

const SIDES = { width: 1200, height: 900 }; // of a drawing to paste, in its own pixels
const SHEET = { width: 1200, height: 1200 }; // of what is printed, which fills the sheet
const ACROSS = 6; // tiles along the longer side

/**
 * A section with what shares a tile; `seen()` gives its look, palette and `skins(tiling, scale)` as they are now.
 * Returns it with `close()`.
 *
 * @param {Api} api
 * @param {Project} project
 * @param {Card} card
 * @param {() => any} seen
 */
export function share(api, project, card, seen) {
  const drawn = (sides) => {
    const { look, palette, skins } = seen();
    const tiling = new Tiling(card);
    const camera = Camera.fit(tiling, sides.width, sides.height, ACROSS);
    return svgOf(tiling, camera, palette, {
      ...sides,
      line: look.line,
      skins: skins(tiling, 1.5 * camera.scale),
      title: project.name,
    });
  };
  const link = async () => {
    const { text } = await api.get(`projects/${project.id}/tiles/${card.id}/link`);
    await copied(`${location.origin}${location.pathname}#/open/${text}`);
    toast(
      "The link is copied. It opens this tile in any studio, without your picture and what you drew.",
    );
  };
  const paste = async () => {
    await copied(drawn(SIDES));
    toast("The drawing is copied. Paste it into a drawing program.");
  };
  const close = printed(() => drawn(SHEET));
  const root = section(
    "panel share",
    "share",
    "Share it",
    aside(
      "The link holds the tile itself. For someone without a studio, make “A page to share” above.",
    ),
    row(
      button("Copy link", () => trying(link), { image: "copy" }),
      button("Copy as SVG", () => trying(paste), { image: "copy" }),
      button("Print", () => print(), { image: "picture" }),
    ),
  );
  return { root, close };
}
