/** What can be taken away of a density: new rows, pictures, regions, and itself. */

import { labelled, select } from "../controls.js";
import { aside, button, h, panel, put, trying } from "../dom.js";
import { wordsOf } from "../takeaway/made.js";

/** @type {[string, string][]} */
const FORMATS = [["png", "PNG, for screens"], ["svg", "SVG, for print"], ["pdf", "PDF, for print"]];

/**
 * Files to take away: `submit(settings)` asks for them.
 *
 * @param {Page} page
 * @param {any} fit
 * @param {AbortSignal} signal
 * @param {(settings: object) => Promise<any>} submit
 */
export function takeaway(page, fit, signal, submit) {
  const amount = h("input", { type: "number", min: 1, max: 1000000, value: 1000 });
  const format = select(FORMATS, "png");
  const made = h("ul.made");
  const get = (words, what, settings = () => ({})) =>
    button(words, () => trying(() => submit({ fit: fit.number, what, ...settings() })));
  const card = (title, about, act, ...fields) =>
    h("div.take.stack", h("h3", title), aside(about), fields, act);
  const list = () => {
    const tasks = page.project.tasks.filter(({ operation }) => operation === "density take");
    put(made, tasks.map((task) => h("li", wordsOf(task))));
  };
  page.events.on("task refresh", list, signal);
  list();
  return panel("Take away", [
    h("div.grid.narrow", [
      card(
        "New rows",
        "As many as you like, drawn from the density.",
        get("Draw rows", "samples", () => ({ count: Number(amount.value) })),
        labelled("How many", amount),
      ),
      card(
        "Pictures",
        fit.surface
          ? "The map, and the surface as a page of its own."
          : "New rows beside yours, angle by angle.",
        get("Make pictures", "figures", () => ({ format: format.value })),
        labelled("Format", format),
      ),
      card(
        "Regions",
        `The smallest regions that hold a half and nine tenths: ${
          fit.surface ? "their outlines" : "how large, and how dense"
        }.`,
        get("Find regions", "regions"),
      ),
      card(
        "The density itself",
        "To go on with in Python, or with the command orbiflow density.",
        get("Get the density", "model"),
      ),
    ]),
    made,
  ]);
}
