/** What a fit shows: the surface, the map, regions, an angle that is held, how well it fits, and files. */

import { showSurface } from "../../api/scripts/surface.js";
import { check, choice, labelled, select, slider } from "../controls.js";
import { aside, h, handled, put, row, soft, stack, toast, trying } from "../dom.js";
import { likelihood, parts } from "./facts.js";
import { Grid } from "./grid.js";
import { dark, drawBar, drawCurve, FlatMap, painted, pale } from "./map.js";
import { takeaway } from "./takeaway.js";
import { angleText, count, EDGES, percent, shape } from "./words.js";

export class Result {
  /** @param {Page} page @param {any} fit */
  constructor(page, fit) {
    this.page = page;
    this.fit = fit;
    this.ending = new AbortController();
    this.signal = this.ending.signal;
    this.grids = new Map();
    this.share = 1;
    this.holding = false;
    this.dots = { map: true, surface: false };
    this.path = `projects/${page.project.id}/density/${fit.number}`;
    this.pair = fit.angles === 1 ? [0] : [0, 1];
    this.held = { axis: 0, place: 0.5 };
  }

  stop() {
    this.ending.abort();
  }

  /** Build everything into an element. */
  async show(root) {
    const { fit } = this;
    const names = fit.names.join(", "), panels = [this.views()];
    if (fit.angles === 2) panels.push(this.conditional());
    panels.push(
      h("div.grid", likelihood(fit), parts(fit)),
      takeaway(this.page, fit, this.signal, (what) => this.submit("density take", what)),
    );
    put(root, [
      soft(`${shape(fit.space, fit.columns.length)}. ${count(fit.rows)} rows of ${names}.`),
      panels,
    ]);
    await trying(async () => {
      if (fit.surface) await this.openSurface();
      await this.openMap();
    });
  }

  views() {
    const { fit } = this, one = fit.angles === 1;
    this.mapCanvas = h("canvas", {
      role: "img",
      class: one ? "curve" : fit.space === "sphere" ? "map wide" : "map",
    });
    this.bar = h("canvas.bar-of-colours", { "aria-hidden": "true" });
    this.pairs = h("div", {});
    this.areaText = h("p.soft.small", { role: "status" });
    const said = (share) => (share >= 1 ? "everything" : percent(share));
    const words = "Show the smallest region that holds";
    const region = slider(words, [0.05, 1, 0.01], 1, said, (share) => {
      this.share = share;
      this.mark();
    });
    const dots = (name, words) =>
      check(words, this.dots[name], (shown) => {
        this.dots[name] = shown;
        this.mark();
      });
    const map = h("figure.panel.stack", [
      h("h2", one ? "The curve" : "The map"),
      this.pairs,
      this.mapCanvas,
      !one && this.bar,
      aside(EDGES[one ? "circle" : fit.space]),
    ]);
    const other = fit.surface ? this.surfaceFigure() : !one && this.conditional();
    return h("section.stack", [
      h("div", { class: one ? "stack" : "grid views" }, fit.surface ? [other, map] : [map, other]),
      h("div.panel.stack.controls", [
        h("div", region, this.areaText),
        !one && row(
          dots("map", "Rows of the table as dots on the map"),
          fit.surface && dots("surface", "and on the surface"),
        ),
      ]),
    ]);
  }

  surfaceFigure() {
    this.surfaceCanvas = handled("surface", "img", "The density on its surface", "surface-tips");
    this.cut = slider("Cut away the front", [0, 100, 1], 0, (cut) => `${cut} %`, (cut) => {
      if (this.surface) {
        this.surface.view.cut = cut;
        this.surface.redraw();
      }
    });
    this.caption = h("p.soft.small");
    return h("figure.panel.stack", [
      h("h2", "The surface"),
      h("div.turned", this.surfaceCanvas),
      h(
        "p.soft.small",
        { id: "surface-tips" },
        "Drag to turn, or use the arrow keys. Plus and minus zoom, 0 starts again.",
      ),
      this.cut,
      h("details", h("summary", "What am I looking at?"), this.caption),
    ]);
  }

  async openSurface() {
    const data = await this.page.api.get(`${this.path}/surface`);
    if (this.signal.aborted) return;
    this.span = data.span;
    this.caption.textContent = data.caption;
    this.surfaceCanvas.ariaLabel = `The density on its surface. ${data.caption}`;
    this.cut.hidden = data.round;
    this.surface = showSurface(this.surfaceCanvas, data, {
      scrolls: true,
      changed: (view) => this.cut.set(view.cut),
    });
    if (!this.surface) {
      this.surfaceCanvas.replaceWith(h("p.lonely", "This picture needs WebGL 2."));
      return;
    }
    this.cut.set(data.start.cut);
    dark.addEventListener("change", () => this.mark(), { signal: this.signal });
    this.signal.addEventListener("abort", () => this.surface.stop());
    this.mark();
  }

  openMap() {
    const { fit, signal, page: { events } } = this;
    if (fit.angles === 1) {
      const redraw = painted(this.mapCanvas, signal, (pen, width, height) => {
        if (this.grid) {
          drawCurve(pen, width, height, {
            values: [...this.grid.logs].map(Math.exp),
            axis: fit.axes[0],
            least: this.least,
          });
        }
      });
      this.map = { redraw, show: redraw, least: -Infinity, dots: true, held: null };
    } else {
      this.map = new FlatMap(this.mapCanvas, signal, fit, (u, v) => this.pick(u, v));
      this.redrawBar = painted(this.bar, signal, (pen, width) => {
        if (this.grid) drawBar(pen, width, fit, this.grid.data);
      });
      if (fit.angles > 2) this.choosePair();
    }
    events.on("refresh", () => trying(() => this.showPair()), signal);
    events.on("task", ({ operation, state, error }) => {
      if (operation !== "density map" || this.grids.has(this.pair.join("-"))) return;
      if (state === "done") trying(() => this.showPair());
      if (state === "failed") toast(error, { bad: true });
    }, signal);
    return this.showPair();
  }

  /** A box that says which two angles the map shows. */
  choosePair() {
    const { names } = this.fit;
    const pairs = names.flatMap((_, up) => names.slice(0, up).map((__, across) => [across, up]));
    const words = (pair) => pair.map((axis) => names[axis]).join(" and ");
    const box = select(pairs.map((pair, k) => [k, words(pair)]), 0, (k) => {
      this.pair = pairs[k];
      trying(() => this.showPair());
    });
    put(this.pairs, labelled("Which two angles", box), aside("Whatever the others are."));
  }

  /** Show the chosen angles; where their grid is not there yet, the server makes it, and this is called again. */
  async showPair() {
    const { pair, fit, page } = this, key = pair.join("-");
    this.mapCanvas.classList.add("busy");
    if (!this.grids.has(key)) {
      const data = await page.api.get(`${this.path}/map?axes=${key}`);
      if (!data) return this.submit("density map", { fit: fit.number, axes: pair });
      this.grids.set(key, new Grid(data, fit.space));
    }
    if (this.signal.aborted || pair !== this.pair) return undefined;
    this.grid = this.grids.get(key);
    this.map.show(this.grid, pair);
    if (!this.holding) this.held.place = this.grid.top[this.held.axis];
    this.redrawBar?.();
    const names = fit.angles ? pair.map((axis) => fit.names[axis]) : fit.names;
    this.mapCanvas.ariaLabel = `Map of the density of ${
      names.join(" and ")
    }. Bright is where rows are likely.`;
    this.mapCanvas.classList.remove("busy");
    this.mark();
    return this.drawHolding?.();
  }

  /** Mark the region on both pictures, and say how large it is. */
  mark() {
    if (!this.grid) return;
    const { least, area } = this.grid.region(this.share);
    this.least = least;
    this.map.least = least;
    this.map.dots = this.dots.map;
    this.map.held = this.holding ? this.held : null;
    this.map.redraw();
    if (this.surface) {
      const [low, high] = this.span;
      this.surface.view.least = least === -Infinity ? -1 : (least - low) / (high - low);
      this.surface.view.pale = pale();
      this.surface.view.dots = this.dots.surface;
      this.surface.redraw();
    }
    const where = this.fit.angles > 2 ? "this map" : "the space";
    this.areaText.textContent = this.share >= 1
      ? "Pull the slider to find where most rows are."
      : `${percent(this.share)} of all rows to come fall into ${percent(area)} of ${where}.`;
  }

  pick(u, v) {
    if (this.fit.angles < 2) return;
    this.hold(this.held.axis === 0 ? u : v);
    this.heldSlider.set(360 * this.held.place);
  }

  hold(place) {
    this.holding = true;
    this.held.place = place;
    this.mark();
    this.drawHolding();
  }

  /** One angle is held: the curve of the other follows. */
  conditional() {
    const canvas = h("canvas.curve", { role: "img" }),
      controls = h("div.stack"),
      place = h("div", {});
    const says = h("p.soft.small");
    const redraw = painted(canvas, this.signal, (pen, width, height) => {
      if (!this.grid) return;
      const { axis, place: at } = this.held, other = this.pair[1 - axis];
      const values = this.grid.slice(axis, at);
      drawCurve(pen, width, height, { values, axis: this.fit.axes[other] });
    });
    const names = () => this.pair.map((axis) => this.fit.names[axis]);
    const build = () => {
      const [name, other] = this.held.axis === 0 ? names() : names().reverse();
      const axis = this.fit.axes[this.pair[this.held.axis]];
      const said = (at) => `${name} = ${angleText(at / 360, axis)}`;
      const held = 360 * this.held.place;
      this.heldSlider = slider(
        `${name} is held at`,
        [0, 360, 1],
        held,
        said,
        (at) => this.hold(at / 360),
      );
      put(place, this.heldSlider);
      says.textContent =
        `The curve says how likely each ${other} then is. You may also drag on the map.`;
      canvas.setAttribute("aria-label", `Curve of ${other} while ${name} is held`);
      redraw();
    };
    let built;
    this.drawHolding = () => {
      if (built !== this.pair) {
        built = this.pair;
        /** @type {[number, string][]} */
        const axes = [[0, names()[0]], [1, names()[1]]];
        const which = choice("Hold", axes, this.held.axis, (axis) => {
          this.held = { axis, place: this.grid.top[axis] };
          build();
          this.hold(this.held.place);
        });
        put(controls, which, place, says);
        build();
      }
      redraw();
    };
    return h("section.panel.grid", stack(h("h2", "If you know one angle"), controls), canvas);
  }

  /** Give the server a task. */
  submit(operation, settings) {
    return this.page.api.start(this.page.project, operation, settings);
  }
}
