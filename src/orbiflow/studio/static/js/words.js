/** Words that several pages share. */

export const STAGES = { sketch: "first sketch", better: "getting better", final: "finished" };

export const EFFORTS = { fast: "Quick", normal: "Careful" };
export const EFFORT_MEANINGS = {
  fast: "The best of fewer tries.",
  normal: "Usually better, and slower.",
};

export const OBJECTIVES = { likeness: "Looks alike", overlap: "Covers it best" };
export const OBJECTIVE_MEANINGS = {
  likeness: "The shape bends until it fits, and keeps its head, legs and tail.",
  overlap: "The tile covers as much of the shape as it can. Thin parts may get lost.",
};

export const STATES = {
  waiting: "Waiting its turn",
  running: "At work",
  paused: "Paused",
  done: "Done",
  failed: "Did not work",
  cancelled: "Stopped",
};

/** What there is to say of a task that waits, failed, or has been ended; undefined of others. */
export function waitWords({ state, place, error }) {
  if (state === "failed") return sentence(error);
  if (state === "waiting") {
    return place > 0
      ? `Waiting: ${number(place, "other thing")} to do first.`
      : "It starts in a moment.";
  }
  return ["done", "running"].includes(state) ? undefined : `${STATES[state]}.`;
}

/** Whether a task may still do something. @param {Task | null | undefined} task */
export const alive = (task) => ["waiting", "running", "paused"].includes(task?.state);

/**
 * Whether a tile was found for an outline that has been changed since.
 *
 * @param {Pick<Card, "found_for">} card
 * @param {Project} project
 */
export function isOutdated({ found_for: marks = [] }, project) {
  const now = [project, project.second].map((own) => own ? own.silhouette?.mark : "none");
  return marks.some((mark, k) => now[k] && now[k] !== mark);
}

/**
 * @param {number} count
 * @param {string} one
 * @param {string} [many]
 */
export const number = (count, one, many = `${one}s`) => `${count} ${count === 1 ? one : many}`;

/** @typedef {Pick<Card, "stars" | "figures">} Starred */

/**
 * "★★★½" for sight and "3.5 of 5 stars" for hearing; of two figures those of each, on a line.
 *
 * @param {Starred} card
 * @returns {string}
 */
export function starText({ stars, figures = [] }) {
  if (!figures.length) return `${"★".repeat(Math.floor(stars))}${stars % 1 ? "½" : ""}`;
  const one = figures.every(({ name }) => name === figures[0].name);
  return figures.map((own) => `${one ? "" : `${own.name} `}${starText({ stars: own.stars })}`)
    .join(one ? " · " : "\n");
}
/** @param {Starred} card @returns {string} */
export function starWords({ stars, figures }) {
  if (!figures) return stars ? `${stars} of 5 stars` : "not rated yet";
  return figures.map((own) => `${own.name}: ${starWords({ stars: own.stars })}`).join(", ");
}

/**
 * The names of the figures that divide a tile, "" if it is one figure.
 *
 * @param {{ figures?: { name: string }[] }} card
 */
export const named = ({ figures = [] }) =>
  [...new Set(figures.map(({ name }) => name))].join(" and ");

/** @param {string} text */
export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/**
 * What the server says, as a sentence: names of settings become words, names of files stay.
 *
 * @param {string} text
 */
export function sentence(text) {
  if (!text) return "";
  const plain = text.replace(/\b[a-z]+(_[a-z]+)+\b(?!\.)/g, (name) => name.replaceAll("_", " "));
  const begun = /^[a-z]+[ ,:]/.test(plain) ? capital(plain) : plain;
  return /[.!?…]$/.test(begun) ? begun : `${begun}.`;
}

/**
 * How long ago a moment was. Moments: ISO texts, or seconds since 1970.
 *
 * @param {string | number} moment
 */
export function ago(moment) {
  const then = typeof moment === "number" ? moment * 1000 : Date.parse(moment);
  const seconds = (Date.now() - then) / 1000;
  /** @type {[Intl.RelativeTimeFormatUnit, number][]} */
  const units = [["day", 86400], ["hour", 3600], ["minute", 60]];
  const [unit, size] = units.find(([, length]) => seconds >= length) ?? [null, 1];
  if (!unit) return "just now";
  const words = new Intl.RelativeTimeFormat("en", { numeric: "auto" });
  return words.format(-Math.floor(seconds / size), unit);
}

/** How large a file is. @param {number} count */
export function bytes(count) {
  if (count < 1e3) return `${count} bytes`;
  return count < 1e6 ? `${(count / 1e3).toFixed(0)} kB` : `${(count / 1e6).toFixed(1)} MB`;
}
