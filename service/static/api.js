/** Talking to the service: problems, the API key, a lost connection, the progress of jobs. */

/** @typedef {{pointer: string, detail: string}} Fault */
/** @typedef {{body?: unknown, headers?: Record<string, string>, signal?: AbortSignal, text?: boolean}} Options */

export const FINAL = new Set(["succeeded", "failed", "cancelled", "timed_out"]);
const KEY = "mutune.key";
const SILENCE = 20_000; // milliseconds; the service gives a sign of life every 15 s

/** Says "lost" and "back" (detail: boolean) as the connection goes and comes. */
export const connection = new EventTarget();
let lost = false;

/** An answer of the service that is an error (RFC 9457). */
export class Problem extends Error {
  /** @param {number} status @param {any} document */
  constructor(status, document) {
    super(document.detail || document.title || `HTTP status ${status}`);
    this.status = status;
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
 * safely be sent twice (tunings carry an Idempotency-Key, analyses change nothing).
 * @param {string} method @param {string} path @param {Options} options
 * @returns {Promise<Response>}
 */
async function send(method, path, { body, headers = {}, signal }) {
  for (let wait = 500; ; wait = Math.min(2 * wait, 5000)) {
    const key = sessionStorage.getItem(KEY);
    try {
      const response = await fetch(path, {
        method,
        signal,
        headers: {
          ...headers,
          ...(body === undefined ? {} : { "Content-Type": "application/json" }),
          ...(key ? { Authorization: `Bearer ${key}` } : {}),
        },
        body: body === undefined ? undefined : JSON.stringify(body),
      });
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

/** @param {Response} response */
async function checked(response) {
  if (response.ok) return response;
  throw new Problem(response.status, isProblem(response) ? await response.json() : {});
}

/** @param {string} method @param {string} path @param {Options} [options] @returns {Promise<any>} */
export async function request(method, path, options = {}) {
  const response = await checked(await send(method, path, options));
  return options.text ? response.text() : response.json();
}

/** A key that no other request has; `crypto.randomUUID` does not exist over plain HTTP. */
export const newKey = () =>
  Array.from(crypto.getRandomValues(new Uint8Array(16)), (b) => b.toString(16).padStart(2, "0")).join("");

/**
 * Follow a job until it ends: by its events, and where those do not come through by asking.
 * @param {string} id @param {(job: any) => void} onChange @param {AbortSignal} signal
 */
export async function follow(id, onChange, signal) {
  const path = `/v1/tunings/${id}`;
  for (;;) {
    try {
      const last = await stream(`${path}/events`, onChange, signal);
      if (last) return last;
    } catch (error) {
      if (signal.aborted || error instanceof Problem) throw error;
    }
    const job = await request("GET", path, { signal });
    onChange(job);
    if (FINAL.has(job.status)) return job;
    await pause(1000);
  }
}

/**
 * @param {string} path @param {(job: any) => void} onChange @param {AbortSignal} signal
 * @returns {Promise<any>} the job of the event `done`, or undefined where the stream ended early
 */
async function stream(path, onChange, signal) {
  const silent = new AbortController();
  let timer = setTimeout(() => silent.abort(), SILENCE);
  const either = AbortSignal.any([signal, silent.signal]);
  try {
    const response = await checked(await send("GET", path, { signal: either }));
    const reader = /** @type {ReadableStream} */ (response.body)
      .pipeThrough(new TextDecoderStream()).getReader();
    for (let text = ""; ; ) {
      const { done, value } = await reader.read();
      if (done) return undefined;
      clearTimeout(timer);
      timer = setTimeout(() => silent.abort(), SILENCE);
      const events = (text + value).split("\n\n");
      text = /** @type {string} */ (events.pop());
      for (const event of events) {
        const data = event.match(/^data: (.*)$/m);
        if (!data) continue;
        if (/^event: done$/m.test(event)) return JSON.parse(data[1]);
        onChange(JSON.parse(data[1]));
      }
    }
  } finally {
    clearTimeout(timer);
    silent.abort();
  }
}
