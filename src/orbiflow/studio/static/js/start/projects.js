/** The projects on the first page: go on with one, rename it, duplicate it, or delete it and take that back. */

import { button, entered, h, icon, put, row, trying } from "../dom.js";
import { ago, number } from "../words.js";
import { thumb as tilingOf } from "./thumb.js";

const PAGES = { density: "d", solid: "s" }; // of projects that are no tiles
/** @type {Record<string, "curve" | "solid" | "picture">} */
const SIGNS = { density: "curve", solid: "solid", tile: "picture" };
const SOME = 10; // projects that are shown at first

export class Projects {
  /** @param {Page} page */
  constructor({ api, signal }) {
    this.api = api;
    this.most = SOME;
    /** @type {Set<string>} */
    this.leaving = new Set(); // deleted when the page is left: until then that can be taken back
    this.root = h("section", { "aria-labelledby": "yours", hidden: true });
    addEventListener("pagehide", () => this.forget(), { signal });
    signal.addEventListener("abort", () => this.forget());
  }

  forget() {
    for (const id of this.leaving) {
      trying(() => this.api.remove(`projects/${id}`, { keepalive: true }));
    }
    this.leaving.clear();
  }

  /** Show the projects that there are, newest first; the others when they are asked for. */
  async show() {
    const found = await this.api.get("projects");
    this.root.hidden = !found.length;
    this.heading = h("h2", { id: "yours", tabindex: "-1" }, "Your projects");
    put(this.root, [
      this.heading,
      h("ul.projects", found.slice(0, this.most).map((own) => this.card(own))),
      found.length > this.most &&
      button(`Show all ${found.length}`, () => this.all(), { image: "more" }),
    ]);
  }

  /** Do something with the projects, then show them anew. */
  async after(work) {
    await trying(work);
    await trying(() => this.show());
    this.heading.focus();
  }

  all() {
    return this.after(() => {
      this.most = Infinity;
    });
  }

  card(own) {
    const place = h("li.project");
    const deed = (words, image, onclick) =>
      button(`${words} ${own.name}`, onclick, { kind: "quiet icon", image });
    const whole = () => {
      put(place, [
        link(this.api, own),
        row(
          deed("Rename", "pencil", () => this.rename(own)),
          deed("Delete", "bin", gone),
        ),
      ]);
    };
    const gone = () => {
      this.leaving.add(own.id);
      const undo = button("Undo", () => {
        this.leaving.delete(own.id);
        whole();
        place.querySelector("a").focus();
      }, { image: "undo" });
      const text = `“${own.name}” is deleted when you leave this page.`;
      put(place, h("div.gone.stack", { role: "status" }, h("p", text), undo));
      undo.focus();
    };
    (this.leaving.has(own.id) ? gone : whole)();
    return place;
  }

  async rename({ id, name }) {
    const given = await entered("Rename this project", "Rename it", name);
    if (given) await this.after(() => this.api.patch(`projects/${id}`, { name: given }));
  }
}

function link(api, { id, kind, name, thumb, tiles, busy, changed }) {
  const path = PAGES[kind] ? `${PAGES[kind]}/${id}` : tiles || busy ? `p/${id}` : `p/${id}/picture`;
  const empty = { density: "a table", solid: "a mesh", tile: "no tiles yet" };
  const facts = [
    tiles ? number(tiles, kind) : empty[kind],
    busy ? "at work" : ago(changed),
  ];
  const picture = thumb ? h("img", { src: thumb, alt: "", loading: "lazy" }) : icon(SIGNS[kind]);
  return h("a", { href: `#/${path}` }, [
    h("span.thumb", kind === "tile" && tiles ? tilingOf(api, id) : picture),
    h("span.project-name", name),
    h("span.soft.small", facts.join(" · ")),
  ]);
}
