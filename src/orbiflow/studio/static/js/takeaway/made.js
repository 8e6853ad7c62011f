/** What was made of a tile: its files, a picture of it, what is to be said. */

import { h, icon, row } from "../dom.js";
import { ago, alive, bytes, capital, sentence } from "../words.js";
import { EVERY_KIND as KINDS, lengthIn } from "./kinds.js";

const SEEN = /\.(png|gif|svg)$/; // files that browsers show

const address = ({ result }, name) =>
  `api/takeaways/${result.takeaway}/files/${encodeURIComponent(name)}`;

/**
 * Whether a task has made files.
 *
 * @param {Task | null} task
 */
export const isMade = (task) =>
  Boolean(KINDS[task?.operation] && task.state === "done" && task.result?.files?.length);

/**
 * Links to the files that a task has made.
 *
 * @param {Task} task
 * @param {string} kind
 */
export function files(task, kind) {
  return task.result.files.map(({ name, bytes: size }) =>
    h(
      "a",
      { class: `button ${kind}`, href: address(task, name), download: name },
      icon("download"),
      name,
      kind && size && h("span", { class: "small" }, bytes(size)),
    )
  );
}

/**
 * A picture of what a task has made, null if there is none.
 *
 * @param {Task} task
 */
export function picture(task) {
  const { takeaway, preview, files: [{ name }] } = task.result;
  if (!preview && !SEEN.test(name)) return null;
  const src = preview ? `api/takeaways/${takeaway}/preview.png` : address(task, name);
  return h("img", {
    src,
    alt: `What was made: ${KINDS[task.operation].title.toLowerCase()}`,
    loading: "lazy",
  });
}

/**
 * What there is to say of a task; `stale`: whether its settings were changed since.
 *
 * @param {Task | null} task
 * @param {boolean} stale
 */
export function words(task, stale) {
  if (alive(task)) {
    return [
      h(
        "p",
        {},
        task.state === "waiting" ? "Waiting its turn …" : capital(task.what || "At work …"),
      ),
      h("progress", { max: 1, value: task.share, "aria-label": "How far it is" }),
    ];
  }
  if (task?.state === "failed") return [h("p", { class: "error" }, sentence(task.error))];
  if (task?.state === "cancelled") return [h("p", { class: "soft" }, "Stopped.")];
  if (!isMade(task)) return [];
  const notes = task.result.notes ?? [];
  return [
    notes.length > 0 &&
    h("ul", { class: "notice" }, notes.map((text) => h("li", {}, sentence(text)))),
    stale && h("p", { class: "soft" }, "You changed something since. Make it again to have it."),
    row(files(task, "primary")),
  ];
}

/**
 * What a task made, for what or how large, and when.
 *
 * @param {Task} task
 */
function about({ operation, result }) {
  const { chosen = {}, facts = {}, made } = result;
  const { title, words: names } = KINDS[operation];
  const options = ["purpose", "kind", "cut"].map((name) =>
    names[name]?.options?.[chosen[name] ?? facts[name]]
  );
  const length = lengthIn(chosen.tile_size ?? (KINDS[operation].solid && facts.tile_size));
  const pixels = operation === "art" && `${facts.width} × ${facts.height} pixels`;
  const solid = operation === "solid" && facts.size &&
    `${facts.size.map(Math.round).join(" × ")} mm`;
  return [
    title,
    ...options,
    length && `tiles of ${Number(length.toFixed(1))} mm`,
    chosen.area,
    pixels,
    solid,
    made && ago(made),
  ].filter(Boolean).join(" · ");
}

/**
 * A list of what was made before.
 *
 * @param {Task[]} tasks
 */
export function madeBefore(tasks) {
  return h(
    "ul",
    { class: "made" },
    tasks.map((task) =>
      h(
        "li",
        { class: "panel stack" },
        picture(task) ?? h("span", { class: "no-picture" }, icon(KINDS[task.operation].image)),
        h("span", { class: "soft small" }, about(task)),
        files(task, ""),
      )
    ),
  );
}
