/** How to search, one wish for all pages of a project: how long, and what counts. */

import { aside, choice, h, newest } from "./dom.js";
import { tookWords } from "./waiting.js";
import { EFFORTS, OBJECTIVE_MEANINGS, OBJECTIVES } from "./words.js";

/**
 * The choices as elements, `objective` null for two pictures, and what they make of a search's `settings()`.
 *
 * @param {Page} page
 */
export function wishes({ api, project, about }) {
  const wanted = { effort: "normal", objective: "likeness", ...project.view?.search };
  const keep = newest(() => api.patch(`projects/${project.id}`, { view: { search: wanted } }), 400);

  /** @type {(label: string, name: string, options: [string, string][], meaningOf: (own: string) => string) => HTMLElement} */
  const wish = (label, name, options, meaningOf) => {
    const meaning = aside(meaningOf(wanted[name]));
    const chosen = (own) => {
      wanted[name] = own;
      project.view = { ...project.view, search: wanted };
      meaning.textContent = meaningOf(own);
      keep();
    };
    return h("div", { class: "wish" }, choice(label, options, wanted[name], chosen), meaning);
  };
  return {
    effort: wish(
      "How long",
      "effort",
      about.efforts.map((own) => [own, EFFORTS[own] ?? own]),
      (own) => tookWords(project, "search", own),
    ),
    objective: project.second ? null : wish(
      "What counts",
      "objective",
      Object.entries(OBJECTIVES),
      (own) => OBJECTIVE_MEANINGS[own],
    ),
    settings: () => ({
      effort: wanted.effort,
      ...(!project.second && { objective: wanted.objective }),
    }),
  };
}
