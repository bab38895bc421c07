/** The result of a tuning: what to set, what it achieves, how sure that is. */

import { request } from "./api.js";
import { copy, download, h, put, table } from "./dom.js";
import { segments } from "./fields.js";
import { figuresOf, showFigures } from "./figures.js";
import { duration, label, number, timeUnit, unitTag, unitText } from "./format.js";
import { analyses, exists, operation, resolve } from "./schema.js";

const ADVICE = [
  "Permit a larger peak M of the sensitivity, or a longer time constant τₚ.",
  "Reduce the uncertainty: a smaller error ε or a shorter time scale θ, if the plant allows it.",
  "Widen the bounds of the controller's parameters, or use PID.",
];
const PEAKS = /** @type {Record<string, string>} */ ({
  robust_performance: "Robust performance", robust_stability: "Robust stability", nominal_performance: "Nominal performance",
});
const FORMS = ["cascade", "ideal", "parallel"];

/** Units that share settings, as ranges: 1–3, 5. @param {number[]} group */
function units(group) {
  const text = [];
  for (let i = 0; i < group.length; ) {
    let end = i;
    while (group[end + 1] === group[end] + 1) end++;
    text.push(end > i ? `${group[i] + 1}–${group[end] + 1}` : `${group[i] + 1}`);
    i = end + 1;
  }
  return text.join(", ");
}

/** The result in a few sentences. @param {any} job */
function headline({ result, request: asked }) {
  const byTime = result.objective === "tau_p";
  const value = byTime ? result.tau_p : result.peaks?.robust_performance.value;
  const met = byTime || value <= 1;
  const what = byTime
    ? "Closed-loop time constant τₚ that holds for every plant within the uncertainty"
    : `Peak of μ at τₚ = ${number(asked.performance.tau_p)}: the demand is ${met ? "met" : "not met"} for every plant within the uncertainty`;
  return h("section", { class: `card hero${met ? "" : " missed"}` },
    h("p", {}, h("strong", { class: "big" }, number(value)), " ", byTime ? unitTag("time") : h("span", { class: "unit" }, "μ")),
    h("p", {}, what, "."), gainOf(result), result.peaks ? peakMeters(result.peaks) : null);
}

/** What asymmetry buys. @param {any} result */
function gainOf({ comparison, objective }) {
  if (!comparison) return null;
  const { gain_percent: gain, identical_value: value, identical_loop: loop } = comparison;
  const unit = objective === "tau_p" ? ` ${timeUnit()}` : "";
  return h("p", { class: "gain" },
    h("strong", {}, `${number(gain, 3)} % ${objective === "tau_p" ? "faster" : "lower"}`),
    ` than the best identical settings: those reach ${number(value)}${unit} with gain ${number(loop.gain)}, integral time ${number(loop.integral_time)}.`);
}

/** @param {any} peaks */
function peakMeters(peaks) {
  return h("div", { class: "peaks" }, h("h2", {}, "Peaks of μ"),
    Object.entries(peaks).map(([name, { value, omega }]) =>
      h("div", { class: "peak" }, h("span", {}, PEAKS[name] ?? label(name)),
        h("meter", { min: 0, max: 1.25, high: 1.0000011, value: value ?? 1.25, "aria-label": PEAKS[name] ?? name }),
        h("span", { class: "value" }, value === null ? "–" : value.toFixed(4)),
        h("span", { class: "help" }, `at ${number(omega, 3)} ${unitText("rad/time")}`))),
    h("p", { class: "help" }, "At most 1: the demand holds for every plant within the uncertainty."));
}

/** @param {HTMLElement} body @param {any} job */
export function resultView(body, job) {
  const { result, id } = job;
  const found = result.loops.length > 0;
  const infeasible = h("section", { class: "card hero missed" },
    h("h2", {}, "No settings meet this demand"), h("p", {}, sentence(result.reason)),
    result.omega === null ? null : h("p", {}, `The frequency that forbids it: ${number(result.omega)} ${unitText("rad/time")}.`),
    h("h3", {}, "What to try"), h("ul", {}, ADVICE.map((text) => h("li", {}, text))));
  const figures = h("div", { class: "figures" });
  put(body,
    h("div", { class: "cards" }, found ? headline(job) : infeasible, found ? settings(result) : null),
    result.warnings.length ? h("section", { class: "card warning" }, h("h2", {}, "Look at this twice"),
      h("ul", {}, result.warnings.map((text) => h("li", {}, sentence(text))))) : null,
    actions(job), figures,
    h("div", { class: "cards" }, certificate(job), inputs(job)));
  if (exists("/v1/tunings/{job_id}/figures", "get")) {
    showFigures(figures, figuresOf(id), `mutune-${id.slice(0, 8)}`);
  }
}

/** @param {string | null} text */
const sentence = (text) => (text ? `${text.charAt(0).toUpperCase()}${text.slice(1)}${text.endsWith(".") ? "" : "."}` : "");

/** The tuning table in the form of the user's control system. @param {any} result */
function settings({ loops, groups }) {
  const place = h("div", {});
  const { node, read } = segments("Form of the controller", FORMS.map(label), 0);
  const said = h("span", { class: "help", role: "status" });
  const help = resolve(operation("/v1/controller-forms").output).properties.forms.items;
  /** @type {string[][]} */
  let sheet = [];
  const first = groups.map((group) => loops[group[0]]);
  const forms = request("POST", "/v1/controller-forms", { body: { loops: first } });
  const show = async () => {
    const form = FORMS[read()];
    const answers = (await forms).forms;
    const given = answers.map((answer) => answer[form]);
    const { description: _, ...part } = resolve(help).properties[form]; // its own says less than the form's
    const described = resolve(part);
    const keys = Object.keys(described.properties).filter((key) => given.some((g) => g?.[key]));
    const unit = (key) =>
      key.endsWith("_time") ? unitText("time") : key === "integral_gain" ? `1/${timeUnit()}` : key === "derivative_gain" ? timeUnit() : "";
    const names = keys.map((key) => (unit(key) ? `${label(key)}, ${unit(key)}` : label(key)));
    sheet = [["Unit", ...names], ...groups.flatMap((group, i) =>
      group.map((k) => [String(k + 1), ...keys.map((key) => String(given[i]?.[key] ?? ""))]))];
    const rows = groups.map((group, i) =>
      [`${group.length > 1 ? "Units" : "Unit"} ${units(group)}`,
        ...keys.map((key) => h("span", { class: "value" }, number(given[i]?.[key], 5)))]);
    const reasons = answers.map((answer) => (answer[form] ? null : answer.reason)).filter(Boolean);
    put(place, table("Controller settings", ["", ...names], rows),
      h("p", { class: "help" }, [described.description, ...reasons].join(" ")));
  };
  node.addEventListener("change", show);
  show();
  const text = (between) => sheet.map((row) => row.map((cell) => (cell.includes(",") && between === "," ? `"${cell}"` : cell)).join(between)).join("\r\n");
  return h("section", { class: "card" }, h("h2", {}, "What to set"), node, place,
    h("div", { class: "buttons" },
      h("button", { type: "button", onclick: async () => (await copy(text("\t")), (said.textContent = "Copied, all digits.")) }, "Copy table"),
      h("button", { type: "button", onclick: () => download("settings.csv", text(","), "text/csv") }, "CSV"), said));
}

/** @param {any} job */
function actions(job) {
  const { id, result } = job;
  const report = async () => download(`mutune-${id.slice(0, 8)}.html`, await request("GET", `/v1/tunings/${id}/report`, { text: true }), "text/html");
  const link = async (/** @type {Event} */ event) => {
    await copy(`${location.origin}/#/tunings/${id}?unit=${encodeURIComponent(timeUnit())}`);
    /** @type {HTMLElement} */ (event.target).textContent = "Link copied";
  };
  const further = analyses().filter(({ input, path }) => resolve(input).properties.plant && path !== "/v1/controller-forms");
  return h("nav", { class: "buttons", "aria-label": "What next" },
    exists("/v1/tunings/{job_id}/report", "get") ? h("button", { type: "button", class: "main", onclick: report }, "Download report") : null,
    h("a", { class: "button", href: `#/?from=${id}` }, "Change and run again"),
    h("a", { class: "button", href: `#/compare?a=${id}` }, "Compare"),
    h("button", { type: "button", onclick: link }, "Copy link"),
    result.loops.length ? h("span", { class: "help" }, "Look further:") : null,
    result.loops.length ? further.map((op) => h("a", { class: "button quiet", href: `#/analyses/${op.name}?from=${id}` }, label(op.name))) : null);
}

/** @param {any} job */
function certificate({ id, result }) {
  if (!result.certificate) return null;
  const { gamma, intervals } = result.certificate;
  const save = () => download(`mutune-${id.slice(0, 8)}-certificate.json`, JSON.stringify(result.certificate, null, 1), "application/json");
  return h("section", { class: "card" }, h("h2", {}, "Certificate"),
    h("p", {}, h("strong", {}, `μ ≤ ${number(gamma, 8)} at every frequency`), intervals ? `, proven on ${intervals.length} intervals from 0 to infinity.` : "."),
    h("p", { class: "help" }, "Anyone can check it from the file alone: mutune verify FILE."),
    h("button", { type: "button", onclick: save }, "Download certificate"));
}

/** @param {any} job */
function inputs({ request: asked, id, result: { search } }) {
  const text = JSON.stringify(asked, null, 2);
  return h("section", { class: "card" }, h("h2", {}, "What was asked"),
    h("p", { class: "help" }, `${search.starts} starts in ${duration(search.elapsed_seconds)}, seed ${search.seed}, ${search.local_optima.length} local optima.`),
    h("details", {}, h("summary", {}, "Request"), h("pre", { tabindex: "0" }, text)),
    h("button", { type: "button", onclick: () => download(`mutune-${id.slice(0, 8)}-request.json`, text, "application/json") }, "Download request"));
}
