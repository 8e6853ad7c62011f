/** Take a tile away: to print or cut, as a picture, a solid or an animation, or the whole project. */

import { Carry } from "../closeup/carry.js";
import { drawnOn, marksOf } from "../closeup/drawn.js";
import { check, choice } from "../controls.js";
import { aside, h, icon, put, section, stack, style, trying } from "../dom.js";
import { form } from "../forms.js";
import { lookKeeper, lookOf, paletteOf } from "../look.js";
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

/** @type {Show} */
export async function show(root, page) {
  const card = page.project.tiles.find(({ id }) => id === page.number);
  if (!card) throw new Error("This tile is not there any more.");
  await style("takeaway");
  const own = new TakeawayPage(page, card);
  const place = `${own.place}/tiles/${card.id}`;
  [own.view, own.cannot, own.rectangles] = await Promise.all(
    [place, `${place}/cannot`, `${place}/rectangles`].map((path) => page.api.get(path)),
  );
  own.build(root);
  own.listen(page);
  await own.choose(own.kept.thing);
}

class TakeawayPage {
  /** @param {Page} page @param {Card} card */
  constructor(page, card) {
    const { api, project, about } = page;
    this.api = api;
    this.project = project;
    this.card = card;
    this.place = `projects/${project.id}`;
    this.kept = KEPT[project.id] ??= { thing: "poster", machines: {} };
    this.about = about;
    this.look = lookOf(project, about);
    this.keepLook = lookKeeper(page);
    this.pictures = new Pictures(() => this.paint());
    /** @type {TileView | null} */
    this.view = null;
    /** @type {Record<string, { setting: string, values: string[], why: string, instead: number }[]>} */
    this.cannot = {};
    /** @type {Point[][]} */
    this.rectangles = [];
    this.schemas = new Map();
    this.layers = { drawing: null, picture: null };
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
    const heard = (error, notes) => this.heard(error, notes);
    this.live = new Preview(this.api, `${this.place}/tiles/${this.card.id}`, this.canvas, heard);
    this.shown = h("div.preview", this.live.root);
    this.noted = h("ul.notice", { hidden: true });
    this.size = trueSize(this.card, this.rectangles);
    this.real = section("panel real", "true", "In its true size", this.size.root);
    this.wishes = h("div.stack");
    /** @type {[string, string, any][]} */
    const choices = Object.entries(THINGS).map(([key, { title, image }]) => [key, title, image]);
    const choose = (thing) => trying(() => this.choose(thing));
    const things = choice("What shall it be?", choices, this.kept.thing, choose);
    put(root, [
      h("h1", { tabindex: "-1" }, "Take it away"),
      h("div.take", [
        h("div.stack.side", [
          h("section.panel.stack.wishes", things, this.wishes, h("div.go", this.making.make)),
          share(this.api, this.project, this.card),
          section("panel whole", "whole", "The whole project", [
            aside("One file with the picture and all tiles. It opens again here, and from Python."),
            h("a.button", { href: `api/${this.place}/file`, download: true }, [
              icon("download"),
              "Save the project",
            ]),
          ]),
        ]),
        stack(this.shown, this.noted, this.making.said, this.real),
      ]),
      this.making.earlier,
    ]);
  }

  /** @param {Page} page */
  listen({ events, navigate, signal }) {
    new ResizeObserver(() => this.paint()).observe(this.shown);
    events.on("task refresh", () => this.making.tell(), signal);
    const gone = ({ tile }) => tile === this.card.id && navigate(`p/${this.project.id}`);
    events.on("gone", gone, signal);
    signal.addEventListener("abort", () => this.live.close());
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
    const isDrawn = this.layers.drawing?.is() ?? look.drawn;
    const marks = isDrawn &&
      marksOf(project.view?.drawing, figures.map((own) => new Carry(own)), tiling);
    const how = { look, palette: paletteOf(look, this.about), pictures, marks };
    return skinsOf(project, figures, tiling.figures, how, scale);
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
    put(this.wishes, [
      Object.values(this.layers),
      machine && profiles(this.api, this.form, this.kept.machines[thing] ??= {}),
      this.form,
      choice("Lengths in", [["mm", "mm"], ["in", "inches"]], unit(), (/** @type {any} */ own) => {
        showIn(own);
        trying(() => this.choose(thing));
      }),
    ]);
    this.making.task = null;
    this.changed();
  }

  /** Say why this tile cannot be the thing that was chosen. */
  refuse(why) {
    put(this.wishes, h("p.notice", why));
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

  /** What can be laid on the tiles, a box to tick for each that can. */
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
    const layer = (name, is, text, checked) => {
      if (!is || !ON[name].includes(kind)) return null;
      return check(text, checked, (on) => {
        if (name === "picture" && this.suits) this.looks({ art: on });
        this.changed();
      });
    };
    const [which, whose] = two
      ? ["pictures on the tiles", "their"]
      : ["picture on each tile", "its"];
    const words = `With your ${which}, in ${whose} own colours`;
    return {
      drawing: layer("drawing", isDrawn, "With what you drew on it", this.look.drawn),
      picture: layer("picture", pictures.length > 0, words, this.look.art),
    };
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
    const { drawing, picture } = this.layers;
    const [purpose, format, kind] = ["purpose", "format", "kind"].map((name) =>
      this.form.now(name)
    );
    const plain = this.kind === "animate" && format === "svg"; // moves in plain colours
    if (drawing) drawing.hidden = plain || kind === "cutter"; // which is open inside
    const suits = !COLOURLESS.includes(purpose);
    if (!picture) return;
    if (suits !== this.suits) picture.set(suits && this.look.art);
    this.suits = suits;
    const turns = this.kind === "art" && format === "html";
    const holds = purpose !== "plotter" && !turns && !["dxf", "json"].includes(format);
    const curves = this.project.input?.type === "svg" && !(turns && drawing?.is());
    picture.hidden = plain || !(holds || curves);
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
    const layers = Object.entries(this.layers).filter(([, box]) => box?.is() && !box.hidden);
    const laid = Object.fromEntries(layers.map(([name]) => [name, true]));
    const chosen = { tile: this.card.id, ...laid, ...this.form.values() };
    const isTinted = chosen.picture && [undefined, "none"].includes(this.form.now("cut"));
    return isTinted ? { ...chosen, tint: this.look.tint } : chosen;
  }
}
