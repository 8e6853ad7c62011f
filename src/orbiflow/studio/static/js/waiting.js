/** How much longer something takes, by what was measured: how far it came on this page, or what such a thing took before. */

import { h } from "./dom.js";
import { EFFORT_MEANINGS } from "./words.js";

const ENOUGH = 0.04; // share of a task from which its pace is known
/** When and how far each task was when it was seen first, and last. */
const seen = new Map();

/** Seconds in words, no more exact than they are known. */
export function duration(seconds) {
  if (seconds < 10) return `${Math.max(1, Math.round(seconds))} s`;
  if (seconds < 90) return `${5 * Math.round(seconds / 5)} s`;
  return `${Math.round(seconds / 60)} min`;
}

/**
 * What is left of a task that runs, "" if nothing is known of it.
 *
 * @param {Task | null | undefined} task
 */
export function timeLeft(task) {
  if (task?.state !== "running") {
    seen.delete(task?.id); // what was held begins anew
    return "";
  }
  const now = performance.now() / 1000;
  const own = seen.get(task.id) ?? { share: task.share, time: now };
  seen.set(task.id, own);
  if (own.last?.share !== task.share) own.last = { share: task.share, time: now };
  const gained = task.share - own.share;
  const passed = own.last.time - own.time;
  const whole = gained > ENOUGH && passed > 0.5 ? passed / gained : task.usual;
  if (!whole) return "";
  const left = whole * (1 - task.share) - (now - own.last.time);
  return left < 1 ? "a moment more" : `about ${duration(left)} more`;
}

/**
 * What a search with an effort means, and what it took here the last time.
 *
 * @param {Project} project
 * @param {string} operation
 * @param {string} effort
 */
export function tookWords(project, operation, effort) {
  const name = `${operation} ${effort}${project.second ? " of two" : ""}`;
  const seconds = project.took?.[name];
  const measured = seconds ? ` It took ${duration(seconds)} here the last time.` : "";
  return EFFORT_MEANINGS[effort] + measured;
}

/** A text that says so each second: {root, update(task)}. */
export function clock() {
  const root = h("span.soft.small");
  /** @type {Task | null} */
  let shown = null;
  let timer = 0;
  const tell = () => {
    root.textContent = timeLeft(shown);
    clearTimeout(timer);
    if (shown?.state === "running" && root.isConnected) timer = setTimeout(tell, 1000);
  };
  /** @param {Task | null} task */
  const update = (task) => {
    shown = task;
    requestAnimationFrame(tell); // once it stands on the page
  };
  return { root, update };
}
