/** The tool that draws on the tile: pencil, rubber and eyes, in all copies at once. */

import { eyeInto, lineInto, markInto } from "../skin.js";
import { partAround } from "./bucket.js";
import { Riders } from "./carry.js";
import { drawnOn, marksOf } from "./drawn.js";
import { rubbed, short, simplified } from "./lines.js";

const PIECES = 40; // of a straight line, which bends with the tile
const NEAR = 0.0015; // by which a line may be simplified
const LONGEST = 0.03; // side of a line
const RUBBER = 0.03;
const KEY_STEP = 7; // pixels that a key moves the pen

/** Points on the way from one to another. */
const straight = ([a, b], [c, d]) =>
  [...Array(PIECES + 1).keys()].map((k) => [
    a + k / PIECES * (c - a),
    b + k / PIECES * (d - b),
  ]);

/** Whether a place is inside of rings, of which holes are some. */
const isInside = (rings, [x, y]) =>
  rings.reduce(
    (odd, ring) =>
      ring.reduce((own, [a, b], k) => {
        const [c, d] = ring[(k + 1) % ring.length];
        return (b > y) !== (d > y) && x < a + (y - b) / (d - b) * (c - a) ? !own : own;
      }, odd),
    false,
  );

export class Pen {
  /** `settings`: {tool: "pencil" | "line" | "fill" | "rubber" | "eye", colour, size, eye, mirror}; `on`: {drawn(drawing), said(text), marks()}. */
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
    this.marks = marksOf(this.drawing, this.carries, this.stage.tiling);
    this.moving = null;
    this.on.marks();
  }

  down(place) {
    const found = this.stage.copyAt(place);
    if (!found) return false;
    this.before = this.drawing;
    const { tool } = this.settings;
    if (tool === "eye") this.#addEye(found);
    else if (tool === "fill") this.#fill(found);
    else if (tool === "rubber") this.#rub(found, true);
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
    if (this.settings.tool === "line") {
      if (same) this.line.points = straight(this.line.points[0], at);
      return;
    }
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

  /** A ring or line of the tile in the silhouette, and how large a tile is there. */
  #kept(figure, points) {
    const carry = this.carries[figure];
    const size = this.size / carry.scale;
    return points.map((point) => carry.inverse(point).map((value) => short(value, size)));
  }

  /** Points, and their mirror image from left to right where that is wished. */
  #bothSides(figure, points) {
    const { map } = this.carries[figure];
    if (!this.settings.mirror || !map) return [points];
    const xs = map.rest.map(([x]) => x);
    const twice = Math.min(...xs) + Math.max(...xs);
    return [points, points.map(([x, y, ...more]) => [twice - x, y, ...more])];
  }

  #keepLine() {
    const { figure } = this.line.copy;
    const points = simplified(this.line.points, NEAR * this.size, LONGEST * this.size);
    const size = this.size / this.carries[figure].scale; // in the silhouette
    const { colour, size: width } = this.settings;
    const { strokes, eyes } = drawnOn(this.drawing, figure);
    const fresh = this.#bothSides(figure, this.#kept(figure, points)).map((own) => ({
      colour,
      width: short(width * size, size),
      points: own,
    }));
    this.#change(figure, { strokes: [...strokes, ...fresh], eyes });
  }

  /** Fill a part; what is filled lies under all lines. */
  #fill({ copy: { figure }, at }) {
    const { lines } = this.marks[figure];
    const rings = partAround(this.stage.tiling.figures[figure], lines, at);
    if (!rings.length) return;
    const kept = rings.map((ring) => this.#kept(figure, ring));
    const { strokes, eyes } = drawnOn(this.drawing, figure);
    const part = { colour: this.settings.colour, width: 0, points: kept[0], rings: kept };
    const last = strokes.findLastIndex((stroke) => stroke.rings) + 1;
    this.#change(figure, { strokes: strokes.toSpliced(last, 0, part), eyes });
  }

  #addEye({ copy: { figure }, at }) {
    const size = this.size / this.carries[figure].scale;
    const [[x, y]] = this.#kept(figure, [at]);
    const { strokes, eyes } = drawnOn(this.drawing, figure);
    const fresh = this.#bothSides(figure, [[x, y, short(this.settings.eye * size, size)]]).flat();
    this.#change(figure, { strokes, eyes: [...eyes, ...fresh] });
  }

  /** Rub out lines and eyes; where the rubber is put down, also the part that is filled there. */
  #rub({ copy: { figure }, at }, first = false) {
    const reach = RUBBER * this.size;
    const [before, marks] = [drawnOn(this.drawing, figure), this.marks[figure]];
    let hit = false;
    const strokes = before.strokes.flatMap((stroke, k) => {
      const { points, width, rings } = marks.lines[k];
      if (rings) {
        const gone = first && isInside(rings, at);
        hit ||= gone;
        return gone ? [] : [stroke];
      }
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
            ringSeats: line.rings?.map((ring) => ring.map((point) => riders.seat(point))),
          })),
          eyes: eyes.map((eye) => ({ ...eye, seat: riders.seat(eye.at) })),
        })),
      };
    }
    for (const { lines, eyes } of this.moving.marks) {
      for (const line of lines) {
        line.points = line.seats.map((seat) => Riders.at(seat, body));
        line.rings = line.ringSeats?.map((ring) => ring.map((seat) => Riders.at(seat, body)));
      }
      for (const eye of eyes) eye.at = Riders.at(eye.seat, body);
    }
  }

  /** Draw on a copy the line in hand, and all marks while the tile is pulled. */
  over(context, { figure }) {
    if (!this.line && !this.moving) return;
    const { palette } = this.stage.options;
    const hidden = !this.moving || !this.stage.options.drawn;
    const { lines, eyes } = hidden ? { lines: [], eyes: [] } : this.moving.marks[figure];
    context.save();
    context.clip(this.stage.tiling.figures[figure].path);
    for (const line of lines) markInto(context, line);
    if (this.line?.copy.figure === figure) {
      lineInto(
        context,
        this.line.points,
        this.settings.colour,
        this.settings.size * this.size,
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
        this.penDown = !["eye", "fill"].includes(this.settings.tool);
        if (!this.penDown) this.up();
        this.on.said(
          this.penDown
            ? "The pen is down. Arrow keys draw; press space to lift it."
            : this.settings.tool === "eye"
            ? "An eye is in its place."
            : "The part is filled.",
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
