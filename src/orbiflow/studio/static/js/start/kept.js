/** What is painted over a picture, as the server has it: sent when it changes, taken over when another tab paints. */

import { newest, trying } from "../dom.js";
import { Marks } from "./marks.js";

export const LAYERS = ["mend", "pins", "emphasis"];

export class Kept {
  marks = new Marks(1, 1);
  sent = 0; // strokes that the server has
  #unsent = new Set();
  #sending = 0; // layers that are on their way

  /**
   * `own()`: what the project has of the picture; `began(answer)` hears what the server does with a layer.
   *
   * @param {Page} page
   * @param {number} number of the picture
   * @param {{ own(): Partial<Picture>, began(answer: any): void }} on
   */
  constructor({ api, project }, number, on) {
    this.api = api;
    this.project = project;
    this.number = number;
    this.on = on;
    this.known = this.#masks; // that the marks began with or became
    this.send = Object.fromEntries(
      LAYERS.map((layer) => [layer, newest(() => this.#upload(layer), 200)]),
    );
  }

  add(stroke) {
    this.marks.add(stroke);
    this.#unsent.add(stroke);
  }

  /** The addresses of what the server has of each layer. */
  get #masks() {
    return LAYERS.map((layer) => this.on.own()[layer] ?? null);
  }

  /** Whether the server has other marks than these, painted elsewhere. */
  get #isBehind() {
    return !this.#sending && String(this.#masks) !== String(this.known);
  }

  /** Begin with the marks that the server has, and what is not sent; false if there is nothing new. */
  async follow({ width, height }) {
    const { api, project } = this;
    if (this.#isBehind) Object.assign(project, await api.get(`projects/${project.id}`)); // events may be late
    if (this.marks.width === width && this.marks.height === height && !this.#isBehind) return false;
    const known = this.known = this.#masks;
    const marks = new Marks(width, height);
    await Promise.all(
      LAYERS.map((layer, k) =>
        known[k] && trying(() => marks.load(layer, known[k], { both: layer === "mend" }))
      ),
    );
    if (known !== this.known) return false;
    marks.strokes = [...this.#unsent];
    this.marks = marks;
    this.sent = 0;
    return true;
  }

  async #upload(layer) {
    const { api, marks, marks: { strokes } } = this;
    const address = `projects/${this.project.id}/${layer}?number=${this.number}`;
    this.#sending += 1;
    try {
      const answer = marks.has(layer)
        ? await api.put(address, await marks.png(layer, { clear: layer === "mend" }))
        : await api.remove(address);
      this.on.own()[layer] = this.known[LAYERS.indexOf(layer)] = answer.mask;
      marks.of(layer, strokes).forEach((stroke) => this.#unsent.delete(stroke));
      if (layer === "mend") this.sent = strokes.length;
      this.on.began({ ...answer, layer });
    } finally {
      this.#sending -= 1;
    }
  }
}
