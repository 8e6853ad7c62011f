/** A project's best tile as a small tiling, as its own pages show it. */

import { about } from "../api.js";
import { h } from "../dom.js";
import { lookOf, paletteOf } from "../look.js";
import { Pictures, skinsOf } from "../skin.js";
import { figuresOf, paintCard } from "../../../../drawing/js/tiling.js";

/**
 * A canvas with the tiling of a project's best tile; empty until it is known, and where there is none any more.
 *
 * @param {Api} api
 * @param {string} id
 */
export function thumb(api, id) {
  const canvas = h("canvas", { "aria-hidden": "true" });
  const draw = async () => {
    const [project, known] = await Promise.all([api.get(`projects/${id}`), about()]);
    const [card] = project.tiles;
    if (!card) return;
    const look = lookOf(project, known);
    const palette = paletteOf(look, known);
    const view = look.art && await api.get(`projects/${id}/tiles/${card.id}`);
    const paint = () => {
      if (!canvas.clientWidth) return;
      const how = { look, palette, pictures };
      paintCard(canvas, card, palette, {
        across: 4,
        skins: ({ figures }, scale) =>
          view && skinsOf(project, figuresOf(view), figures, how, scale),
      });
      canvas.dataset.tile = String(card.id);
    };
    const pictures = new Pictures(paint);
    new ResizeObserver(paint).observe(canvas);
  };
  const watch = new IntersectionObserver(([{ isIntersecting }]) => {
    if (!isIntersecting) return;
    watch.disconnect(); // of a thousand projects only those in view are asked for
    draw().catch(() => {}); // deleted meanwhile
  });
  watch.observe(canvas);
  return canvas;
}
