/** Words about a fit: how well it fits, and what it is made of. */

import { aside, h, panel, soft } from "../dom.js";
import { partBar } from "./watch.js";
import { count, figure, PARTS, percent } from "./words.js";

/** How likely rows are, those of the fit and those that were kept aside. @param {any} fit */
export function likelihood(fit) {
  const { natural: mean, natural_rows: rows, uniform } = fit.likelihood,
    { validation: kept, start_nll: before, validation_nll: after } = fit,
    times = (nats) => figure(Math.exp(nats), 2);
  const which = rows === fit.rows
    ? `all ${count(rows)} rows`
    : `${count(rows)} of the ${count(fit.rows)} rows, drawn at random`;
  return panel("How well it fits", [
    h("p.big", `Rows are ${times(mean - uniform)} times as likely as by chance`),
    h("p", [
      `Mean log density: ${figure(mean, 4)} nats, over ${which} that it was made from. `,
      `If all places were alike it would be ${figure(uniform, 4)}.`,
    ]),
    soft(
      `The fairer test: ${count(kept)} rows were kept aside in turn while it was made. `,
      `They were ${times(before - after)} times as likely as by chance.`,
    ),
  ]);
}

/** What a density is made of, and what was tried. @param {any} fit */
export function parts(fit) {
  const { components, weights, notes } = fit;
  const said = ({ name, share, gain, error }) =>
    partBar(
      name,
      share,
      percent(share),
      gain === undefined
        ? ""
        : gain > error
        ? `Without it, rows would be ${figure(100 * (1 - Math.exp(-gain)), 2)} % less likely.`
        : "The others could do without it.",
    );
  const used = components.filter(({ share }) => share > 0).sort((one, other) =>
    other.share - one.share
  );
  const idle = components.filter(({ share }) => !share).map(({ name }) => PARTS[name]?.[0] ?? name);
  if (weights?.uniform) used.push({ name: "uniform", share: weights.uniform });
  return panel("What it is made of", [
    h("ul.parts.stack", used.map(said)),
    idle.length > 0 &&
    aside(`Also tried, and not needed: ${idle.join(", ").toLowerCase()}.`),
    h("details", [
      h("summary", "Notes of the fit"),
      h("ul.notes.soft.small", notes.map((note) => h("li", note))),
    ]),
  ]);
}
