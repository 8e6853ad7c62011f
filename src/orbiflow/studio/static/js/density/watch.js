/** A fit as it goes on: how far it is, what it tries, and buttons to hold or stop it. */

import { aside, h, meter, put } from "../dom.js";
import { steering } from "../steering.js";
import { capital, STATES } from "../words.js";
import { PARTS } from "./words.js";

const TRIED = /^held-out part (\d+) of (\d+): (\w+)(?: of (\d+))?/;

/** A part of a density, with a bar that says how much of it there is. */
export function partBar(name, share, words, more = "") {
  const [title, about] = PARTS[name] ?? [name, ""];
  return meter(title, share, words, `${capital(about)}. ${more}`);
}

export class Watch {
  /** @param {Page} page @param {Task} task */
  constructor(page, task) {
    this.page = page;
    this.found = new Map();
    this.says = h("p");
    this.kinds = h("ul.parts.stack");
    this.steer = steering(page.api, "How far the fit is");
    this.root = h("section.panel.stack.watch", [
      h("h2", "Making the density"),
      this.steer.bar,
      this.says,
      this.steer.root,
      aside("Several kinds of density are tried. Rows kept aside choose among them."),
      this.kinds,
    ]);
    this.update(task);
  }

  update(task) {
    this.task = task;
    const what = task.what ?? "",
      step = { drawing: ": drawing it", "putting together": ": putting it together" }[what] ??
        (this.hear(what) ? ": trying what suits the rows" : "");
    const state = task.state === "waiting" && task.place
      ? `${STATES.waiting}: ${task.place} before it`
      : STATES[task.state];
    this.says.textContent = task.state === "running"
      ? `${Math.round(100 * task.share)} % done${step}`
      : state;
    this.steer.update(task);
  }

  hear(what) {
    const tried = TRIED.exec(what),
      kind = tried ? tried[3] : what.startsWith("flow") ? "flow" : null;
    if (!kind) return false;
    const own = this.found.get(kind) ?? {};
    this.found.set(
      kind,
      tried ? { part: Number(tried[1]), parts: Number(tried[2]), size: tried[4] ?? own.size } : {},
    );
    put(
      this.kinds,
      [...this.found].map(([name, { part, parts, size }]) => (part
        ? partBar(
          name,
          part / parts,
          `part ${part} of ${parts}${size ? `, up to ${size} bumps` : ""}`,
        )
        : partBar(name, this.task.share, "being stirred"))
      ),
    );
    return true;
  }
}
