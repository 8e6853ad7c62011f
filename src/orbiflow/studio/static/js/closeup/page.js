/** The close-up of one tile: look, pull, draw. */

import { client } from "../api.js";
import { choice } from "../controls.js";
import {
  button,
  dialog,
  h,
  notes,
  put,
  soft,
  stack,
  style,
  toast,
  trying,
  undoKeys,
} from "../dom.js";
import { keeper } from "../memory.js";
import { lookKeeper, lookOf, paletteOf } from "../look.js";
import { shapeCards } from "../shapes/page.js";
import { backdropOf } from "../skin.js";
import { figuresOf } from "../../../../drawing/js/tiling.js";
import { alive, capital, named } from "../words.js";
import { Carry } from "./carry.js";
import { Dress } from "./dress.js";
import { LiveTiling } from "./live.js";
import { colourPanel, HELP, penPanel, pullPanel, shapePanel, signPanel } from "./looks.js";
import { Past } from "./past.js";
import { Pen } from "./pen.js";
import { Pulling } from "./pulling.js";
import { kindsOf, paintSigns, placed, signAt } from "./signs.js";
import { Stage } from "./stage.js";

const PEN = { tool: "pencil", colour: "#1b1b1b", size: 0.018, eye: 0.045, mirror: false };
const percent = (share) => `${Math.round(100 * share)} %`;
const CALM = 8000; // ms after which a refusal makes way

/** @type {Show} */
export async function show(root, given) {
  await style("closeup");
  await new Closeup(root, given).open(given.number);
}

class Closeup {
  /** @param {HTMLElement} root @param {Page} page */
  constructor(root, page) {
    const { api, events, project, navigate, about, signal } = page;
    this.root = root;
    this.signal = signal;
    this.api = api;
    this.project = project;
    this.navigate = navigate;
    this.about = about;
    this.home = `projects/${project.id}`;
    const kept = project.view?.closeup ?? {};
    this.look = { ...lookOf(project, about), share: 1 };
    this.keepLook = lookKeeper(page);
    this.pull = { what: "outline", reach: 0.5, lattice: true, gives: false, ...kept.pull };
    this.penSettings = { ...PEN, ...kept.pen };
    this.mode = "look"; // not what it was: the first click of whoever comes back would draw
    this.lit = null;
    const keep = keeper(page, "closeup");
    this.keep = () => keep({ pull: this.pull, pen: this.penSettings });
    this.keepDrawing = keeper(page, "drawing");
    this.#build();
    events.on("card", (card) => this.#better(card), signal);
    events.on("project", (now) => this.#elsewhere(now), signal);
    events.on("task", () => this.#checking(), signal);
    events.on("gone", ({ tile }) => tile === this.view?.id && navigate(`p/${project.id}`), signal);
    undoKeys((step) => (step < 0 ? this.past.undo() : this.past.redo()), signal);
    signal.addEventListener("abort", () => {
      clearTimeout(this.calming);
      this.stage.close();
    });
  }

  /** A search has made the tile that is shown better: show it, unless it is in the hand. */
  async #better(card) {
    if (card.id !== this.view?.id || card.stage === this.view.stage) return;
    if (this.pulling.hand || this.pulling.waiting || this.pen.line) {
      this.later = () => this.#better(card);
      return;
    }
    await trying(() => this.open(card.id));
    toast("The search has made this tile better.");
  }

  /** Another tab has drawn. */
  #elsewhere({ view, changed_by: by }) {
    if (by !== client && view?.drawing && this.carries && !this.pen.line) {
      this.pen.use(this.carries, view.drawing);
    }
  }

  #build() {
    this.said = h("p.unseen", { role: "status", "aria-live": "polite" });
    this.badge = h("p.badge");
    const stop = () => trying(() => this.api.post(`tasks/${this.checked.id}/cancel`));
    this.stop = button("Stop", stop, { image: "stop", kind: "stop", hidden: true });
    this.hint = h("p.hint", { hidden: true });
    this.stage = new Stage("The tiling, without end", "closeup-help", () => this.tool);
    this.pulling = new Pulling(this.stage, this.pull, {
      released: (parameters, inside) => this.#byHand("pull", { parameters, inside }),
      said: (text) => this.say(text),
      changed: (now) => this.#pulledTo(now),
    });
    this.pen = new Pen(this.stage, this.penSettings, {
      drawn: (drawing, before) => this.#drawn(drawing, before),
      said: (text) => this.say(text),
      marks: () => this.dress?.stale(),
    });
    this.dress = new Dress(this.project, this.look, this.stage, this.pen);
    this.past = new Past(this.project.id, {
      go: (step, side) => trying(() => this.#go(step, side)),
      busy: () => Boolean(this.pulling.waiting || this.pulling.hand),
      said: (text) => this.say(text),
    });
    this.stage.layers.push((context) => this.#overlay(context));
    this.stage.onhover = (place) => this.#hover(place);
    this.stage.options.over = (context, copy) => this.pen.over(context, copy);
    const { buttons } = this.past;
    this.stage.box.append(
      h("div.past", buttons),
      this.badge,
      this.stop,
      this.hint,
      this.stage.zooms(),
    );
    this.heading = h("h1", { tabindex: "-1" }, "Close up");
    this.kind = h("p.soft.small");
    this.noted = h("div");
    this.more = h("p.soft.small");
    /** @type {[string, string][]} */
    const modes = [["look", "Look"], ["pull", "Pull"], ["draw", "Draw"]];
    const choose = (mode) => this.#choose(mode);
    this.modes = choice("What to do", modes, this.mode, choose, { unseen: true });
    this.panel = h("div.stack");
    this.help = h("p.small.soft", { id: "closeup-help" });
    const side = h("div.closeup-side", [
      h(
        "div",
        this.heading,
        this.kind,
        this.noted,
        h("details", h("summary", "More about it"), this.more),
      ),
      this.modes,
      this.panel,
      this.help,
    ]);
    this.root.classList.add("closeup");
    put(this.root, h("div.closeup-page", this.stage.box, side), this.said);
  }

  /** Show a tile of the project. */
  async open(id, { quiet = false } = {}) {
    const view = await this.api.get(`${this.home}/tiles/${id}`);
    if (this.signal.aborted) return;
    const drawing = this.view ? this.pen.drawing : this.project.view?.drawing;
    this.view = view;
    this.figures = figuresOf(view);
    this.carries = this.figures.map((own) => new Carry(own));
    this.tiling = new LiveTiling(view);
    this.look.share = 1;
    this.dress.use(this.figures);
    this.space = null;
    delete this.root.dataset.ready;
    this.pulling.use(null);
    this.stage.show(this.tiling);
    this.#palette();
    this.pen.use(this.carries, drawing);
    this.heading.textContent = view.arrangement ? capital(view.arrangement) : "Close up";
    this.kind.textContent = named(view);
    put(this.noted, notes(view.notes ?? []));
    this.more.textContent =
      `In mathematics: isohedral class ${view.class_name}, wallpaper group ${view.group.name}.`;
    this.#proved();
    this.#panels();
    this.past.show(view, quiet);
    if (quiet) this.navigate(`p/${this.project.id}/t/${id}`, { quiet: true });
    if (this.mode === "pull") this.#ready(); // not waited for: what is next may be asked at once
  }

  /** Fetch how the tile can be pulled. */
  async #ready() {
    const { view } = this;
    if (this.space) return;
    try {
      const space = await this.api.get(`${this.home}/tiles/${view.id}/space`);
      if (this.signal.aborted || this.view !== view) return;
      this.space = space;
      this.tiling.outlines(this.#rings());
      this.pulling.use(space);
      this.stage.redraw();
      this.root.dataset.ready = "pull";
    } catch (error) {
      toast(error.message, { bad: true });
    }
  }

  get tool() {
    return { pull: this.pulling, draw: this.pen }[this.mode];
  }

  #choose(mode) {
    this.mode = mode;
    this.stage.canvas.style.cursor = "";
    if (!this.view) return; // the tile opens in this mode when it is there
    if (this.badge.dataset.kind === "refused") this.#proved();
    if (mode !== "look" && this.look.share < 1) this.#change({ share: 1 });
    this.#panels();
    if (mode === "pull") this.#ready();
    this.stage.redraw();
  }

  #panels() {
    const { look, view, about } = this;
    const inside = this.mode === "pull" && this.pull.what === "inside";
    const [hands, keys] = HELP[inside ? "draw" : this.mode];
    put(this.help, hands, h("span.by-keys", ` Keys: ${keys}`));
    const needed = 1 + Math.max(...view.colours.table.flat(2));
    const change = (what) => this.#change(what);
    const hasMap = this.figures.every(({ map }) => map);
    if (this.mode === "look") {
      const has = {
        count: this.figures.length,
        hasMap,
        hasArt: this.figures.some((figure, k) => backdropOf(this.project, figure, k)),
      };
      this.signs = signPanel(view.elements, look, change, (key) => this.#light(key));
      const colours = colourPanel(about, look, needed, change);
      put(this.panel, shapePanel(look, has, change), this.signs, colours);
    } else if (this.mode === "pull") {
      const pulled = (what) => {
        Object.assign(this.pull, what);
        this.keep();
        this.stage.redraw();
        if ("what" in what) this.#panels();
      };
      const lay = this.figures.length === 1 && (() => trying(() => this.#lay()));
      put(this.panel, pullPanel(this.pull, pulled, () => this.#restore(), hasMap, lay));
    } else {
      const chosen = (what) => {
        Object.assign(this.penSettings, what);
        this.keep();
      };
      const clear = () => this.#setDrawing({ strokes: [], eyes: [] });
      const show = (drawn) => change({ drawn });
      put(this.panel, penPanel(this.penSettings, chosen, clear, look.drawn, show));
    }
  }

  #change(what) {
    Object.assign(this.look, what);
    if ("share" in what) this.#between();
    else this.keepLook(what.palette === "own" ? { ...what, custom: this.look.custom } : what);
    this.dress.stale();
    this.#palette();
    this.stage.redraw();
  }

  #palette() {
    const { look } = this;
    const palette = paletteOf(look, this.about);
    Object.assign(this.stage.options, { palette, line: look.line, drawn: look.drawn });
    this.stage.redraw();
  }

  /** The outline on its way from the silhouette to the tile. */
  #between() {
    const { share } = this.look;
    const there = ({ silhouette_track: from, tile_track: to }) =>
      from.map(([x, y], k) => [x + share * (to[k][0] - x), y + share * (to[k][1] - y)]);
    const isThere = share >= 1;
    this.tiling.outlines(isThere ? this.#rings() : this.figures.map(there), { exact: isThere });
    this.dress.stale();
  }

  /** The outline of each figure, as it can be pulled if that is known. */
  #rings() {
    return this.space
      ? this.space.rings.map((ring) => ring.map((k) => this.space.polygon[k]))
      : this.figures.map(({ polygon }) => polygon);
  }

  #overlay(context) {
    if (this.mode !== "look" || !this.look.signs) return;
    const { camera, width, height } = this.stage;
    this.places = placed(this.view.elements, this.tiling, camera, width, height);
    paintSigns(context, this.places, this.lit);
  }

  #hover(place) {
    if (this.mode !== "look" || !this.look.signs || !this.places) return;
    const key = place && signAt(this.places, place);
    if (key !== this.lit) this.#light(key);
    if (!key) return;
    this.hint.style.setProperty("left", `${Math.min(place[0] + 16, this.stage.width - 260)}px`);
    this.hint.style.setProperty("top", `${Math.min(place[1] + 16, this.stage.height - 90)}px`);
  }

  #light(key) {
    this.lit = key;
    this.signs?.light?.(key);
    const kind = key && kindsOf(this.view.elements).find((own) => own.key === key);
    this.hint.hidden = !kind || !this.stage.canvas.matches(":hover");
    if (kind) put(this.hint, h("strong", kind.name), h("span", kind.says));
    this.stage.redraw();
  }

  say(text) {
    this.said.textContent = text;
  }

  /** The badge over the picture, for eyes only: what must be heard is said. A refusal makes way again. */
  tell(kind, text) {
    if (this.badge.dataset.kind === kind && this.badge.textContent === text) return;
    this.badge.dataset.kind = kind;
    this.badge.textContent = text;
    clearTimeout(this.calming);
    if (kind !== "checking") this.stop.hidden = true;
    if (kind === "refused") this.calming = setTimeout(() => this.#proved(), CALM);
  }

  /** How far the check of a pulled tile is; it can be stopped. */
  #checking() {
    const { badge, project } = this;
    this.checked = project.tasks.find((own) =>
      ["pull", "class"].includes(own.operation) && alive(own)
    );
    this.stop.hidden = !this.checked || badge.dataset.kind !== "checking";
    if (!this.stop.hidden) this.tell("checking", `Checking … ${percent(this.checked.share)}`);
  }

  #proved() {
    this.tell("proved", "Proved to tile");
  }

  #pulledTo({ stopped, body }) {
    this.dress.ride(this.pulling.puller, body, this.space);
    if (this.pulling.hand) {
      if (stopped && this.badge.dataset.kind !== "stopped") this.say("No further here.");
      if (stopped) this.tell("stopped", "No further here");
      else this.tell("moving", "Let go to check it");
    }
    if (!body && this.badge.dataset.kind !== "refused") this.#proved();
    if (!body && this.later) {
      this.later();
      this.later = null;
    }
  }

  /** Lay the copies as those of another class do, with the tile that is most like this one. */
  async #lay() {
    const shapes = await this.api.get("shapes");
    const { list, close } = shapeCards(this.about);
    const name = await dialog("Lay the copies another way", (done) => {
      const card = ({ name }, parts) => {
        const disabled = name === this.view.class_name;
        return h("button", { type: "button", disabled, onclick: () => done(name) }, parts);
      };
      return stack(soft("The outline stays as near to what it is as it can."), list(shapes, card));
    });
    close();
    if (name) this.#byHand("class", { name });
  }

  /**
   * Make a tile of this one by hand, and show it once it is proved.
   *
   * @param {"pull" | "class"} way
   * @param {object} settings
   */
  async #byHand(way, settings) {
    const before = this.view;
    this.tell("checking", "Checking …");
    this.#checking();
    try {
      const place = `${this.home}/tiles/${before.id}/by-hand/${way}`;
      const card = await this.api.post(place, settings);
      if (this.signal.aborted) return;
      this.past.did({ tile: [before.id, card.id] });
      await this.open(card.id, { quiet: true });
      this.say("Proved to tile.");
    } catch (error) {
      if (this.signal.aborted) return;
      const why = capital(error.message);
      this.pulling.back();
      this.tell("refused", why);
      this.say(why);
    }
  }

  #restore() {
    this.pulling.back();
    if (this.badge.dataset.kind === "refused") this.#proved();
    const { first } = this.past;
    if (first && first !== this.view.id) {
      this.past.did({ tile: [this.view.id, first] });
      this.open(first, { quiet: true });
    }
  }

  #drawn(drawing, before) {
    this.past.did({ drawing: [before, drawing] });
    this.keepDrawing(drawing);
  }

  #setDrawing(drawing) {
    this.#drawn(drawing, this.pen.drawing);
    this.pen.use(this.carries, drawing);
  }

  /**
   * Go back before a step, or on after it.
   *
   * @param {import("./past.js").Step} step
   * @param {0 | 1} side
   */
  async #go({ tile, drawing }, side) {
    if (tile) await this.open(tile[side], { quiet: true });
    else {
      this.pen.use(this.carries, drawing[side]);
      this.keepDrawing(drawing[side]);
    }
  }
}
