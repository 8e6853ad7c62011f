/** States of what somebody works on, to go back and forth by buttons and keys. */

import { button } from "../dom.js";

/** @template S */
export class States {
  /** @param {S} first @param {(state: S) => void} went hears where one has gone */
  constructor(first, went) {
    this.went = went;
    this.buttons = [
      button("Undo", () => this.go(-1), { kind: "quiet", image: "undo" }),
      button("Redo", () => this.go(1), { kind: "quiet", image: "redo" }),
    ];
    this.begin(first);
  }

  /** @param {S} first that comes after none */
  begin(first) {
    this.all = [first];
    this.#at(0);
  }

  /** @param {S} state that comes after the present one, or takes its place */
  add(state, replace = false) {
    const at = this.at + (replace ? 0 : 1);
    this.all.splice(at, Infinity, state);
    this.#at(at);
  }

  /** @param {number} step 1 or -1 */
  go(step) {
    if (!(this.at + step in this.all)) return;
    this.#at(this.at + step);
    this.went(this.all[this.at]);
  }

  #at(at) {
    this.at = at;
    this.buttons[0].disabled = at === 0;
    this.buttons[1].disabled = at === this.all.length - 1;
  }
}
