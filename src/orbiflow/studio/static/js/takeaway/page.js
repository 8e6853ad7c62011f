/** Take a tile away: to print or cut, as a picture, a solid or an animation, or the whole project. */

import { button, choice, h, icon, newest, put, style, trying } from "../dom.js";
import { form } from "../forms.js";
import { paintCard } from "../tiling.js";
import { alive, bytes, capital, sentence } from "../words.js";
import { KINDS, colours, lengthIn } from "./kinds.js";
import { trueSize } from "./truesize.js";

const DRAWN = ["export", "art"]; // what a drawing or the picture can be laid on
const NEVER = ["tile", "result", "out", "force", "picture", "drawing"]; // the page's own
const PICTURES = ["png", "jpg", "jpeg", "webp", "svg"];

export async function show(root, { api, events, project, tileId, navigate, about }) {
  const card = project.tiles.find(({ id }) => id === tileId);
  if (!card) throw new Error("This tile is not there any more.");
  await style("takeaway");
  const place = `projects/${project.id}`;
  const schemas = new Map();
  const state = { kind: "export", task: null, form: null };
  const { palette, value: chosen, options } = colours(project, about);

  const heading = h("h1", { tabindex: "-1" }, "Take it away");
  const wishes = h("div", { class: "stack" });
  const shown = h("div", { class: "preview" });
  const said = h("div", { class: "stack said", role: "status" });
  const make = button("Make it", () => trying(() => (alive(state.task) ? api.post(`tasks/${state.task.id}/cancel`) : start())), { kind: "primary big" });
  const own = trueSize(card.polygon, card.y_down);
  const real = h("section", { class: "panel stack real", "aria-labelledby": "true" }, h("h2", { id: "true" }, "In its true size"), own.root);
  const earlier = h("section", { class: "stack earlier", "aria-labelledby": "earlier" });

  async function choose(kind) {
    state.kind = kind;
    const { first, words } = KINDS[kind];
    if (!schemas.has(kind)) schemas.set(kind, await api.get(`operations/${kind}/schema`));
    if (state.kind !== kind) return;
    const schema = structuredClone(schemas.get(kind));
    const { palette: own } = schema.properties;
    if (own) own.enum = Object.keys(options);
    const { strokes, eyes } = project.view?.drawing ?? {};
    state.own = DRAWN.includes(kind) ? [
      (strokes?.length || eyes?.length) && ["drawing", "With what you drew on it", true],
      PICTURES.includes(project.input?.type) && ["picture", "With the picture itself on each tile", false],
    ].filter(Boolean).map(([name, said, checked]) => [name, h("input", { type: "checkbox", checked, onchange: () => changed() }), said]) : [];
    state.form = form(schema, {
      first, words: { ...words, palette: { ...words.palette, options } }, hidden: NEVER, start: own && { palette: chosen },
    }, changed);
    put(wishes, state.own.map(([, box, words]) => h("label", { class: "check" }, box, words)), state.form);
    state.task = null;
    changed();
    tell();
  }

  /** Show the size at once; what was made before is no longer what is asked for. */
  function changed() {
    const size = lengthIn(state.form.now("tile_size"));
    real.hidden = !(size && KINDS[state.kind].solid);
    if (!real.hidden) own.show(size);
    if (state.task && !alive(state.task)) { state.stale = true; tell(); }
  }

  async function start() {
    const own = state.own.filter(([, box]) => box.checked).map(([name]) => [name, true]);
    const settings = { tile: tileId, ...Object.fromEntries(own), ...state.form.values() };
    try {
      state.task = (await api.post(`${place}/tasks`, { operation: state.kind, settings })).task;
    } catch (error) {
      if (state.form.refuse(error.message)) return;
      throw error;
    }
    Object.assign(state, { stale: false, news: true });
    tell();
  }

  const files = (task) => task.result.files.map(({ name, bytes: size }) =>
    h("a", { class: "button primary", href: `api/takeaways/${task.result.takeaway}/files/${encodeURIComponent(name)}`, download: name }, icon("download"), `${name}`, size ? h("span", { class: "small" }, bytes(size)) : null));
  const picture = (task) => {
    const { takeaway, preview, files: [first] } = task.result;
    const shows = preview || /\.(png|gif|svg)$/.test(first.name);
    return shows && h("img", {
      src: preview ? `api/takeaways/${takeaway}/preview.png` : `api/takeaways/${takeaway}/files/${encodeURIComponent(first.name)}`,
      alt: `What was made: ${KINDS[task.operation].title.toLowerCase()}`, loading: "lazy",
    });
  };

  function tell() {
    const { task } = state;
    const busy = alive(task);
    make.lastChild.textContent = busy ? "Stop" : state.stale ? "Make it again" : "Make it";
    const done = task?.state === "done" && task.result?.files?.length;
    if (done && !state.stale) {
      const seen = picture(task);
      put(shown, seen || canvas);
      if (!seen) paint();
      if (state.news) shown.scrollIntoView({ block: "nearest" });
      state.news = false;
    } else if (shown.firstChild !== canvas) {
      put(shown, canvas);
      paint();
    }
    put(said,
      busy && h("div", { class: "stack" }, h("p", {}, task.state === "waiting" ? "Waiting its turn …" : capital(task.what || "At work …")), h("progress", { max: 1, value: task.share, "aria-label": "How far it is" })),
      task?.state === "failed" && h("p", { class: "error" }, sentence(task.error)),
      task?.state === "cancelled" && h("p", { class: "soft" }, "Stopped."),
      done && h("div", { class: "stack" }, (task.result.notes ?? []).map((text) => h("p", { class: "notice" }, sentence(text))),
        state.stale && h("p", { class: "soft" }, "You changed something since. Make it again to have it."), h("div", { class: "row" }, files(task))));
    history();
  }

  function history() {
    const made = project.tasks.filter((task) => KINDS[task.operation] && task.state === "done" && task.result?.files?.length && task.id !== state.task?.id);
    earlier.hidden = !made.length;
    put(earlier, made.length > 0 && [h("h2", { id: "earlier" }, "Made before"), h("ul", { class: "made" }, made.map((task) =>
      h("li", { class: "panel stack" }, picture(task), h("span", { class: "soft small" }, KINDS[task.operation].title), files(task).map((link) => { link.classList.remove("primary"); return link; }))))]);
  }

  const canvas = h("canvas", { role: "img", "aria-label": `A tiling: ${card.arrangement}` });
  const paint = () => canvas.clientWidth && paintCard(canvas, card, palette, { across: 6 });
  const watch = new ResizeObserver(paint);
  const kinds = choice("What shall it be?", Object.entries(KINDS).map(([key, { title, image }]) => [key, title, image]), "export", (kind) => trying(() => choose(kind)));
  put(root,
    heading,
    h("div", { class: "take" },
      h("div", { class: "stack" }, shown, said, real, earlier),
      h("div", { class: "stack side" },
        h("section", { class: "panel stack wishes" }, kinds, wishes, h("div", { class: "go" }, make)),
        h("section", { class: "panel stack whole", "aria-labelledby": "whole" },
          h("h2", { id: "whole" }, "The whole project"),
          h("p", { class: "soft small" }, "One file with the picture and all tiles. It opens again here, and from Python."),
          h("a", { class: "button", href: `api/${place}/file`, download: true }, icon("download"), "Save the project")))));
  put(shown, canvas);
  watch.observe(shown);
  await choose("export");
  const off = [
    events.on("task", (task) => { if (task.id === state.task?.id) { state.task = task; tell(); } else if (KINDS[task.operation]) history(); }),
    events.on("refresh", () => { state.task = project.tasks.find(({ id }) => id === state.task?.id) ?? state.task; tell(); }),
    events.on("gone", ({ tile }) => { if (tile === tileId) navigate(`p/${project.id}`); }),
  ];
  return () => { off.forEach((stop) => stop()); watch.disconnect(); };
}
