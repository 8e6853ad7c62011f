/** What lies on a tile as a picture, which each copy sees through its own colour. */

/** A picture of what lies on a figure; where there is a picture below, each copy tints it by its colour. */
export class Skin {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Matrix} matrix its pixels to the tile
   * @param {number} tint from 0 to 1: the colour's share
   * @param {{ picture: HTMLImageElement, colour(fill: string): string } | null} ink a mask drawn above, and its colour
   */
  constructor(canvas, matrix, tint, ink = null) {
    this.canvas = canvas;
    this.matrix = matrix;
    this.tint = tint;
    this.ink = ink;
    this.tinted = new Map();
  }

  /** @param {string} colour */
  in(colour) {
    if (!this.tint && !this.ink) return this.canvas;
    if (!this.tinted.has(colour)) {
      const made = this.#filled(this.canvas, colour, this.tint, "multiply");
      if (this.ink) {
        const { picture } = this.ink;
        const inked = this.#filled(picture, this.ink.colour(colour), 1, "source-over");
        made.getContext("2d").drawImage(inked, 0, 0);
      }
      this.tinted.set(colour, made);
    }
    return this.tinted.get(colour);
  }

  /** A picture with a colour over it, where it is not transparent. */
  #filled(picture, colour, share, mode) {
    const made = document.createElement("canvas");
    Object.assign(made, { width: this.canvas.width, height: this.canvas.height });
    const context = made.getContext("2d");
    context.drawImage(picture, 0, 0);
    context.globalCompositeOperation = mode;
    context.globalAlpha = share;
    context.fillStyle = colour;
    context.fillRect(0, 0, made.width, made.height);
    Object.assign(context, { globalCompositeOperation: "destination-in", globalAlpha: 1 });
    context.drawImage(picture, 0, 0);
    context.globalCompositeOperation = "source-over"; // for what is drawn on it next
    return made;
  }
}
