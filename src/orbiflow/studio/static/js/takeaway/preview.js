/** What will be made, drawn small as soon as a setting changes. */

import { h, put, stack } from "../dom.js";
import { duration } from "../waiting.js";

const PATIENCE = 1500; // ms after which an unwanted drawing is given up
const SIDES = [480, 1000]; // pixels: soon, then in detail
const SLOW = 1000; // ms after which the page says so

const SAYS = { animate: "One moment of the animation." };
/** Seconds that previews took in this session, by operation and detail. */
const took = {};

export class Preview {
  /**
   * @param {Api} api
   * @param {string} place the address of the tile
   * @param {HTMLElement} meanwhile shown until the first one is there
   * @param {(error: import("../api.js").Refusal | null, notes: string[]) => void} told
   */
  constructor(api, place, meanwhile, told) {
    this.api = api;
    this.place = place;
    this.told = told;
    this.says = h("p.soft.small", { "aria-live": "polite" });
    this.meanwhile = meanwhile;
    this.image = h("div.live", meanwhile);
    this.root = stack(this.image, this.says);
    this.wanted = "";
    /** @type {AbortController | null} */
    this.running = null;
  }

  /** Draw what these settings make, or the last of several. False if they are drawn already. */
  ask(operation, settings, title) {
    const wanted = JSON.stringify({ operation, settings });
    if (wanted === this.wanted) return false;
    this.wanted = wanted;
    this.title = title;
    const late = this.running && performance.now() - this.began > PATIENCE;
    if (late) this.running.abort();
    if (!this.running || late) this.#draw(late);
    return true;
  }

  async #draw(instead, detail = 0) {
    const [running, asked] = [new AbortController(), this.wanted];
    this.running = running;
    this.again = false;
    this.began = performance.now();
    const { operation, settings } = JSON.parse(asked);
    const kind = `${operation} ${settings.kind ?? settings.world ?? ""} ${detail}`;
    const slow = setTimeout(() => {
      const usual = took[kind] > 1.5 ? ` It took ${duration(took[kind])} the last time.` : "";
      this.says.textContent = `Drawing ${
        detail ? "it in more detail" : "what will be made"
      } …${usual}`;
    }, SLOW);
    try {
      const body = { operation, settings, instead, side: SIDES[detail] };
      const { signal } = running;
      const found = await this.api.post(`${this.place}/preview`, body, { signal });
      if (running !== this.running) return;
      took[kind] = (performance.now() - this.began) / 1000;
      const src = `data:image/png;base64,${found.image}`;
      put(this.image, h("img", { src, alt: `What will be made: ${this.title}` }));
      this.says.textContent = SAYS[operation] ?? "";
      this.told(null, found.notes);
      this.again = !detail && operation !== "solid";
    } catch (error) {
      if (running !== this.running || error.name === "AbortError") return;
      this.says.textContent = "";
      if (asked === this.wanted) this.told(error, []);
    } finally {
      clearTimeout(slow);
      if (running === this.running) {
        this.running = null;
        if (asked !== this.wanted) this.#draw(false);
        else if (this.again) this.#draw(false, 1);
      }
    }
  }

  close() {
    this.wanted = this.says.textContent = "";
    put(this.image, this.meanwhile);
    this.running?.abort();
    this.running = null;
  }
}
