/** Machines with their materials: settings that are kept under a name, for all projects. */

import { labelled, select } from "../controls.js";
import { button, entered, h, put, row, trying } from "../dom.js";

/**
 * The choice of a profile for a form; `memory` keeps its name while the form's values are kept.
 *
 * @param {Api} api
 * @param {any} form
 * @param {{ profile?: string }} memory
 */
export function profiles(api, form, memory) {
  const list = select([], "", take);
  const drop = button("Forget it", () => change("remove", memory.profile), { kind: "quiet" });
  const root = h("div.field", [
    labelled("Machine and material", list),
    row(button("Keep these settings …", keep, { kind: "quiet" }), drop),
  ]);
  /** @type {{ settings: string[], kept: Record<string, any>, name?: string }} */
  let told = { settings: [], kept: {} };

  function show() {
    if (!(memory.profile in told.kept)) memory.profile = "";
    put(
      list,
      new Option("None in particular", ""),
      Object.keys(told.kept).map((name) => new Option(name)),
    );
    list.value = memory.profile;
    drop.hidden = !memory.profile;
  }
  function take(name) {
    memory.profile = name;
    show();
    form.take(told.settings, told.kept[name] ?? {});
  }
  /** @param {"put" | "remove"} how */
  const change = (how, name, body = {}) =>
    trying(async () => {
      told = await api[how](`profiles?name=${encodeURIComponent(name)}`, body);
      memory.profile = told.name;
      show();
    });
  async function keep() {
    const name = await entered("Keep machine and material", "Keep", memory.profile, [
      h("p", "Give them a name, such as “my K40, 3 mm birch”. The command line takes it, too."),
    ]);
    const values = Object.entries(form.values()).filter(([own]) => told.settings.includes(own));
    if (name) await change("put", name, Object.fromEntries(values));
  }
  trying(async () => {
    told = await api.get("profiles");
    show();
  });
  return root;
}
