/** The views of many tunings: their history, and two side by side. */

import { FINAL, pause, request } from "./api.js";
import { button, h, help, lead, put, table } from "./dom.js";
import { figuresOf, showFigures } from "./figures.js";
import { clock, label, number, setTimeUnit, unitOf } from "./format.js";
import { rescaled, unitsIn } from "./units.js";
import { chipOf } from "./job.js";
import { summary } from "./summary.js";

const EVERY = 2000; // milliseconds between two looks while something runs

/** The unit of its times: its own, else what this browser called it. @param {any} job */
const unitOfJob = ({ id, request: asked }) => asked.time_unit ?? unitOf(id);

/** @param {any} job */
function line(job) {
  const { title, aim } = summary(job.request);
  const unit = job.request.objective === "mu" ? "μ" : unitOfJob(job) ?? "";
  return [
    h("a", { href: `#/tunings/${job.id}` }, title, h("br"), h("span", { class: "help unit" }, aim)),
    chipOf(job),
    h("span", { class: "value" }, number(job.progress.best), " ", h("span", { class: "unit" }, unit)),
    h("span", { class: "unit" }, clock(job.created_at)),
  ];
}

/** @param {View} view */
export async function historyView({ main, signal, keep }) {
  const chosen = /** @type {Set<string>} */ (new Set());
  const place = h("div", {});
  const compare = button("Compare the two chosen", () => {
    const [a, b] = chosen;
    location.hash = `#/compare?a=${a}&b=${b}`;
  });
  compare.disabled = true;
  const choice = ({ id, created_at }) => h("input", {
    type: "checkbox", "aria-label": `Choose the tuning of ${clock(created_at)}`, checked: chosen.has(id),
    onchange: ({ target }) => {
      if (target.checked) chosen.add(id);
      else chosen.delete(id);
      compare.disabled = chosen.size !== 2;
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
    const rows = jobs.map((job) => [...line(job), choice(job)]);
    const none = h("p", {}, "No tuning yet. ", h("a", { href: "#/" }, "Start the first one."));
    const heads = ["Plant", "Status", "Best", "Started", "Compare"];
    if (!place.contains(document.activeElement)) put(place, rows.length ? table("Newest first", heads, rows) : none);
    return jobs.some((job) => !FINAL.has(job.status));
  };
  const more = button("Earlier ones", () => (pages++, load()));
  main.replaceChildren(lead("History"),
    h("section", { class: "card" }, place, h("div", { class: "buttons" }, compare, more)));
  const poll = async () => {
    do await pause(EVERY);
    while (!signal.aborted && (await load()));
  };
  if (await load()) keep(poll());
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
  const names = ["a", "b"];
  const ids = names.map((name) => query.get(name));
  const { items } = await request("GET", "/v1/tunings?limit=100&status=succeeded", { signal });
  const pick = (name, i) => {
    const options = items.map((job) => {
      const { title, aim } = summary(job.request);
      const text = [title, aim, number(job.progress.best), clock(job.created_at)].join(" · ");
      return h("option", { value: job.id, selected: job.id === ids[i] }, text);
    });
    const choose = ({ target }) => (query.set(name, target.value), go(`#/compare?${query}`));
    const select = h("select", { id: name, onchange: choose }, h("option", { value: "" }, "Choose a tuning"), options);
    return h("div", { class: "field" }, h("label", { for: name }, i ? "Second" : "First"), select);
  };
  const body = h("div", {});
  main.replaceChildren(lead("Compare two tunings"), h("div", { class: "cards" }, names.map(pick)), body);
  if (!ids[0] || !ids[1]) return;

  const jobs = await Promise.all(ids.map((id) => request("GET", `/v1/tunings/${id}`, { signal })));
  const [own, other] = jobs.map(unitOfJob);
  setTimeUnit(own ?? "time units");
  const factor = unitsIn(other, own);
  const factors = [1, Number.isNaN(factor) ? 1 : factor];
  const told = Number.isNaN(factor) ? "The unit of time of one is not known: times are compared as they stand."
    : `Times are in ${own ?? "time units"}.`;
  const heads = jobs.map(({ id, request: asked }, i) =>
    h("a", { href: `#/tunings/${id}` }, `${i ? "Second" : "First"}: ${summary(asked).title}`));
  /** @type {(sides: any[], matters: (one: string, other: string) => boolean) => string[][]} */
  const lines = (sides, matters) => {
    const [a, b] = sides.map((side) => new Map(flat(side)));
    return [...new Set([...a.keys(), ...b.keys()])]
      .map((at) => [at.split("/").slice(1).map(label).join(" › "), a.get(at) ?? "–", b.get(at) ?? "–"])
      .filter(([, one, other]) => matters(one, other));
  };
  const found = jobs.map(({ result }, i) => (result ? rescaled(essence(result), factors[i]) : {}));
  const results = lines(found, (one, other) => one !== "–" || other !== "–");
  const asked = jobs.map((job, i) => rescaled({ ...job.request, time_unit: null }, factors[i]));
  const differing = lines(asked, (one, other) => one !== other);
  const sides = jobs.map(() => h("div", { class: "side" }));
  put(body,
    h("section", { class: "card" }, table("Results", ["", ...heads], results), help(told)),
    h("section", { class: "card" }, differing.length
      ? table("Where the requests differ", ["", "First", "Second"], differing)
      : h("p", {}, "The requests are the same.")),
    h("div", { class: "figures" }, sides));
  for (const [i, { id }] of jobs.entries()) await showFigures(sides[i], figuresOf(id), `mutune-${id.slice(0, 8)}`);
}
