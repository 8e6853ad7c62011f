/** The buttons of a task that is not done: hold it or let it go on, and stop it. */

import { button, h, icon, row, trying } from "./dom.js";
import { clock } from "./waiting.js";
import { alive } from "./words.js";

/** Milliseconds for which a click is still meant for the button that stood at its place before. */
export const LATE = 600;

/**
 * {root, bar, update(task)}; both are hidden where nothing is to be done. The same buttons stand at the same places in
 * all states, whenever these change: whoever presses one meets no other.
 *
 * @param {Api} api
 * @param {string} label of the bar
 */
export function steering(api, label) {
  /** @type {Task | undefined} */
  let task;
  const act = (deed) => trying(() => api.post(`tasks/${task.id}/${deed}`));
  const held = () => task?.state === "paused";
  const hold = button("Pause", () => act(held() ? "resume" : "pause"), { kind: "hold" });
  const left = clock();
  const root = row(hold, button("Stop", () => act("cancel"), { image: "stop" }), left.root);
  const bar = h("progress", { max: 1, "aria-label": label });

  /** @param {Task | undefined} now */
  function update(now) {
    const before = task && held();
    task = now;
    root.hidden = bar.hidden = !alive(now);
    if (!now) return;
    if (held() !== before) {
      hold.replaceChildren(icon(held() ? "play" : "pause"), held() ? "Go on" : "Pause");
    }
    hold.classList.toggle("primary", held());
    if (now.state === "waiting") bar.removeAttribute("value");
    else bar.value = now.share;
    left.update(now);
  }
  return { root, bar, update };
}
