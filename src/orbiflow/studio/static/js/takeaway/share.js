/** Share a tile by a link that carries it. */

import { aside, button, row, section, toast, trying } from "../dom.js";
import { copied } from "../../../../drawing/js/svg.js";

/**
 * A section with what shares a tile.
 *
 * @param {Api} api
 * @param {Project} project
 * @param {Card} card
 */
export function share(api, project, card) {
  const link = async () => {
    const { text } = await api.get(`projects/${project.id}/tiles/${card.id}/link`);
    await copied(`${location.origin}${location.pathname}#/open/${text}`);
    toast(
      "The link is copied. It opens this tile in any studio, without your picture and what you drew.",
    );
  };
  return section("panel share", "share", "Share it", [
    aside(
      "The link holds the tile itself. For someone without a studio, make “Page to share” above.",
    ),
    row(button("Copy link", () => trying(link), { image: "copy" })),
  ]);
}
