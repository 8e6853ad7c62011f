/** The page of a mesh: the figure, the search, the solids that were found, and what is made of them. */

import { button, confirmed, h, put, stack, style, trying } from "../dom.js";
import { atNextFrame } from "../../../../drawing/js/turned.js";
import { alive, number } from "../words.js";
import { Search } from "./search.js";
import { Stage } from "./stage.js";
import { Takeaway } from "./takeaway.js";
import { facts, percent, sides, stateWords } from "./words.js";

/** @type {Show} */
export async function show(root, page) {
  await style("takeaway", "solid");
  await new SolidPage(page).build(root);
}

class SolidPage {
  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    this.project = page.project;
    this.place = `projects/${page.project.id}`;
    this.chosen = page.number; // by the user; else the best is shown
    this.stage = new Stage();
    this.soon = atNextFrame(() => trying(() => this.tell()));
    page.signal.addEventListener("abort", () => this.stage.close());
  }

  /** Build what there is to see, now or once the mesh is read. */
  async build(root) {
    const { api, events, signal } = this.page;
    const [{ mesh }, fill, build] = await Promise.all([
      api.get(`${this.place}/mesh`),
      api.get("operations/fill/schema"),
      api.get("operations/build/schema"),
    ]);
    const heading = h("h1", { tabindex: "-1" }, "A solid that fills space");
    if (!mesh) {
      put(root, heading, h("p", { role: "status" }, this.unread()));
      const read = new AbortController();
      events.on("task", (task) => {
        if (task.operation !== "mesh read" || alive(task)) return;
        read.abort();
        trying(() => this.build(root));
      }, AbortSignal.any([signal, read.signal]));
      return;
    }
    this.mesh = mesh;
    this.search = new Search(this.page, mesh, fill, {
      begin: (settings) => this.begin(settings),
      turnUp: (axis) => this.stage.turnUp(axis),
    });
    this.takeaway = new Takeaway(this.page, build);
    this.said = h("p.state-words", { role: "status" });
    this.facts = h("section.panel.stack");
    this.list = h("ul.solids");
    this.others = h("section.stack", { "aria-labelledby": "found" }, [
      h("h2", { id: "found", tabindex: "-1" }, "Solids"),
      this.list,
    ]);
    const notes = h("ul.notice", mesh.notes.map((text) => h("li", text)));
    put(root, [h("div.solid.stack", [
      h("div", heading, this.said),
      h("div.take", [
        stack(
          this.stage.root,
          mesh.notes.length > 0 && notes,
          this.others,
          this.takeaway.making.earlier,
        ),
        h("div.stack.side", [
          this.search.watch,
          this.facts,
          this.takeaway.root,
          this.search.wishes,
        ]),
      ]),
    ])]);
    events.on("card gone refresh task", this.soon, signal);
    await this.tell();
  }

  unread() {
    const task = this.newest("mesh read");
    return alive(task) ? "Reading the mesh …" : task?.error ?? "There is no mesh here.";
  }

  /** @param {string} operation */
  newest(operation) {
    const tasks = this.project.tasks.filter((task) => task.operation === operation);
    return tasks.find(alive) ?? tasks[0];
  }

  /** Search; another time from other places. */
  begin(settings) {
    const seed = this.project.tasks.filter(({ operation }) => operation === "fill").length;
    return this.page.api.start(this.project, "fill", { seed, ...settings });
  }

  /** Show what is true now. */
  async tell() {
    const { project, search, takeaway } = this, task = this.newest("fill");
    /** @type {any[]} */
    const solids = project.tiles;
    const own = solids.find(({ id }) => id === this.chosen) ?? solids[0];
    const words = stateWords(task, solids.length);
    if (this.said.textContent !== words) this.said.textContent = words;
    this.said.classList.toggle("error", task?.state === "failed");
    search.update(task, solids.length > 0);
    takeaway.making.tell();
    this.others.hidden = this.facts.hidden = takeaway.root.hidden = !own;
    const told = JSON.stringify([own?.id, solids.map(({ id }) => id)]);
    if (told === this.told) return;
    this.told = told;
    if (own) {
      put(this.facts, facts(own));
      takeaway.choose(own);
    }
    put(this.list, solids.map((one) => this.thumb(one, one === own)));
    await this.open(own);
  }

  /** Let a solid turn, or the figure before there is one. */
  async open(own) {
    const key = own?.id ?? 0;
    if (key === this.opened) return;
    this.opened = key;
    const { api, project } = this.page;
    const path = own ? `tiles/${own.id}` : "mesh/figure";
    const data = await api.get(`${this.place}/${path}`);
    if (this.page.signal.aborted || key !== this.opened) return;
    const { triangles, low, high } = this.mesh;
    const label = own
      ? `${project.name}: a solid, and a stack of its copies`
      : `${project.name}: ${number(triangles, "triangle")}, ${
        sides(high.map((a, k) => a - low[k]))
      }`;
    this.stage.open(data, label);
    if (!own) this.stage.turnUp(this.search.wanted.up);
  }

  thumb(card, current) {
    const { id, group, shadows } = card, path = `s/${this.project.id}/t/${id}`;
    const choose = (event) => {
      event.preventDefault();
      this.chosen = id;
      this.page.navigate(path, { quiet: true });
      trying(async () => {
        await this.tell();
        /** @type {HTMLElement} */
        const now = this.list.querySelector("[aria-current]");
        now?.focus();
      });
    };
    return h("li", [
      h("a", { href: `#/${path}`, "aria-current": current && "true", onclick: choose }, [
        h("img", {
          src: `api/${this.place}/tiles/${id}/files/thumb.png`,
          alt: "",
          loading: "lazy",
        }),
        h("strong", group),
        h("span.soft.small", `shadows ${percent(shadows)}`),
      ]),
      button(`Remove the solid in ${group}`, () => this.remove(card), {
        kind: "quiet icon",
        image: "bin",
      }),
    ]);
  }

  async remove({ id }) {
    const sure = await confirmed("Remove this solid?", "It will be gone for good.", "Remove it");
    if (!sure) return;
    await trying(() => this.page.api.remove(`${this.place}/tiles/${id}`));
    this.others.querySelector("h2").focus();
  }
}
