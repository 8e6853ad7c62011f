/** Lengths in the unit that this browser shows: millimetres or inches. */

const KEY = "orbiflow.unit";
const UNITS = { mm: 1, cm: 10, m: 1000, in: 25.4, pt: 25.4 / 72 };

/** @returns {"mm" | "in"} */
export const unit = () => (localStorage.getItem(KEY) === "in" ? "in" : "mm");
/** @param {"mm" | "in"} chosen */
export const showIn = (chosen) => localStorage.setItem(KEY, chosen);

/** A number of mm in the unit that is shown, or one of that unit in mm. */
export const shown = (length) => Number((length / UNITS[unit()]).toPrecision(4));
export const millimetres = (number) => Number((number * UNITS[unit()]).toFixed(4));

/** Lengths in words, such as "40.0 mm" or "1.57 × 0.79 in". */
export const measure = (...lengths) =>
  `${
    lengths.map((own) => (own / UNITS[unit()]).toFixed(unit() === "in" ? 2 : 1)).join(" × ")
  } ${unit()}`;

/** A length in mm from a number or a text such as "4 cm"; undefined if it is none. */
export function lengthIn(value) {
  const found = /^\s*([\d.]+)\s*(mm|cm|m|in|pt)?\s*$/.exec(String(value ?? ""));
  const length = found ? Number(found[1]) * UNITS[found[2] ?? "mm"] : NaN;
  return length > 0 ? length : undefined;
}
