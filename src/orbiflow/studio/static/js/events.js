/** A project that stays true: its events are applied in place, then told to whoever listens. */

import { api } from "./api.js";

const KINDS = ["task", "silhouette", "card", "notice", "project", "gone"];

const byId = (list, item, add) => {
  const at = list.findIndex((other) => other.id === item.id);
  if (at >= 0) list[at] = item;
  else list[add](item);
};

/** Best first: certified stars, then the score. @param {Card} a @param {Card} b */
export const better = (a, b) => b.stars - a.stars || b.score - a.score || a.id - b.id;

export class Feed extends EventTarget {
  /** The feed of a project that was just fetched. @param {Project} project */
  constructor(project) {
    super();
    this.project = project;
    this.closing = new AbortController();
    const seen = () => (document.hidden ? this.rest() : this.refresh());
    document.addEventListener("visibilitychange", seen, { signal: this.closing.signal });
    this.open();
  }

  /**
   * Hear kinds of events, "lost", "back" or "refresh", as long as a signal lasts.
   *
   * @param {string} kinds such as "task gone"
   * @param {(data: any) => any} handler
   * @param {AbortSignal} [signal]
   */
  on(kinds, handler, signal) {
    for (const kind of kinds.split(" ")) {
      this.addEventListener(kind, (event) => handler(/** @type {CustomEvent} */ (event).detail), {
        signal,
      });
    }
  }

  tell(kind, detail) {
    this.dispatchEvent(new CustomEvent(kind, { detail }));
  }

  apply(kind, data) {
    const own = this.project;
    if (kind === "task") byId(own.tasks, data, "unshift");
    if (kind === "card") byId(own.tiles, data, "push");
    if (kind === "card") own.tiles.sort(better);
    if (kind === "silhouette" || kind === "project") Object.assign(own, data);
    if (kind === "gone" && data.tile) own.tiles = own.tiles.filter((card) => card.id !== data.tile);
  }

  open() {
    const source = new EventSource(
      `api/projects/${this.project.id}/events?after=${this.project.head ?? 0}`,
    );
    this.source = source;
    let lost = false;
    for (const kind of KINDS) {
      source.addEventListener(kind, (event) => {
        const data = JSON.parse(event.data);
        this.project.head = Number(event.lastEventId) || this.project.head;
        this.apply(kind, data);
        this.tell(kind, data);
      });
    }
    source.onopen = () => {
      if (lost) {
        lost = false;
        this.tell("back");
        this.refresh();
      }
    };
    source.onerror = () => {
      if (this.source !== source) return;
      if (!lost) this.tell("lost");
      lost = true;
      if (source.readyState === EventSource.CLOSED) this.again();
    };
  }

  /** The server refused the stream: ask for the project until it answers, then listen again. */
  again() {
    this.source?.close();
    clearTimeout(this.timer);
    this.timer = setTimeout(
      () => this.refresh().then((fine) => (fine ? this.tell("back") : this.again())),
      1500,
    );
  }

  /** Take over the project as the server has it, and listen from there. */
  async refresh() {
    this.rest();
    try {
      Object.assign(this.project, await api.get(`projects/${this.project.id}`));
    } catch (error) {
      if (error.status === 404) this.tell("gone", { project: this.project.id });
      else this.again();
      return false;
    }
    if (this.closing.signal.aborted) return false;
    this.open();
    this.tell("refresh");
    return true;
  }

  rest() {
    this.source?.close();
    this.source = null;
    clearTimeout(this.timer);
  }

  close() {
    this.closing.abort();
    this.rest();
  }
}
