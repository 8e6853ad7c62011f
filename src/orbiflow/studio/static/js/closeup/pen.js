/** The tool that draws on the tile: pencil, rubber and eyes, in all copies at once. */

import { boxOf } from "../../../../drawing/js/tiling.js";
import { KeyPen } from "../keypen.js";
import { eyeInto, lineInto, markInto } from "../skin.js";
import { partAround } from "./bucket.js";
import { Riders } from "./carry.js";
import { drawnOn, marksOf } from "./drawn.js";
import { rubbed, short, simplified } from "./lines.js";
import { isSame } from "./stage.js";

const PIECES = 40; // of a straight line, which bends with the tile
const NEAR = 0.0015; // by which a line may be simplified
const LONGEST = 0.03; // side of a line
const RUBBER = 0.03;
const KEY_STEP = 7; // pixels that a key moves the pen, with Shift three times as many

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
    this.keys = new KeyPen({
      size: () => [stage.width, stage.height],
      step: (far) => (far ? 3 : 1) * KEY_STEP,
      down: (at) => this.#press(at),
      move: (at) => this.move(at),
      up: () => {
        this.up();
        on.said("The pen is up.");
      },
    });
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
    const same = isSame(copy, this.line.copy);
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
    const { left, wide } = boxOf(map.rest);
    const twice = 2 * left + wide;
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

  hover() {
    this.stage.canvas.style.cursor = "crosshair";
  }

  /** Arrows move the pen, space puts it down and up again. */
  key(event) {
    const heard = this.keys.key(event);
    if (heard) this.stage.redraw();
    return heard;
  }

  /** The pen of the keys is put down; whether it stays down. */
  #press(place) {
    if (!this.down(place)) return false;
    const { tool } = this.settings;
    const once = { eye: "An eye is in its place.", fill: "The part is filled." }[tool];
    if (once) this.up();
    this.on.said(once ?? "The pen is down. Arrow keys draw; press space to lift it.");
    return !once;
  }

  paint(context) {
    if (!this.keys.at || document.activeElement !== this.stage.canvas) return;
    const [x, y] = this.keys.at;
    for (const [colour, width] of [["#ffffff", 5], ["#0b6b66", 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.stroke(new Path2D(`M${x - 11} ${y}h22M${x} ${y - 11}v22`));
    }
  }
}
