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

const ICONS = {
  upload: "M12 16V4m-5 5 5-5 5 5M4 16v3a1 1 0 0 0 1 1h14a1 1 0 0 0 1-1v-3",
  camera: "M4 8h3l2-3h6l2 3h3v11H4zM12 10a3.5 3.5 0 1 0 0 7 3.5 3.5 0 0 0 0-7",
  pencil: "m4 20 1-5L16 4l4 4L9 19zM14 6l4 4",
  copy: "M9 9h11v11H9zM5 15H4V4h11v1",
  paste: "M9 4h6v3H9zM9 5H6v15h12V5h-3",
  open: "M3 19V5h6l2 3h10v11z",
  undo: "M9 14 4 9l5-5M4 9h10a6 6 0 0 1 0 12h-3",
  redo: "m15 14 5-5-5-5m5 5H10a6 6 0 0 0 0 12h3",
  pause: "M8 5v14M16 5v14",
  play: "M7 4.5v15l12-7.5z",
  stop: "M6 6h12v12H6z",
  download: "M12 4v12m-5-5 5 5 5-5M4 20h16",
  bin: "M5 7h14M10 7V4h4v3M7 7l1 13h8l1-13",
  more: "M12 5v14M5 12h14",
  close: "m6 6 12 12M18 6 6 18",
  arrow: "M5 12h14m-6-6 6 6-6 6",
  brush: "M14 10 20 4M14 10c2 2 2 4 0 6-3 3-7 3-10 3 2-2 1-4 3-7 2-3 5-4 7-2",
  lasso: "M12 5c5 0 8 2 8 5s-3 5-8 5-8-2-8-5 3-5 8-5M8 15c-2 1-2 4 0 5",
  pin: "M9 4h6l-1 6 3 3H7l3-3zM12 13v7",
  star: "m12 4 2.4 5.2 5.6.7-4.1 3.9 1 5.6L12 16.700l-4.900 2.700 1-5.600L4 9.900l5.600-.7z",
  line: "M5 19 19 5M3 17v4h4M17 3h4v4",
  fill: "m5 12 7-7 7 7-7 7zM9 8 6 5M5 12h14M21 15c-2 3-2 5 0 5s2-2 0-5",
  eye: "M2 12c5-8 15-8 20 0-5 8-15 8-20 0zM12 9a3 3 0 1 0 0 6 3 3 0 0 0 0-6",
  rub: "m4 15 8-9 7 6-7 8H7zM9 20h11",
  cut: "M6 6a2 2 0 1 0 .1 0zM6 14a2 2 0 1 0 .1 0zM8 9l12 9M8 15 20 6",
  picture: "M4 5h16v14H4zM4 16l5-5 4 4 3-3 4 4",
  solid: "m12 3 8 4.5v9L12 21l-8-4.5v-9zM12 12l8-4.5M12 12v9M12 12 4 7.500",
  curve: "M3 17c4 0 5-11 9-11s5 11 9 11M3 20h18",
  film: "M4 5h16v14H4zM8 5v14M16 5v14M4 12h16",
  laser: "M12 2v8M12 14v1M6 21h12M8 17l-2-1M16 17l2-1M12 18v-1",
  jigsaw: "M4 8h5a2 2 0 1 1 4 0h7v5a2 2 0 1 0 0 4v4H4z",
  poster: "M5 3h14v18H5zM5 12h14M12 3v18",
  fabric: "M3 5c4-3 6 3 9 0s5 3 9 0v14c-4 3-6-3-9 0s-5-3-9 0zM9 9h1M14 9h1M9 14h1M14 14h1",
  mug: "M4 6h12v13H4zM16 9h2a3 3 0 0 1 0 7h-2",
  sticker: "M12 3a9 9 0 1 0 9 9h-5a4 4 0 0 1-4-4zM12 3l9 9",
  stamp: "M10 12c1-3-1-4-1-6a3 3 0 1 1 6 0c0 2-2 3-1 6zM5 12h14v5H5zM5 21h14",
  cutter: "M12 3l2.5 5.5 6 .6-4.5 4 1.3 6L12 16l-5.3 3.1 1.3-6-4.5-4 6-.6z",
  ball: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18M3 12c5 4 13 4 18 0M12 3c-5 5-5 13 0 18",
  page: "M6 3h8l4 4v14H6zM14 3v4h4M9 12h6M9 16h6",
};

/**
 * An icon; words stand beside it, so readers of screens skip it.
 *
 * @param {keyof typeof ICONS} name
 */
export function icon(name) {
  const made = document.createElementNS(SVG, "svg");
  const path = document.createElementNS(SVG, "path");
  made.setAttribute("viewBox", "0 0 24 24");
  made.setAttribute("aria-hidden", "true");
  made.classList.add("icon-svg");
  path.setAttribute("d", ICONS[name]);
  made.append(path);
  return made;
}

/**
 * A button with a text, and an icon if one is named; `kind`: classes such as "primary".
 *
 * @param {string} text
 * @param {(event: MouseEvent) => any} onclick
 * @param {{ kind?: string, image?: keyof typeof ICONS, [attribute: string]: any }} [options]
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
 * @param {[value: V, words: string, image?: keyof typeof ICONS][]} options
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
