/** The first page: bring a picture, take one of ours, or go on with an earlier project. */

import { button, confirmed, h, icon, put, style, toast, trying } from "../dom.js";
import { Camera, Tiling, paint, sized } from "../tiling.js";
import { ago, bytes, number } from "../words.js";
import { sample } from "./sample.js";

const TABLES = /\.(csv|tsv|txt|npy|parquet)$/i;
const stem = ({ name }) => name.replace(/\.\w+$/, "");
const PICTURES = "image/*,.svg,.json,.dat";

export async function show(root, { api, navigate, about }) {
  await style("start");
  const projects = h("section", { "aria-labelledby": "yours", hidden: true });

  /** Make a project of what somebody brings, and go and see what was read. */
  async function begin(name, send) {
    document.body.classList.add("busy");
    await trying(async () => {
      const { id } = await api.post("projects", { kind: "tile", name });
      try {
        await send(id);
      } catch (error) {
        await api.remove(`projects/${id}`);
        throw error;
      }
      navigate(`p/${id}/picture`);
    });
    document.body.classList.remove("busy");
  }

  const take = (file) => {
    const name = file.name || "picture.png";
    const most = about.limits?.bytes;
    if (most && file.size > most) {
      toast(`${name} has ${bytes(file.size)}; at most ${bytes(most)} can be read. Make it smaller first.`, { bad: true });
      return undefined;
    }
    return begin(stem({ name }), (id) => api.put(`projects/${id}/input?name=${encodeURIComponent(name)}`, file));
  };
  const open = (file) => trying(async () => {
    const project = await api.post("projects/open", file);
    navigate(project.kind === "density" ? `d/${project.id}` : `p/${project.id}`);
  });
  const count = (file) => trying(async () => {
    const { id } = await api.post("projects", { kind: "density", name: file ? stem(file) : "My table" });
    if (file) await api.put(`projects/${id}/density/table?name=${encodeURIComponent(file.name)}`, file);
    navigate(`d/${id}`);
  });
  const either = (file) => {
    if (file.name?.endsWith(".orbiflow")) return open(file);
    return TABLES.test(file.name) ? count(file) : take(file);
  };

  const chosen = (label, use, attributes) => {
    const box = h("input", { type: "file", class: "unseen", tabindex: "-1", "aria-label": label, onchange: () => box.files[0] && use(box.files[0]), ...attributes });
    return box;
  };
  const file = chosen("A picture from your computer", take, { accept: PICTURES, id: "file" });
  const photo = chosen("A photo", take, { accept: "image/*", capture: "environment" });
  const saved = chosen("A project file", open, { accept: ".orbiflow" });
  const touch = matchMedia("(pointer: coarse)").matches;
  const snap = async () => {
    if (touch || !navigator.mediaDevices?.getUserMedia) return photo.click();
    const { photograph } = await import("./camera.js");
    const shot = await photograph();
    return shot && take(new File([shot], "photo.png"));
  };
  const draw = async () => {
    const { drawn } = await import("./drawing.js");
    const picture = await drawn();
    if (picture) take(new File([picture], "drawing.png"));
  };
  const paste = () => trying(async () => {
    const items = await navigator.clipboard.read().catch(() => { throw new Error("Your browser keeps what was copied. Press Ctrl+V instead."); });
    for (const item of items) {
      const type = item.types.find((known) => known.startsWith("image/"));
      if (type) return take(new File([await item.getType(type)], "pasted.png"));
    }
    throw new Error("There is no picture to paste. Copy one first.");
  });

  const drop = h("div", { class: "drop" },
    h("p", { class: "drop-words" }, touch ? "Bring a picture" : "Drop a picture here"),
    h("p", { class: "soft small" }, "One animal, or any other shape, on a plain background works best."),
    h("div", { class: "row" },
      button("Choose a picture", () => file.click(), { kind: "primary big", image: "upload" }),
      (touch || navigator.mediaDevices?.getUserMedia) && button("Take a photo", snap, { image: "camera" }),
      button("Draw a shape", draw, { image: "pencil" }),
      navigator.clipboard?.read && button("Paste", paste, { image: "paste" })),
    file, photo, saved);
  const art = h("canvas", { class: "hero-art", role: "img", "aria-label": "A tiling of lizards" });
  put(root,
    h("section", { class: "hero" },
      h("div", { class: "stack" },
        h("h1", { tabindex: "-1" }, "Turn an animal into a tile"),
        h("p", { class: "lead soft" }, "Bring a picture. We bend its outline, as little as we can, until copies of it fill the plane without a gap."),
        drop),
      art),
    h("section", { "aria-labelledby": "ours" },
      h("h2", { id: "ours" }, "Or take one of ours"),
      h("ul", { class: "animals" }, about.animals.map(({ name, title, picture }) =>
        h("li", {}, h("button", { type: "button", class: "animal", onclick: () => begin(title, (id) => api.post(`projects/${id}/animal`, { name })) },
          h("img", { src: picture, alt: "", loading: "lazy" }), h("span", {}, title)))))),
    projects,
    h("section", { class: "others" },
      button("Open a project file", () => saved.click(), { image: "open" }),
      button("Numbers instead of animals", () => count(), { kind: "quiet", image: "arrow" }),
      h("span", { class: "soft small" }, "Angles, directions or axes in a table: see where they crowd.")));

  async function list() {
    const found = await api.get("projects");
    projects.hidden = !found.length;
    put(projects, found.length > 0 && [h("h2", { id: "yours" }, "Your projects"),
      h("ul", { class: "projects" }, found.map((own) => {
        const path = own.kind === "density" ? `d/${own.id}` : own.tiles || own.busy ? `p/${own.id}` : `p/${own.id}/picture`;
        return h("li", { class: "project" },
          h("a", { href: `#/${path}` },
            h("span", { class: "thumb" }, own.thumb ? h("img", { src: own.thumb, alt: "", loading: "lazy" }) : icon("picture")),
            h("span", { class: "project-name" }, own.name),
            h("span", { class: "soft small" }, [own.kind === "tile" ? number(own.tiles, "tile") : "a table", own.busy ? "at work" : ago(own.changed)].join(" · "))),
          button(`Delete ${own.name}`, async () => {
            if (!(await confirmed("Delete this project?", `“${own.name}” and all its tiles will be gone for good.`, "Delete it"))) return;
            await trying(() => api.remove(`projects/${own.id}`));
            await trying(list);
            root.querySelector("h1").focus();
          }, { kind: "quiet icon", image: "bin" }));
      }))]);
  }

  const over = (event) => { event.preventDefault(); document.body.classList.add("over"); };
  const leave = (event) => { if (!event.relatedTarget) document.body.classList.remove("over"); };
  const dropped = (event) => {
    event.preventDefault();
    document.body.classList.remove("over");
    const [first] = event.dataTransfer.files;
    if (first) either(first);
    else toast("That was no file. Save the picture first, then drop it here.");
  };
  const pasted = (event) => {
    const [first] = event.clipboardData.files;
    if (first) either(first);
  };
  const tiling = new Tiling(sample.card);
  const paintArt = () => {
    const { context, width, height, ratio } = sized(art);
    const camera = Camera.fit(tiling, width, height, 5.2);
    paint(context, tiling, camera, sample.palette, { width, height, ratio, line: 1.4 });
  };
  const watch = new ResizeObserver(paintArt);
  watch.observe(art);
  const listeners = { dragover: over, dragleave: leave, drop: dropped, paste: pasted };
  Object.entries(listeners).forEach(([name, heard]) => document.addEventListener(name, heard));
  await trying(list);
  return () => {
    watch.disconnect();
    Object.entries(listeners).forEach(([name, heard]) => document.removeEventListener(name, heard));
    document.body.classList.remove("over", "busy");
  };
}
