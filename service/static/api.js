/** Talking to the service: problems, the API key, a lost connection, the progress of jobs. */

/** @typedef {{body?: unknown, headers?: Record<string, string>, signal?: AbortSignal, text?: boolean}} Options */

export const FINAL = new Set(["succeeded", "failed", "cancelled", "timed_out"]);
const KEY = "mutune.key";
const EVERY = 400; // milliseconds between two looks at a running job

/** Says as its detail whether the connection is lost, when it goes and when it comes back. */
export const connection = new EventTarget();
let lost = false;

/** An answer of the service that is an error (RFC 9457). */
export class Problem extends Error {
  /** @param {number} status @param {any} document */
  constructor(status, document) {
    super(document.detail || document.title || `HTTP status ${status}`);
    this.title = document.title ?? "The service refused the request";
    this.faults = /** @type {Fault[]} */ (document.errors ?? []);
  }
}

/** @type {() => Promise<string>} */
let askForKey = () => Promise.reject(new Error("no way to ask for a key"));

/** @param {() => Promise<string>} ask */
export function onKeyNeeded(ask) {
  askForKey = ask;
}

/** @param {number} milliseconds */
export const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

/** @param {boolean} now */
function setLost(now) {
  if (now !== lost) connection.dispatchEvent(new CustomEvent("change", { detail: (lost = now) }));
}

/**
 * Fetch, again and again while the service cannot be reached: every request of this page may
 * safely be sent twice (jobs carry an Idempotency-Key, analyses change nothing).
 * @param {string} method @param {string} path @param {Options} options @returns {Promise<Response>}
 */
async function send(method, path, { body, headers = {}, signal }) {
  for (let wait = 500; ; wait = Math.min(2 * wait, 5000)) {
    const key = sessionStorage.getItem(KEY);
    const all = new Headers(headers);
    if (body !== undefined) all.set("Content-Type", "application/json");
    if (key) all.set("Authorization", `Bearer ${key}`);
    try {
      const response = await fetch(path, { method, signal, headers: all, body: JSON.stringify(body) });
      const gateway = response.status >= 502 && !isProblem(response);
      if (!gateway) {
        setLost(false);
        if (response.status !== 401) return response;
        sessionStorage.setItem(KEY, await askForKey());
        continue;
      }
    } catch (error) {
      if (signal?.aborted || !(error instanceof TypeError)) throw error;
    }
    setLost(true);
    await pause(wait);
  }
}

const isProblem = (/** @type {Response} */ response) =>
  response.headers.get("content-type")?.startsWith("application/problem+json");

/** @param {string} method @param {string} path @param {Options} [options] @returns {Promise<any>} */
export async function request(method, path, options = {}) {
  const response = await send(method, path, options);
  if (!response.ok) throw new Problem(response.status, isProblem(response) ? await response.json() : {});
  return options.text ? response.text() : response.json();
}

/** A header by which a request that is sent twice counts once. */
export const once = () => ({
  // `crypto.randomUUID` does not exist over plain HTTP.
  "Idempotency-Key": crypto.getRandomValues(new Uint32Array(4)).join("-"),
});

/**
 * Follow a job until it ends. It is asked for, again and again: a stream of events would hold one
 * of the six connections that a browser has for all its tabs.
 * @param {string} resource @param {string} id @param {(job: any) => void} onChange @param {AbortSignal} signal
 */
export async function follow(resource, id, onChange, signal) {
  for (;;) {
    const job = await request("GET", `/v1/${resource}/${id}`, { signal });
    onChange(job);
    if (FINAL.has(job.status)) return job;
    await pause(EVERY);
  }
}
