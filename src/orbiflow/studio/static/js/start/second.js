/** The second picture of a project: bring one, see both, take it away again. */

import {
  aside,
  button,
  confirmed,
  dialog,
  h,
  icon,
  put,
  row,
  soft,
  stack,
  trying,
} from "../dom.js";
import { Bringing, stem } from "./bringing.js";

/** Brings a picture into a project that has one already. */
class BringingSecond extends Bringing {
  /** @override */
  number = 1;

  /** @param {Page} page @param {() => void} close */
  constructor(page, close) {
    super(page);
    this.page = page;
    this.brought = close;
  }

  /** @override */
  begin(name, send) {
    const { events, project } = this.page;
    return this.trying(async () => {
      await send(project.id);
      await events.refresh();
      this.go(`p/${project.id}/picture/2`);
      this.brought();
    }, `Reading ${name} …`);
  }

  /** Take the first picture once more. */
  again() {
    return this.begin("it again", (id) => this.api.post(`projects/${id}/second`));
  }

  /** @override */
  either(file) {
    return this.take(file);
  }
}

/** Ask for a second picture. @param {Page} page */
export async function addSecond(page) {
  const closing = new AbortController();
  const signal = AbortSignal.any([page.signal, closing.signal]);
  await dialog("Add a second picture", (close) => {
    const bring = new BringingSecond({ ...page, signal }, close);
    return stack(
      soft("Both animals then fill the plane together, without a gap."),
      bring.panel(),
      row(
        button("The same picture again", () => bring.again(), { image: "picture" }),
        h("span.soft.small", "or one of ours:"),
      ),
      bring.animals(page.about),
    );
  });
  closing.abort();
}

/**
 * What a page of one picture says of both: {root, update()}.
 *
 * @param {Page} page
 * @param {number} number the picture that the page shows, 0 or 1
 */
export function bothPictures(page, number) {
  const { api, events, project, navigate } = page;
  const root = h("section.panel.stack.both", { "aria-label": "One animal or two" });
  const place = `p/${project.id}/picture`;

  const link = ({ input, silhouette }, k) =>
    h("a", { href: `#/${place}${k ? "/2" : ""}`, "aria-current": k === number && "page" }, [
      silhouette ? h("img", { src: silhouette.backdrop, alt: "" }) : icon("picture"),
      h("span", stem(input?.name ?? "picture")),
    ]);

  async function remove() {
    const words = "What you painted over it goes, too. The tiles that were found stay.";
    if (!(await confirmed("Take the second picture away?", words, "Take it away"))) return;
    await trying(async () => {
      await api.remove(`projects/${project.id}/second`);
      await events.refresh();
      navigate(place);
    });
  }

  let told = "";
  function update() {
    const { second } = project;
    const shown = (own) => [own?.input, own?.silhouette?.backdrop];
    const now = JSON.stringify([project, second].map(shown));
    if (now === told) return; // what has the focus stays
    told = now;
    if (second) {
      put(root, [
        h("p", "These two fill the plane together:"),
        h("nav.figures", { "aria-label": "Pictures" }, [project, second].map(link)),
        button("Take the second picture away", remove, { kind: "quiet", image: "bin" }),
      ]);
    } else {
      put(root, [
        aside("Two animals can fill the plane together."),
        h("div", button("Add a second picture", () => addSecond(page), { image: "more" })),
      ]);
    }
  }
  update();
  return { root, update, remove };
}
