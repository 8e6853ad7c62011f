/** What a project remembers of its pages, part by part. */

import { newest } from "./dom.js";

/**
 * A function that keeps a part of a project's view.
 *
 * @param {Pick<Page, "api" | "project">} page
 * @param {keyof Views} part
 */
export function keeper({ api, project }, part) {
  const send = newest(
    (value) => api.patch(`projects/${project.id}`, { view: { [part]: value } }),
    400,
  );
  return (value) => {
    project.view = { ...project.view, [part]: value };
    send(value);
  };
}
