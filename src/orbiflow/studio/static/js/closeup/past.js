/** What was done to a project's tiles, to be undone and redone; it outlives a change of the address. */

import { button } from "../dom.js";

/** @typedef {{ tile?: [number, number], drawing?: [any, any] }} Step each with before and after */

/** @type {Map<string, { done: Step[], undone: Step[], at?: number }>} */
const pasts = new Map();

export class Past {
  /**
   * @param {string} project
   * @param {{ go(step: Step, side: 0 | 1): any, busy(): boolean, said(text: string): void }} on
   */
  constructor(project, on) {
    if (!pasts.has(project)) pasts.set(project, { done: [], undone: [] });
    this.steps = pasts.get(project);
    this.on = on;
    this.buttons = [
      button("Undo", () => this.undo(), { kind: "icon", image: "undo" }),
      button("Redo", () => this.redo(), { kind: "icon", image: "redo" }),
    ];
    this.show(null); // nothing can be undone before the tile is there
  }

  /**
   * Take the tile that is shown; another one than steps have led to has a past of its own.
   *
   * @param {TileView | null} view
   */
  show(view, quiet = true) {
    const { steps } = this;
    if (view && (steps.at ??= view.id) !== view.id && !quiet) {
      Object.assign(steps, { done: [], undone: [] });
    }
    if (view) steps.at = view.id;
    this.view = view;
    this.buttons[0].disabled = !steps.done.length && !view?.parent;
    this.buttons[1].disabled = !steps.undone.length;
  }

  /** @param {Step} step */
  did(step) {
    this.steps.done.push(step);
    this.steps.undone.length = 0;
    this.show(this.view);
  }

  /** The tile that was there first. */
  get first() {
    return this.steps.done.find((step) => step.tile)?.tile[0];
  }

  async undo() {
    const { done } = this.steps;
    if (!done.length && this.view?.parent) done.push({ tile: [this.view.parent, this.view.id] });
    await this.#go(done, this.steps.undone, 0, "Undone.");
  }

  async redo() {
    await this.#go(this.steps.undone, this.steps.done, 1, "Done again.");
  }

  async #go(from, to, side, words) {
    if (this.going || this.on.busy()) return;
    const step = from.pop();
    if (!step) return;
    this.going = true;
    to.push(step);
    await this.on.go(step, side);
    this.on.said(words);
    this.going = false;
    this.show(this.view);
  }
}
