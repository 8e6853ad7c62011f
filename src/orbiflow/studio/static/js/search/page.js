/** The search as it goes: all classes side by side, best first. */

import { FEW_PALETTES, select } from "../controls.js";
import { button, confirmed, h, notes, put, row, soft, style, toast, trying } from "../dom.js";
import { atNextFrame } from "../../../../drawing/js/turned.js";
import { better } from "../events.js";
import { lookKeeper, lookOf, paletteOf } from "../look.js";
import { Pictures } from "../skin.js";
import { LATE, steering } from "../steering.js";
import { alive, capital, isOutdated, number, waitWords } from "../words.js";
import { wishes } from "../wishes.js";
import { cardView } from "./card.js";
import { reordered } from "./moving.js";

const NINE = 9; // classes that are searched for every picture
const WEAK = 2; // stars of a tile that is folded away
const REST = 1500; // ms after the last move of the mouse, for which cards stay where they are

/** @type {Show} */
export async function show(root, page) {
  const { project, navigate } = page;
  if (!project.silhouette && !project.tiles.length) {
    navigate(`p/${project.id}/picture`, { replace: true });
    return;
  }
  await style("search");
  new SearchPage(page).build(root);
}

/** Cards that are folded away. */
class Fold {
  title = h("summary");
  list = h("ul.cards");
  root = h("details", this.title, this.list);

  show(cards, title) {
    reordered(this.list, cards);
    this.title.textContent = title;
    this.root.hidden = !cards.length;
  }
}

class SearchPage {
  weaker = new Fold();
  earlier = new Fold();

  /** @param {Page} page */
  constructor(page) {
    const { api, project, about } = page;
    this.page = page;
    this.wishes = wishes(page);
    this.api = api;
    this.project = project;
    this.about = about;
    this.place = `projects/${project.id}`;
    this.look = lookOf(project, about);
    this.keepLook = lookKeeper(page);
    this.pictures = new Pictures(() => this.views.forEach((view) => view.paint()));
    this.views = new Map();
    this.spare = []; // cards that hold a place
    this.touched = -Infinity; // when the mouse last moved over the cards
    this.soon = atNextFrame(() => {
      this.arrange();
      this.tell();
    });
  }

  build(root) {
    const moved = ({ pointerType }) => {
      if (pointerType === "mouse") this.touched = performance.now();
    };
    this.grid = h("ul.cards", { onpointermove: moved });
    this.folds = [this.weaker, this.earlier].map((fold) => {
      fold.root.ontoggle = () => this.views.forEach((view) => view.paint(false));
      return fold.root;
    });
    this.said = h("p.state-words", { role: "status" });
    this.noted = h("div", { role: "status" });
    this.steer = steering(this.api, "How far the search is");
    this.again = button("", () => this.search(), { kind: "primary", image: "arrow" });
    this.deeds = row(this.steer.root, this.again);
    this.heading = h("h1", { tabindex: "-1" }, "Tiles");
    const { effort, objective } = this.wishes;
    this.panel = h("div.wishes", effort, objective);
    this.empty = h("div.lonely.stack", [
      soft("No tiles yet."),
      h("p", h("a", { href: `#/p/${this.project.id}/picture` }, "Back to the picture")),
    ]);
    put(root, [
      h("div.head", h("div.grow", this.heading, this.said), this.colours(), this.panel, this.deeds),
      this.steer.bar,
      this.noted,
      this.empty,
      this.grid,
      this.folds,
    ]);
    new ResizeObserver(() => this.views.forEach((view) => view.paint(false))).observe(this.grid);
    this.page.events.on("card gone refresh silhouette task", this.soon, this.page.signal);
    this.arrange();
    this.tell();
  }

  /** The choice of colours. */
  colours() {
    const dots = h("span.dots", { "aria-hidden": "true" });
    const show = () => {
      this.palette = paletteOf(this.look, this.about);
      const dot = (colour) => h("i", { style: { background: colour } });
      put(dots, this.palette.colours.slice(0, 4).map(dot));
    };
    const names = this.about.palettes.map(({ name }) => name);
    if (this.look.custom) names.unshift("own");
    /** @type {[string, string][]} */
    const options = names.map((name) => [name, capital(name === "own" ? "my own" : name)]);
    const list = select(options, this.look.palette, (palette) => {
      this.look.palette = palette;
      this.keepLook({ palette });
      show();
      this.arrange();
    }, FEW_PALETTES);
    list.ariaLabel = "Colours";
    show();
    return h("label.palette.row", dots, list);
  }

  /** The search that is going on, or the last one. */
  get task() {
    const searches = this.project.tasks.filter(({ operation }) => operation === "search");
    return searches.find(alive) ?? searches[0];
  }

  start(words, more = {}) {
    return trying(async () => {
      const settings = { ...this.wishes.settings(), ...more };
      await this.api.start(this.project, "search", settings);
      toast(words);
    });
  }

  more({ id, arrangement }) {
    return this.start(`Looking for more like “${arrangement}”.`, { like: id });
  }

  async remove({ id }) {
    const words = "It will be gone for good. A new search may find it again.";
    if (!(await confirmed("Remove this tile?", words, "Remove it"))) return;
    await trying(() => this.api.remove(`${this.place}/tiles/${id}`));
    this.heading.focus();
  }

  /** Say how far the search is. */
  tell() {
    const { task, project } = this;
    const words = stateWords(task, project, this.groups.length);
    if (this.said.textContent !== words) this.said.textContent = words;
    this.said.classList.toggle("error", task?.state === "failed");
    const doubts = [project, project.second].flatMap((own) => own?.silhouette?.doubts ?? []);
    const said = [...doubts, ...task?.result?.notes ?? []];
    const told = JSON.stringify(said);
    if (told !== this.told) put(this.noted, notes(said));
    this.told = told;
    this.empty.hidden = Boolean(project.tiles.length) || alive(task);
    this.offer(task);
  }

  /**
   * Show the buttons that a state has; the focus stays on one of them.
   *
   * @param {Task | undefined} task
   */
  offer(task) {
    const [busy, held] = [alive(task), this.deeds.contains(document.activeElement)];
    this.steer.update(task);
    this.again.lastChild.textContent = task ? "Search again" : "Search";
    if (busy === this.busy) return;
    this.turned = this.busy === undefined ? -Infinity : performance.now();
    this.busy = busy;
    this.again.hidden = this.panel.hidden = busy || !this.project.silhouette;
    /** @type {HTMLButtonElement} */
    const first = this.deeds.querySelector("button:not([hidden], [hidden] *)");
    if (held) first.focus();
  }

  /** Search again, unless the click was meant for the button that stood here. */
  search() {
    return performance.now() - this.turned > LATE && this.start("The search begins.");
  }

  /** The tiles, each with what was pulled from it, best first. */
  get groups() {
    const byId = this.project.tiles.toSorted((a, b) => a.id - b.id);
    const groups = Map.groupBy(byId, ({ id, root }) => root ?? id);
    return [...groups.values()].sort((a, b) => better(a[0], b[0]));
  }

  /** Show the cards in their order; but not away from the mouse. */
  arrange() {
    const { views, grid, groups } = this;
    const key = (group) => group[0].root ?? group[0].id;
    if (performance.now() - this.touched < REST) {
      const places = new Map([...grid.children].map((child, k) => [child, k]));
      const place = (group) => places.get(views.get(key(group))?.root) ?? Infinity;
      const now = new Map(groups.map((group) => [group, place(group)]));
      groups.sort((a, b) => (now.get(a) === now.get(b) ? 0 : now.get(a) - now.get(b)));
      clearTimeout(this.later);
      this.later = setTimeout(this.soon, REST);
    }
    const keys = groups.map(key);
    for (const id of [...views.keys()]) if (!keys.includes(id)) views.delete(id);
    for (const id of keys) if (!views.has(id)) views.set(id, cardView(this.project, this));
    const roots = (own) => own.map((group) => views.get(key(group)).root);
    const isOld = (group) => isOutdated(group[0], this.project);
    const now = groups.filter((group) => !isOld(group));
    const old = groups.filter(isOld);
    const weak = this.weak(now);
    const alike = weak.some(([card]) => card.stars > WEAK);
    const one = alike ? "weaker or nearly alike" : "weaker one";
    this.weaker.show(roots(weak), number(weak.length, one, alike ? one : `${one}s`));
    const before = `Found before you changed the picture: ${number(old.length, "tile")}`;
    this.earlier.show(roots(old), before);
    reordered(grid, [...roots(now.filter((group) => !weak.includes(group))), ...this.ghosts()]);
    groups.forEach((group) => views.get(key(group)).update(group, this.palette));
  }

  /** Of some groups those that are folded away once all are found: of few stars, or like a better one. */
  weak(groups) {
    const known = new Set(groups.map(([{ id }]) => id));
    const poor = groups.filter(([{ like, stars }, ...pulled]) =>
      !pulled.length && (stars && stars <= WEAK || known.has(like))
    );
    return alive(this.task) || poor.length === groups.length ? [] : poor;
  }

  /** Empty cards hold the places of the nine classes until the first tiles are done. */
  ghosts() {
    const { tiles } = this.project;
    const begun = alive(this.task) && !tiles.some(({ stage }) => stage === "final");
    const missing = begun ? Math.max(0, NINE - this.groups.length) : 0;
    while (this.spare.length < missing) {
      this.spare.push(h("li.card.ghost", { "aria-hidden": "true" }, h("div", {})));
    }
    return this.spare.slice(0, missing);
  }
}

/**
 * What there is to say of a search, and of `tiles` with what was pulled from them.
 *
 * @param {Task | undefined} task
 * @param {Project} project
 * @param {number} tiles
 */
function stateWords(task, { tiles: { length: every }, second, silhouette }, tiles) {
  const pulled = every > tiles ? ` and ${number(every - tiles, "pulled version")}` : "";
  const first = silhouette ? ", best first" : "";
  const count = number(tiles, "tile");
  const found = `${count}${pulled}${first}. Each one covers the plane: we proved it.`;
  if (!task) return tiles ? found : "Nothing has been searched yet.";
  const wait = waitWords(task);
  if (wait) return wait;
  if (task.state === "running") {
    if (second && !tiles) return "Looking for tiles of both: the first takes a moment";
    return task.what ? capital(task.what) : "Looking for tiles";
  }
  if (!tiles) return "No tile was found. Smooth the picture a little, or search more thoroughly.";
  return found;
}
