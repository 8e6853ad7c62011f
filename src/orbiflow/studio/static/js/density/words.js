/** Words of the density page. */

export const SPACES = [
  {
    name: "torus",
    title: "Angles",
    about: "Each comes back to its start, like a clock. Two angles live on a doughnut.",
    needs: "1 to 7 columns of angles",
    least: 1,
    most: 7,
  },
  {
    name: "sphere",
    title: "Directions",
    about: "Where an arrow points: places on the Earth, winds, stars.",
    needs: "latitude and longitude, or x, y, z",
    least: 2,
    most: 3,
  },
  {
    name: "projective-plane",
    title: "Lines without an arrow",
    about: "Both ends mean the same: crystals, magnetic poles, cracks in rock.",
    needs: "latitude and longitude, or x, y, z",
    least: 2,
    most: 3,
  },
  {
    name: "klein-bottle",
    title: "Theta and phi of picture patches",
    about: "How edges lie in tiny bits of photographs: a Klein bottle.",
    needs: "theta, then phi",
    least: 2,
    most: 2,
  },
];

/** @param {string} name */
export const spaceOf = (name) => SPACES.find((space) => space.name === name);

/**
 * Where rows of so many columns live, in a few words.
 *
 * @param {string} space
 * @param {number} count
 */
export function shape(space, count) {
  const angles = { 1: "One angle: a circle", 2: "Two angles: a doughnut" }[count] ??
    `${count} angles, all at once`;
  return {
    torus: angles,
    sphere: "Directions: a ball",
    "projective-plane": "Lines without an arrow: the projective plane",
    "klein-bottle": "Theta and phi: the Klein bottle",
  }[space];
}

/** A role in words. @param {string} role */
export const roleWords = (role) => {
  const [kind, value] = role.split(":");
  return {
    angle: `angle, in ${value}`,
    axial: `line without an arrow, in ${value}`,
    cycle: `comes back after ${value}`,
    ignore: "counts the rows",
  }[kind] ?? "number";
};

export const UNITS = Object.entries({
  degrees: "Degrees (360 all round)",
  radians: "Radians (6.28 all round)",
  turns: "Turns (1 all round)",
});

/** What a column that comes back may be, beside an angle. */
export const CYCLES = Object.entries({
  "cycle:24": "Hours of a day (24 all round)",
  "cycle:7": "Days of a week (7 all round)",
  "cycle:12": "Months (12 all round)",
  "axial:degrees": "Both ends alike (180° all round)",
});

/** What a density may be made of: a title, and what it is. */
export const PARTS = {
  kernels: ["Small bumps", "a soft bump around every row"],
  mixture: ["Wide bumps", "a few bumps, each over many rows"],
  chains: ["Leaning bumps", "bumps in which one angle leans on the others"],
  flow: ["Stirred dough", "an even layer, pushed into shape by a smooth flow"],
  network: ["Network", "a small neural network, one angle after the other"],
  uniform: ["Even layer", "a thin layer everywhere, for surprises"],
};

/** What a flat map leaves out. */
export const EDGES = {
  circle: "The left and the right end are one.",
  torus: "The left and the right edge are one, and so are the top and the bottom.",
  sphere: "Equal areas look equal. The left and the right edge are one.",
  "projective-plane":
    "Half of the ball, as the other is the same. Opposite points of the rim are one.",
  "klein-bottle":
    "The left and the right edge are one. So are top and bottom, one of them turned round.",
};

/**
 * A number in a few digits, with a true minus sign.
 *
 * @param {number} value
 * @param {number} [digits]
 */
export const figure = (value, digits = 3) => {
  const size = Math.abs(value);
  const text = size !== 0 && (size < 0.001 || size >= 1e5)
    ? value.toExponential(digits - 1)
    : String(Number(value.toPrecision(digits)));
  return text.replaceAll("-", "\u2212");
};
/** @param {number} value */
export const count = (value) => value.toLocaleString("en");
/** @param {number} share */
export const percent = (share) => {
  const rest = Math.min(share, 1 - share);
  return `${
    rest > 0 && rest < 0.01 ? figure(100 * share, share < 0.5 ? 1 : 3) : Math.round(100 * share)
  } %`;
};
/**
 * A place of a torus' window, from 0 to 1, in the unit of its axis.
 *
 * @param {number} place
 * @param {{low: number, period: number, texts: string[]}} axis
 */
export const angleText = (place, { low, period, texts }) => {
  const value = Number(((place + low) * period).toFixed(period > 100 ? 0 : period > 1 ? 2 : 3));
  return figure(value) + (texts[0].endsWith("°") ? "°" : "");
};
