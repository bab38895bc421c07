/** The view of a tuning: its progress while it runs, then its result. */

import { FINAL, follow, request } from "./api.js";
import { button, h, lead, put, svg } from "./dom.js";
import { clock, duration, label, number, setTimeUnit, unitOf, unitTag } from "./format.js";
import { summary } from "./record.js";
import { resultView } from "./result.js";
import { plantFormula } from "./symbols.js";

/** @typedef {import("./main.js").View} View */

const MEANING = /** @type {Record<string, string>} */ ({
  cancelled: "This tuning was cancelled before it had a result.",
  failed: "This tuning failed.",
  timed_out: "This tuning ran out of time before it had a result.",
});

/** @param {string} status */
export const chipOf = (status) => h("span", { class: `status ${status}` }, label(status));

/** @param {View} view @param {string} id @param {URLSearchParams} query */
export async function jobView({ main, signal, keep }, id, query) {
  setTimeUnit(query.get("unit") ?? unitOf(id) ?? "time units");
  const job = await request("GET", `/v1/tunings/${id}`, { signal });
  const { title, aim } = summary(job.request);
  const chip = h("span", {}, chipOf(job.status));
  const body = h("div", {});
  main.replaceChildren(
    lead(h("span", {}, title, " ", chip), h("p", {}, aim, " · ", clock(job.created_at))),
    body);
  const ended = (last) => {
    chip.replaceChildren(chipOf(last.result?.status === "infeasible" ? "infeasible" : last.status));
    if (last.result) return resultView(body, last);
    const again = h("a", { class: "button", href: `#/?from=${id}` }, "Change and run again");
    put(body, h("section", { class: "card" },
      h("p", {}, MEANING[last.status]), last.error ? h("p", { class: "error" }, last.error.detail) : null, again));
  };
  if (FINAL.has(job.status)) return ended(job);

  const meter = progress(job, () => request("DELETE", `/v1/tunings/${id}`, { signal }));
  const asked = h("section", { class: "card" }, h("h2", {}, "Plant"), plantFormula(job.request.plant));
  put(body, h("div", { class: "cards" }, meter.node, asked));
  keep(follow(id, (now) => {
    chip.replaceChildren(chipOf(now.status));
    meter.update(now);
  }, signal).then(ended).finally(meter.stop));
}

/** @param {any} job @param {() => Promise<any>} cancel */
function progress(job, cancel) {
  const output = h("output", { class: "big" }, "–");
  const bar = h("progress", { max: 1, "aria-label": "Part of the search done" });
  const told = h("p", { class: "help" });
  const line = svg("polyline", { points: "" });
  const frame = { viewBox: "0 0 100 30", preserveAspectRatio: "none", class: "trace", "aria-hidden": "true" };
  const trace = svg("svg", frame, line);
  const stop = button("Cancel", () => {
    stop.disabled = true;
    cancel();
  });
  const seen = /** @type {{at: number, best: number}[]} */ ([]);
  const started = Date.now();
  const unit = job.request.objective === "mu" ? null : unitTag("time");
  let fraction = 0;
  const tick = () => {
    const state = fraction > 0 ? `${Math.round(100 * fraction)} % of the search` : "Waiting for a worker";
    told.textContent = `${state} · ${duration((Date.now() - started) / 1000)}`;
  };
  const timer = setInterval(tick, 500);
  const node = h("section", { class: "card progress" },
    h("h2", {}, "Best so far"), h("p", {}, output, " ", unit), trace, bar, told, stop);
  const update = (now) => {
    fraction = now.progress.fraction;
    bar.value = fraction;
    if (now.progress.best !== null) {
      // The service tells the best of the grouping in hand; no grouping ends worse than one before.
      const best = Math.min(now.progress.best, seen.at(-1)?.best ?? Infinity);
      seen.push({ at: Date.now() - started, best });
      output.textContent = number(best);
      const high = Math.max(...seen.map((point) => point.best));
      const low = Math.min(...seen.map((point) => point.best));
      const end = Math.max(Date.now() - started, 1);
      const points = [...seen, { at: end, best }].map((point) =>
        `${(100 * point.at) / end},${28 - (26 * (point.best - low)) / (high - low || 1)}`);
      line.setAttribute("points", points.join(" "));
    }
    tick();
    if (!node.isConnected) clearInterval(timer);
  };
  update(job);
  return { node, update, stop: () => clearInterval(timer) };
}
