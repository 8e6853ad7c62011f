/** Words about solids. */

import { aside, h, meter } from "../dom.js";
import { number, waitWords } from "../words.js";

const STEPS = {
  placing: "Laying copies side by side",
  bending: "Bending the figure until its copies meet",
  closing: "Closing the last gaps, and proving that nothing is left",
};

/** @param {number} share */
export const percent = (share) => `${Math.round(100 * share)}\u00a0%`;
/** @param {number[]} sides */
export const sides = (sides) =>
  `${
    sides.map((side) => side < 10 ? Number(side.toPrecision(2)) : Math.round(side)).join(" × ")
  } mm`;

/**
 * What there is to say of a search for solids.
 *
 * @param {Task | undefined} task
 * @param {number} count
 */
export function stateWords(task, count) {
  if (!task) return "This is what was read. Say how to search, and look for solids like it.";
  const wait = waitWords(task);
  if (wait) return wait;
  if (task.state === "running") return `${STEPS[task.what] ?? "Looking for solids"} …`;
  if (!count) {
    return "No solid was found that is one piece and fills space. Search more carefully, or in other space groups.";
  }
  return `${
    number(count, "solid")
  }, best first. Copies of each fill space without a gap: we proved it.`;
}

const MEASURES = [
  ["shadows", "Shadows", "How far its shadows agree with the figure’s, from seven sides."],
  ["overlap", "Overlap", "How much of the space that both take they share."],
  ["kept", "Thin parts", "How much of legs, ears and the like is still there."],
];

/** How much a solid looks like its figure, and what it is. @param {any} card */
export function facts(card) {
  const { strain, size, group, positions: ways } = card;
  return [
    h("h2", "How alike it is"),
    h("ul.stack.measures", [
      MEASURES.map(([name, title, about]) => meter(title, card[name], percent(card[name]), about)),
    ]),
    h("p", `To get there, parts of the figure became ${percent(strain)} longer or shorter.`),
    aside(
      `${sides(size)}. ${
        ways === 1 ? "All copies lie alike" : `Its copies lie in ${ways} ways`
      }: space group ${group}.`,
    ),
  ];
}
