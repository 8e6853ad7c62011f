/** All ways to bring a picture, a table or a project: choose, drop, paste, photograph, draw. */

import { chooser } from "../controls.js";
import { aside, button, h, put, row, toast } from "../dom.js";
import { Feed } from "../events.js";
import { alive, bytes, sentence } from "../words.js";

const PICTURES = "image/*,.svg,.json,.geojson,.dat,.wkt";
const MESHES = /\.(stl|obj|ply|3mf|gltf|glb)$/i;
const TABLES = /\.(csv|tsv|txt|npy|parquet)$/i;
export const stem = (name) => name.replace(/\.\w+$/, "");

/** Resolves when nothing is done for a new project any more; fails if what was done did. */
function filled(project) {
  const feed = new Feed(project);
  return new Promise((resolve, reject) => {
    const check = () => {
      const { tasks, silhouette, tiles } = project;
      const failed = tasks.find(({ state }) => state === "failed");
      if (failed && !silhouette && !tiles.length) reject(new Error(sentence(failed.error)));
      else if (!tasks.some(alive)) resolve();
    };
    feed.on("task refresh", check);
    feed.on("gone", () => reject(new Error("This project was deleted.")));
    check();
  }).finally(() => feed.close());
}

export class Bringing {
  number = 0; // of the picture in its project

  /** @param {Page} page */
  constructor({ api, navigate, about, signal }) {
    this.api = api;
    this.signal = signal;
    this.navigate = navigate;
    this.most = about.limits?.bytes ?? Infinity;
    this.touch = matchMedia("(pointer: coarse)").matches;
    this.file = chooser("A picture from your computer", (file) => this.take(file), {
      accept: PICTURES,
      id: "file",
    });
    this.photo = chooser("A photo", (file) => this.take(file), {
      accept: "image/*",
      capture: "environment",
    });
    this.said = h("div.told", { role: "status" });
    this.mesh = chooser("A mesh from your computer", (file) => this.shape(file), {
      accept: ".stl,.obj,.ply,.3mf,.gltf,.glb",
    });
    this.saved = chooser("A project file", (file) => this.open(file), { accept: ".orbiflow" });
    const over = (yes) => document.body.classList.toggle("over", yes);
    /** @type {(kind: string, hear: (event: any) => any) => void} */
    const on = (kind, hear) => document.addEventListener(kind, hear, { signal });
    on("dragover", (event) => {
      event.preventDefault();
      over(true);
    });
    on("dragleave", (event) => event.relatedTarget || over(false));
    on("drop", (event) => {
      event.preventDefault();
      over(false);
      const [first] = event.dataTransfer.files;
      if (first) this.either(first);
      else this.tell("That was no file. Save the picture first, then drop it here.", "notice");
    });
    on("paste", ({ clipboardData: { files: [first] } }) => first && this.either(first));
    signal.addEventListener("abort", () => document.body.classList.remove("over", "busy"));
  }

  /** Say a sentence beside the buttons. */
  tell(text, kind) {
    put(this.said, text && h("p", { class: kind }, text));
    this.said.scrollIntoView({ block: "nearest" });
  }

  /** Do what may fail and takes a while, both told beside the buttons. */
  async trying(work, words = "") {
    document.body.classList.toggle("busy", Boolean(words));
    this.tell(words, "soft");
    try {
      await work();
      if (words) this.tell();
    } catch (error) {
      this.tell(error.message, "error");
    }
    document.body.classList.remove("busy");
  }

  panel() {
    return h("div.drop", [
      h("p.drop-words", this.touch ? "Bring a picture" : "Drop a picture here"),
      aside("One animal, or any other shape, on a plain background works best."),
      row(
        button("Choose a picture", () => this.file.click(), {
          kind: "primary big",
          image: "upload",
        }),
        this.touch && button("Take a photo", () => this.photo.click(), { image: "camera" }),
        button("Draw a shape", () => this.draw(), { image: "pencil" }),
        navigator.clipboard?.read &&
          button("Paste", () => this.trying(() => this.paste()), { image: "paste" }),
      ),
      this.said,
      this.file,
      this.photo,
      this.saved,
      this.mesh,
    ]);
  }

  /** Make a project of what `send` puts into it; search if the picture is clear, or show what was read. */
  begin(name, send) {
    return this.trying(async () => {
      const { id } = await this.api.post("projects", { kind: "tile", name });
      const { silhouette } = await this.kept(id, () => send(id));
      if (!silhouette?.clear || this.signal.aborted) return this.go(`p/${id}/picture`);
      await this.api.start({ id }, "search", {});
      toast("Looking for tiles of the shape that was read. Is it not right? Mend it in “Picture”.");
      return this.go(`p/${id}`);
    }, `Reading ${name} …`);
  }

  /** Wait until a new project is filled; if it cannot be, delete it and say why. */
  async kept(id, fill = () => {}) {
    try {
      await fill();
      const project = await this.api.get(`projects/${id}`);
      await filled(project);
      return project;
    } catch (error) {
      await this.api.remove(`projects/${id}`).catch(() => {});
      throw error;
    }
  }

  /** Go to a page, unless the user has gone to another. */
  go(path) {
    if (!this.signal.aborted) this.navigate(path);
  }

  animal({ name, title }) {
    return this.begin(
      title,
      (id) => this.api.post(`projects/${id}/animal?number=${this.number}`, { name }),
    );
  }

  /** The animals that are there to try. */
  animals({ animals }) {
    const animal = (own) =>
      h("button.animal", { type: "button", onclick: () => this.animal(own) }, [
        h("img", { src: own.picture, alt: "", loading: "lazy" }),
        h("span", own.title),
      ]);
    return h("ul.animals", animals.map((own) => h("li", animal(own))));
  }

  /** Say that a file is too large, if it is. */
  refuses({ name, size }) {
    if (size <= this.most) return false;
    const words = `${name} has ${bytes(size)}; at most ${bytes(this.most)} can be read.`;
    this.tell(`${words} Make it smaller first.`, "error");
    return true;
  }

  take(file) {
    if (this.refuses(file)) return undefined;
    const number = String(this.number);
    const send = (id) => this.api.upload(`projects/${id}/input`, file, { number });
    return this.begin(stem(file.name), send);
  }

  open(file) {
    return this.trying(async () => {
      const { id, kind } = await this.api.post("projects/open", file);
      const { tiles } = await this.kept(id);
      this.go(kind === "density" ? `d/${id}` : tiles.length ? `p/${id}` : `p/${id}/picture`);
    }, `Opening ${file.name} …`);
  }

  /** Begin with a table, or with none yet. */
  count(file) {
    return this.trying(async () => {
      const name = file ? stem(file.name) : "My table";
      const { id } = await this.api.post("projects", { kind: "density", name });
      if (file) await this.api.upload(`projects/${id}/density/table`, file);
      this.navigate(`d/${id}`);
    });
  }

  /** Begin with a mesh, and go and see it. */
  shape(file) {
    if (this.refuses(file)) return undefined;
    const { name } = file;
    return this.trying(async () => {
      const { id } = await this.api.post("projects", { kind: "solid", name: stem(name) });
      await this.kept(id, () => this.api.upload(`projects/${id}/mesh`, file));
      this.go(`s/${id}`);
    }, `Reading ${name} …`);
  }

  either(file) {
    if (file.name?.endsWith(".orbiflow")) return this.open(file);
    if (MESHES.test(file.name)) return this.shape(file);
    return TABLES.test(file.name) ? this.count(file) : this.take(file);
  }

  async draw() {
    const { drawn } = await import("./drawing.js");
    const picture = await drawn();
    return picture && this.take(new File([picture], "drawing.png"));
  }

  async paste() {
    const items = await navigator.clipboard.read().catch(() => {
      throw new Error("Your browser keeps what was copied. Press Ctrl+V instead.");
    });
    for (const item of items) {
      const type = item.types.find((known) => known.startsWith("image/"));
      if (type) return this.take(new File([await item.getType(type)], "pasted.png"));
    }
    throw new Error("There is no picture to paste. Copy one first.");
  }
}
