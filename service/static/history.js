/** The views of many tunings: their history, and two side by side. */

import { FINAL, pause, request } from "./api.js";
import { h, lead, put, table } from "./dom.js";
import { figuresOf, showFigures } from "./figures.js";
import { clock, label, number, setTimeUnit, unitOf } from "./format.js";
import { chipOf } from "./job.js";
import { summary } from "./record.js";
import { exists } from "./schema.js";

/** @typedef {import("./main.js").View} View */

/** @param {any} job */
function line(job) {
  const { title, aim } = summary(job.request);
  const unit = job.request.objective === "mu" ? "μ" : unitOf(job.id) ?? "";
  return [
    h("a", { href: `#/tunings/${job.id}` }, title, h("br"), h("span", { class: "help" }, aim)),
    chipOf(job.status),
    h("span", { class: "value" }, number(job.progress.best), " ", h("span", { class: "unit" }, unit)),
    clock(job.created_at),
  ];
}

/** @param {View} view */
export async function historyView({ main, signal, keep }) {
  const place = h("div", {});
  const more = h("button", { type: "button", hidden: true }, "Earlier ones");
  const compare = h("button", { type: "button", disabled: true }, "Compare the two chosen");
  const chosen = /** @type {string[]} */ ([]);
  compare.addEventListener("click", () => (location.hash = `#/compare?a=${chosen[0]}&b=${chosen[1]}`));
  const choice = (job) => h("input", {
    type: "checkbox", "aria-label": `Choose the tuning of ${clock(job.created_at)}`, checked: chosen.includes(job.id),
    onchange: (event) => {
      if (event.target.checked) chosen.push(job.id);
      else chosen.splice(chosen.indexOf(job.id), 1);
      compare.disabled = chosen.length !== 2;
    },
  });
  let pages = 1;
  const load = async () => {
    const jobs = [];
    let next = "/v1/tunings?limit=20";
    for (let page = 0; page < pages && next; page++) {
      const answer = await request("GET", next, { signal });
      jobs.push(...answer.items);
      next = answer.next;
    }
    more.hidden = !next;
    const focused = document.activeElement;
    const none = h("p", {}, "No tuning yet. ", h("a", { href: "#/" }, "Start the first one."));
    const rows = jobs.map((job) => [...line(job), choice(job)]);
    const heads = ["Plant", "Status", "Best", "Started", "Compare"];
    if (!place.contains(focused)) put(place, rows.length ? table("Tunings, newest first", heads, rows) : none);
    return jobs.some((job) => !FINAL.has(job.status));
  };
  more.addEventListener("click", () => (pages++, load()));
  main.replaceChildren(lead("History"),
    h("section", { class: "card" }, place, h("div", { class: "buttons" }, compare, more)));
  const running = await load();
  if (running) keep(poll());

  async function poll() {
    do await pause(2000);
    while (!signal.aborted && (await load()));
  }
}

/** @param {any} value @param {string} [pointer] @returns {[string, string][]} */
const flat = (value, pointer = "") =>
  value !== null && typeof value === "object"
    ? Object.entries(value).flatMap(([key, item]) => flat(item, `${pointer}/${key}`))
    : [[pointer, typeof value === "number" ? number(value) : String(value ?? "–")]];

/** What is worth comparing. @param {any} result */
const essence = ({ tau_p, peaks, comparison, loops, groups }) => ({
  tau_p,
  peak: Object.fromEntries(Object.entries(peaks ?? {}).map(([name, { value }]) => [name, value])),
  gain_of_asymmetry: comparison && `${number(comparison.gain_percent, 3)} %`,
  ...Object.fromEntries(groups.map(([first], i) => [`group_${i + 1}`, loops[first] ?? {}])),
});

/** @param {View} view @param {URLSearchParams} query */
export async function compareView({ main, signal, go }, query) {
  const ids = ["a", "b"].map((name) => query.get(name));
  const { items } = await request("GET", "/v1/tunings?limit=100&status=succeeded", { signal });
  const pick = (name, i) => {
    const options = items.map((job) => {
      const { title, aim } = summary(job.request);
      const text = [title, aim, number(job.progress.best), clock(job.created_at)].join(" · ");
      return h("option", { value: job.id, selected: job.id === ids[i] }, text);
    });
    const select = h("select", { id: name }, h("option", { value: "" }, "Choose a tuning"), options);
    select.addEventListener("change", () => {
      query.set(name, select.value);
      go(`#/compare?${query}`);
    });
    return h("div", { class: "field" }, h("label", { for: name }, i ? "Second" : "First"), select);
  };
  const body = h("div", {});
  main.replaceChildren(lead("Compare two tunings"),
    h("div", { class: "cards" }, ["a", "b"].map(pick)), body);
  if (!ids[0] || !ids[1]) return;

  setTimeUnit(unitOf(ids[0]) ?? "time units");
  const jobs = await Promise.all(ids.map((id) => request("GET", `/v1/tunings/${id}`, { signal })));
  const heads = jobs.map((job, i) =>
    h("a", { href: `#/tunings/${job.id}` }, `${i ? "Second" : "First"}: ${summary(job.request).title}`));
  const told = jobs.map(({ result }) => new Map(flat(result ? essence(result) : {})));
  const asked = jobs.map((job) => new Map(flat(job.request)));
  const rows = (sides, every) => [...new Set(sides.flatMap((side) => [...side.keys()]))]
    .filter((at) => every || sides[0].get(at) !== sides[1].get(at))
    .map((at) => [at.split("/").slice(1).map(label).join(" › "), ...sides.map((side) => side.get(at) ?? "–")]);
  const differing = rows(asked, false);
  const columns = h("div", { class: "figures" });
  body.replaceChildren(
    h("section", { class: "card" }, table("Results", ["", ...heads], rows(told, true))),
    h("section", { class: "card" }, differing.length
      ? table("Where the requests differ", ["", "First", "Second"], differing)
      : h("p", {}, "The requests are the same.")),
    columns);
  if (!exists("/v1/tunings/{job_id}/figures", "get") || jobs.some((job) => !job.result?.loops.length)) return;
  const sides = jobs.map((job) => ({ job, place: h("div", { class: "side" }) }));
  columns.replaceChildren(...sides.map(({ place }) => place));
  for (const { job, place } of sides) {
    await showFigures(place, figuresOf(job.id), `mutune-${job.id.slice(0, 8)}`);
  }
}
