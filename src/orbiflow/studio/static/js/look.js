/** How a project's tiles look, one choice for all pages: colours, outline, picture and its tint. */

import { keeper } from "./memory.js";

/** Whether tiles show what lies under a silhouette: not if that is of one colour, or dark as lines. */
const shows = (own) => Boolean(own?.silhouette?.coloured && own.silhouette.told_apart !== false);

/** The look of a project's tiles. @param {Project} project @param {About} about */
export function lookOf(project, about) {
  const { look, closeup, search } = project.view ?? {};
  return {
    palette: search?.palette ?? about.palettes[0].name,
    custom: null,
    line: 1.4,
    signs: false,
    tint: 0.35,
    drawn: true,
    ...closeup?.look, // where it was kept before
    art: [project, project.second].some(shows),
    ...look,
  };
}

/**
 * The palette of a look, which may be the user's own.
 *
 * @param {Pick<ReturnType<typeof lookOf>, "palette" | "custom">} look
 * @param {About} about
 * @returns {Palette}
 */
export function paletteOf({ palette, custom }, { palettes }) {
  const found = palettes.find(({ name }) => name === palette) ?? palettes[0];
  return palette === "own" && custom ? { ...found, ...custom, shades: undefined } : found;
}

/** A function that keeps what changes of a project's look. @param {Page} page */
export function lookKeeper(page) {
  const keep = keeper(page, "look");
  const chosen = {}; // on this page: what the server tells meanwhile may be older
  /** @param {object} what */
  return (what) => keep({ ...page.project.view?.look, ...Object.assign(chosen, what) });
}
