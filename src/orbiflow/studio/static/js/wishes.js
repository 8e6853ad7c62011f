/** How to search, one wish for all pages of a project: how long, and what counts. */

import { aside, choice, h, newest } from "./dom.js";
import { EFFORT_TIMES, EFFORTS, OBJECTIVE_MEANINGS, OBJECTIVES, PAIR_TIMES } from "./words.js";

/**
 * The choices as elements, `objective` null for two pictures, and what they make of a search's `settings()`.
 *
 * @param {Page} page
 */
export function wishes({ api, project, about }) {
  const wanted = { effort: "normal", objective: "likeness", ...project.view?.search };
  const keep = newest(() => api.patch(`projects/${project.id}`, { view: { search: wanted } }), 400);

  /** @type {(label: string, name: string, options: [string, string][], meanings: Record<string, string>) => HTMLElement} */
  const wish = (label, name, options, meanings) => {
    const meaning = aside(meanings[wanted[name]]);
    const chosen = (own) => {
      wanted[name] = own;
      project.view = { ...project.view, search: wanted };
      meaning.textContent = meanings[own] ?? "";
      keep();
    };
    return h("div", { class: "wish" }, choice(label, options, wanted[name], chosen), meaning);
  };
  return {
    effort: wish(
      "How long",
      "effort",
      about.efforts.map((own) => [own, EFFORTS[own] ?? own]),
      project.second ? PAIR_TIMES : EFFORT_TIMES,
    ),
    objective: project.second
      ? null
      : wish("What counts", "objective", Object.entries(OBJECTIVES), OBJECTIVE_MEANINGS),
    settings: () => ({
      effort: wanted.effort,
      ...(!project.second && { objective: wanted.objective }),
    }),
  };
}
