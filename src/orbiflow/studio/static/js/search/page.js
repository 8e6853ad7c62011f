/** The search as it goes: all classes side by side, best first. */

import { button, choice, confirmed, h, newest, put, style, toast, trying } from "../dom.js";
import { better } from "../events.js";
import { EFFORTS, EFFORT_TIMES, OBJECTIVES, OBJECTIVE_MEANINGS, STATES, alive, capital, number, sentence } from "../words.js";
import { cardView } from "./card.js";
import { reordered } from "./moving.js";

const SEARCHES = ["search", "studio search"];

export async function show(root, { api, events, project, navigate, about }) {
  if (!project.silhouette && !project.tiles.length) {
    navigate(`p/${project.id}/picture`, { replace: true });
    return () => {};
  }
  await style("search");
  const place = `projects/${project.id}`;
  const wanted = { effort: "normal", objective: "likeness", palette: about.palettes[0].name, ...project.view?.search };
  const keep = newest(() => api.patch(place, { view: { search: wanted } }), 400);
  const palette = () => about.palettes.find(({ name }) => name === wanted.palette) ?? about.palettes[0];
  const views = new Map();
  let due = 0;
  let later = 0;

  let touched = -Infinity; // when the mouse last moved over the cards
  const grid = h("ul", { class: "cards", onpointermove: ({ pointerType }) => { if (pointerType === "mouse") touched = performance.now(); } });
  const said = h("p", { class: "state-words", role: "status" });
  const bar = h("progress", { max: 1, "aria-label": "How far the search is" });
  const deeds = h("div", { class: "row" });
  const heading = h("h1", { tabindex: "-1" }, "Tiles");
  const empty = h("div", { class: "lonely stack" });

  const act = (task, deed) => trying(async () => api.post(`tasks/${task.id}/${deed}`));
  const start = (settings, words) => trying(async () => {
    await api.post(`${place}/tasks`, { operation: "search", settings });
    toast(words);
  });
  const search = () => start({ effort: wanted.effort, objective: wanted.objective }, "The search begins.");
  const actions = {
    more: (card) => start({ effort: wanted.effort, objective: wanted.objective, like: card.id }, `Looking for more like “${card.arrangement}”.`),
    async remove(card) {
      if (!(await confirmed("Remove this tile?", "It will be gone for good. A new search may find it again.", "Remove it"))) return;
      await trying(() => api.remove(`${place}/tiles/${card.id}`));
      heading.focus();
    },
  };

  const task = () => project.tasks.find((own) => SEARCHES.includes(own.operation) && alive(own))
    ?? project.tasks.find((own) => SEARCHES.includes(own.operation));

  function progress(own) {
    if (!own) return "Nothing has been searched yet.";
    if (own.state === "failed") return sentence(own.error);
    if (own.state === "waiting") return own.place > 0 ? `Waiting: ${number(own.place, "other thing")} to do first.` : "It starts in a moment.";
    if (own.state === "running") return own.what ? capital(own.what) : "Looking for tiles";
    if (own.state === "done" && !project.tiles.length) return "No tile was found. Smooth the picture a little, or search more thoroughly.";
    if (own.state === "done") return `${capital(number(project.tiles.length, "tile"))}, best first. Each one covers the plane: we proved it.`;
    return `${STATES[own.state]}.`;
  }

  let drawn = "";
  function tell() {
    const own = task();
    const words = progress(own);
    if (said.textContent !== words) said.textContent = words;
    said.classList.toggle("error", own?.state === "failed");
    bar.hidden = !alive(own);
    if (own?.state === "waiting") bar.removeAttribute("value");
    else bar.value = own?.share ?? 0;
    const key = `${own?.id} ${own?.state}`;
    if (key !== drawn) {
      drawn = key;
      const held = deeds.contains(document.activeElement);
      put(deeds, buttons(own));
      if (held) deeds.querySelector("button")?.focus();
      panel.hidden = alive(own);
      if (panel.hidden) panel.open = false;
    }
    empty.hidden = Boolean(project.tiles.length) || alive(own);
  }

  const buttons = (own) => ({
    waiting: [button("Stop", () => act(own, "cancel"), { image: "stop" })],
    running: [button("Pause", () => act(own, "pause"), { image: "pause" }), button("Stop", () => act(own, "cancel"), { image: "stop" })],
    paused: [button("Go on", () => act(own, "resume"), { kind: "primary", image: "play" }), button("Stop", () => act(own, "cancel"), { image: "stop" })],
  })[own?.state] ?? [button(own ? "Search again" : "Search", search, { kind: "primary", image: "arrow" })];

  /** Empty cards hold the place of the nine classes until the first tiles are there. */
  function ghosts() {
    const { tiles } = project;
    const missing = alive(task()) && !tiles.some(({ stage }) => stage === "final") ? Math.max(0, 9 - tiles.length) : 0;
    while (spare.length < missing) spare.push(h("li", { class: "card ghost", "aria-hidden": "true" }, h("div", {})));
    return spare.slice(0, missing);
  }
  const spare = [];

  const placeOf = ({ id }) => (views.has(id) ? [...grid.children].indexOf(views.get(id).root) : 1e9);

  /** Show the cards in their order; cards that stay move there calmly, but not away from the mouse. */
  function arrange() {
    const cards = [...project.tiles].sort(better);
    if (performance.now() - touched < 1500) {
      cards.sort((a, b) => placeOf(a) - placeOf(b) || better(a, b));
      clearTimeout(later);
      later = setTimeout(soon, 1500);
    }
    const kept = new Set(cards.map(({ id }) => id));
    for (const [id, view] of views) if (!kept.has(id)) { view.root.remove(); views.delete(id); }
    for (const card of cards) if (!views.has(card.id)) views.set(card.id, cardView(project, actions));
    reordered(grid, [...cards.map((card) => views.get(card.id).root), ...ghosts()]);
    cards.forEach((card) => views.get(card.id).update(card, palette()));
  }
  const soon = () => { cancelAnimationFrame(due); due = requestAnimationFrame(() => { arrange(); tell(); }); };

  const effortWords = h("p", { class: "soft small" }, EFFORT_TIMES[wanted.effort]);
  const objectiveWords = h("p", { class: "soft small" }, OBJECTIVE_MEANINGS[wanted.objective]);
  const panel = h("details", { class: "panel wishes", open: !project.tiles.length },
    h("summary", {}, "How to search"),
    h("div", { class: "wish" },
      h("div", { class: "stack" }, choice("How long", about.efforts.map((own) => [own, EFFORTS[own] ?? own]), wanted.effort, (own) => {
        wanted.effort = own; effortWords.textContent = EFFORT_TIMES[own] ?? ""; keep();
      }), effortWords),
      h("div", { class: "stack" }, choice("What counts", Object.entries(OBJECTIVES), wanted.objective, (own) => {
        wanted.objective = own; objectiveWords.textContent = OBJECTIVE_MEANINGS[own]; keep();
      }), objectiveWords)));
  const colours = h("select", { "aria-label": "Colours", onchange: () => { wanted.palette = colours.value; swatches(); arrange(); keep(); } },
    about.palettes.map(({ name }) => h("option", { value: name }, capital(name))));
  colours.value = palette().name;
  const dots = h("span", { class: "dots", "aria-hidden": "true" });
  const swatches = () => put(dots, palette().colours.slice(0, 4).map((colour) => h("i", { style: { background: colour } })));
  swatches();
  put(empty, h("p", { class: "soft" }, "No tiles yet."), h("p", {}, h("a", { href: `#/${place.replace("projects", "p")}/picture` }, "Back to the picture")));

  put(root,
    h("div", { class: "head" },
      h("div", { class: "grow" }, heading, said),
      h("label", { class: "palette row" }, dots, colours), deeds),
    bar, panel, empty, grid);
  const watch = new ResizeObserver(() => views.forEach((view) => view.paint(false)));
  watch.observe(grid);
  arrange();
  tell();
  const off = ["card", "gone", "refresh"].map((kind) => events.on(kind, soon));
  off.push(events.on("task", soon));
  return () => { off.forEach((stop) => stop()); watch.disconnect(); cancelAnimationFrame(due); clearTimeout(later); };
}
