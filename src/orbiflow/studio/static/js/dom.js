/** Elements, controls, toasts and dialogs: what every page builds with. */

import { sentence } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";

/**
 * Make an element of a tag and classes, such as "ul.cards". Attributes, which may be left out, are as in HTML; functions
 * listen, `style` is an object. Children may stand in lists.
 *
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T | `${T}.${string}`} selector
 * @param {any} [attributes]
 * @param {...Child} children
 */
export function h(selector, attributes = {}, ...children) {
  const [tag, ...classes] = selector.split(".");
  const made = document.createElement(/** @type {T} */ (tag));
  if (attributes?.constructor !== Object) [attributes, children] = [{}, [attributes, ...children]];
  made.classList.add(...classes);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (typeof value === "function") made.addEventListener(name.replace(/^on/, ""), value);
    else if (name === "style") {
      Object.entries(value).forEach(([key, entry]) => made.style.setProperty(key, entry));
    } else if (["value", "checked"].includes(name)) made[name] = value;
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...nodes(children));
  return made;
}

/** What of children is shown, in one list. @param {Child[]} children */
const nodes = (children) =>
  /** @type {any[]} */ (children).flat(Infinity).filter((child) =>
    child !== false && child != null
  );

/** Replace all children. @param {Element} place @param {...Child} children */
export const put = (place, ...children) => place.replaceChildren(...nodes(children));

/** @param {...Child} words small print */
export const aside = (...words) => h("p.soft.small", ...words);
/** @param {...Child} words what is less important */
export const soft = (...words) => h("p.soft", ...words);
/** A part of a page by its title's id. */
export const section = (kind, id, title, ...parts) =>
  h("section", { class: `stack ${kind}`, "aria-labelledby": id }, [h("h2", { id }, title), parts]);
/** A part of a page, with a title. */
export const panel = (title, ...parts) => h("section.panel.stack", h("h2", title), ...parts);
/** @param {...Child} parts one beside the other */
export const row = (...parts) => h("div.row", ...parts);
/** @param {...Child} parts one below the other */
export const stack = (...parts) => h("div.stack", ...parts);

/** A canvas that is moved by hand and keys; its label and the id of its help are for readers of screens. */
export const handled = (kind, role, label, help = undefined) =>
  h("canvas", { class: kind, tabindex: "0", role, "aria-label": label, "aria-describedby": help });

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
  const shown = kind.includes("icon") ? [h("span.unseen", text)] : [text];
  const title = kind.includes("icon") ? text : undefined;
  return h("button", { type: "button", class: `button ${kind}`, onclick, title, ...rest }, [
    image && icon(image),
    shown,
  ]);
}

/**
 * Buttons to come nearer, go farther and see all.
 *
 * @param {(by: number) => any} zoom
 * @param {() => any} fit
 */
export const zooms = (zoom, fit) =>
  h("div.zooms", [
    button("+", () => zoom(1.35), { "aria-label": "Nearer" }),
    button("−", () => zoom(1 / 1.35), { "aria-label": "Farther" }),
    button("Fit", fit),
  ]);

let count = 0;
/** A name that no other element of the page has. @param {string} stem */
export const unique = (stem) => `${stem}-${(count += 1)}`;

/** How much there is of something, from 0 to 1, in a list. */
export const meter = (title, share, words, about) =>
  h("li", [
    h("div.share", h("strong", title), h("span", words)),
    h("meter", { value: share, "aria-label": title }),
    aside(about),
  ]);

/** Show a sentence for a while; one that is bad stays until it is closed. @param {string} text */
export function toast(text, { bad = false } = {}) {
  const box = document.querySelector("#toasts");
  if ([...box.children].some((other) => other.firstChild.textContent === text)) return;
  const made = h("div", { class: bad ? "toast bad" : "toast" }, [
    h("span", text),
    h("button", { type: "button", "aria-label": "Close", onclick: () => made.remove() }, [
      icon("close"),
    ]),
  ]);
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
  h("ul.said-notes.soft.small", texts.map((text) => h("li", sentence(text))));

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
      h("div", [
        h("header", [
          h("h2", { id }, title),
          button("Close", () => close(), { kind: "quiet icon", image: "close" }),
        ]),
        build(close),
      ]),
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
      h("footer", [
        button("Keep it", () => close(false), { autofocus: true }),
        button(verb, () => close(true), { kind: "primary" }),
      ]),
    ));
}

/**
 * Ask for a name; resolves with it, undefined if none was given.
 *
 * @param {string} title
 * @param {string} verb
 * @param {string} name that is there already
 * @param {Child[]} words above the box
 * @returns {Promise<string | undefined>}
 */
export function entered(title, verb, name, words = []) {
  const box = h("input", { type: "text", maxlength: 80, value: name, "aria-label": "Its name" });
  return dialog(title, (close) => {
    const onsubmit = (event) => {
      event.preventDefault();
      close(box.value.trim());
    };
    return h("form.stack", { onsubmit }, [words, box, h("footer", submit(verb))]);
  });
}

/** The button of a form. */
const submit = (verb) => button(verb, () => {}, { kind: "primary", type: "submit" });

/**
 * Hear the keys that undo and do again: `go(-1)` and `go(1)`.
 *
 * @param {(step: -1 | 1) => void} go
 * @param {AbortSignal} signal
 */
export function undoKeys(go, signal) {
  document.addEventListener("keydown", (event) => {
    const { key, shiftKey, altKey, target } = event;
    const isText = /** @type {Element} */ (target).matches("[type=text], [type=number], select");
    if (isText || altKey || !(event.ctrlKey || event.metaKey) || !/^[zy]$/i.test(key)) return;
    event.preventDefault();
    go(shiftKey || key.toLowerCase() === "y" ? 1 : -1);
  }, { signal });
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
