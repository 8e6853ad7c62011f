/** The first page: bring a picture, take one of ours, or go on with an earlier project. */

import { button, confirmed, h, icon, put, style, trying } from "../dom.js";
import { Camera, paint, sized, Tiling } from "../tiling.js";
import { ago, number } from "../words.js";
import { Bringing } from "./bringing.js";
import { sample } from "./sample.js";

const PAGES = { density: "d", solid: "s" }; // of projects that are no tiles
const SOME = 24; // projects that are shown at first

const MESH_WORDS =
  "Drop a 3D mesh: STL, OBJ, PLY, 3MF, glTF. We bend it until copies of it fill space.";
const TABLE_WORDS = "Angles, directions or axes in a table: see where they crowd.";
const FILE_WORDS = "Go on with what you saved, here or elsewhere.";

/** Another way to begin, in a few words. */
const other = (title, image, begin, words) =>
  h("div", {}, button(title, begin, { image }), h("p", { class: "soft small" }, words));

/**
 * @param {HTMLElement} root
 * @param {Page} page
 */
export async function show(root, page) {
  await style("start");
  const bring = new Bringing(page);
  const art = h("canvas", { class: "hero-art", role: "img", "aria-label": "A tiling of lizards" });
  const projects = h("section", { "aria-labelledby": "yours", hidden: true });
  const watch = new ResizeObserver(() => paintSample(art));
  put(
    root,
    h(
      "section",
      { class: "hero" },
      h(
        "div",
        { class: "stack" },
        h("h1", { tabindex: "-1" }, "Turn an animal into a tile"),
        h(
          "p",
          { class: "lead soft" },
          "Bring a picture. We bend its outline, as little as we can, until copies of it fill the plane without a gap.",
        ),
        bring.panel(),
      ),
      art,
    ),
    h(
      "section",
      { "aria-labelledby": "ours" },
      h("h2", { id: "ours" }, "Or take one of ours"),
      bring.animals(page.about),
    ),
    projects,
    h(
      "section",
      { class: "others" },
      other("A solid instead of a picture", "solid", () => bring.mesh.click(), MESH_WORDS),
      other("Numbers instead of animals", "arrow", () => bring.count(), TABLE_WORDS),
      other("Open a project file", "open", () => bring.saved.click(), FILE_WORDS),
    ),
  );
  watch.observe(art);
  await trying(() => list(projects, page.api));
  return () => {
    watch.disconnect();
    bring.close();
  };
}

function paintSample(canvas) {
  const { context, width, height, ratio } = sized(canvas);
  const tiling = new Tiling(sample.card);
  paint(context, tiling, Camera.fit(tiling, width, height, 5.2), sample.palette, {
    width,
    height,
    ratio,
    line: 1.4,
  });
}

/** Show the projects that there are, newest first; the others when they are asked for. */
async function list(place, api, most = SOME) {
  const found = await api.get("projects");
  place.hidden = !found.length;
  put(
    place,
    h("h2", { id: "yours", tabindex: "-1" }, "Your projects"),
    h(
      "ul",
      { class: "projects" },
      found.slice(0, most).map((own) =>
        h(
          "li",
          { class: "project" },
          link(own),
          button(`Delete ${own.name}`, () => remove(own, place, api, most), {
            kind: "quiet icon",
            image: "bin",
          }),
        )
      ),
    ),
    found.length > most &&
      button(`Show all ${found.length}`, () => all(place, api), { image: "more" }),
  );
}

async function all(place, api) {
  await trying(() => list(place, api, Infinity));
  place.querySelector("h2").focus();
}

function link({ id, kind, name, thumb, tiles, busy, changed }) {
  const path = PAGES[kind] ? `${PAGES[kind]}/${id}` : tiles || busy ? `p/${id}` : `p/${id}/picture`;
  const facts = [
    kind === "density" ? "a table" : kind === "solid" && !tiles ? "a mesh" : number(tiles, kind),
    busy ? "at work" : ago(changed),
  ];
  return h(
    "a",
    { href: `#/${path}` },
    h(
      "span",
      { class: "thumb" },
      thumb ? h("img", { src: thumb, alt: "", loading: "lazy" }) : icon("picture"),
    ),
    h("span", { class: "project-name" }, name),
    h("span", { class: "soft small" }, facts.join(" · ")),
  );
}

async function remove({ id, name }, place, api, most) {
  if (
    !(await confirmed(
      "Delete this project?",
      `“${name}” and all its tiles will be gone for good.`,
      "Delete it",
    ))
  ) return;
  await trying(() => api.remove(`projects/${id}`));
  await trying(() => list(place, api, most));
  place.querySelector("h2").focus();
}
