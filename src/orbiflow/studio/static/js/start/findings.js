/** What there is to say of what was read of a picture. */

import { button, h, notes } from "../dom.js";
import { number, sentence } from "../words.js";

const MANY = 6; // parts left out, from which a picture is a photograph with a background

/**
 * What may be wrong, what was left out, and how it was read; `grow` makes thin parts thicker.
 *
 * @param {Silhouette} silhouette
 * @param {(share: number) => void} grow
 */
export function findings({ doubts, notes: said, left_out: others = [] }, grow) {
  const out = others.length;
  return h("ul.notes.stack", [
    doubts.map((text) =>
      h("li.notice.stack", [
        sentence(text),
        text.includes("(Thin parts)") &&
        button("Make thin parts thicker", () => grow(text.includes("thread") ? 0.1 : 0.04), {
          kind: "quiet",
        }),
      ])
    ),
    out > 0 &&
    h("li", [
      h("span.swatch"),
      `${number(out, "part is", "parts are")} left out: a tile is one piece. `,
      out < MANY
        ? `Paint a bridge with “Add” to keep ${out === 1 ? "it" : "them"}.`
        : "A busy photograph? Draw round the head with “Add” and the lasso, then “Remove” what is too much.",
    ]),
    said.length > 0 && h("li", notes(said)),
  ]);
}
