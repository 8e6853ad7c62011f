/** Take a tile away: to print or cut, as a picture, a solid or an animation, or the whole project. */

import { Carry } from "../closeup/carry.js";
import { drawnOn, marksOf } from "../closeup/drawn.js";
import { aside, choice, h, icon, put, section, stack, style, trying } from "../dom.js";
import { form } from "../forms.js";
import { keeper, lookOf, paletteOf } from "../look.js";
import { backdropOf, Pictures, skinsOf } from "../skin.js";
import { figuresOf, paintCard } from "../../../../drawing/js/tiling.js";
import { sentence } from "../words.js";
import { lengthIn, showIn, unit } from "../lengths.js";
import { COLOURLESS, colours, KINDS } from "./kinds.js";
import { Making, picture } from "./made.js";
import { Preview } from "./preview.js";
import { profiles } from "./profiles.js";
import { share } from "./share.js";
import { THINGS } from "./things.js";
import { trueSize } from "./truesize.js";

/** What each can be laid on. */
const ON = {
  drawing: ["export", "art", "solid", "animate"],
  picture: ["export", "art", "animate"],
};
const NEVER = "tile result out force picture drawing eyes second_eyes tint".split(" "); // what the page itself sets, or drawings hold
/** What was chosen for tiles of each project: the thing, and the settings and the machine of each. */
const KEPT = {};
const PICTURES = ["png", "jpg", "jpeg", "webp", "svg"];

/**
 * @param {HTMLElement} root
 * @param {Page} page
 */
export async function show(root, page) {
  const card = page.project.tiles.find(({ id }) => id === page.tileId);
  if (!card) throw new Error("This tile is not there any more.");
  await style("takeaway");
  const own = new TakeawayPage(page, card);
  const place = `${own.place}/tiles/${card.id}`;
  [own.view, own.cannot, own.rectangles] = await Promise.all(
    [place, `${place}/cannot`, `${place}/rectangles`].map((path) => page.api.get(path)),
  );
  own.build(root);
  await own.choose(own.kept.thing);
  return () => own.close();
}

class TakeawayPage {
  /**
   * @param {Page} page
   * @param {Card} card
   */
  constructor({ api, events, project, navigate, about }, card) {
    this.api = api;
    this.events = events;
    this.project = project;
    this.navigate = navigate;
    this.card = card;
    this.place = `projects/${project.id}`;
    this.kept = KEPT[project.id] ??= { thing: "poster", machines: {} };
    this.about = about;
    this.look = lookOf(project, about);
    this.keepLook = keeper(api, project);
    this.pictures = new Pictures(() => this.paint());
    /** @type {TileView | null} */
    this.view = null;
    /** @type {Record<string, { setting: string, values: string[], why: string, instead: number }[]>} */
    this.cannot = {};
    /** @type {Point[][]} */
    this.rectangles = [];
    this.schemas = new Map();
    this.making = new Making(api, project, {
      asked: () => [this.kind, this.settings()],
      refused: (setting, text) => this.form.refuse(setting, text),
      show: (task) => {
        put(this.shown, (task && picture(task)) || this.live.root);
        this.paint();
        if (task) this.shown.scrollIntoView({ block: "nearest" });
      },
    });
  }

  build(root) {
    this.canvas = h("canvas", { role: "img", "aria-label": `A tiling: ${this.card.arrangement}` });
    this.live = new Preview(
      this.api,
      `${this.place}/tiles/${this.card.id}`,
      this.canvas,
      (error, notes) => this.heard(error, notes),
    );
    this.shown = h("div", { class: "preview" }, this.live.root);
    this.noted = h("ul", { class: "notice", hidden: true });
    this.size = trueSize(this.card, this.rectangles);
    this.real = section("panel real", "true", "In its true size", this.size.root);
    this.wishes = h("div", { class: "stack" });
    this.shared = share(this.api, this.project, this.card, () => ({
      look: this.look,
      palette: paletteOf(this.look, this.about),
      skins: (tiling, scale) => this.skins(tiling, scale),
    }));
    /** @type {[string, string, any][]} */
    const choices = Object.entries(THINGS).map(([key, { title, image }]) => [key, title, image]);
    const things = choice(
      "What shall it be?",
      choices,
      this.kept.thing,
      (thing) => trying(() => this.choose(thing)),
    );
    put(
      root,
      h("h1", { tabindex: "-1" }, "Take it away"),
      h(
        "div",
        { class: "take" },
        h(
          "div",
          { class: "stack side" },
          h(
            "section",
            { class: "panel stack wishes" },
            things,
            this.wishes,
            h("div", { class: "go" }, this.making.make),
          ),
          this.shared.root,
          section(
            "panel whole",
            "whole",
            "The whole project",
            aside("One file with the picture and all tiles. It opens again here, and from Python."),
            h(
              "a",
              { class: "button", href: `api/${this.place}/file`, download: true },
              icon("download"),
              "Save the project",
            ),
          ),
        ),
        stack(this.shown, this.noted, this.making.said, this.real),
      ),
      this.making.earlier,
    );
    this.listen();
  }

  listen() {
    this.watch = new ResizeObserver(() => this.paint());
    this.watch.observe(this.shown);
    const tell = () => this.making.tell();
    const gone = ({ tile }) => {
      if (tile === this.card.id) this.navigate(`p/${this.project.id}`);
    };
    this.off = [["task", tell], ["refresh", tell], ["gone", gone]].map(([kind, heard]) =>
      this.events.on(kind, heard)
    );
  }

  close() {
    this.off.forEach((stop) => stop());
    this.watch.disconnect();
    this.live.close();
    this.shared.close();
  }

  /** What the preview has to say. */
  heard(error, notes) {
    if (error && this.form.refuse(error.setting, error.message, false)) return;
    const words = error ? [error.message] : notes;
    this.noted.hidden = !words.length;
    put(this.noted, words.map((text) => h("li", sentence(text))));
  }

  paint() {
    if (!this.canvas.clientWidth) return;
    paintCard(this.canvas, this.card, paletteOf(this.look, this.about), {
      across: 6,
      skins: (tiling, scale) => this.skins(tiling, scale),
    });
  }

  /** What lies on the tiles, the drawing if that is wished. */
  skins(tiling, scale) {
    const { look, pictures, project, view } = this;
    const figures = figuresOf(view);
    const isDrawn = this.layer("drawing")?.checked ?? look.drawn;
    const marks = isDrawn &&
      marksOf(project.view?.drawing, figures.map((own) => new Carry(own)), tiling);
    const how = { look, palette: paletteOf(look, this.about), pictures, marks };
    return skinsOf(project, figures, tiling.figures, how, scale);
  }

  /** The box that lays a drawing or picture on the tiles, if there is one. */
  layer(name) {
    return this.layers?.find((own) => own.name === name)?.box;
  }

  /** Show the settings of another thing. */
  async choose(thing) {
    const { first, fixed, machine, makes: kind, start } = THINGS[thing];
    this.thing = this.kept.thing = thing;
    this.kind = kind;
    if (!this.schemas.has(kind)) {
      this.schemas.set(kind, await this.api.get(`operations/${kind}/schema`));
    }
    if (this.thing !== thing) return;
    const schema = structuredClone(this.schemas.get(kind));
    const { palette } = schema.properties;
    const { options, value } = colours(this.look, this.about);
    if (palette) palette.enum = Object.keys(options);
    const without = this.without(kind, schema);
    const wish = { ...start, ...this.kept[thing] };
    const able = (name) => {
      const property = schema.properties[name];
      const allowed = [property, ...(property.anyOf ?? [])].flatMap((own) => own.enum ?? []);
      return !allowed.length || allowed.includes(wish[name]);
    };
    const never = Object.keys(start ?? {}).find((name) => !able(name));
    if (never) return this.refuse(without[never].about);
    this.making.make.hidden = false;
    const open = this.form?.querySelector("details").open && thing === this.built;
    this.built = thing;
    const names = { ...KINDS[kind].words, ...THINGS[thing].words };
    this.form = form(schema, {
      first,
      fixed,
      words: { ...names, palette: { ...names.palette, options }, ...without },
      hidden: NEVER,
      start: {
        ...Object.fromEntries(Object.entries(wish).filter(([name]) => able(name))),
        ...(palette && { palette: value }),
      },
    }, () => {
      this.keepLooks();
      this.changed();
    });
    this.form.querySelector("details").open = open;
    this.layers = this.laidOn(kind);
    this.suits = null;
    put(
      this.wishes,
      this.layers.map(({ box, text }) => h("label", { class: "check" }, box, text)),
      machine && profiles(this.api, this.form, this.kept.machines[thing] ??= {}),
      this.form,
      choice("Lengths in", [["mm", "mm"], ["in", "inches"]], unit(), (/** @type {any} */ own) => {
        showIn(own);
        trying(() => this.choose(thing));
      }),
    );
    this.making.task = null;
    this.changed();
  }

  /** Say why this tile cannot be the thing that was chosen. */
  refuse(why) {
    put(this.wishes, h("p", { class: "notice" }, why));
    this.making.make.hidden = this.real.hidden = true;
    this.making.task = null;
    this.making.change();
    this.live.close();
    this.noted.hidden = true;
    this.paint();
  }

  /** Take choices out of a schema that this tile does not have; returns words on why, by setting. */
  without(kind, schema) {
    const { kept, project: { id }, thing } = this;
    const [told, words] = [KINDS[kind].words, {}];
    for (const { setting, values, why, instead } of this.cannot[kind] ?? []) {
      const property = schema.properties[setting];
      for (const own of [property, ...(property.anyOf ?? [])]) {
        if (own.enum) own.enum = own.enum.filter((value) => !values.includes(value));
      }
      const names = values.map((value) => told[setting].options[value]).join(", ");
      const other = instead && h("a", {
        href: `#/p/${id}/take/${instead}`,
        onclick: () => {
          kept[thing] = { [setting]: values[0] };
        },
      }, "Take a tile that can.");
      const about = [...(words[setting]?.about ?? []), `Not ${names}: ${sentence(why)} `, other];
      words[setting] = { ...told[setting], about };
    }
    return words;
  }

  /** What can be laid on the tiles: {name, box, text} of each. */
  laidOn(kind) {
    const two = Boolean(this.card.figures);
    const isDrawn = figuresOf(this.view).some((_, k) => {
      const { strokes, eyes } = drawnOn(this.project.view?.drawing, k);
      return strokes.length || eyes.length;
    });
    const pictures = figuresOf(this.view).filter((figure, k) =>
      backdropOf(this.project, figure, k) &&
      PICTURES.includes((k ? this.project.second : this.project).input?.type)
    );
    const layer = (name, text, checked) => ({
      name,
      text,
      box: h("input", {
        type: "checkbox",
        checked,
        onchange: ({ target }) => {
          if (name === "picture" && this.suits) this.looks({ art: target.checked });
          this.changed();
        },
      }),
    });
    return [
      isDrawn && layer("drawing", "With what you drew on it", this.look.drawn),
      pictures.length > 0 && layer(
        "picture",
        `With your ${two ? "pictures on the tiles" : "picture on each tile"}, in ${
          two ? "their" : "its"
        } own colours`,
        this.look.art,
      ),
    ].filter((own) => own && ON[own.name].includes(kind));
  }

  /** What is chosen here of the look holds everywhere. */
  keepLooks() {
    const given = this.form.now("palette");
    const { value, options } = colours(this.look, this.about);
    if (given && given !== value) this.looks({ palette: options[given] ? "own" : given });
  }

  looks(what) {
    Object.assign(this.look, what);
    this.keepLook(what);
    this.paint();
  }

  /** The picture is laid on what shows its colours, as the look says; else if that is wished. */
  fitLayers() {
    const [drawing, box] = [this.layer("drawing"), this.layer("picture")];
    const may = (own, can) => {
      own.disabled = own.parentElement.hidden = !can;
    };
    const [purpose, format, kind] = ["purpose", "format", "kind"].map((name) =>
      this.form.now(name)
    );
    const plain = this.kind === "animate" && format === "svg"; // moves in plain colours
    if (drawing) may(drawing, !plain && kind !== "cutter"); // which is open inside
    const suits = !COLOURLESS.includes(purpose);
    if (!box) return;
    if (suits !== this.suits) box.checked = suits && this.look.art;
    this.suits = suits;
    const turns = this.kind === "art" && format === "html";
    const holds = purpose !== "plotter" && !turns && !["dxf", "json"].includes(format);
    const curves = this.project.input?.type === "svg" && !(turns && drawing?.checked);
    may(box, !plain && (holds || curves));
  }

  /** Show the size at once; what was said or made before is past. */
  changed() {
    this.fitLayers();
    this.kept[this.thing] = this.form.values();
    const size = lengthIn(this.form.now("tile_size"));
    this.real.hidden = !(size && KINDS[this.kind].solid);
    if (!this.real.hidden) this.size.show(size, this.form.now("warn_neck"));
    const title = THINGS[this.thing].title.toLowerCase();
    const shown = { ...this.settings(), ...THINGS[this.thing].shown };
    this.live.ask(this.kind, shown, title);
    this.making.change();
  }

  /** What is to be made, as the server takes it. */
  settings() {
    const layers = this.layers.filter(({ box }) => box.checked && !box.disabled).map((
      { name },
    ) => [name, true]);
    const chosen = { tile: this.card.id, ...Object.fromEntries(layers), ...this.form.values() };
    const isTinted = chosen.picture && [undefined, "none"].includes(this.form.now("cut"));
    return isTinted ? { ...chosen, tint: this.look.tint } : chosen;
  }
}
