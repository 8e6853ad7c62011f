/** What was read of a picture, and how to mend it: sliders, brushes, lassos, parts to keep. */

import {
  button,
  h,
  handled,
  newest,
  put,
  row,
  soft,
  stack,
  style,
  toast,
  trying,
  undoKeys,
  zooms,
} from "../dom.js";
import { sized } from "../../../../drawing/js/turned.js";
import { timeLeft } from "../waiting.js";
import { wishes } from "../wishes.js";
import { alive, sentence } from "../words.js";
import { paintingControls, readingControls } from "./controls.js";
import { findings } from "./findings.js";
import { Kept, LAYERS } from "./kept.js";
import { paintBrush, paintSilhouette, paintStrokes, tinted } from "./overlay.js";
import { pointing } from "./pointing.js";
import { addSecond, bothPictures } from "./second.js";
import { States } from "./states.js";
import { View } from "./view.js";

/** @type {Reading} */
const AS_FOUND = { threshold: null, invert: null, smooth: 0, thicken: 0 };
const ONE_GO = 700; // ms between two moves of a slider that are undone together
const KEYS =
  "With the keyboard: arrow keys move the brush, Space begins and ends a stroke, plus and minus zoom.";

/** @type {Show} */
export async function show(root, page) {
  const number = page.number === 2 ? 1 : 0;
  if (number && !page.project.second) {
    page.navigate(`p/${page.project.id}/picture`, { replace: true });
    return;
  }
  await style("start");
  new PicturePage(page, number).build(root);
}

class PicturePage {
  /** @param {Page} page @param {number} number */
  constructor(page, number) {
    const { api, project } = page;
    this.page = page;
    this.wishes = wishes(page);
    this.number = number;
    this.api = api;
    this.project = project;
    this.place = `projects/${project.id}`;
    this.pen = { tool: "add", shape: "brush", size: 4 };
    this.reading = { ...AS_FOUND, ...this.own.reading };
    this.kept = new Kept(page, number, { own: () => this.own, began: (told) => this.began(told) });
    this.view = new View(1, 1);
    this.states = new States(this.state, (state) => this.went(state));
    /** @type {HTMLImageElement | undefined} */
    this.picture = undefined;
    this.shown = ""; // the address of the picture
    this.tints = new Map(); // the marks in their colours, painted anew when strokes change
    this.refused = {}; // why a search would not take what is painted, by layer
    this.known = 0; // strokes that the outline on the screen knows
    this.read = newest(async () =>
      this.began(await api.put(`${this.place}/reading?number=${number}`, this.reading))
    );
  }

  build(root) {
    const label = `The picture with the outline that was read. ${KEYS}`;
    this.canvas = handled("reading", "application", label);
    this.stage = h("div.stage", { hidden: true }, this.canvas);
    this.busy = h("p.soft.grow", { role: "status" });
    this.under = row(this.busy, zooms((by) => this.zoom(by), () => this.zoom(0)));
    this.heading = h("h1", { tabindex: "-1" }, this.title);
    this.said = h("div.said.stack", { role: "status" });
    this.lead = h("p.soft");
    this.find = button("Find tiles", () => this.search(), { kind: "primary big", image: "arrow" });
    this.searches = h("p", { role: "status", hidden: true }, [
      "A search is at work: ",
      h("a", { href: `#/p/${this.project.id}` }, "see its tiles"),
      ".",
    ]);
    this.both = bothPictures(this.page, this.number);
    const clear = button("Start over", () => this.startOver(), { kind: "quiet", image: "bin" });
    this.controls = readingControls(this.reading, () => this.reads());
    this.unread = h("div.lonely.stack", { role: "status" });
    this.side = h("div.stack.side", [
      h("div.go", this.find, this.searches, this.wishes.effort),
      paintingControls(this.pen, () => this.paint(), [this.states.buttons, clear]),
      this.controls.root,
      this.both.root,
    ]);
    put(root, [
      h("div.picture", [
        stack(this.heading, this.lead, this.stage, this.under, this.said, this.unread),
        this.side,
      ]),
    ]);
    this.listen();
    this.ready();
  }

  listen() {
    pointing(this.canvas, () => [this.marks.width, this.marks.height], {
      begin: (point) => this.begin(this.view.at(point)),
      move: (points) => {
        this.stroke?.points.push(...points.map((point) => this.view.at(point)));
        this.paint();
      },
      end: () => this.end(),
      stop: () => {
        this.stroke = null;
      },
      zoom: (by, point) => this.zoom(by, point),
      pan: (distance) => {
        this.view.pan(distance);
        this.paint();
      },
      hover: (point) => {
        this.cross = point;
        this.paint();
      },
    });
    const { events, signal } = this.page;
    undoKeys((step) => this.states.go(step), signal);
    new ResizeObserver(() => this.paint()).observe(this.stage);
    events.on("silhouette refresh", () => this.ready(), signal);
    events.on("task", () => this.tell(), signal);
  }

  /**
   * What the project has of this picture; nothing when it was taken away.
   *
   * @returns {Partial<Picture>}
   */
  get own() {
    return (this.number ? this.project.second : this.project) ?? {};
  }

  get title() {
    const which = this.number ? "second " : "";
    return this.own.silhouette ? `Is this your ${which}animal?` : `Your ${which}picture`;
  }

  /** Show the silhouette that the project has now. */
  async ready() {
    const { silhouette } = this.own;
    if (silhouette && silhouette.backdrop !== this.shown) {
      const image = new Image();
      image.src = silhouette.backdrop;
      const loaded = await image.decode().then(() => true, () => false);
      if (silhouette !== this.own.silhouette) return; // there is a newer one, or none
      if (!loaded) return toast("The picture cannot be loaded: reload the page", { bad: true });
      [this.picture, this.shown] = [image, silhouette.backdrop];
    }
    if (silhouette) await this.follow(silhouette);
    this.known = Math.min(this.kept.sent, this.marks.strokes.length);
    [this.lead, this.stage, this.under, this.side].forEach((part) => {
      part.hidden = !silhouette;
    });
    this.lead.textContent = `What is ${
      silhouette?.coloured ? "inside the green line" : "green"
    } is what we read. If something is missing or too much, mend it here.`;
    this.unread.hidden = Boolean(silhouette);
    this.heading.textContent = this.title;
    this.tell();
  }

  /** Show the marks that the server has, if they are others. */
  async follow(silhouette) {
    if (!(await this.kept.follow(silhouette))) return;
    const { width, height } = silhouette;
    this.tints.clear();
    this.states.begin(this.state);
    if (this.view.width !== width || this.view.height !== height) {
      this.view = new View(width, height);
    }
    this.stage.style.setProperty("--shape", `${width} / ${height}`);
    this.stage.style.setProperty("--ratio", String(width / height));
  }

  get marks() {
    return this.kept.marks;
  }

  /** What can be undone: what is painted, and how the picture is read. */
  get state() {
    const { strokes, before } = this.marks;
    return { strokes, before, reading: { ...this.reading } };
  }

  /** Something was undone, or done again: send what differs. */
  went(now) {
    const { marks, state: old } = this;
    const differing = LAYERS.filter((layer) => {
      const [was, is] = [old, now].map(({ strokes }) => marks.of(layer, strokes));
      return old.before[layer] !== now.before[layer] || was.length !== is.length ||
        was.some((stroke, k) => stroke !== is[k]);
    });
    Object.assign(marks, { strokes: now.strokes, before: now.before });
    if (JSON.stringify(now.reading) !== JSON.stringify(old.reading)) {
      this.undoing = true;
      this.controls.take(now.reading);
      this.undoing = false;
    }
    this.changed(differing);
  }

  /** The reading was changed: one step back undoes all that a slider does in one go. */
  reads() {
    this.read();
    if (this.undoing) return;
    const now = performance.now();
    this.states.add(this.state, now - this.slid < ONE_GO);
    this.slid = now;
    this.tell();
  }

  /** Come nearer by a factor, or with 0 show all; returns whether that changed anything. */
  zoom(by, point) {
    const before = this.view.nearer;
    this.view.zoom(by, point);
    this.paint();
    return this.view.nearer !== before;
  }

  paint() {
    const { own: { silhouette }, picture, marks, pen, view } = this;
    if (!silhouette || !picture) return;
    const { width, ratio } = sized(this.canvas);
    const context = this.canvas.getContext("2d");
    const pixel = marks.width / width / view.nearer;
    const scale = ratio / pixel;
    context.setTransform(scale, 0, 0, scale, -view.x * scale, -view.y * scale);
    paintSilhouette(context, picture, silhouette, pixel);
    const marked = ["pins", "emphasis"].filter((layer) => marks.has(layer));
    paintStrokes(context, {
      marks: marked.map((layer) => this.tint(layer)),
      fresh: marks.strokes.slice(this.known).filter(({ layer }) => layer === "mend"),
      stroke: this.stroke,
      tool: pen.tool,
    });
    const radius = pen.shape === "lasso" ? 4 * pixel : this.brush() / 2;
    if (this.cross) paintBrush(context, view.at(this.cross), radius, pixel);
  }

  tint(layer) {
    if (!this.tints.has(layer)) this.tints.set(layer, tinted(this.marks, layer));
    return this.tints.get(layer);
  }

  /** The width of the brush in pixels of the picture: the nearer, the finer. */
  brush() {
    return (this.pen.size / 100) * Math.max(this.marks.width, this.marks.height) / this.view.nearer;
  }

  begin(point) {
    const { tool, shape } = this.pen;
    this.stroke = {
      layer: { add: "mend", remove: "mend", rub: "all" }[tool] ?? tool,
      shape,
      size: this.brush(),
      points: [point],
      black: tool === "remove",
      erases: tool === "rub",
    };
    this.paint();
  }

  end() {
    const { stroke } = this;
    this.stroke = null;
    if (!stroke || (stroke.shape === "lasso" && stroke.points.length < 3)) return this.paint();
    this.kept.add(stroke);
    this.states.add(this.state);
    this.slid = -Infinity;
    return this.changed(
      LAYERS.filter((layer) => stroke.layer === layer || (stroke.erases && this.marks.has(layer))),
    );
  }

  /** Layers were painted on, or are as they were before: send them. */
  changed(layers) {
    this.tints.clear();
    this.known = Math.min(this.known, this.marks.strokes.length);
    layers.forEach((layer) => this.kept.send[layer]());
    this.tell();
  }

  startOver() {
    this.marks.clear();
    this.slid = performance.now(); // one step with the reading
    this.states.add(this.state);
    this.controls.take(AS_FOUND);
    this.changed(LAYERS);
  }

  /** Take note of a reading that has begun, if its events have not told of it already. */
  began({ task, layer, refused }) {
    if (layer) this.refused[layer] = refused;
    if (task && !this.project.tasks.some(({ id }) => id === task.id)) {
      this.page.events.apply("task", task);
    }
    this.tell();
  }

  get task() {
    const own = this.number ? "read second" : "read";
    return this.project.tasks.find(({ operation }) => operation === own);
  }

  /** Say what was read, and which buttons do something. */
  tell() {
    const { own: { silhouette }, project, task } = this;
    const busy = alive(task);
    const unread = !project.silhouette || (project.second && !project.second.silhouette);
    this.find.disabled = Boolean(unread || this.searching);
    this.searches.hidden = !project.tasks.some((own) => own.operation === "search" && alive(own));
    this.busy.textContent = busy ? `Reading it again … ${timeLeft(task)}` : "";
    this.both.update();
    this.canvas.setAttribute("aria-busy", String(Boolean(busy)));
    this.paint();
    const shown = silhouette && { ...silhouette, outline: null };
    const { state, error: why } = task ?? {};
    const told = JSON.stringify([busy, state, why, project.tasks.some(alive), this.refused, shown]);
    if (told === this.told) return; // what is open stays open
    this.told = told;
    const error = !busy && task?.state === "failed" && h("p.error", sentence(task.error));
    if (silhouette) {
      put(this.said, [
        error,
        Object.values(this.refused).map((why) => why && h("p.error", sentence(why))),
        findings(silhouette, (thicken) => this.controls.take({ thicken })),
      ]);
    } else if (project.tasks.some(alive)) put(this.unread, soft("Reading the picture …"));
    else put(this.unread, this.nothing(error));
  }

  /** What is shown if there is no silhouette, and none to come. */
  nothing(error) {
    const leave = async () => {
      if (this.number) return addSecond(this.page);
      if (!this.project.tiles.length) await this.api.remove(this.place);
      this.page.navigate("");
    };
    const words = `Choose ${error ? "another" : "a"} picture`;
    return [
      error || soft("There is no picture yet."),
      h("p", button(words, () => trying(leave), { kind: "primary" })),
      this.number > 0 &&
      h("p", button("Go on without it", () => this.both.remove(), { kind: "quiet" })),
    ];
  }

  /** Search for tiles of what is on the screen: first all of it must have been read. */
  search() {
    this.searching = this.find.disabled = true;
    return trying(async () => {
      await Promise.all([this.read, ...Object.values(this.kept.send)].map((sent) => sent.done()));
      await this.settled();
      await this.api.start(this.project, "search", this.wishes.settings());
      this.page.navigate(`p/${this.project.id}`);
    }).then(() => {
      this.searching = this.find.disabled = false;
    });
  }

  /** Resolves when nothing is being read. */
  settled() {
    return new Promise((resolve) => {
      const settled = new AbortController();
      const check = () => {
        if (alive(this.task)) return;
        settled.abort();
        resolve();
      };
      this.page.events.on("task", check, settled.signal);
      check();
    });
  }
}
