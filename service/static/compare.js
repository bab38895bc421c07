/** Any number of tunings side by side: results, what differs between their requests, curves in overlays. */

import { request } from "./api.js";
import { button, h, help, lead, put, table } from "./dom.js";
import { drawFigures, waiting } from "./figures.js";
import { clock, label, number, setTimeUnit } from "./format.js";
import { summaryOf } from "./summary.js";
import { rescaled, unitOfJob, unitsIn } from "./units.js";

const LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";
const DASHES = ["solid", "dash", "dashdot", "longdash"];

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
  ...Object.fromEntries(groups.map((group, i) =>
    [groups.length === 1 ? "all_loops" : `loop${group.length > 1 ? "s" : ""}_${group.map((k) => k + 1).join(" ")}`,
      loops[groups[i][0]] ?? {}])),
});

/** Rows in which the sides are told, one a value. @param {any[]} sides @param {(cells: string[]) => boolean} matters */
function lines(sides, matters) {
  const maps = sides.map((side) => new Map(flat(side)));
  return [...new Set(maps.flatMap((map) => [...map.keys()]))]
    .map((at) => [at.split("/").slice(1).map(label).join(" › "), ...maps.map((map) => map.get(at) ?? "–")])
    .filter(([, ...cells]) => matters(cells));
}

/** @param {View} view @param {URLSearchParams} query */
export async function compareView({ main, signal, go }, query) {
  const ids = (query.get("ids") ?? "").split(",").filter(Boolean).slice(0, LETTERS.length);
  const { items } = await request("GET", "/v1/tunings?limit=100", { signal });
  const open = (chosen) => go(`#/compare?ids=${chosen.join(",")}`);
  const others = items.filter(({ id, status }) => status === "succeeded" && !ids.includes(id));
  const select = h("select", { id: "add", onchange: ({ target }) => open([...ids, target.value]) },
    h("option", { value: "" }, "Choose a tuning"), others.map((job) => {
      const { title, aim } = summaryOf(job);
      const text = [title, aim, number(job.progress.best), clock(job.created_at)].join(" · ");
      return h("option", { value: job.id }, text);
    }));
  const body = h("div", {});
  main.replaceChildren(lead("Compare tunings"),
    h("section", { class: "card" },
      h("div", { class: "field" }, h("label", { for: "add" }, "Add to the comparison"), select)),
    body);
  if (!ids.length) return;
  const jobs = await Promise.all(ids.map((id) => request("GET", `/v1/tunings/${id}`, { signal })));
  const own = unitOfJob(jobs[0]);
  setTimeUnit(own ?? "time units");
  const found = jobs.map((job) => unitsIn(unitOfJob(job), own));
  const factors = found.map((factor) => (Number.isNaN(factor) ? 1 : factor));
  const told = found.some(Number.isNaN) ? "The unit of time of one is not known: its times are compared as they stand."
    : `Times are in ${own ?? "time units"}.`;
  const heads = jobs.map((job, i) => h("span", {},
    h("a", { href: `#/tunings/${job.id}` }, `${LETTERS[i]}: ${summaryOf(job).title}`), " ",
    closing(`Leave out ${LETTERS[i]}`, () => open(ids.filter((one) => one !== job.id)))));
  const results = lines(jobs.map(({ result }, i) => (result ? rescaled(essence(result), factors[i]) : {})),
    (cells) => cells.some((cell) => cell !== "–"));
  const plain = ({ request: asked }, i) => rescaled({ ...asked, time_unit: null, title: null }, factors[i]);
  const differing = lines(jobs.map(plain), (cells) => new Set(cells).size > 1);
  const figures = h("div", { class: "figures", "aria-busy": "true" }, waiting(2));
  put(body,
    h("section", { class: "card" }, table("Results", ["", ...heads], results), help(told)),
    jobs.length > 1 && h("section", { class: "card" }, differing.length
      ? table("Where the requests differ", ["", ...jobs.map((_, i) => LETTERS[i])], differing)
      : h("p", {}, "The requests are the same.")), figures);
  const sheets = await Promise.all(jobs.map(({ id, result }) => result?.loops.length
    ? request("GET", `/v1/tunings/${id}/sheet?unit=${encodeURIComponent(own ?? "time units")}`, { signal }) : null));
  await drawFigures(figures, overlaid(jobs, sheets, factors, own ?? "time units"), "mutune-comparison");
  figures.removeAttribute("aria-busy");
}

/** @param {string} name @param {() => void} close */
function closing(name, close) {
  const cross = button("✕", close, "quiet small");
  cross.setAttribute("aria-label", name);
  return cross;
}

/**
 * The responses of all runs in one figure each, and their curves of mu: a colour a run, a dash a loop.
 * @param {any[]} jobs @param {any[]} sheets @param {number[]} factors @param {string} unit @returns {Figures}
 */
function overlaid(jobs, sheets, factors, unit) {
  const first = sheets.find(Boolean);
  if (!first) return { templates: { light: {}, dark: {} }, figures: {}, omitted: {} };
  const { templates } = first.figures;
  const colours = templates.light.layout.colorway;
  const colour = (i) => colours[i % colours.length];
  const figures = /** @type {Figures["figures"]} */ ({});
  for (const [name, { layout }] of Object.entries(first.figures.figures)) {
    const data = sheets.flatMap((sheet, i) => {
      const curves = (sheet?.figures.figures[name]?.data ?? []).filter((trace) =>
        !trace.fill && !["set point", "identical settings"].includes(trace.name));
      const loops = [...new Set(curves.map((trace) => trace.name))];
      return curves.map((trace) => ({ ...trace, x: trace.x.map((x) => x * factors[i]),
        name: `${LETTERS[i]}: ${trace.name}`, legendgroup: `${i}${trace.name}`,
        line: { ...trace.line, color: colour(i), dash: DASHES[loops.indexOf(trace.name) % DASHES.length] } }));
    });
    const meta = { ...layout.meta, description: "A colour a tuning, a dash a loop; outputs above, inputs below." };
    figures[name] = { data, layout: { ...layout, meta } };
  }
  const data = jobs.flatMap(({ result }, i) => (result?.curves ? [{ type: "scatter", mode: "lines",
    name: LETTERS[i], x: result.curves.omega.map((omega) => omega / factors[i]), y: result.curves.robust_performance,
    line: { color: colour(i), dash: DASHES[i % DASHES.length], width: 2 } }] : []));
  figures.mu = { data, layout: { height: 420,
    meta: { title: "μ of robust performance", description: "At most 1: the demand of that tuning holds." },
    xaxis: { type: "log", title: { text: `frequency ω (rad/${unit})` }, exponentformat: "power" },
    yaxis: { title: { text: "μ (1)" }, rangemode: "tozero" } } };
  return { templates, figures, omitted: {} };
}
