/** Draw a shape: each closed line adds to it or cuts from it. */

import { choice } from "../controls.js";
import { button, dialog, h, handled, row, soft, stack } from "../dom.js";
import { drawStroke, Marks } from "./marks.js";
import { pointing } from "./pointing.js";
import { States } from "./states.js";

const SIDE = 1000;
const LABEL =
  "Sheet to draw on. With the keyboard: arrow keys move the pen, Space begins and ends a line.";

/** Resolves with a PNG, black on white, or undefined. */
export function drawn() {
  const marks = new Marks(SIDE, SIDE);
  const states = new States(marks.strokes, (strokes) => {
    marks.strokes = strokes;
    tell();
  });
  let black = true;
  let tell;
  let stroke = null;
  let cross = null;
  const canvas = handled("sheet", "application", LABEL);
  canvas.width = canvas.height = SIDE;
  const context = canvas.getContext("2d");

  function paint() {
    context.fillStyle = "#ffffff";
    context.fillRect(0, 0, SIDE, SIDE);
    for (const one of marks.strokes) drawStroke(context, one, one.black ? "#000000" : "#ffffff");
    if (stroke) {
      context.globalAlpha = 0.35;
      drawStroke(context, stroke, stroke.black ? "#000000" : "#a3241d");
      context.globalAlpha = 1;
      drawStroke(
        context,
        { ...stroke, shape: "brush", size: 4 },
        stroke.black ? "#000000" : "#a3241d",
      );
    }
    if (cross) drawStroke(context, { shape: "brush", size: 14, points: [cross] }, "#0b6b66");
  }

  return dialog("Draw a shape", (close) => {
    const use = button("Use this shape", () => {
      cross = null;
      paint();
      canvas.toBlob(close, "image/png");
    }, { kind: "primary" });
    tell = () => {
      use.disabled = !marks.strokes.some((one) => one.black);
      paint();
    };
    pointing(canvas, () => [SIDE, SIDE], {
      begin(point) {
        stroke = { shape: "lasso", size: 1, points: [point], black };
        paint();
      },
      move(points) {
        stroke?.points.push(...points);
        paint();
      },
      end() {
        if (stroke && stroke.points.length > 2) {
          marks.add(stroke);
          states.add(marks.strokes);
        }
        stroke = null;
        tell();
      },
      stop() {
        stroke = null;
        paint();
      },
      hover(point) {
        cross = canvas.matches(":focus-visible") ? point : null;
        paint();
      },
    });
    tell();
    return stack(
      soft("Draw around the animal in one line. It closes when you let go."),
      canvas,
      row(
        choice("A line", [[true, "adds", "more"], [false, "cuts away", "cut"]], true, (chosen) => {
          black = chosen;
        }, { unseen: true }),
        h("span.grow"),
        states.buttons,
      ),
      h("footer", use),
    );
  });
}
