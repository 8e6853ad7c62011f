/** Begin with a shape that fits: all isohedral types as small tilings, each a link that opens it. */

import { h, put, style, trying } from "../dom.js";
import { lookOf, paletteOf } from "../look.js";
import { paintCard } from "../../../../drawing/js/tiling.js";
import { capital } from "../words.js";

/** What a shape keeps of its own symmetry, however its edges are pulled. */
const symmetryWords = (name) =>
  name[0] === "C" ? "looks the same when it is turned" : "its halves mirror each other";

/**
 * What shows shapes: `list(shapes, link)` has a card for each, made by `link(shape, parts)`.
 *
 * @param {any} about
 */
export function shapeCards(about) {
  const palette = paletteOf(lookOf(/** @type {any} */ ({ view: {} }), about), about);
  /** @type {Map<Element, any>} */
  const shown = new Map();
  const watch = new ResizeObserver((seen) =>
    seen.forEach(({ target }) => {
      const canvas = /** @type {HTMLCanvasElement} */ (target);
      if (canvas.clientWidth) paintCard(canvas, shown.get(canvas), palette, { across: 4 });
    })
  );
  const card = (own, link) => {
    const canvas = h("canvas", { "aria-hidden": "true" });
    shown.set(canvas, own);
    watch.observe(canvas);
    const parts = [
      canvas,
      h("span.shape-words", capital(own.arrangement)),
      own.symmetry !== "C1" && h("span.soft.small", symmetryWords(own.symmetry)),
    ];
    return h("li", { title: `${own.name}, ${own.group_name}` }, link(own, parts));
  };
  return {
    list: (shapes, link) => h("ul.shapes", shapes.map((own) => card(own, link))),
    close: () => watch.disconnect(),
  };
}

/** @type {Show} */
export async function show(root, { api, about }) {
  await style("start");
  const cards = shapeCards(about);
  const list = (shapes) =>
    cards.list(
      shapes,
      (own, parts) => h("a", { href: `#/open/${own.text}`, "data-shape": own.name }, parts),
    );
  const others = h("div");
  const more = h("details", {
    ontoggle: () =>
      others.firstChild ||
      trying(async () => put(others, list(await api.get("shapes?every=1")))),
  }, [h("summary", "All other types"), others]);
  put(root, [
    h("h1", { tabindex: "-1" }, "Begin with a shape that fits"),
    h(
      "p.lead.soft",
      "Copies of each fill the plane. Choose one and pull its edges: all copies follow. Then draw an animal into it.",
    ),
    list(await api.get("shapes")),
    more,
  ]);
  return cards.close;
}
