/** What lies on the tiles of the close-up: painted anew when it is too coarse, or while the tile is pulled. */

import { Pictures, skinsOf } from "../skin.js";
import { Riders } from "./carry.js";

const SHARPER = 1.5; // times that the scale may change before a skin is painted anew
const NO_MARKS = { lines: [], eyes: [] };

export class Dress {
  /**
   * @param {Project} project
   * @param {any} look
   * @param {import("./stage.js").Stage} stage
   * @param {import("./pen.js").Pen} pen
   */
  constructor(project, look, stage, pen) {
    this.project = project;
    this.look = look;
    this.stage = stage;
    this.pen = pen;
    /** @type {any} */
    this.moving = null;
    this.pictures = new Pictures(() => this.stale());
    stage.options.skins = () => this.skins();
  }

  /** @param {FigureView[]} figures of the tile that is shown */
  use(figures) {
    this.figures = figures;
    this.moving = null;
    this.stale();
  }

  stale() {
    this.known = null;
    this.stage.redraw();
  }

  /** Let all that lies on the tile ride on its body as it is pulled; `body` is null when it rests. */
  ride(puller, body, space) {
    if (!body) this.moving = null;
    else if (this.moving?.puller !== puller) {
      const riders = new Riders(space.body);
      const seats = this.figures.map(({ map }) =>
        (this.look.art && map?.images.map((point) => riders.seat(point))) || null
      );
      this.moving = { puller, riders, seats };
    }
    if (body) this.moving.body = body;
    this.pen.ride(this.moving, body);
    this.stale();
  }

  /** The figures as they are now. */
  #now() {
    if (!this.moving) return this.figures;
    const { seats, body } = this.moving;
    return this.figures.map((figure, k) => {
      const images = seats[k]?.map((seat) => Riders.at(seat, body));
      return images ? { ...figure, map: { ...figure.map, images } } : figure;
    });
  }

  skins() {
    const { look, stage, pen, moving } = this;
    if (look.share < 1 && !look.art) return null;
    const scale = stage.camera.scale * Math.min(globalThis.devicePixelRatio || 1, moving ? 1 : 2);
    if (!this.known || Math.abs(Math.log(this.known.scale / scale)) > Math.log(SHARPER)) {
      const marks = look.share < 1 || moving || !look.drawn
        ? this.figures.map(() => NO_MARKS)
        : pen.marks;
      const { palette } = stage.options;
      const how = { look, palette, pictures: this.pictures, marks, share: look.share };
      const own = skinsOf(this.project, this.#now(), stage.tiling.figures, how, scale);
      this.known = { scale, own };
    }
    return this.known.own;
  }
}
