/** The tool that draws on the tile: pencil, rubber and eyes, in all copies at once. */

import { eyeInto, lineInto } from "../skin.js";
import { beside, rubbed, short, simplified } from "./lines.js";
import { Riders } from "./carry.js";

export const WIDTHS = { thin: 0.008, medium: 0.018, thick: 0.04 }; // in sizes of the tile
const EYE = 0.045;
const NEAR = 0.0015; // by which a line may be simplified
const LONGEST = 0.03; // side of a line
const RUBBER = 0.03;
const ROOM = 0.75; // share of the distance to the outline that an eye may fill
const KEY_STEP = 7; // pixels that a key moves the pen

/** What is drawn on a figure. */
const drawnOn = (drawing, figure) => {
  const { strokes = [], eyes = [] } = (figure ? drawing?.second : drawing) ?? {};
  return { strokes, eyes };
};

export class Pen {
  /** `settings`: {tool: "pencil" | "rubber" | "eye", colour, width}; `on`: {drawn(drawing), said(text), marks()}. */
  constructor(stage, settings, on) {
    this.stage = stage;
    this.settings = settings;
    this.on = on;
    this.drawing = { strokes: [], eyes: [] };
    this.marks = [{ lines: [], eyes: [] }]; // on each figure
    this.line = null;
  }

  /** Take the map of each of a tile's figures, and what was drawn: on the second figure under `second`. */
  use(carries, drawing) {
    this.carries = carries;
    this.drawing = { ...drawing, ...drawnOn(drawing, 0) };
    this.#carried();
  }

  get size() {
    return Math.sqrt(this.stage.tiling.area);
  }

  #carried() {
    this.marks = this.carries.map((carry, figure) => {
      const { strokes, eyes } = drawnOn(this.drawing, figure);
      return {
        lines: strokes.map(({ points, colour, width }) => ({
          points: points.map((point) => carry.forward(point)),
          colour,
          width: width * carry.scale, // as exports keep it
        })),
        eyes: eyes.map(([x, y, radius]) => this.#eye(figure, [x, y], radius)),
      };
    });
    this.moving = null;
    this.on.marks();
  }

  #eye(figure, point, radius) {
    const carry = this.carries[figure];
    const at = carry.forward(point);
    const grown = radius * carry.growth(point, 0.5 * EYE * this.size / carry.scale);
    return { at, radius: Math.min(grown, ROOM * this.#room(figure, at)), light: carry.light };
  }

  /** The distance of a point of a figure from its outline. */
  #room(figure, at) {
    const ring = this.stage.tiling.figures[figure].polygon;
    return Math.min(...ring.map((a, k) => beside(at, a, ring[(k + 1) % ring.length]).apart));
  }

  down(place) {
    const found = this.stage.copyAt(place);
    if (!found) return false;
    this.before = this.drawing;
    if (this.settings.tool === "eye") this.#addEye(found);
    else if (this.settings.tool === "rubber") this.#rub(found);
    else this.line = { copy: found.copy, points: [found.at] };
    this.stage.redraw();
    return true;
  }

  move(place) {
    const found = this.stage.copyAt(place);
    if (!found) return;
    if (this.settings.tool === "rubber") this.#rub(found);
    else if (this.line) this.#draw(found);
    this.stage.redraw();
  }

  #draw({ copy, at }) {
    const same = copy.aspect === this.line.copy.aspect &&
      String(copy.cell) === String(this.line.copy.cell);
    if (same) {
      this.line.points.push(at);
      return;
    }
    // over the edge: the line goes on in the next tile
    this.#keepLine();
    this.line = { copy, points: [at] };
  }

  up() {
    if (this.line) this.#keepLine();
    this.line = null;
    if (this.before !== this.drawing) this.on.drawn(this.drawing, this.before);
    this.stage.redraw();
  }

  cancel() {
    this.line = null;
    if (this.before) this.drawing = this.before;
    this.#carried();
  }

  #keepLine() {
    const { figure } = this.line.copy;
    const carry = this.carries[figure];
    const points = simplified(this.line.points, NEAR * this.size, LONGEST * this.size);
    const size = this.size / carry.scale; // in the silhouette
    const own = points.map((point) => carry.inverse(point).map((value) => short(value, size)));
    const stroke = {
      colour: this.settings.colour,
      width: short(WIDTHS[this.settings.width] * size, size),
      points: own,
    };
    const { strokes, eyes } = drawnOn(this.drawing, figure);
    this.#change(figure, { strokes: [...strokes, stroke], eyes });
  }

  #addEye({ copy: { figure }, at }) {
    const carry = this.carries[figure];
    const size = this.size / carry.scale;
    const [x, y] = carry.inverse(at).map((value) => short(value, size));
    const { strokes, eyes } = drawnOn(this.drawing, figure);
    this.#change(figure, { strokes, eyes: [...eyes, [x, y, short(EYE * size, size)]] });
  }

  #rub({ copy: { figure }, at }) {
    const reach = RUBBER * this.size;
    const [before, marks] = [drawnOn(this.drawing, figure), this.marks[figure]];
    let hit = false;
    const strokes = before.strokes.flatMap((stroke, k) => {
      const { points, width } = marks.lines[k];
      const parts = rubbed(points, at, reach + width / 2);
      if (!parts) return [stroke];
      hit = true;
      return parts.map((part) => ({ ...stroke, points: part.map((i) => stroke.points[i]) }));
    });
    const eyes = before.eyes.filter((_, k) => {
      const { at: [x, y], radius } = marks.eyes[k];
      return Math.hypot(x - at[0], y - at[1]) > radius + reach / 2;
    });
    if (hit || eyes.length < before.eyes.length) this.#change(figure, { strokes, eyes });
  }

  /** Take what is drawn on a figure. */
  #change(figure, own) {
    this.drawing = figure ? { ...this.drawing, second: own } : { ...this.drawing, ...own };
    this.#carried();
  }

  /** Show what is drawn where the tile is pulled to; `body` is null when it rests. */
  ride(moving, body) {
    if (!body) {
      this.moving = null;
      return;
    }
    if (this.moving?.of !== moving) {
      const { riders } = moving;
      this.moving = {
        of: moving,
        marks: this.marks.map(({ lines, eyes }) => ({
          lines: lines.map((line) => ({
            ...line,
            seats: line.points.map((point) => riders.seat(point)),
          })),
          eyes: eyes.map((eye) => ({ ...eye, seat: riders.seat(eye.at) })),
        })),
      };
    }
    for (const { lines, eyes } of this.moving.marks) {
      for (const line of lines) line.points = line.seats.map((seat) => Riders.at(seat, body));
      for (const eye of eyes) eye.at = Riders.at(eye.seat, body);
    }
  }

  /** Draw on a copy the line in hand, and all marks while the tile is pulled. */
  over(context, { figure }) {
    if (!this.line && !this.moving) return;
    const { palette } = this.stage.options;
    const { lines, eyes } = this.moving?.marks[figure] ?? { lines: [], eyes: [] };
    context.save();
    context.clip(this.stage.tiling.figures[figure].path);
    for (const { points, colour, width } of lines) lineInto(context, points, colour, width);
    if (this.line?.copy.figure === figure) {
      lineInto(
        context,
        this.line.points,
        this.settings.colour,
        WIDTHS[this.settings.width] * this.size,
      );
    }
    context.restore();
    for (const { at, radius, light } of eyes) eyeInto(context, at, radius, palette, light);
  }

  hover(place) {
    this.at = place;
    this.stage.canvas.style.cursor = "crosshair";
  }

  /** Arrows move the pen, space puts it down and up again. */
  key(event) {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[event.key];
    if (way) {
      this.pen ??= [this.stage.width / 2, this.stage.height / 2];
      const far = event.shiftKey ? 3 * KEY_STEP : KEY_STEP;
      this.pen = [this.pen[0] + far * way[0], this.pen[1] + far * way[1]];
      if (this.penDown) this.move(this.pen);
      this.stage.redraw();
      return true;
    }
    if (event.key === " " || event.key === "Enter") {
      this.pen ??= [this.stage.width / 2, this.stage.height / 2];
      if (this.penDown) {
        this.up();
        this.penDown = false;
        this.on.said("The pen is up.");
      } else if (this.down(this.pen)) {
        this.penDown = this.settings.tool !== "eye";
        if (!this.penDown) this.up();
        this.on.said(
          this.penDown
            ? "The pen is down. Arrow keys draw; press space to lift it."
            : "An eye is in its place.",
        );
      }
      return true;
    }
    return false;
  }

  paint(context) {
    if (!this.pen || document.activeElement !== this.stage.canvas) return;
    const [x, y] = this.pen;
    for (const [colour, width] of [["#ffffff", 5], ["#0b6b66", 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.beginPath();
      context.moveTo(x - 11, y);
      context.lineTo(x + 11, y);
      context.moveTo(x, y - 11);
      context.lineTo(x, y + 11);
      context.stroke();
    }
  }
}
