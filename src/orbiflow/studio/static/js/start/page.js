/** The first page: bring a picture, go on with an earlier project, or take one of our animals. */

import { aside, button, h, put, stack, style, trying } from "../dom.js";
import { Bringing } from "./bringing.js";
import { Projects } from "./projects.js";

const MESH_WORDS =
  "Drop a 3D mesh: STL, OBJ, PLY, 3MF, glTF. We bend it until copies of it fill space.";
const SHAPE_WORDS = "Begin with a tile, and pull it into an animal by hand.";
const TABLE_WORDS = "Angles, directions or axes in a table: see where they crowd.";
const FILE_WORDS = "Go on with what you saved, here or elsewhere.";

/** Another way to begin, in a few words. */
const other = (title, image, begin, words) =>
  h("div", button(title, begin, { image }), aside(words));

/** @type {Show} */
export async function show(root, page) {
  await style("start");
  const bring = new Bringing(page);
  const art = h("img.hero-art", { src: "hero.svg", alt: "A tiling of lizards" });
  const projects = new Projects(page);
  put(root, [
    h("section.hero", [
      stack(
        h("h1", { tabindex: "-1" }, "Turn an animal into a tile"),
        h(
          "p.lead.soft",
          "Bring a picture. We bend its outline as little as we can, until its copies fill the plane without a gap.",
        ),
        bring.panel(),
      ),
      art,
    ]),
    projects.root,
    h("section", { "aria-labelledby": "ours" }, [
      h("h2", { id: "ours" }, "Or take one of ours"),
      bring.animals(page.about),
    ]),
    h("section.others", [
      other("A solid instead of a picture", "solid", () => bring.mesh.click(), MESH_WORDS),
      other("A shape that fits", "pencil", () => page.navigate("shapes"), SHAPE_WORDS),
      other("Numbers instead of animals", "curve", () => bring.count(), TABLE_WORDS),
      other("Open a project file", "open", () => bring.saved.click(), FILE_WORDS),
    ]),
  ]);
  await trying(() => projects.show());
}
