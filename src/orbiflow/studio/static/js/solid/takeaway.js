/** What can be taken away of a solid: things to print, a film, a picture, a page. */

import { button, h, icon, put, trying } from "../dom.js";
import { form } from "../forms.js";
import { LATE } from "../steering.js";
import { BUILD } from "../takeaway/kinds.js";
import { isMade, madeBefore, picture, words } from "../takeaway/made.js";
import { alive } from "../words.js";

/** @type {[name: string, title: string, image: "picture" | "solid"][]} */
const FILES = [["sheet.png", "Picture", "picture"], ["page.html", "Page that turns it", "solid"]];

export class Takeaway {
  /**
   * @param {Page} page
   * @param {any} schema
   */
  constructor({ api, project }, schema) {
    this.api = api;
    this.project = project;
    this.place = `projects/${project.id}`;
    this.task = null; // the one whose result is shown
    this.stale = false; // whether settings were changed since
    this.busy = this.news = false;
    this.turned = -Infinity; // when the button last changed its meaning
    /** @type {any[]} */
    const settings = Object.values(schema.properties);
    for (const own of settings) own["x-group"] = "More";
    this.form = form(schema, {
      first: BUILD.first,
      words: BUILD.words,
      hidden: ["solid"],
    }, () => {
      this.stale = true;
      this.tell();
    });
    this.make = button("Make it", () => trying(() => this.press()), { kind: "primary big" });
    this.said = h("div", { class: "stack said", role: "status" });
    this.shown = h("div", { class: "preview", hidden: true });
    this.files = h("div", { class: "row" });
    this.before = h("div");
    this.earlier = h(
      "section",
      { class: "stack earlier", "aria-labelledby": "earlier" },
      h("h2", { id: "earlier" }, "Made before"),
      this.before,
    );
    this.root = h(
      "section",
      { class: "panel stack", "aria-labelledby": "take" },
      h("h2", { id: "take" }, "Take it away"),
      this.form,
      this.make,
      this.shown,
      this.said,
      h("h3", {}, "To show it to others"),
      this.files,
    );
  }

  /** Be about another solid. */
  choose({ id }) {
    if (id === this.tile) return;
    this.tile = id;
    this.task = null;
    const href = (name) => `api/${this.place}/tiles/${id}/files/${name}`;
    put(
      this.files,
      button("Film (GIF)", () => trying(() => this.submit("film")), { image: "film" }),
      FILES.map(([name, title, image]) =>
        h("a", { class: "button", href: href(name), download: true }, icon(image), title)
      ),
    );
    this.tell();
  }

  /** Make it, or stop what is being made. */
  async press() {
    if (performance.now() - this.turned < LATE) return; // meant for what the button said before
    if (alive(this.task)) {
      await this.api.post(`tasks/${this.task.id}/cancel`);
      return;
    }
    try {
      await this.submit("build", this.form.values());
    } catch (error) {
      if (!this.form.refuse(error.setting, error.message)) throw error;
    }
  }

  /** Let something be made of the solid, and show it. */
  async submit(operation, settings = {}) {
    const body = { operation, settings: { tile: this.tile, ...settings } };
    this.task = (await this.api.post(`${this.place}/tasks`, body)).task;
    [this.stale, this.news] = [false, true];
    this.tell();
  }

  /** Show how far it is, or what was made. */
  tell() {
    const { tasks } = this.project;
    this.task = tasks.find(({ id }) => id === this.task?.id) ?? this.task;
    const busy = alive(this.task), again = isMade(this.task) && this.stale;
    if (busy !== this.busy) [this.busy, this.turned] = [busy, performance.now()];
    this.make.lastChild.textContent = busy ? "Stop" : again ? "Make it again" : "Make it";
    const before = tasks.filter((task) => isMade(task) && task.id !== this.task?.id);
    const told = JSON.stringify([this.task, again, before.map(({ id }) => id)]);
    if (told === this.told) return; // what has the focus stays
    this.told = told;
    const seen = isMade(this.task) && picture(this.task);
    put(this.shown, seen);
    this.shown.hidden = !seen;
    put(this.said, words(this.task, again));
    if (seen && this.news) this.root.scrollIntoView({ block: "nearest" });
    this.news &&= !seen;
    this.earlier.hidden = !before.length;
    put(this.before, madeBefore(before));
  }
}
