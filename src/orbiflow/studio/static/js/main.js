/** The shell: which page is shown, its project, and the bar on top. */

import { about, api } from "./api.js";
import { h, newest, put, toast } from "./dom.js";
import { Feed } from "./events.js";
import { sentence } from "./words.js";

/** @type {[pattern: RegExp, load: () => Promise<any>, step?: string][]} */
const ROUTES = [
  [/^$/, () => import("./start/page.js")],
  [/^p\/([\w-]+)\/picture(?:\/(2))?$/, () => import("./start/picture.js"), "picture"],
  [/^p\/([\w-]+)$/, () => import("./search/page.js"), "tiles"],
  [/^p\/([\w-]+)\/t\/(\d+)$/, () => import("./closeup/page.js"), "closeup"],
  [/^p\/([\w-]+)\/take\/(\d+)$/, () => import("./takeaway/page.js"), "take"],
  [/^shapes$/, () => import("./shapes/page.js")],
  [/^open\/[\w-]+$/, () => import("./takeaway/opened.js")],
  [/^d\/([\w-]+)$/, () => import("./density/page.js")],
  [/^s\/([\w-]+)(?:\/t\/(\d+))?$/, () => import("./solid/page.js")],
];

const page = document.querySelector("#page");
const bar = document.querySelector("#top");
/** What the page that is shown does when it is left, and what ends all that it hears. */
let close = () => {};
let leaving = new AbortController();
/** @type {Feed | null} */
let feed = null;
let turn = 0;
/** Where each step of the history was scrolled to, by its number, and what is shown. */
const places = {};
let [here, path] = [0, ""];
history.scrollRestoration = "manual";

/** Go to a page; `replace` leaves no step in the history. @param {string} to */
export function navigate(to, { replace = false, quiet = false } = {}) {
  if (quiet) {
    path = to;
    history.replaceState(history.state, "", `#/${to}`);
    shownTile = Number(to.match(/\/t\/(\d+)$/)?.[1]) || shownTile;
    links();
    return;
  }
  if (replace) location.replace(`#/${to}`);
  else location.hash = `#/${to}`;
}

async function show() {
  places[here] = scrollY;
  here = history.state ?? performance.timeOrigin + performance.now();
  history.replaceState(here, "");
  const before = path;
  path = decodeURIComponent(location.hash.replace(/^#\/?/, ""));
  const mine = (turn += 1);
  const [pattern, load, step] = ROUTES.find(([known]) => known.test(path)) ?? [null];
  const [, id, digits] = pattern ? path.match(pattern) : [];
  if (id !== feed?.project.id) {
    document.querySelectorAll("#toasts .bad").forEach((one) => one.remove());
  }
  const leave = close;
  close = () => {};
  leaving.abort();
  const { signal } = leaving = new AbortController();
  await leave();
  const root = h("div.page");
  const waiting = setTimeout(
    () => mine === turn && put(page, h("p.lonely.soft", "One moment …")),
    300,
  );
  try {
    if (!pattern) throw new Error("There is no such page.");
    const [module, known] = await Promise.all([load(), about(), follow(id)]);
    if (mine !== turn) return;
    const number = Number(digits) || null;
    drawBar(step, step === "picture" ? null : number);
    clearTimeout(waiting);
    put(page, root);
    const shown = await module.show(root, {
      api,
      events: feed,
      project: feed?.project ?? null,
      number,
      navigate,
      about: known,
      signal,
    });
    if (mine !== turn) shown?.();
    else close = shown ?? (() => {});
    head(before, places[here]);
  } catch (error) {
    if (mine !== turn) return;
    drawBar();
    put(page, [
      h("div.lonely.stack", [
        h("h1", { tabindex: "-1" }, "This page cannot be shown"),
        h("p", error.message),
        h("p", h("a", { href: "#/" }, "Back to the start")),
      ]),
    ]);
    head();
  } finally {
    clearTimeout(waiting);
  }
}

/** The title of the window, and where readers of screens begin: on the way back, where one was. */
function head(before, top) {
  const title = page.querySelector("h1");
  const name = feed?.project.name;
  document.title = [title?.textContent, name, "orbiflow studio"].filter(Boolean).join(" · ");
  /** @type {HTMLElement} */
  const link = top >= 0 ? page.querySelector(`a[href="#/${before}"]`) : null;
  if (!page.contains(document.activeElement)) (link ?? title)?.focus({ preventScroll: true });
  scrollTo(0, top ?? 0);
}

/** Fetch the project of a page and hear its events, unless it is the one that is heard already. */
async function follow(id) {
  if (feed && feed.project.id === id) return;
  feed?.close();
  feed = null;
  if (!id) return;
  const project = await api.get(`projects/${id}`);
  const own = new Feed(project);
  feed = own;
  const lost = (yes) => document.querySelector(".lost").toggleAttribute("hidden", !yes);
  own.on("lost", () => lost(true));
  own.on("back", () => lost(false));
  own.on("notice", ({ text, warning }) => toast(sentence(text), { bad: warning }));
  own.on("gone", (what) => {
    if (what.project) {
      toast("This project was deleted.");
      navigate("");
    }
  });
  own.on("project refresh", rename);
  own.on("card refresh", links);
}

let shownStep;
let shownTile;

function rename() {
  /** @type {HTMLInputElement | null} */
  const box = bar.querySelector(".title");
  if (box && document.activeElement !== box) box.value = feed.project.name;
}

/** The steps of a project: those that have nothing to show yet are left out. */
function links() {
  const place = bar.querySelector(".steps");
  if (!place) return;
  const { id, tiles, silhouette } = feed.project;
  const tile = shownTile ?? tiles[0]?.id;
  const steps = [["picture", "Picture", `p/${id}/picture`]];
  if (silhouette || tiles.length) steps.push(["tiles", "Tiles", `p/${id}`]);
  if (tile) steps.push(["closeup", "Close up", `p/${id}/t/${tile}`]);
  if (tile) steps.push(["take", "Take away", `p/${id}/take/${tile}`]);
  /** @param {string[]} step */
  const link = ([key, words, path]) =>
    h("a", { href: `#/${path}`, "aria-current": key === shownStep && "page" }, words);
  put(place, steps.map(link));
}

function drawBar(step, tile) {
  [shownStep, shownTile] = [step, tile];
  const project = feed?.project;
  const save = newest((name) => api.patch(`projects/${project.id}`, { name }), 500);
  put(bar, [
    h("div", { class: `bar at-${step}` }, [
      h("a.brand", { href: "#/", "aria-label": "orbiflow studio: start" }, [
        h("img", { src: "icon.svg", alt: "" }),
        h("span", "orbiflow"),
      ]),
      project && h("input.title", {
        type: "text",
        "aria-label": "Name of the project",
        maxlength: 80,
        value: project.name,
        oninput: ({ target: { value } }) => {
          if (value.trim()) save(project.name = value.trim());
        },
      }),
      project && step && h("nav.steps", { "aria-label": "Steps" }),
    ]),
    h("p.lost", { role: "status", hidden: true }, "The studio does not answer. Trying again …"),
  ]);
  if (project) links();
}

addEventListener("hashchange", show);
addEventListener(
  "unhandledrejection",
  ({ reason }) => toast(reason?.message ?? "Something went wrong."),
);
show();
