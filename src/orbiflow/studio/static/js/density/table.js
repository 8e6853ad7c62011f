/** Choosing a table, and what is fitted to it. */

import { check, chooser, labelled, select } from "../controls.js";
import { aside, button, h, icon, panel, put, row, soft, stack, trying, unique } from "../dom.js";
import { bytes, capital, number as numbered } from "../words.js";
import { count, CYCLES, figure, roleWords, shape, spaceOf, SPACES, UNITS } from "./words.js";

const ENDINGS = ".csv,.tsv,.txt,.npy";

/**
 * Where a table is dropped or chosen, and tables to try.
 *
 * @param {Page} page
 * @param {{ name: string, title: string, about: string }[]} examples
 */
export function chooseTable(page, examples) {
  const { api, project } = page, path = `projects/${project.id}/density`;
  const take = (file) =>
    trying(async () => {
      if (file.size > page.about.limits.bytes) {
        throw new Error(`At most ${bytes(page.about.limits.bytes)} are taken.`);
      }
      await api.upload(`${path}/table`, file);
    });
  const input = chooser("A table from your computer", take, { accept: ENDINGS });
  const drop = h("div.drop.panel.stack", [
    icon("upload"),
    h("p", "Drop a table here"),
    aside("CSV, TSV or .npy, with a row for each thing that you measured."),
    h("div", button("Choose a file", () => input.click(), { kind: "primary" }), input),
  ]);
  const over = (yes) => (event) => {
    event.preventDefault();
    drop.classList.toggle("over", yes);
  };
  drop.addEventListener("dragover", over(true));
  drop.addEventListener("dragleave", over(false));
  drop.addEventListener("drop", (event) => {
    over(false)(event);
    if (event.dataTransfer.files.length) take(event.dataTransfer.files[0]);
  });
  const example = ({ name, title, about }) =>
    h("li", [
      h("button.example.panel", {
        type: "button",
        onclick: () => trying(() => api.post(`${path}/example`, { name })),
      }, [h("strong", title), h("span.soft.small", about)]),
    ]);
  return stack(
    drop,
    h("h2", "Or try one of these"),
    h("ul.grid.narrow", examples.map(example)),
    aside("From the Top8000 proteins of Duke University (CC BY 4.0), PmagPy and javaPlex (BSD)."),
  );
}

/** The first rows of a table. */
function firstRows(table) {
  const head = table.columns.map(({ name, role, missing }) =>
    h("th", { scope: "col" }, [
      name,
      h("span.soft.small", roleWords(role), missing > 0 && `, ${count(missing)} empty`),
    ])
  );
  const cell = (value) => h("td", value === null ? "" : figure(value, 6));
  const title = "First rows of the table";
  return h("div.scroll", { tabindex: "0", role: "region", "aria-label": title }, [
    h("table", [
      h("caption.unseen", title),
      h("thead", h("tr", head)),
      h("tbody", table.first.map((row) => h("tr", row.map(cell)))),
    ]),
  ]);
}

/**
 * A form that says where the rows live, with the guess made; `start(settings)` begins the fit.
 *
 * @param {any} table
 * @param {(settings: object) => any} start
 * @param {any} last
 */
export function chooseSpace(table, start, last) {
  const guess = last ?? table.guess;
  const chosen = { space: guess.space, columns: [...guess.columns], unit: guess.unit };
  const roles = Object.fromEntries(
    table.columns.map(({ name, role }) => [name, /^(angle|axial|cycle):/.test(role) ? role : ""]),
  );
  last?.roles.forEach((role, k) => {
    roles[last.columns[k]] = role;
  });
  const units = h("div.unit"),
    go = button("Fit the density", () => start(settings()), { kind: "primary big" });
  const says = h("p.soft", { role: "status" });
  const settings = () => ({
    space: chosen.space,
    columns: chosen.space === "torus"
      ? chosen.columns.map((name) => `${name}=${roles[name]}`)
      : chosen.columns,
    ...(chosen.space === "klein-bottle" ? { unit: chosen.unit } : {}),
  });

  const name = unique("space");
  const card = (space) => {
    const onchange = () => {
      chosen.space = space.name;
      fit();
    };
    return h("label.space", [
      h("input", { type: "radio", name, checked: space.name === chosen.space, onchange }),
      h("span", [
        h("strong", space.title),
        h("span.soft.small", space.about),
        h("span.soft.small", `Needs ${space.needs}.`),
      ]),
    ]);
  };
  const spaces = h("fieldset", [
    h("legend", "What are the numbers?"),
    h("div.grid.narrow", SPACES.map(card)),
  ]);
  const order = h("span.soft.small");
  const columns = h("fieldset", [
    h("legend", "Which columns?"),
    row(
      table.columns.map((column) =>
        check(column.name, chosen.columns.includes(column.name), (taken) => {
          chosen.columns = chosen.columns.filter((own) => own !== column.name);
          if (taken) chosen.columns.push(column.name);
          fit();
        })
      ),
    ),
    order,
  ]);

  function fit() {
    const space = spaceOf(chosen.space), number = chosen.columns.length;
    order.textContent = number > 1 ? `In this order: ${chosen.columns.join(", ")}.` : "";
    const torus = space?.name === "torus";
    const [kind, said] = (roles[chosen.columns[0]] ?? "").split(":");
    if (kind === "angle") chosen.unit ??= said;
    /** A box that asks how something is counted, and builds this form again. */
    const asked = (words, choices, value, took) => {
      const other = value && !choices.some(([own]) => own === value);
      const options = [["", "Choose …"], ...choices, ...other ? [[value, roleWords(value)]] : []];
      const take = (chosen) => {
        took(chosen);
        fit();
      };
      return h("div", labelled(words, select(options, value ?? "", take)));
    };
    const angles = UNITS.map(([unit, words]) => [`angle:${unit}`, words]);
    put(units, [
      torus &&
      chosen.columns.map((name) =>
        asked(`How is ${name} counted?`, [...angles, ...CYCLES], roles[name], (role) => {
          roles[name] = role;
        })
      ),
      space?.name === "klein-bottle" &&
      asked("How are angles counted?", UNITS, chosen.unit, (unit) => {
        chosen.unit = unit;
      }),
    ]);
    const unsaid = torus ? chosen.columns.filter((name) => !roles[name]) : [];
    const many = space && number >= space.least && number <= space.most;
    const fits = many && !unsaid.length && (space.name !== "klein-bottle" || chosen.unit);
    go.disabled = !fits;
    says.textContent = told();
    function told() {
      if (!space) return "Choose what the numbers are.";
      if (!many) {
        return `This needs ${space.needs}; ${numbered(number, "column is", "columns are")} chosen.`;
      }
      const slow = table.rows > 5000 ? " So many rows take some minutes." : "";
      if (fits) return `${shape(space.name, number)}.${slow}`;
      const verb = unsaid.length === 1 ? "is" : "are";
      return `Say how ${torus ? unsaid.join(" and ") : "the angles"} ${verb} counted.`;
    }
  }
  fit();
  const hint = guess.space ? ". So this is chosen already; change it if it is wrong." : ".";
  const why = h("p.notice", { class: guess.space && "notice good" }, capital(guess.why) + hint);
  const more = table.more.length > 0 &&
    `. Not shown: ${table.more.join(", ")}, as only columns of numbers are, 30 at most`;
  return h("div.ask", [
    panel("The table", [
      soft(`${count(table.rows)} rows`, more, ". Rows with an empty cell are left out."),
      firstRows(table),
    ]),
    panel("Where they live", !last && why, spaces, columns, units, row(go, says)),
  ]);
}
