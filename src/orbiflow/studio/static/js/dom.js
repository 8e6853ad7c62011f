/** Elements, controls, toasts and dialogs: what every page builds with. */

import { sentence } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";

/**
 * Make an element. Attributes, which may be left out, are as in HTML; functions listen, `style` is an object.
 *
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {any} [attributes]
 * @param {...Child} children
 */
export function h(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  if (attributes?.constructor !== Object) [attributes, children] = [{}, [attributes, ...children]];
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (typeof value === "function") made.addEventListener(name.replace(/^on/, ""), value);
    else if (name === "style") {
      Object.entries(value).forEach(([key, entry]) => made.style.setProperty(key, entry));
    } else if (["value", "checked", "srcObject", "muted"].includes(name)) made[name] = value;
    else made.setAttribute(name, value === true ? "" : value);
  }
  /** @type {any[]} */
  const all = children.flat();
  made.append(...all.filter((child) => child !== null && child !== undefined && child !== false));
  return made;
}

/** @param {...Child} words small print */
export const aside = (...words) => h("p", { class: "soft small" }, ...words);
/** @param {...Child} words what is less important */
export const soft = (...words) => h("p", { class: "soft" }, ...words);
/** A part of a page by its title's id. */
export const section = (kind, id, title, ...parts) =>
  h(
    "section",
    { class: `stack ${kind}`, "aria-labelledby": id },
    h("h2", { id }, title),
    ...parts,
  );
/** A part of a page, with a title. */
export const panel = (title, ...parts) =>
  h("section", { class: "panel stack" }, h("h2", title), ...parts);
/** @param {...Child} parts one beside the other */
export const row = (...parts) => h("div", { class: "row" }, ...parts);
/** @param {...Child} parts one below the other */
export const stack = (...parts) => h("div", { class: "stack" }, ...parts);

/** An icon of `icons.svg`; words stand beside it, so readers of screens skip it. @param {string} name */
export function icon(name) {
  const made = document.createElementNS(SVG, "svg");
  const use = made.appendChild(document.createElementNS(SVG, "use"));
  made.setAttribute("viewBox", "0 0 24 24");
  made.setAttribute("aria-hidden", "true");
  made.classList.add("icon-svg");
  use.setAttribute("href", `icons.svg#${name}`);
  return made;
}

/**
 * A button with a text, and an icon if one is named; `kind`: classes such as "primary".
 *
 * @param {string} text
 * @param {(event: MouseEvent) => any} onclick
 * @param {{ kind?: string, image?: string, [attribute: string]: any }} [options]
 */
export function button(text, onclick, { kind = "", image, ...rest } = {}) {
  const shown = kind.includes("icon") ? [h("span", { class: "unseen" }, text)] : [text];
  const title = kind.includes("icon") ? text : undefined;
  return h(
    "button",
    { type: "button", class: `button ${kind}`, onclick, title, ...rest },
    image && icon(image),
    ...shown,
  );
}

/**
 * Buttons to come nearer, go farther and see all.
 *
 * @param {(by: number) => any} zoom
 * @param {() => any} fit
 */
export const zooms = (zoom, fit) =>
  h(
    "div",
    { class: "zooms" },
    button("+", () => zoom(1.35), { "aria-label": "Nearer" }),
    button("−", () => zoom(1 / 1.35), { "aria-label": "Farther" }),
    button("Fit", fit),
  );

/** Palettes that are seen before "More". */
export const FEW_PALETTES = 6;

/** Options of a list; after the first few, under "More". */
export const listed = (options, few) => [
  ...options.slice(0, few),
  options.length > few && h("optgroup", { label: "More" }, options.slice(few)),
];

/** A box to tick. */
export const check = (words, checked, onchange) =>
  h(
    "label",
    { class: "check" },
    h("input", { type: "checkbox", checked, onchange: ({ target }) => onchange(target.checked) }),
    h("span", words),
  );

let count = 0;
/**
 * A name that no other element of the page has.
 *
 * @param {string} stem
 */
export const unique = (stem) => `${stem}-${(count += 1)}`;

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
  const made = h(
    "fieldset",
    { class: "choice" },
    h("legend", { class: unseen && "unseen" }, label),
    h(
      "div",
      options.map(([, words, image], k) =>
        h("label", boxes[k], h("span", image && icon(image), words))
      ),
    ),
  );
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
 * @param {{ min: number, max: number, step: number, value: number, said?: (value: number) => string }} range
 * @param {(value: number) => any} oninput
 */
export function slider(label, { min, max, step, value, said = String }, oninput) {
  const id = unique("slider");
  const shown = h("output", { for: id });
  const box = h("input", {
    type: "range",
    id,
    min,
    max,
    step,
    oninput: () => {
      tell();
      oninput(Number(box.value));
    },
  });
  const tell = () => {
    shown.textContent = said(Number(box.value));
    box.setAttribute("aria-valuetext", shown.textContent);
  };
  const made = h(
    "div",
    { class: "slider" },
    h("label", { for: id, class: "label" }, label),
    shown,
    box,
  );
  /** @param {number} number */
  const set = (number) => {
    box.value = String(number);
    tell();
  };
  set(value);
  return Object.assign(made, { set });
}

/**
 * Show a sentence for a while; one that is bad stays until it is closed.
 *
 * @param {string} text
 */
export function toast(text, { bad = false } = {}) {
  const box = document.querySelector("#toasts");
  if ([...box.children].some((other) => other.firstChild.textContent === text)) return;
  const made = h(
    "div",
    { class: bad ? "toast bad" : "toast" },
    h("span", text),
    h(
      "button",
      { type: "button", "aria-label": "Close", onclick: () => made.remove() },
      icon("close"),
    ),
  );
  box.append(made);
  while (box.children.length > 3) box.firstChild.remove();
  if (!bad) setTimeout(() => made.remove(), 6000);
}

/**
 * What a reading or a search has to say, a sentence each; nothing for none.
 *
 * @param {string[]} texts
 */
export const notes = (texts) =>
  texts.length > 0 &&
  h("ul", { class: "said-notes soft small" }, texts.map((text) => h("li", sentence(text))));

/**
 * Call a function that may fail; if it does, say why.
 *
 * @template R
 * @param {() => R | Promise<R>} work
 */
export async function trying(work) {
  try {
    return await work();
  } catch (error) {
    if (error.name !== "AbortError") toast(error.message, { bad: true });
    return undefined;
  }
}

/**
 * Open a dialog; resolves with what `close(value)` is given, undefined if it was dismissed.
 *
 * @param {string} title
 * @param {(close: (value?: any) => void) => HTMLElement} build
 * @returns {Promise<any>}
 */
export function dialog(title, build) {
  return new Promise((resolve) => {
    const id = unique("dialog");
    let result;
    const made = h("dialog", {
      "aria-labelledby": id,
      onclose: () => {
        made.remove();
        resolve(result);
      },
    });
    const close = (value) => {
      result = value;
      made.close();
    };
    made.append(
      h(
        "div",
        h(
          "header",
          h("h2", { id }, title),
          button("Close", () => close(), { kind: "quiet icon", image: "close" }),
        ),
        build(close),
      ),
    );
    document.body.append(made);
    made.showModal();
  });
}

/**
 * Ask before something that cannot be taken back.
 *
 * @param {string} title
 * @param {string} text
 * @param {string} verb
 */
export function confirmed(title, text, verb) {
  return dialog(title, (close) =>
    stack(
      h("p", text),
      h(
        "footer",
        button("Keep it", () => close(false), { autofocus: true }),
        button(verb, () => close(true), { kind: "primary" }),
      ),
    ));
}

/**
 * A function that does `work` for its newest arguments only, when calls have paused for `ms`;
 * `.done()` does at once what waits, and resolves when all is done.
 *
 * @template {any[]} Given
 * @param {(...given: Given) => any} work
 */
export function newest(work, ms = 250) {
  let timer = 0;
  let running = null;
  let waiting = null;
  const go = async () => {
    clearTimeout(timer);
    while (running || waiting) {
      if (!running) {
        const given = waiting;
        waiting = null;
        running = trying(() => work(...given)).then(() => {
          running = null;
        });
      }
      await running;
    }
  };
  const made = (...given) => {
    waiting = given;
    clearTimeout(timer);
    timer = setTimeout(go, ms);
  };
  made.done = go;
  return made;
}

const sheets = new Map();
/**
 * Use a page's style sheets, and no other page's; resolves when they apply.
 *
 * @param {...string} names
 */
export async function style(...names) {
  for (const name of names.filter((own) => !sheets.has(own))) {
    const link = h("link", { rel: "stylesheet", href: `css/${name}.css` });
    const ready = new Promise((resolve) => {
      link.onload = link.onerror = resolve;
    });
    sheets.set(name, { link, ready });
    document.head.append(link);
  }
  await Promise.all(names.map((name) => sheets.get(name).ready));
  for (const [other, { link }] of sheets) link.disabled = !names.includes(other);
}

/**
 * Replace all children.
 *
 * @param {Element} place
 * @param {...Child} children
 */
export function put(place, ...children) {
  /** @type {any[]} */
  const all = children.flat();
  place.replaceChildren(...all.filter(Boolean));
}
