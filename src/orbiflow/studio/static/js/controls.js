/** Controls: what is ticked, chosen, pulled along a scale, each of which can be set anew. */

import { h, icon, unique } from "./dom.js";

/** Palettes that are seen before "More". */
export const FEW_PALETTES = 6;

/** Options of a list; after the first few, under "More". */
export const listed = (options, few) => [
  ...options.slice(0, few),
  options.length > few && h("optgroup", { label: "More" }, options.slice(few)),
];

/** A box to tick. `.is()` tells whether it is ticked, `.set(value)` changes it. */
export function check(words, checked, onchange) {
  const box = h("input", { type: "checkbox", checked, onchange: () => onchange(box.checked) });
  const set = (value) => {
    box.checked = value;
  };
  return Object.assign(h("label.check", box, h("span", words)), { is: () => box.checked, set });
}

/** A field for files that a button opens. */
export function chooser(label, use, attributes) {
  const box = h("input", {
    type: "file",
    hidden: true,
    "aria-label": label,
    ...attributes,
    onchange: () => {
      const [file] = box.files;
      box.value = ""; // the same file can be chosen again
      if (file) use(file);
    },
  });
  return box;
}

/**
 * One of a few, as buttons side by side. `.set(value)` changes it.
 *
 * @template V
 * @param {string} label
 * @param {[value: V, words: string, image?: string][]} options
 * @param {V} value
 * @param {(value: V) => any} onchange
 * @param {{ unseen?: boolean }} [look]
 */
export function choice(label, options, value, onchange, { unseen = false } = {}) {
  const name = unique("choice");
  const boxes = options.map(([own]) =>
    h("input", {
      type: "radio",
      name,
      value: String(own),
      checked: own === value,
      onchange: () => onchange(own),
    })
  );
  /** @type {(option: [V, string, string?], k: number) => HTMLElement} */
  const shown = ([, words, image], k) =>
    h("label", boxes[k], h("span", image && icon(image), words));
  const made = h("fieldset.choice", [
    h("legend", { class: unseen && "unseen" }, label),
    h("div", options.map(shown)),
  ]);
  return Object.assign(made, {
    /** @param {V} chosen */
    set: (chosen) =>
      boxes.forEach((box, k) => {
        box.checked = options[k][0] === chosen;
      }),
  });
}

/**
 * A slider that says its value in words. `.set(value)` changes it.
 *
 * @param {string} label
 * @param {[min: number, max: number, step: number]} range
 * @param {number} value
 * @param {(value: number) => string} said
 * @param {(value: number) => any} oninput
 */
export function slider(label, [min, max, step], value, said, oninput) {
  const shown = h("output");
  const box = h("input", { type: "range", min, max, step, value });
  const tell = () => {
    shown.textContent = said(box.valueAsNumber);
    box.setAttribute("aria-valuetext", shown.textContent);
  };
  box.oninput = () => {
    tell();
    oninput(box.valueAsNumber);
  };
  tell();
  const [words] = labelled(label, box);
  shown.htmlFor.value = box.id;
  /** @param {number} number */
  const set = (number) => {
    box.valueAsNumber = number;
    tell();
  };
  return Object.assign(h("div.slider", words, shown, box), { set });
}

/**
 * A box with its label before it.
 *
 * @template {HTMLElement} B
 * @param {string} words
 * @param {B} box
 * @returns {[HTMLLabelElement, B]}
 */
export function labelled(words, box) {
  box.id ||= unique("box");
  return [h("label.label", { for: box.id }, words), box];
}

/**
 * A list of which one is chosen; after the first `few`, options are under "More".
 *
 * @param {[value: string | number, words: string][]} options
 * @param {string | number} value
 * @param {(value: string) => any} [onchange]
 */
export function select(options, value, onchange, few = options.length) {
  const all = options.map(([own, words]) => h("option", { value: own }, words));
  const box = h("select", { onchange: () => onchange?.(box.value) }, listed(all, few));
  box.value = String(value);
  return box;
}

/**
 * Controls of an object's values, each of which tells what it is changed to: `change({ [name]: value })`. `show()` lets
 * all show what the values are now.
 *
 * @param {Record<string, any>} values
 * @param {(what: Record<string, any>) => any} change
 */
export function controlsOf(values, change) {
  const made = [];
  const tell = (name) => (value) => change({ [name]: value });
  /** @template {HTMLElement & { set(value: any): void }} C @param {string} name @param {C} control */
  const kept = (name, control) => {
    made.push(() => control.set(values[name]));
    return control;
  };
  return {
    show: () => made.forEach((show) => show()),
    /** @param {string} name @param {string} words */
    check: (name, words) => kept(name, check(words, values[name], tell(name))),
    /** @param {string} name @param {string} words @param {any[]} options @param {{ unseen?: boolean }} [look] */
    choice: (name, words, options, look) =>
      kept(name, choice(words, options, values[name], tell(name), look)),
    /** @param {string} name @param {string} words @param {any} range @param {(value: number) => string} said */
    slider: (name, words, range, said) =>
      kept(name, slider(words, range, values[name], said, tell(name))),
  };
}
