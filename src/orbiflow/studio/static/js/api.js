/** Calls to the server. Whatever fails is a `Refusal` with one plain sentence. */

import { sentence } from "./words.js";

export const client = crypto.getRandomValues(new Uint32Array(2)).join("");

export class Refusal extends Error {
  constructor(message, status, setting = "") {
    super(message);
    this.status = status;
    this.setting = setting;
  }
}

/**
 * @param {string} method
 * @param {string} path
 * @param {any} body
 * @param {Options} [options]
 * @returns {Promise<any>}
 */
async function call(method, path, body, { signal, keepalive } = {}) {
  const headers = { "X-Orbiflow": "1", "X-Orbiflow-Client": client };
  const raw = body instanceof Blob;
  if (body !== undefined && !raw) headers["Content-Type"] = "application/json";
  let answer;
  try {
    answer = await fetch(`api/${path}`, {
      method,
      headers,
      signal,
      keepalive,
      body: raw || body === undefined ? body : JSON.stringify(body),
    });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refusal("The studio does not answer. Start it again; your work is kept.", 0);
  }
  const text = await answer.text();
  let found = null;
  try {
    found = text ? JSON.parse(text) : null;
  } catch {
    throw new Refusal(
      "The studio answered something that this page cannot read. Reload the page.",
      answer.status,
    );
  }
  if (!answer.ok) {
    throw new Refusal(
      sentence(found?.error) || `The studio refused this (${answer.status}).`,
      answer.status,
      found?.setting,
    );
  }
  return found;
}

/** @typedef {{ signal?: AbortSignal, keepalive?: boolean }} Options */

export const api = {
  /** @type {(path: string, options?: Options) => Promise<any>} */
  get: (path, options) => call("GET", path, undefined, options),
  /** @type {(path: string, body?: any, options?: Options) => Promise<any>} */
  post: (path, body = {}, options = {}) => call("POST", path, body, options),
  /** @type {(path: string, body: any, options?: Options) => Promise<any>} */
  put: (path, body, options) => call("PUT", path, body, options),
  /** @type {(path: string, body: any, options?: Options) => Promise<any>} */
  patch: (path, body, options) => call("PATCH", path, body, options),
  /** Send a file under its name. @type {(path: string, file: File, query?: Record<string, string>) => Promise<any>} */
  upload: (path, file, query) =>
    call(
      "PUT",
      `${path}?${new URLSearchParams({ name: file.name, ...query })}`,
      file.slice(0, file.size, "application/octet-stream"), // whatever it is, it is no message
    ),
  /** Give a project a task. @type {(project: Pick<Project, "id">, operation: string, settings: object) => Promise<any>} */
  start: ({ id }, operation, settings) => api.post(`projects/${id}/tasks`, { operation, settings }),
  /** @type {(path: string, options?: Options) => Promise<any>} */
  remove: (path, options) => call("DELETE", path, undefined, options),
};

let told;
/** What the server can do: limits, animals, palettes, efforts. Asked once. */
export const about = () => (told ??= api.get("about").catch((error) => {
  told = undefined;
  throw error;
}));
