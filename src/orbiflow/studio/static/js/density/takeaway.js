/** What can be taken away of a density: new rows, pictures, regions, and itself. */

import { aside, button, h, icon, panel, put, trying, unique } from "../dom.js";
import { alive, bytes } from "../words.js";

/**
 * Files to take away: `submit(settings)` asks for them, `ends` hears how to stop listening.
 *
 * @param {Page} page
 * @param {any} fit
 * @param {(() => void)[]} ends
 * @param {(settings: object) => Promise<any>} submit
 */
export function takeaway(page, fit, ends, submit) {
  const amount = h("input", {
    type: "number",
    id: unique("amount"),
    min: 1,
    max: 1000000,
    value: 1000,
  });
  const format = h(
    "select",
    { id: unique("format") },
    [["png", "PNG, for screens"], ["svg", "SVG, for print"], ["pdf", "PDF, for print"]].map((
      [value, words],
    ) => h("option", { value }, words)),
  );
  const made = h("ul", { class: "made" });
  const get = (words, what, settings = () => ({})) =>
    button(
      words,
      () => trying(() => submit({ fit: fit.number, what, ...settings() })),
    );
  const card = (title, about, act, ...fields) =>
    h(
      "div",
      { class: "take stack" },
      h("h3", title),
      aside(about),
      fields,
      act,
    );
  const list = () => {
    const tasks = page.project.tasks.filter(({ operation }) => operation === "density take");
    put(
      made,
      tasks.map((task) =>
        h(
          "li",
          alive(task)
            ? h("span", { role: "status" }, `${task.what || "Waiting"} …`)
            : task.state === "done"
            ? task.result.files.map((file) =>
              h(
                "a",
                {
                  class: "button",
                  download: file.name,
                  href: `api/takeaways/${task.id}/files/${encodeURIComponent(file.name)}`,
                },
                icon("download"),
                `${file.name}, ${bytes(file.bytes)}`,
              )
            )
            : h("span", { class: "error" }, task.error ?? "Stopped."),
        )
      ),
    );
  };
  ends.push(page.events.on("task", list), page.events.on("refresh", list));
  list();
  return panel(
    "Take away",
    h(
      "div",
      { class: "grid narrow" },
      card(
        "New rows",
        "As many as you like, drawn from the density.",
        get("Draw rows", "samples", () => ({ count: Number(amount.value) })),
        h("label", { for: amount.id, class: "label" }, "How many"),
        amount,
      ),
      card(
        "Pictures",
        fit.surface
          ? "The map, and the surface as a page of its own."
          : "New rows beside yours, angle by angle.",
        get("Make pictures", "figures", () => ({ format: format.value })),
        h("label", { for: format.id, class: "label" }, "Format"),
        format,
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
    ),
    made,
  );
}
