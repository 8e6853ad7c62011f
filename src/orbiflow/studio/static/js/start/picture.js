/** What was read of a picture, and how to mend it: sliders, brushes, lassos, parts to keep. */

import { button, choice, h, newest, put, slider, style, toast, trying } from "../dom.js";
import { pathOf, sized } from "../tiling.js";
import { alive, number, sentence } from "../words.js";
import { Marks, drawStroke } from "./marks.js";
import { pointing } from "./pointing.js";

const TOOLS = [
  ["add", "Add", "more"], ["remove", "Take away", "cut"], ["pins", "Keep its shape", "pin"],
  ["emphasis", "Matters most", "star"], ["rub", "Rub out", "rub"],
];
const TOOL_MEANINGS = {
  add: "Paint over what belongs to the animal and was missed.",
  remove: "Paint over what does not belong to it.",
  pins: "Paint over a part that must not bend, such as a head. The rest bends more.",
  emphasis: "Paint over a part by which one knows the animal, such as ears or a tail.",
  rub: "Rub out what you painted.",
};
const COLOURS = { add: "#0f8f86", remove: "#c2362c", pins: "#3a6fd8", emphasis: "#e09a1b" };

export async function show(root, { api, events, project, navigate }) {
  await style("start");
  const place = `projects/${project.id}`;
  const state = { tool: "add", shape: "brush", size: 4, stroke: null, cross: null, sent: 0 };
  let marks = new Marks(1, 1);
  let picture = null;
  let shownPicture = "";

  const canvas = h("canvas", {
    class: "reading", tabindex: "0", role: "application",
    "aria-label": "The picture with the outline that was read. With the keyboard: arrow keys move the brush, Space begins and ends a stroke.",
  });
  const said = h("div", { class: "said stack", role: "status" });
  const meaning = h("p", { class: "soft small" }, TOOL_MEANINGS.add);
  const find = button("Find tiles", search, { kind: "primary big", image: "arrow" });
  const back = button("Undo", () => changed(marks.undo()), { kind: "quiet", image: "undo" });
  const again = button("Redo", () => changed(marks.redo()), { kind: "quiet", image: "redo" });
  const clear = button("Start over", startOver, { kind: "quiet", image: "bin" });

  const { threshold, invert, smooth } = project.reading ?? {};
  const reading = { threshold: threshold ?? null, invert: invert ?? null, smooth: smooth ?? 0 };
  const read = newest((values) => api.put(`${place}/reading`, values), 250);
  const change = (part) => { Object.assign(reading, part); read({ ...reading }); };
  const level = slider("Where it ends", { min: 0, max: 1, step: 0.01, value: reading.threshold ?? 0.5, said: (value) => (reading.threshold === null ? "found by itself" : value.toFixed(2)) },
    (value) => { reading.threshold = value; level.set(value); auto.checked = false; change({}); });
  const auto = h("input", { type: "checkbox", checked: reading.threshold === null, onchange: () => {
    change({ threshold: auto.checked ? null : 0.5 });
    level.set(reading.threshold ?? 0.5);
  } });
  const smoothing = slider("Smoothing", { min: 0, max: 0.06, step: 0.002, value: reading.smooth, said: (value) => (value ? `${(100 * value).toFixed(1)} %` : "none") },
    (value) => change({ smooth: value }));
  const part = choice("The animal is", [[null, "found by itself"], [false, "dark"], [true, "light"]], reading.invert,
    (value) => change({ invert: value }));

  /** Strokes that the outline on the screen does not know yet. */
  const fresh = () => marks.strokes.slice(state.sent).filter(({ layer, erases }) => layer === "mend" || erases);

  function paint() {
    const { silhouette } = project;
    if (!silhouette || !picture) return;
    const { width, height } = marks;
    const { context, width: shown, ratio } = sized(canvas);
    const pixel = width / shown;
    context.setTransform(ratio / pixel, 0, 0, ratio / pixel, 0, 0);
    context.fillStyle = "#ffffff";
    context.fillRect(0, 0, width, height);
    context.drawImage(picture, 0, 0, width, height);
    const outline = pathOf(silhouette.outline);
    const rest = new Path2D(outline);
    rest.rect(0, 0, width, height);
    context.fillStyle = "rgb(255 255 255 / 62%)";
    context.fill(rest, "evenodd");
    context.fillStyle = "rgb(15 143 134 / 55%)";
    context.fill(outline);
    context.lineJoin = "round";
    for (const ring of silhouette.left_out ?? []) {
      context.setLineDash([5 * pixel, 4 * pixel]);
      context.lineWidth = 2 * pixel;
      context.strokeStyle = COLOURS.remove;
      context.stroke(pathOf(ring));
      context.setLineDash([]);
    }
    context.globalAlpha = 0.65;
    for (const layer of ["pins", "emphasis"]) {
      if (marks.has(layer)) context.drawImage(tinted(layer), 0, 0);
    }
    for (const stroke of fresh()) if (!stroke.erases) drawStroke(context, stroke, COLOURS[stroke.black ? "remove" : "add"]);
    if (state.stroke) {
      const colour = COLOURS[state.tool] ?? "#777777";
      const { shape } = state.stroke;
      drawStroke(context, { ...state.stroke, erases: false, size: shape === "lasso" ? 1 : state.stroke.size }, colour);
    }
    context.globalAlpha = 1;
    for (const [line, colour] of [[4, "#ffffff"], [2, "#0b6b66"]]) {
      context.lineWidth = line * pixel;
      context.strokeStyle = colour;
      context.stroke(outline);
    }
    if (state.cross) {
      context.beginPath();
      context.arc(...state.cross, state.shape === "lasso" ? 4 * pixel : brush() / 2, 0, 7);
      for (const [line, colour] of [[3, "#ffffff"], [1.5, "#1d1c1a"]]) {
        context.lineWidth = line * pixel;
        context.strokeStyle = colour;
        context.stroke();
      }
    }
  }

  const layers = new Map(); // tinted pictures of the marks, drawn anew when strokes change
  function tinted(layer) {
    if (!layers.has(layer)) {
      const own = marks.layer(layer, () => COLOURS[layer]);
      const context = own.getContext("2d");
      context.globalCompositeOperation = "source-in";
      context.fillStyle = COLOURS[layer];
      context.fillRect(0, 0, own.width, own.height);
      layers.set(layer, own);
    }
    return layers.get(layer);
  }

  /** Whether a stroke meets the animal. */
  function touches({ points, size }) {
    const context = canvas.getContext("2d");
    const outline = pathOf(project.silhouette.outline);
    context.save();
    context.resetTransform();
    context.lineWidth = size;
    const found = points.some(([x, y]) => context.isPointInPath(outline, x, y) || context.isPointInStroke(outline, x, y));
    context.restore();
    return found;
  }

  const brush = () => (state.size / 100) * Math.max(marks.width, marks.height);

  /** Send the layers that a stroke touches; the newest state wins. */
  const send = Object.fromEntries(["mend", "pins", "emphasis"].map((layer) => [layer, newest(async () => {
    const until = marks.strokes.length;
    if (marks.has(layer)) await api.put(`${place}/${layer}`, await marks.png(layer, { clear: layer === "mend" }));
    else await api.remove(`${place}/${layer}`);
    if (layer === "mend") state.until = until;
  }, 200)]));

  function changed(stroke) {
    if (!stroke) return;
    layers.clear();
    state.sent = Math.min(state.sent, marks.strokes.length);
    for (const layer of stroke.erases ? Object.keys(send) : [stroke.layer]) if (stroke.layer === layer || marks.has(layer)) send[layer]();
    tell();
  }

  function startOver() {
    marks.clear();
    layers.clear();
    Object.assign(state, { sent: 0 });
    Object.values(send).forEach((go) => go());
    Object.assign(reading, { threshold: null, invert: null, smooth: 0 });
    change({});
    auto.checked = true;
    level.set(0.5);
    smoothing.set(0);
    part.set(null);
    tell();
  }

  pointing(canvas, () => [marks.width, marks.height], {
    begin(point) {
      const layer = { add: "mend", remove: "mend", rub: "all" }[state.tool] ?? state.tool;
      state.stroke = { layer, shape: state.shape, size: brush(), points: [point], black: state.tool === "remove", erases: state.tool === "rub" };
      paint();
    },
    move(points) { state.stroke?.points.push(...points); paint(); },
    end() {
      const { stroke } = state;
      state.stroke = null;
      if (!stroke || (stroke.shape === "lasso" && stroke.points.length < 3)) return paint();
      if (["pins", "emphasis"].includes(stroke.layer) && !touches(stroke)) {
        toast("Paint on the animal itself: that is outside of it.");
        return paint();
      }
      marks.add(stroke);
      return changed(stroke);
    },
    hover(point) { state.cross = point; paint(); },
  });

  /** Say what was read, and which buttons do something. */
  function tell() {
    const { silhouette, tasks } = project;
    const task = tasks.find((own) => own.operation.includes("read"));
    const busy = alive(task);
    find.disabled = !silhouette;
    back.disabled = !marks.strokes.length;
    again.disabled = !marks.undone.length;
    canvas.setAttribute("aria-busy", String(Boolean(busy)));
    const out = silhouette?.left_out?.length ?? 0;
    put(said,
      busy && h("p", { class: "soft" }, silhouette ? "Reading it again …" : "Reading the picture …"),
      !busy && task?.state === "failed" && h("p", { class: "error" }, sentence(task.error)),
      silhouette && h("ul", { class: "notes stack" },
        silhouette.doubts.map((text) => h("li", { class: "notice" }, sentence(text))),
        out > 0 && h("li", {}, h("span", { class: "swatch dashed" }), `${number(out, "part is", "parts are")} left out: a tile is one piece. Paint a bridge with “Add” to keep ${out === 1 ? "it" : "them"}.`),
        silhouette.notes.length > 0 && h("li", {}, h("details", {}, h("summary", {}, "How it was read"), h("p", { class: "soft" }, silhouette.notes.map(sentence).join(" "))))));
    paint();
  }

  async function silhouetteChanged() {
    const { silhouette } = project;
    if (silhouette && silhouette.backdrop !== shownPicture) {
      const image = new Image();
      image.src = silhouette.backdrop;
      await trying(() => image.decode());
      [picture, shownPicture] = [image, silhouette.backdrop];
      if (marks.width !== silhouette.width || marks.height !== silhouette.height) await fit(silhouette);
    }
    state.sent = Math.min(state.until ?? 0, marks.strokes.length);
    stage.hidden = !silhouette;
    tell();
  }

  /** A canvas of the picture's size, with the marks that the server has. */
  async function fit({ width, height }) {
    stage.style.setProperty("--shape", `${width} / ${height}`);
    stage.style.setProperty("--ratio", width / height);
    marks = new Marks(width, height);
    const found = [["mend", project.mend], ["pins", project.pins], ["emphasis", project.emphasis]].filter(([, url]) => url);
    await Promise.all(found.map(([layer, url]) => trying(() => marks.load(layer, url, { both: layer === "mend" }))));
  }

  async function search() {
    find.disabled = true;
    await trying(async () => {
      const { objective, effort } = { objective: "likeness", effort: "normal", ...project.view?.search };
      await api.post(`${place}/tasks`, { operation: "search", settings: { objective, effort } });
      navigate(`p/${project.id}`);
    });
    find.disabled = false;
  }

  const stage = h("div", { class: "stage", hidden: true }, canvas);
  const size = slider("Size of the brush", { min: 1, max: 20, step: 0.5, value: state.size, said: (value) => `${value} %` }, (value) => { state.size = value; paint(); });
  const unread = h("p", { class: "lonely soft" }, "Reading the picture …");
  const tools = choice("Paint on the picture", TOOLS, "add", (tool) => { state.tool = tool; meaning.textContent = TOOL_MEANINGS[tool]; paint(); });
  tools.classList.add("tools");
  put(root, h("div", { class: "picture" },
    h("div", { class: "stack" },
      h("h1", { tabindex: "-1" }, "Is this your animal?"),
      h("p", { class: "soft" }, "The green shape is what we read. If something is missing or too much, mend it here."),
      stage, unread),
    h("div", { class: "stack side" },
      h("div", { class: "go" }, find),
      said,
      h("section", { class: "panel stack", "aria-label": "How the picture is read" },
        part, h("label", { class: "check" }, auto, "Find the edge of the animal by itself"), level, smoothing),
      h("section", { class: "panel stack", "aria-label": "Paint on the picture" },
        tools, meaning,
        choice("With a", [["brush", "brush", "brush"], ["lasso", "lasso", "lasso"]], "brush", (shape) => { state.shape = shape; size.hidden = shape === "lasso"; }, { unseen: true }),
        size,
        h("div", { class: "row" }, back, again, clear)))));
  const ready = () => { unread.hidden = Boolean(project.silhouette); silhouetteChanged(); };
  ready();
  const keys = (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.target.type === "text") return;
    event.preventDefault();
    changed(event.shiftKey ? marks.redo() : marks.undo());
  };
  document.addEventListener("keydown", keys);
  const watch = new ResizeObserver(paint);
  watch.observe(stage);
  const off = [events.on("silhouette", ready), events.on("refresh", ready), events.on("task", tell)];
  return () => { watch.disconnect(); document.removeEventListener("keydown", keys); off.forEach((stop) => stop()); };
}
