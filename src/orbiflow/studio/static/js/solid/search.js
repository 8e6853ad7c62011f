/** How to search for solids, and how far a search is. */

import { choice } from "../controls.js";
import { aside, button, h, put, stack } from "../dom.js";
import { form } from "../forms.js";
import { keeper } from "../memory.js";
import { steering } from "../steering.js";
import { effortChoice } from "../wishes.js";
import { alive } from "../words.js";
import { sides } from "./words.js";

const AXES = ["x", "y", "z"];
const SHOWN = ["size", "groups", "emphasis", "tiles"]; // settings of the form; the page has its own for the rest

export class Search {
  /**
   * `begin(settings)` searches, `turnUp(axis)` shows what points up.
   *
   * @param {Page} page
   * @param {any} mesh
   * @param {any} schema
   * @param {{ begin(settings: object): Promise<any>, turnUp(axis: string): void }} actions
   */
  constructor(page, mesh, schema, { begin, turnUp }) {
    const { api, project } = page, keep = keeper(page, "fill");
    const wanted = { effort: "normal", up: mesh.up, form: {}, ...project.view?.fill };
    this.wanted = wanted;
    const changed = () => keep(wanted);
    const long = effortChoice(page, "fill", wanted.effort, (effort) => {
      wanted.effort = effort;
      changed();
    });
    const up = choice(
      "Which axis points up?",
      AXES.map((axis) => [axis, axis]),
      wanted.up,
      (own) => {
        wanted.up = own;
        turnUp(own);
        changed();
      },
    );
    this.error = h("div", { role: "alert" });
    this.go = button("Find solids", async () => {
      put(this.error);
      try {
        await begin(this.settings());
      } catch (error) {
        put(this.error, h("p.error", error.message));
      }
    }, { kind: "primary big", image: "arrow" });
    this.form = form(described(schema, mesh), {
      first: ["size"],
      words: words(mesh),
      start: wanted.form,
    }, (values) => {
      wanted.form = values;
      changed();
    });
    this.title = h("summary", "How to search");
    this.wishes = h("details.panel.wishes", { open: true }, [
      this.title,
      stack(long, up, this.form, this.error, this.go),
    ]);
    this.share = h("p.soft");
    this.steer = steering(api, "How far the search is");
    this.watch = h("section.panel.stack.watch", [
      h("h2", "Searching"),
      this.steer.bar,
      this.share,
      this.steer.root,
      aside("You may close this page: the search goes on without it."),
    ]);
  }

  settings() {
    const { effort, up } = this.wanted, { emphasis, ...rest } = this.form.values();
    return { effort, up, ...rest, ...(emphasis && { emphasis: [emphasis.join(" ")] }) };
  }

  /**
   * Show the newest search; `found`: whether there are solids.
   *
   * @param {Task | undefined} task
   * @param {boolean} found
   */
  update(task, found) {
    const busy = alive(task);
    this.watch.hidden = !busy;
    this.wishes.hidden = busy;
    this.go.lastChild.textContent = task ? "Search again" : "Find solids";
    if (found !== this.found) this.wishes.open = !found;
    this.found = found;
    if (!busy) return;
    this.share.textContent = `${Math.round(100 * task.share)} % done`;
    this.steer.update(task);
  }
}

/** The settings that the form shows, and what is usual for this mesh. */
function described(schema, { usual_size: usual, low, high }) {
  const own = structuredClone(schema), { properties } = own;
  const longest = Math.max(...high.map((side, k) => side - low[k]));
  own.properties = Object.fromEntries(SHOWN.map((name) => [name, properties[name]]));
  own.properties.size["x-default"] = `${Number((usual ?? longest).toPrecision(3))} mm`;
  for (const name of SHOWN) properties[name]["x-group"] = "More";
  return own;
}

function words({ usual_size: usual, low, high }) {
  const reach = low.map((least, k) =>
    `${AXES[k]} from ${least.toPrecision(2)} to ${high[k].toPrecision(2)}`
  );
  const size = sides(high.map((side, k) => side - low[k]));
  return {
    size: {
      title: "How long is its longest side?",
      about: usual
        ? `The file says ${size}, which is no size to print.`
        : `By default as in the file: ${size}.`,
    },
    groups: {
      title: "Space groups",
      about:
        "By number or symbol, such as P-1, P 21 21 21. Empty: those that usually give the best.",
    },
    emphasis: {
      title: "A part that matters most",
      about:
        `The middle and radius of a ball, as x,y,z,radius: its inside bends five times less. The file has ${
          reach.join(", ")
        }. Or painted: what has another colour than most.`,
    },
    tiles: { title: "How many solids to keep", about: "" },
  };
}
