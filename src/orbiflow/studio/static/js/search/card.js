/** One tile of a search: a small tiling, its stars, and what can be done with it. */

import { button, h, put } from "../dom.js";
import { skinsOf } from "../skin.js";
import { figuresOf, paintCard } from "../../../../drawing/js/tiling.js";
import { capital, sentence, STAGES, starText, starWords } from "../words.js";

/**
 * A card of a tile and what was pulled from it, that can be told to change: {root, update(versions, palette), paint()}.
 *
 * @param {Project} project
 * @param {{ api: Api, pictures: any, look: any, more(card: Card): void, remove(card: Card): void }} actions
 */
export function cardView(project, actions) {
  /** @type {TileView | null} */
  let view = null;
  let asked = "";
  const canvas = h("canvas", { "aria-hidden": "true" });
  const stars = h("span.stars", { role: "img" });
  const word = h("span.word");
  const lies = h("span.lies");
  const stage = h("span.stage-word");
  const why = h("span.soft.small");
  const link = h("a.open", [
    canvas,
    h("span.facts", h("span.row", stars, word, h("span.grow"), stage), lies, why),
  ]);
  const more = button("More like this", () => actions.more(shown), { kind: "quiet" });
  const drop = button("Remove this tile", () => actions.remove(shown), {
    kind: "quiet icon",
    image: "bin",
  });
  const take = h("a.button.quiet", "Take away");
  const versions = h("div.versions", { role: "group", "aria-label": "Versions" });
  const root = h("li.card", link, versions, h("div.row.deeds", take, more, h("span.grow"), drop));
  /** @type {Card | null} */
  let shown = null;
  /** @type {Palette | null} */
  let palette = null;
  let painted = "";

  function paint(anew = true) {
    if (!shown || !canvas.clientWidth) return;
    const key = `${canvas.clientWidth} ${canvas.clientHeight}`;
    if (!anew && key === painted) return;
    painted = key;
    const { look, pictures } = actions;
    const how = { look, palette, pictures };
    paintCard(canvas, shown, palette, {
      across: canvas.clientWidth > 480 ? 6 : 4.5,
      skins: ({ figures }, scale) => view && skinsOf(project, figuresOf(view), figures, how, scale),
    });
  }

  /** Ask for the map by which a picture is laid on the tile, once for each of its stages. */
  async function fetchMap({ id, stage }) {
    if (!actions.look.art || asked === `${id} ${stage}`) return;
    asked = `${id} ${stage}`;
    const found = await actions.api.get(`projects/${project.id}/tiles/${id}`).catch(() => null);
    if (asked !== `${id} ${stage}`) return;
    view = found;
    const lacks = found && figuresOf(found).find(({ map }) => !map);
    why.textContent = lacks
      ? sentence(`Without your picture: ${lacks.no_map || "the search left no map of it"}`)
      : "";
    paint();
  }

  let known = "";
  let chosen = 0;

  /**
   * Show the version that is chosen, the last one if none is.
   *
   * @param {Card[]} group
   * @param {Palette} colours
   */
  function update(group, colours) {
    const ids = group.map(({ id }) => id).join();
    if (ids !== known) chosen = group.at(-1).id; // a tile that was just pulled is shown
    const own = `${ids} ${chosen}`;
    if (own !== versions.dataset.own) {
      versions.dataset.own = own;
      versions.hidden = group.length < 2;
      put(
        versions,
        group.map(({ id, parent }, k) =>
          button(
            parent ? `Pulled ${k || ""}`.trim() : project.silhouette ? "As found" : "First",
            () => {
              chosen = id;
              update(group, colours);
              /** @type {HTMLElement} */ (versions.querySelector("[aria-pressed=true]")).focus();
            },
            { kind: "quiet", "aria-pressed": String(id === chosen) },
          )
        ),
      );
    }
    known = ids;
    tell(group.find(({ id }) => id === chosen), colours);
  }

  /** @param {Card} card @param {Palette} colours */
  function tell(card, colours) {
    const anew = !shown || shown.polygon !== card.polygon || palette !== colours;
    [shown, palette] = [card, colours];
    root.dataset.tile = String(card.id);
    root.dataset.stage = card.stage;
    root.classList.toggle("rough", card.stage !== "final");
    link.href = `#/p/${project.id}/t/${card.id}`;
    take.href = `#/p/${project.id}/take/${card.id}`;
    stars.textContent = starText(card);
    stars.setAttribute("aria-label", starWords(card));
    word.textContent = card.stars && !card.figures ? capital(card.word) : "";
    lies.textContent = capital(card.arrangement);
    stage.textContent = card.stage === "final" ? "" : STAGES[card.stage] ?? "";
    const about = `${capital(card.word || "a tile")}, ${card.arrangement}`;
    link.setAttribute("aria-label", `Open: ${about}. ${starWords(card)}.`);
    more.hidden = !project.silhouette || Boolean(card.figures) !== Boolean(project.second);
    more.setAttribute("aria-label", `More like this: ${about}`);
    take.setAttribute("aria-label", `Take away: ${about}`);
    drop.setAttribute("aria-label", `Remove this tile: ${about}`);
    if (anew) paint();
    fetchMap(card);
  }
  return { root, update, paint };
}
