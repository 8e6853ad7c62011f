/** What can be taken away of a solid: things to print, a film, a picture, a page. */

import { button, h, icon, put, section, trying } from "../dom.js";
import { form } from "../forms.js";
import { BUILD } from "../takeaway/kinds.js";
import { Making, picture } from "../takeaway/made.js";

/** @type {[name: string, title: string, image: "picture" | "solid"][]} */
const FILES = [["sheet.png", "Picture", "picture"], ["page.html", "Page that turns it", "solid"]];

export class Takeaway {
  /** @param {Page} page @param {any} schema */
  constructor({ api, project }, schema) {
    this.place = `projects/${project.id}`;
    this.making = new Making(api, project, {
      asked: () => ["build", this.settings(this.form.values())],
      refused: (setting, text) => this.form.refuse(setting, text),
      show: (task) => {
        const seen = task && picture(task);
        put(this.shown, seen);
        this.shown.hidden = !seen;
        if (seen) this.root.scrollIntoView({ block: "nearest" });
      },
    });
    /** @type {any[]} */
    const settings = Object.values(schema.properties);
    for (const own of settings) own["x-group"] = "More";
    this.form = form(schema, {
      first: BUILD.first,
      words: BUILD.words,
      hidden: ["solid"],
    }, () => this.making.change());
    this.shown = h("div.preview", { hidden: true });
    this.files = h("div.row");
    this.root = section("panel", "take", "Take it away", [
      this.form,
      this.making.make,
      this.shown,
      this.making.said,
      h("h3", "To show it to others"),
      this.files,
    ]);
  }

  /** Be about another solid. */
  choose({ id }) {
    if (id === this.tile) return;
    this.tile = id;
    this.making.task = null;
    const href = (name) => `api/${this.place}/tiles/${id}/files/${name}`;
    put(this.files, [
      button("Film (GIF)", () => trying(() => this.making.submit("film", this.settings())), {
        image: "film",
      }),
      FILES.map(([name, title, image]) =>
        h("a.button", { href: href(name), download: true }, icon(image), title)
      ),
    ]);
    this.making.tell();
  }

  settings(more = {}) {
    return { tile: this.tile, ...more };
  }
}
