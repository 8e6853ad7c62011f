/** Forms from the JSON Schema of an operation's settings. */

import { labelled, listed } from "./controls.js";
import { h, unique } from "./dom.js";
import { millimetres, shown, unit as lengthUnit } from "./lengths.js";
import { capital } from "./words.js";

/** The kinds of values that a schema allows, `null` apart. */
function kinds(schema) {
  const inner = schema.anyOf ? schema.anyOf.flatMap(kinds) : [schema];
  return inner.filter(({ type }) => type !== "null");
}

const label = (name) => capital(name.replaceAll("_", " "));

/** A value as a text that the server reads again: sides with their unit. */
const text = (
  value,
  unit = "",
) => (Array.isArray(value) ? value.join("x") + unit : String(value ?? ""));

/** Sides without their unit, which is then the one that is shown. */
const BARE_SIDES = /^\d+(\.\d+)?\s*[x×]\s*\d+(\.\d+)?$/;

/** What a box holds as a value: an array of texts, a number, or text. */
function read(given, found) {
  const types = found.map(({ type }) => type);
  if (types.includes("array") && !types.includes("string")) return given.split(/[;\s]+/);
  return ["number", "integer"].some((type) => types.includes(type)) && !Number.isNaN(Number(given))
    ? Number(given)
    : given;
}

/**
 * The control of one setting: {root, box, now(), value(), usual(value), show(value), reset()}. What it shows is `now`;
 * `value` is undefined where that is the default, which `usual` changes.
 */
function control(name, schema, words, changed) {
  const found = kinds(schema);
  const options = found.find((kind) => kind.enum)?.enum;
  const meaning = words?.about ?? schema.description;
  const about = meaning && h("p.soft.small", { id: unique("about") }, meaning);
  const shared = { name, "aria-describedby": about?.id, onchange: changed };
  const isLength = schema["x-unit"] === "mm";
  const unit = isLength ? lengthUnit() : schema["x-unit"];
  const title = words?.title ?? label(name);
  const yes = found.some(({ type }) => type === "boolean");
  const some = words?.some &&
    h("datalist", { id: unique("some") }, words.some.map((value) => h("option", { value })));
  let standard = schema.default ?? (yes ? false : null);
  /** @type {HTMLInputElement | HTMLSelectElement} */
  let box;
  /** @type {(value: any) => void} */
  let show;
  /** @type {() => any} */
  let get;
  if (yes) {
    const tick = box = h("input", { ...shared, type: "checkbox" });
    show = (value) => {
      tick.checked = value;
    };
    get = () => tick.checked;
  } else if (options) {
    const first = standard === null && words?.usual !== false
      ? [h("option", { value: "" }, words?.usual ?? capital(schema["x-default"] || "none"))]
      : [];
    const listing = options.map((value) =>
      h("option", { value }, words?.options?.[value] ?? capital(value))
    );
    box = h("select", shared, first, listed(listing, words?.few ?? options.length));
    show = (value) => {
      box.value = value ?? "";
    };
    get = () => box.value || null;
  } else {
    const bare = found.find(({ type }) => type === "number" || type === "integer");
    const numeric = bare && found.length === 1;
    const field = box = h("input", {
      ...shared,
      type: numeric ? "number" : "text",
      min: numeric ? bare.minimum ?? bare.exclusiveMinimum : undefined,
      max: numeric ? bare.maximum : undefined,
      step: !numeric ? undefined : bare.type === "integer" ? 1 : "any",
      autocomplete: "off",
      list: some?.id,
      inputmode: bare ? "decimal" : undefined,
    });
    let before = ["", null]; // what it shows as long as nobody changes it, and the value
    show = (value) => {
      const isNumber = isLength && typeof value === "number";
      const sides = isLength && Array.isArray(value) ? value.map(shown) : value;
      field.value = text(isNumber ? shown(value) : sides, unit);
      field.placeholder = field.value || schema["x-default"] || "";
      before = [field.value, value];
    };
    get = () => {
      const given = box.value.trim();
      if (given === "") return standard;
      if (given === before[0]) return before[1];
      if (isLength && BARE_SIDES.test(given)) return given.replace("×", "x") + unit;
      const value = read(given, found);
      return isLength && typeof value === "number" ? millimetres(value) : value;
    };
  }
  const value = () => (get() === standard ? undefined : get());
  const usual = (next) => {
    const own = value();
    standard = next;
    if (own === undefined) show(next);
  };
  show(standard);
  const named = yes
    ? h("label.check", box, title)
    : labelled(unit && !options ? `${title} (${unit})` : title, box);
  const root = h("div.field", named, some, about);
  return { root, box, now: get, value, usual, standard, show, reset: () => show(standard) };
}

/**
 * A form: the settings named in `first` on top, the rest folded away in their groups; `fixed` ones are not shown.
 * `words`: titles and the like by setting; in them `some`: texts to choose from; `not`: values of others that rule it out;
 * `sets`: whether its choice begins all others anew, but those in `keeps`.
 * `hidden`: settings that the page sets itself. `start`: values to begin with.
 * `.values()`: what differs from the defaults and applies. `.refuse(name, text)`: show what is wrong beside the
 * setting that the text begins with; false if it names none. `.take(names, values)`: set some anew.
 */
export function form(
  schema,
  { first, fixed = [], words = {}, hidden = [], start = {} },
  changed = (_) => {},
) {
  const controls = new Map();
  const presets = Object.entries(schema["x-presets"] ?? {});
  const names = Object.keys(schema.properties).filter((name) =>
    !hidden.includes(name) && !("const" in schema.properties[name])
  );
  const heard = ({ target }) => {
    const { sets, keeps = [] } = words[target.name] ?? {};
    const others = sets
      ? names.filter((name) => name !== target.name && !keeps.includes(name))
      : [];
    for (const name of others) {
      const { root, box, reset } = controls.get(name);
      reset();
      root.querySelector(".error")?.remove();
      box.removeAttribute("aria-invalid");
    }
    fit();
    changed(values());
  };
  for (const name of names) {
    controls.set(name, control(name, schema.properties[name], words[name], heard));
  }
  const begin = () =>
    names.filter((name) => start[name] !== undefined).forEach((name) =>
      controls.get(name).show(start[name])
    );

  /** Show the defaults that other choices give, and hide what does not apply to the rest, so that only what works can be set. */
  function fit() {
    const given = Object.assign(
      {},
      ...presets.map(([name, choices]) => (controls.has(name) && choices[now(name)]) || {}),
    );
    for (const [name, { usual, standard }] of controls) {
      usual(name in given ? given[name] : standard);
    }
    for (const name of names) {
      const rules = Object.entries(schema.properties[name]["x-only-with"] ?? {});
      const applies = rules.every(([other, allowed]) =>
        !controls.has(other) || [allowed].flat().includes(now(other))
      );
      const never = Object.entries(words[name]?.not ?? {}).some(([other, values]) =>
        controls.has(other) && (values.call ? values(now) : values.includes(now(other)))
      );
      controls.get(name).root.hidden = !applies || never;
    }
    for (const box of made.querySelectorAll("details, .group")) {
      box.toggleAttribute("hidden", !box.querySelector(".field:not([hidden])"));
    }
  }
  const now = (name) => controls.get(name).now();
  const rest = names.filter((name) => !first.includes(name) && !fixed.includes(name));
  const groups = Map.groupBy(rest, (name) => schema.properties[name]["x-group"] || "More");
  const made = h("div.stack.form", [
    first.filter((name) => controls.has(name)).map((name) => controls.get(name).root),
    h("details", [
      h("summary", "More"),
      [...groups].map(([group, own]) =>
        h("div.stack.group", [
          groups.size > 1 && h("h3", group),
          own.map((name) => controls.get(name).root),
        ])
      ),
    ]),
  ]);
  function values() {
    const shown = names.filter((name) => !controls.get(name).root.hidden);
    return Object.fromEntries(
      shown.map((name) => [name, controls.get(name).value()]).filter(([, value]) =>
        value !== undefined
      ),
    );
  }
  function refuse(name, text, focus = true) {
    if (!controls.has(name)) return false;
    const { root, box } = controls.get(name);
    const said = h("p.error.small", { role: "alert" }, text);
    root.querySelector(".error")?.remove();
    root.append(said);
    root.closest("details")?.setAttribute("open", "");
    box.setAttribute("aria-invalid", "true");
    const fine = () => {
      said.remove();
      box.removeAttribute("aria-invalid");
    };
    box.addEventListener("input", fine, { once: true });
    box.addEventListener("change", fine, { once: true });
    if (focus) box.focus();
    return true;
  }
  for (const _ of [1, 2]) { // what others are by a choice is known only after it
    begin();
    fit();
  }
  const known = (name) => (controls.has(name) ? now(name) : undefined);
  function take(others, chosen) {
    for (const name of others.filter((own) => controls.has(own))) {
      const { show, reset } = controls.get(name);
      if (name in chosen) show(chosen[name]);
      else reset();
    }
    fit();
    changed(values());
  }
  return Object.assign(made, { now: known, values, refuse, take });
}
