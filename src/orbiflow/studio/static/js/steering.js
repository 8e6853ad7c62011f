/** The buttons of a task that is not done: hold it or let it go on, and stop it. */

import { button, icon, row, trying } from "./dom.js";
import { clock } from "./waiting.js";

/** Milliseconds for which a click is still meant for the button that stood at its place before. */
export const LATE = 600;

/**
 * {root, update(task)}. The same buttons stand at the same places in all states, whenever these change: whoever
 * presses one meets no other.
 *
 * @param {Api} api
 */
export function steering(api) {
  /** @type {Task | null} */
  let task = null;
  const act = (deed) => trying(() => api.post(`tasks/${task.id}/${deed}`));
  const hold = button("Pause", () => act(task.state === "paused" ? "resume" : "pause"), {
    kind: "hold",
  });
  const left = clock();
  const root = row(hold, button("Stop", () => act("cancel"), { image: "stop" }), left.root);

  /** @param {Task} now */
  function update(now) {
    const held = now.state === "paused";
    if (held !== (task && task.state === "paused")) {
      hold.replaceChildren(icon(held ? "play" : "pause"), held ? "Go on" : "Pause");
    }
    hold.classList.toggle("primary", held);
    task = now;
    left.update(now);
  }
  return { root, update };
}
