/** How to search, one wish for all pages of a project: how long, and what counts. */

import { choice } from "./controls.js";
import { aside, h } from "./dom.js";
import { keeper } from "./memory.js";
import { tookWords } from "./waiting.js";
import { EFFORTS, OBJECTIVE_MEANINGS, OBJECTIVES } from "./words.js";

/**
 * A choice that says what it means: how long a search takes, by what one has taken here.
 *
 * @param {Page} page
 * @param {string} operation
 * @param {string} effort
 * @param {(effort: string) => void} changed
 */
export const effortChoice = ({ project, about }, operation, effort, changed) =>
  wish(
    "How long",
    about.efforts.map((own) => [own, EFFORTS[own] ?? own]),
    effort,
    (own) => tookWords(project, operation, own),
    changed,
  );

/** @type {(label: string, options: [string, string][], value: string, meaningOf: (own: string) => string, changed: (own: string) => void) => HTMLElement} */
function wish(label, options, value, meaningOf, changed) {
  const meaning = aside(meaningOf(value));
  const chosen = (own) => {
    meaning.textContent = meaningOf(own);
    changed(own);
  };
  return h("div.wish", choice(label, options, value, chosen), meaning);
}

/**
 * The choices as elements, `objective` null for two pictures, and what they make of a search's `settings()`.
 *
 * @param {Page} page
 */
export function wishes(page) {
  const { project } = page;
  const wanted = { effort: "normal", objective: "likeness", ...project.view?.search };
  const keep = keeper(page, "search");
  const change = (name) => (own) => keep(Object.assign(wanted, { [name]: own }));
  const means = (own) => OBJECTIVE_MEANINGS[own];
  return {
    effort: effortChoice(page, "search", wanted.effort, change("effort")),
    objective: project.second ? null : wish(
      "What counts",
      Object.entries(OBJECTIVES),
      wanted.objective,
      means,
      change("objective"),
    ),
    settings: () => ({
      effort: wanted.effort,
      ...(!project.second && { objective: wanted.objective }),
    }),
  };
}
