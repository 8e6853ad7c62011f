/** The density page: a table, where its rows live, the fit, and what it shows. */

import { button, h, put, row, style, trying } from "../dom.js";
import { alive, capital } from "../words.js";
import { Result } from "./result.js";
import { chooseSpace, chooseTable } from "./table.js";
import { Watch } from "./watch.js";

/** @type {Show} */
export async function show(root, page) {
  const { api, events, project } = page, path = `projects/${project.id}/density`;
  await style("density");
  const body = h("div.stack"),
    problem = h("div", {}),
    actions = h("div.row");
  put(root, [
    h("div.density.stack", [
      row(h("h1.grow", { tabindex: "-1" }, "See where your data crowd"), actions),
      problem,
      body,
    ]),
  ]);
  let state = await api.get(path), shown = "", part = null, changing = false;

  const newest = (operation) => project.tasks.find((task) => task.operation === operation);
  const start = (settings) =>
    trying(async () => {
      await api.start(project, "density fit", settings);
      changing = false;
    });
  /** Which part of the page it is time for, and a word that changes when it must be built again. */
  function wanted() {
    const reading = newest("density table"), fitting = newest("density fit");
    if (alive(reading)) return ["reading", `reading ${reading.id}`];
    if (alive(fitting)) return ["watch", `watch ${fitting.id}`];
    if (state.fit && !changing) return ["result", `result ${state.fit.number}`];
    if (state.table) return ["space", `space ${reading?.id}`];
    return ["table", "table"];
  }

  function build() {
    const [kind, word] = wanted();
    if (kind === "watch" && part instanceof Watch && shown === word) {
      part.update(newest("density fit"));
    }
    if (shown === word) return;
    shown = word;
    part?.stop?.();
    part = null;
    const again = button("Change what is fitted", () => {
      changing = true;
      build();
    }, { image: "pencil" });
    const back = button("Back to the density", () => {
      changing = false;
      build();
    }, { image: "undo" });
    put(actions, [
      kind === "result" && again,
      kind === "space" && state.fit && back,
      ["result", "space"].includes(kind) && button("Another table", another),
    ]);
    if (kind === "table") put(body, intro(), chooseTable(page, state.examples));
    if (kind === "reading") {
      put(body, h("p.panel", { role: "status" }, "Reading the table …"));
    }
    if (kind === "space") {
      put(body, chooseSpace(state.table, start, state.fit && { ...state.fit, why: "" }));
    }
    if (kind === "watch") {
      part = new Watch(page, newest("density fit"));
      put(body, part.root);
    }
    if (kind === "result") (part = new Result(page, state.fit)).show(body);
  }

  const another = () =>
    trying(async () => page.navigate(`d/${(await api.post("projects", { kind: "density" })).id}`));
  const intro = () =>
    h(
      "p.soft.lead",
      "A density says where rows of a table are likely. It is made for numbers that go round: angles, directions, axes.",
    );

  const STEPS = ["density table", "density fit"];
  let told = undefined;
  /** Say what went wrong in the newest step, if anything did. */
  function complain() {
    const fault = STEPS.map(newest).find((task) => task?.state === "failed");
    if (fault?.id === told) return;
    told = fault?.id;
    put(problem, fault && h("p.error", { role: "alert" }, `${capital(fault.error)}.`));
  }

  async function hear(task) {
    if (!STEPS.includes(task.operation)) return;
    if (!alive(task)) state = await api.get(path);
    complain();
    build();
  }
  events.on("task", (task) => trying(() => hear(task)), page.signal);
  const refresh = async () => {
    state = await api.get(path);
    build();
  };
  events.on("refresh", () => trying(refresh), page.signal);
  build();
  complain();
  return () => {
    // a project that nobody brought a table to is not kept
    const empty = !state.table && !project.tasks.length;
    part?.stop?.();
    return empty && api.remove(`projects/${project.id}`).catch(() => {});
  };
}
