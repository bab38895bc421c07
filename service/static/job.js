/** The view of a tuning: its progress while it runs, then its result. */

import { FINAL, follow, request } from "./api.js";
import { button, card, h, help, lead, link, put, svg } from "./dom.js";
import { chipOf } from "./chip.js";
import { clock, duration, number, setTimeUnit, unitOf, unitTag } from "./format.js";
import { summaryOf } from "./summary.js";
import { unitAsked } from "./unit_asked.js";
import { resultView } from "./result.js";
import { plantFormula } from "./symbols.js";

const MEANING = /** @type {Record<string, string>} */ ({
  cancelled: "This tuning was stopped before it had a result.",
  failed: "This tuning failed.",
  timed_out: "This tuning ran out of time before it had a result.",
});

/** @param {View} view @param {string} id @param {URLSearchParams} query */
export async function jobView({ main, signal, keep }, id, query) {
  setTimeUnit(query.get("unit") ?? unitOf(id) ?? "");
  const job = await request("GET", `/v1/tunings/${id}`, { signal });
  if (job.request.time_unit) setTimeUnit(job.request.time_unit);
  const { title, aim } = summaryOf(job);
  const chip = h("span", {}, chipOf(job));
  const body = h("div", {});
  main.replaceChildren(lead(h("span", {}, title, " ", chip), h("p", {}, aim, " · ", clock(job.created_at)),
    unitAsked(job)), body);
  const ended = (last) => {
    put(chip, chipOf(last));
    if (last.result?.loops.length || (last.result && last.status === "succeeded")) return resultView(body, last);
    const reason = last.error && h("p", { class: "error" }, last.error.detail);
    put(body, card(MEANING[last.status], reason, link("Change and run again", `#/?from=${id}`)));
  };
  if (FINAL.has(job.status)) return ended(job);

  const meter = progress(job, () => request("DELETE", `/v1/tunings/${id}`, { signal }));
  put(body, h("div", { class: "cards" }, meter.node, card("Plant", plantFormula(job.request.plant))));
  keep(follow("tunings", id, (now) => (put(chip, chipOf(now)), meter.update(now)), signal).then(ended));
}

/** @param {any} job @param {() => Promise<any>} cancel */
function progress({ request: { objective }, created_at }, cancel) {
  const output = h("output", { class: "big" });
  const bar = h("progress", { max: 1, "aria-label": "Part of the search done" });
  const told = help("");
  const line = svg("polyline");
  const trace = svg("svg",
    { viewBox: "0 0 100 30", preserveAspectRatio: "none", class: "trace", "aria-hidden": "true" }, line);
  const stop = button("Stop", () => {
    stop.disabled = true;
    stop.textContent = "Stopping …";
    cancel();
  });
  const seen = /** @type {{at: number, best: number}[]} */ ([]);
  const update = ({ progress: { fraction, best } }) => {
    bar.value = fraction;
    const at = Math.max(Date.now() - Date.parse(created_at), 0);
    const state = fraction > 0 ? `${Math.round(100 * fraction)} % of the search` : "Waiting for a worker";
    told.textContent = `${state} · ${duration(at / 1000)}`;
    // The service tells the best of the grouping in hand; no grouping ends worse than one before.
    if (best !== null) seen.push({ at, best: Math.min(best, seen.at(-1)?.best ?? Infinity) });
    output.textContent = number(seen.at(-1)?.best, 3);
    const [{ at: start, best: high } = { at, best: 0 }] = seen;
    const low = seen.at(-1)?.best ?? 0;
    line.setAttribute("points", seen.map((point) =>
      [(100 * (point.at - start)) / (at - start || 1), 28 - (26 * (point.best - low)) / (high - low || 1)]).join(" "));
  };
  const node = card("Best so far", h("p", {}, output, " ", objective === "mu" ? null : unitTag("time")),
    trace, bar, told, stop,
    help("Of a grid of frequencies, and made exact at the end. Stopping keeps the best so far."));
  return { node, update };
}
