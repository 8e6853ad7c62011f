/** What is made of a tile: the button that makes and saves it, a picture, words, and what was made before. */

import { button, h, icon, put, row, section, soft, trying } from "../dom.js";
import { LATE } from "../steering.js";
import { clock } from "../waiting.js";
import { ago, alive, bytes, capital, sentence } from "../words.js";
import { lengthIn, measure } from "../lengths.js";
import { EVERY_KIND as KINDS } from "./kinds.js";

const SEEN = /\.(png|gif|svg)$/;

const address = ({ result }, name) =>
  `api/takeaways/${result.takeaway}/files/${encodeURIComponent(name)}`;

/** Whether a task has made files. @param {Task | null} task */
export const isMade = (task) => Boolean(task?.state === "done" && task.result?.files?.length);

/** Links to the files that a task has made. */
function files(task, kind) {
  return task.result.files.flatMap(({ name, bytes: size }) => [
    h("a", { class: `button ${kind}`, href: address(task, name), download: name }, [
      icon("download"),
      name,
      size && h("span.small", bytes(size)),
    ]),
    name.endsWith(".html") &&
    h("a.button", { href: address(task, name), target: "_blank" }, "Open"),
  ]);
}

/** A picture of what a task has made, null if there is none. @param {Task} task */
export function picture(task) {
  const { takeaway, preview, files: [{ name }] } = task.result;
  if (!preview && !SEEN.test(name)) return null;
  const src = preview ? `api/takeaways/${takeaway}/preview.png` : address(task, name);
  const alt = `What was made: ${KINDS[task.operation].title.toLowerCase()}`;
  return h("img", { src, alt, loading: "lazy" });
}

/** What there is to say of a task. @param {Task | null} task */
export function wordsOf(task) {
  if (alive(task)) {
    const left = clock();
    left.update(task);
    const what = task.state === "waiting"
      ? "Waiting its turn …"
      : capital(task.what || "At work …");
    const bar = h("progress", { max: 1, value: task.share, "aria-label": "How far it is" });
    return [h("p", what), bar, left.root];
  }
  if (task?.state === "failed") return [h("p.error", sentence(task.error))];
  if (task?.state === "cancelled") return [soft("Stopped.")];
  if (!isMade(task)) return [];
  const notes = task.result.notes ?? [];
  return [
    notes.length > 0 &&
    h("ul.notice", notes.map((text) => h("li", sentence(text)))),
    row(files(task, "primary")),
  ];
}

/** What a task made, for what or how large, and when. @param {Task} task */
function about({ operation, result }) {
  const { chosen = {}, facts = {}, made } = result;
  const { title, words: names } = KINDS[operation];
  const options = ["purpose", "kind", "cut"].map((name) =>
    names[name]?.options?.[chosen[name] ?? facts[name]]
  );
  const length = lengthIn(chosen.tile_size ?? (KINDS[operation].solid && facts.tile_size));
  const solid = operation === "solid" && facts.size &&
    `${facts.size.map(Math.round).join(" × ")} mm`;
  return [
    title,
    ...options,
    length && `tiles of ${measure(length)}`,
    chosen.area,
    solid,
    made && ago(made),
  ].filter(Boolean).join(" · ");
}

/** What was made before, in a list. */
const madeBefore = (task) =>
  h("li.panel.stack", [
    picture(task) ?? h("span.no-picture", icon(KINDS[task.operation].image)),
    h("span.soft.small", about(task)),
    files(task, ""),
  ]);

/** A button that makes things, what it has to say, and what was made `earlier`. */
export class Making {
  /** @type {Task | null} */
  task = null; // the one whose result is shown
  stale = false; // whether settings were changed since
  busy = false;
  turned = -Infinity; // when the button last changed its meaning

  /**
   * `asked()` gives the operation and settings; `refused(setting, text)` says where they are wrong, if it can;
   * `show(task)` shows what was made, or with null what may be.
   *
   * @param {Api} api
   * @param {Project} project
   * @param {{ asked(): [string, object], refused(setting: string, text: string): boolean, show(task: Task | null): void }} on
   */
  constructor(api, project, on) {
    this.api = api;
    this.project = project;
    this.on = on;
    this.make = button("Download", () => trying(() => this.press()), { kind: "primary big" });
    this.said = h("div.stack.said", { role: "status" });
    this.before = h("ul.made");
    this.earlier = section("earlier", "earlier", "Made before", this.before);
  }

  /** Something else is asked for now. */
  change() {
    this.stale = true;
    this.turned = -Infinity;
    this.tell();
  }

  /** Make it, or stop what is being made. */
  async press() {
    if (performance.now() - this.turned < LATE) return; // meant for what the button said before
    if (alive(this.task)) {
      await this.api.post(`tasks/${this.task.id}/cancel`);
      return;
    }
    try {
      await this.submit(...this.on.asked());
    } catch (error) {
      if (!this.on.refused(error.setting, error.message)) throw error;
    }
  }

  async submit(operation, settings) {
    this.task = (await this.api.start(this.project, operation, settings)).task;
    [this.stale, this.news] = [false, true];
    this.tell();
  }

  /** Show how far it is, or what was made: the new file is what whoever waits for it meets next. */
  tell() {
    const { tasks } = this.project;
    this.task = tasks.find(({ id }) => id === this.task?.id) ?? this.task; // as the events have told
    const [made, busy] = [isMade(this.task), alive(this.task)];
    const [old, done] = [this.stale && !busy, made && !this.stale ? this.task : null];
    if (busy !== this.busy) [this.busy, this.turned] = [busy, performance.now()];
    this.make.lastChild.textContent = busy ? "Stop" : "Download";
    const before = tasks.filter((task) => isMade(task) && task.id !== done?.id);
    const told = JSON.stringify([this.task, old, before.map(({ id }) => id)]);
    if (told === this.told) return; // what has the focus stays
    this.told = told;
    put(
      this.said,
      !old ? wordsOf(this.task) : made && soft("You changed something since: see “Made before”."),
    );
    this.earlier.hidden = !before.length;
    put(this.before, before.map(madeBefore));
    if (done?.id !== this.seen) this.on.show(done);
    this.seen = done?.id;
    if (!done || !this.news) return;
    this.news = false;
    this.said.querySelector("a").click();
    if (document.activeElement === this.make) this.said.querySelector("a").focus();
  }
}
