/** What was read of a picture, and how to mend it: sliders, brushes, lassos, parts to keep. */

import { button, h, newest, put, row, soft, stack, style, toast, trying, zooms } from "../dom.js";
import { sized } from "../../../../drawing/js/tiling.js";
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

/**
 * @param {HTMLElement} root
 * @param {Page} page
 * @param {number} [number] 1 for the second of two pictures
 */
export async function show(root, page, number = 0) {
  if (number && !page.project.second) {
    page.navigate(`p/${page.project.id}/picture`, { replace: true });
    return () => {};
  }
  await style("start");
  const own = new PicturePage(page, number);
  own.build(root);
  return () => own.close();
}

/**
 * @param {HTMLElement} root
 * @param {Page} page
 */
export const showSecond = (root, page) => show(root, page, 1);

class PicturePage {
  /**
   * @param {Page} page
   * @param {number} number
   */
  constructor(page, number) {
    const { api, events, project, navigate } = page;
    this.page = page;
    this.wishes = wishes(page);
    this.number = number;
    this.api = api;
    this.events = events;
    this.project = project;
    this.navigate = navigate;
    this.place = `projects/${project.id}`;
    this.pen = { tool: "add", shape: "brush", size: 4 };
    this.reading = { ...AS_FOUND, ...this.own.reading };
    this.kept = new Kept(page, number, { own: () => this.own, began: (told) => this.began(told) });
    this.view = new View(1, 1);
    this.states = new States(this.state);
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
    this.canvas = h("canvas", {
      class: "reading",
      tabindex: "0",
      role: "application",
      "aria-label": `The picture with the outline that was read. ${KEYS}`,
    });
    this.stage = h(
      "div",
      { class: "stage", hidden: true },
      this.canvas,
    );
    this.busy = h("p", { class: "soft grow", role: "status" });
    this.under = row(this.busy, zooms((by) => this.zoom(by), () => this.zoom(0)));
    this.heading = h("h1", { tabindex: "-1" }, this.title);
    this.said = h("div", { class: "said stack", role: "status" });
    this.lead = h("p", { class: "soft" });
    this.find = button("Find tiles", () => this.search(), { kind: "primary big", image: "arrow" });
    this.searches = h(
      "p",
      { role: "status", hidden: true },
      "A search is at work: ",
      h("a", { href: `#/p/${this.project.id}` }, "see its tiles"),
      ".",
    );
    this.both = bothPictures(this.page, this.number);
    this.back = button("Undo", () => this.go(-1), { kind: "quiet", image: "undo" });
    this.again = button("Redo", () => this.go(1), { kind: "quiet", image: "redo" });
    const clear = button("Start over", () => this.startOver(), { kind: "quiet", image: "bin" });
    this.controls = readingControls(this.reading, () => this.reads());
    this.unread = h("div", { class: "lonely stack", role: "status" });
    this.side = h(
      "div",
      { class: "stack side" },
      h("div", { class: "go" }, this.find, this.searches, this.wishes.effort),
      paintingControls(this.pen, () => this.paint(), [this.back, this.again, clear]),
      this.controls.root,
      this.both.root,
    );
    put(
      root,
      h(
        "div",
        { class: "picture" },
        stack(this.heading, this.lead, this.stage, this.under, this.said, this.unread),
        this.side,
      ),
    );
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
    this.keys = (event) => {
      const key = event.key.toLowerCase();
      if (
        !(event.ctrlKey || event.metaKey) || !"zy".includes(key) || event.target.type === "text"
      ) {
        return;
      }
      event.preventDefault();
      this.go(event.shiftKey || key === "y" ? 1 : -1);
    };
    document.addEventListener("keydown", this.keys);
    this.watch = new ResizeObserver(() => this.paint());
    this.watch.observe(this.stage);
    const ready = () => this.ready();
    this.off = [["silhouette", ready], ["refresh", ready], ["task", () => this.tell()]].map((
      [kind, heard],
    ) => this.events.on(kind, heard));
  }

  close() {
    this.watch.disconnect();
    document.removeEventListener("keydown", this.keys);
    this.off.forEach((stop) => stop());
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
    this.states = new States(this.state);
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

  /** Undo or redo: send what differs. */
  go(step) {
    const { marks } = this;
    const old = this.state;
    const now = this.states.go(step);
    if (!now) return;
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
    const { context, width, ratio } = sized(this.canvas);
    const pixel = marks.width / width / view.nearer;
    const scale = ratio / pixel;
    context.setTransform(scale, 0, 0, scale, -view.x * scale, -view.y * scale);
    paintSilhouette(context, picture, silhouette, pixel);
    paintStrokes(context, {
      marks: ["pins", "emphasis"].filter((layer) => marks.has(layer)).map((layer) =>
        this.tint(layer)
      ),
      fresh: marks.strokes.slice(this.known).filter(({ layer }) => layer === "mend"),
      stroke: this.stroke,
      tool: pen.tool,
    });
    if (this.cross) {
      paintBrush(
        context,
        view.at(this.cross),
        pen.shape === "lasso" ? 4 * pixel : this.brush() / 2,
        pixel,
      );
    }
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
    const layer = { add: "mend", remove: "mend", rub: "all" }[tool] ?? tool;
    this.stroke = {
      layer,
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
      this.events.apply("task", task);
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
    this.back.disabled = !this.states.can(-1);
    this.again.disabled = !this.states.can(1);
    this.canvas.setAttribute("aria-busy", String(Boolean(busy)));
    this.paint();
    const told = JSON.stringify([
      busy,
      task?.state,
      task?.error,
      this.project.tasks.some(alive),
      this.refused,
      silhouette && { ...silhouette, outline: null },
    ]);
    if (told === this.told) return; // what is open stays open
    this.told = told;
    const error = !busy && task?.state === "failed" &&
      h("p", { class: "error" }, sentence(task.error));
    if (silhouette) {
      put(
        this.said,
        error,
        Object.values(this.refused).map((why) => why && h("p", { class: "error" }, sentence(why))),
        findings(silhouette, (thicken) => this.controls.take({ thicken })),
      );
    } else {put(
        this.unread,
        ...(this.project.tasks.some(alive) ? [soft("Reading the picture …")] : this.nothing(error)),
      );}
  }

  /** What is shown if there is no silhouette, and none to come. */
  nothing(error) {
    const leave = async () => {
      if (this.number) return addSecond(this.page);
      if (!this.project.tiles.length) await this.api.remove(this.place);
      this.navigate("");
    };
    const without = () => this.both.remove();
    return [
      error || soft("There is no picture yet."),
      h(
        "p",
        button(`Choose ${error ? "another" : "a"} picture`, () => trying(leave), {
          kind: "primary",
        }),
      ),
      this.number > 0 && h("p", button("Go on without it", without, { kind: "quiet" })),
    ];
  }

  /** Search for tiles of what is on the screen: first all of it must have been read. */
  search() {
    this.searching = this.find.disabled = true;
    return trying(async () => {
      await Promise.all(
        [this.read, ...Object.values(this.kept.send)].map((pending) => pending.done()),
      );
      await this.settled();
      await this.api.post(`${this.place}/tasks`, {
        operation: "search",
        settings: this.wishes.settings(),
      });
      this.navigate(`p/${this.project.id}`);
    }).then(() => {
      this.searching = this.find.disabled = false;
    });
  }

  /** Resolves when nothing is being read. */
  settled() {
    return new Promise((resolve) => {
      const check = () => {
        if (!alive(this.task)) {
          stop();
          resolve();
        }
      };
      const stop = this.events.on("task", check);
      check();
    });
  }
}
