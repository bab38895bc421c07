/** Any number of tunings side by side: results, what differs between their requests, curves in overlays. */

import { Problem, request } from "./api.js";
import { button, h, help, lead, put, table } from "./dom.js";
import { drawFigures, inUnit, waiting } from "./figures.js";
import { clock, label, number, option, rangesOf, setTimeUnit, timeUnit, unitText } from "./format.js";
import { summaryOf } from "./summary.js";
import { tagged } from "./tags.js";
import { rescaled, unitOfJob, unitsIn } from "./units.js";

const LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";
const DASHES = ["solid", "dash", "dashdot", "longdash"];

/** @param {any} value @param {string} [pointer] @returns {[string, string][]} */
const flat = (value, pointer = "") =>
  value !== null && typeof value === "object"
    ? Object.entries(value).flatMap(([key, item]) => flat(item, `${pointer}/${key}`))
    : [[pointer, typeof value === "number" ? number(value)
      : /^[a-z]+(_[a-z]+)+$/.test(value ?? "") ? option(value) : String(value ?? "–")]];

/** What is worth comparing. @param {any} result */
const essence = ({ tau_p, peaks, comparison, loops, groups }) => ({
  tau_p,
  peak: Object.fromEntries(Object.entries(peaks ?? {}).map(([name, { value }]) => [name, value])),
  gain_of_asymmetry: comparison && `${number(comparison.gain_percent, 3)} %`,
  ...Object.fromEntries(groups.map((group, i) =>
    [groups.length === 1 ? "all_loops" : `loop${group.length > 1 ? "s" : ""}_${group.map((k) => k + 1).join(", ")}`,
      loops[groups[i][0]] ?? {}])),
});

const PLACE = /\/(\d+)(?=\/|$)/; // of one in a list, counted from 0

/**
 * Rows in which the sides are told, one a value; those that are alike for several of a list are one.
 * @param {any[]} sides @param {(cells: string[]) => boolean} matters
 */
function lines(sides, matters) {
  const maps = sides.map((side) => new Map(flat(side)));
  const rows = /** @type {Map<string, {at: string, cells: string[], places: number[]}>} */ (new Map());
  for (const at of new Set(maps.flatMap((map) => [...map.keys()]))) {
    const cells = maps.map((map) => map.get(at) ?? "–");
    if (!matters(cells)) continue;
    const key = [at.replace(PLACE, "/*"), ...cells].join("\n");
    const row = rows.get(key) ?? { at, cells, places: [] };
    rows.set(key, row);
    row.places.push(Number(PLACE.exec(at)?.[1] ?? 0));
  }
  const named = (part, places) => (/^\d+$/.test(part) ? rangesOf(places) : label(part));
  return [...rows.values()].map(({ at, cells, places }) => {
    let first = true; // further places, of coefficients and columns, are not taken together
    const parts = at.split("/").slice(1).map((part) => {
      const own = first && /^\d+$/.test(part) ? places : [Number(part)];
      first &&= !/^\d+$/.test(part);
      return named(part, own);
    });
    return [parts.join(" › "), ...cells];
  });
}

/** The signals of all runs, where their loops have the same tags. @param {any[]} jobs */
function sharedSignals(jobs) {
  const tags = jobs.map(({ request: { instruments } }) => (instruments ?? []).map(({ tag }) => tag).join("\n"));
  return new Set(tags).size === 1 ? jobs[0].request.instruments : null;
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
  const own = jobs.map(unitOfJob).find((unit) => unitsIn(unit, "s")) ?? unitOfJob(jobs[0]);
  setTimeUnit(own ?? "");
  const found = jobs.map((job) => unitsIn(unitOfJob(job), own));
  const factors = found.map((factor) => (Number.isNaN(factor) ? 1 : factor));
  const strange = LETTERS.split("").filter((_, i) => Number.isNaN(found[i])).join(", ");
  const told = `Times are in ${timeUnit()}${strange && `, but as they stand in ${strange}: the unit is not known`}.`;
  const heads = jobs.map((job, i) => h("span", {},
    h("a", { href: `#/tunings/${job.id}` }, `${LETTERS[i]}: ${summaryOf(job).title}`), " ",
    closing(`Leave out ${LETTERS[i]}`, () => open(ids.filter((one) => one !== job.id)))));
  const results = lines(jobs.map(({ result }, i) => (result ? rescaled(essence(result), factors[i]) : {})),
    (cells) => cells.some((cell) => cell !== "–"))
    .map(([at, ...cells]) => [tagged(at, sharedSignals(jobs)), ...cells]);
  const plain = ({ request: asked }, i) => rescaled({ ...asked, time_unit: null, title: null }, factors[i]);
  const differing = lines(jobs.map(plain), (cells) => new Set(cells).size > 1);
  const figures = h("div", { class: "figures", "aria-busy": "true" }, waiting(2));
  put(body,
    h("section", { class: "card" }, table("Results", ["", ...heads], results), help(told)),
    jobs.length > 1 && h("section", { class: "card" }, differing.length
      ? table("Where the requests differ", ["", ...jobs.map((_, i) => LETTERS[i])], differing)
      : h("p", {}, "The requests are the same.")), figures);
  const sheets = await sheetsOf(jobs, signal);
  await drawFigures(figures, overlaid(jobs, sheets, factors, found.some(Number.isNaN)), "mutune-comparison");
  const missing = LETTERS.split("").filter((_, i) => jobs[i]?.result?.loops.length && !sheets[i]).join(", ");
  if (missing) figures.prepend(help(`Without the responses of ${missing}, which took too long: open it by itself.`));
  figures.removeAttribute("aria-busy");
}

/** The sheets of runs, one after another, each with all of the time that it may take. @param {any[]} jobs
 * @param {AbortSignal} signal @returns {Promise<any[]>} null where there is none, or none in time */
async function sheetsOf(jobs, signal) {
  const sheets = [];
  for (const { id, result } of jobs) {
    const asked = result?.loops.length && request("GET", inUnit(`/v1/tunings/${id}/sheet`), { signal });
    sheets.push(await Promise.resolve(asked || null).catch((error) => {
      if (!(error instanceof Problem) || signal.aborted) throw error;
      return null;
    }));
  }
  return sheets;
}

/**
 * The layout with no unit at an axis that carries several.
 * @param {any} layout @param {any[]} sheets @param {string} name of the figure @param {boolean} mixed
 */
function withoutUnits(layout, sheets, name, mixed) {
  const others = sheets.flatMap((sheet) => sheet?.figures.figures[name]?.layout ?? []);
  const axes = Object.keys(layout).filter((key) => /^[xy]axis/.test(key) && layout[key].title?.text);
  const stripped = axes.filter((key) => (mixed && key.startsWith("x"))
    || others.some((other) => other[key]?.title?.text !== layout[key].title.text));
  return { ...layout, ...Object.fromEntries(stripped.map((key) => {
    const text = layout[key].title.text.replace(/(<br>| )\(.*/, "");
    return [key, { ...layout[key], title: { ...layout[key].title, text } }];
  })) };
}

/** @param {string} name @param {() => void} close */
function closing(name, close) {
  const cross = button("✕", close, "quiet small");
  cross.setAttribute("aria-label", name);
  return cross;
}

/**
 * The responses of all runs in one figure each, and their curves of mu: a colour a run, a dash a loop.
 * @param {any[]} jobs @param {any[]} sheets @param {number[]} factors
 * @param {boolean} mixed whether the unit of time of one is not known @returns {Figures}
 */
function overlaid(jobs, sheets, factors, mixed) {
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
    figures[name] = { data, layout: { ...withoutUnits(layout, sheets, name, mixed), meta } };
  }
  const data = jobs.flatMap(({ result }, i) => (result?.curves ? [{ type: "scatter", mode: "lines",
    name: LETTERS[i], x: result.curves.omega.map((omega) => omega / factors[i]), y: result.curves.robust_performance,
    line: { color: colour(i), dash: DASHES[i % DASHES.length], width: 2 } }] : []));
  figures.mu = { data, layout: { height: 420,
    meta: { title: "μ of robust performance", description: "At most 1: the demand of that tuning holds." },
    xaxis: { type: "log", title: { text: mixed ? "frequency ω" : `frequency ω (${unitText("rad/time")})` },
      exponentformat: "power" },
    yaxis: { title: { text: "μ (1)" }, rangemode: "tozero" } } };
  return { templates, figures, omitted: {} };
}
