/** Machines with their materials: settings that are kept under a name, for all projects. */

import { button, dialog, h, put, row, stack, trying, unique } from "../dom.js";

/**
 * The choice of a profile for a form.
 *
 * @param {Api} api
 * @param {any} form
 */
export function profiles(api, form) {
  let chosen = "";
  const id = unique("profile");
  const list = h("select", { id, onchange: () => take(list.value) });
  const drop = button("Forget it", () => change("remove", chosen), { kind: "quiet" });
  const root = h(
    "div",
    { class: "field" },
    h("label", { for: id, class: "label" }, "Machine and material"),
    list,
    row(button("Keep these settings …", keep, { kind: "quiet" }), drop),
  );
  /** @type {{ settings: string[], kept: Record<string, any> }} */
  let told = { settings: [], kept: {} };

  function show() {
    if (!(chosen in told.kept)) chosen = "";
    put(
      list,
      h("option", { value: "" }, "None in particular"),
      Object.keys(told.kept).map((name) => h("option", { value: name }, name)),
    );
    list.value = chosen;
    drop.hidden = !chosen;
  }
  function take(name) {
    chosen = name;
    show();
    form.take(told.settings, told.kept[name] ?? {});
  }
  /** @param {"put" | "remove"} how */
  const change = (how, name, body = {}) =>
    trying(async () => {
      told = await api[how](`profiles?name=${encodeURIComponent(name)}`, body);
      if (how === "put") chosen = name;
      show();
    });
  async function keep() {
    const box = h("input", { type: "text", maxlength: 80, value: chosen, "aria-label": "Name" });
    const name = await dialog("Keep machine and material", (close) =>
      stack(
        h("p", "Give them a name, such as “my K40, 3 mm birch”. The command line takes it, too."),
        box,
        h(
          "footer",
          button("Keep", () => close(box.value.trim().replace(/\s+/g, " ")), { kind: "primary" }),
        ),
      ));
    if (name) await change("put", name, values());
  }
  const values = () =>
    Object.fromEntries(
      Object.entries(form.values()).filter(([own]) => told.settings.includes(own)).sort(),
    );
  trying(async () => {
    told = await api.get("profiles");
    const now = JSON.stringify(values());
    const holds = ([_, kept]) =>
      JSON.stringify(Object.fromEntries(Object.entries(kept).sort())) === now;
    chosen = Object.entries(told.kept).find(holds)?.[0] ?? "";
    show();
  });
  return root;
}
