/** States of what somebody works on, to go back and forth. */

/** @template S */
export class States {
  /** @param {S} first */
  constructor(first) {
    this.all = [first];
    this.at = 0;
  }

  /** @param {S} state that comes after the present one, or takes its place */
  add(state, replace = false) {
    this.at += replace ? 0 : 1;
    this.all.splice(this.at, Infinity, state);
  }

  /** @param {number} step 1 or -1 */
  can(step) {
    return this.at + step in this.all;
  }

  /**
   * Go a step and return the state there, undefined if there is none.
   *
   * @param {number} step
   */
  go(step) {
    if (!this.can(step)) return undefined;
    this.at += step;
    return this.all[this.at];
  }
}
