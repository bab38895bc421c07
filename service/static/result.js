/** The result of a tuning: what to set, what it achieves, how sure that is. */

import { request } from "./api.js";
import { button, card, copy, download, h, help, link, put, table } from "./dom.js";
import { segments } from "./fields.js";
import { handOver } from "./hand_over.js";
import { figuresOf, inUnit, showFigures } from "./figures.js";
import { duration, label, number, sentence, timeUnit, unitTag, unitText } from "./format.js";
import { analyses, faults, fitting, operation, resolve } from "./schema.js";
import { tradeOff } from "./trade_off.js";

const FORMS = ["cascade", "ideal", "parallel"];
const ADVICE = [
  "Permit a larger peak M of the sensitivity, or a longer time constant τₚ.",
  "Reduce the uncertainty: a smaller error ε or a shorter time scale θ, if the plant allows it.",
  "Widen the bounds of the controller's parameters, or use PID.",
];
const HINT = "20 % is 0.2.";
const ADVICE_AT_REST = [
  "No controller with integral action can do this, whatever its settings: look at the plant.",
  "Choose other inputs or outputs, or pair them anew; the analysis of interaction tells which.",
];

/** @param {HTMLElement} body @param {any} job */
export function resultView(body, job) {
  const { result, id } = job;
  const found = result.loops.length > 0;
  const figures = h("div", { class: "figures" });
  put(body,
    h("div", { class: "cards" }, found ? headline(job) : infeasible(job), found && handOver(job)),
    result.warnings.length > 0 && h("section", { class: "card warning" }, h("h2", {}, "Look at this twice"),
      h("ul", {}, result.warnings.map((text) => h("li", {}, sentence(text))))),
    result.advice?.length > 0 && h("section", { class: "card" }, h("h2", {}, "Good to know"),
      h("ul", {}, result.advice.map((/** @type {string} */ text) => h("li", {}, sentence(text))))),
    actions(job, found), figures, found && result.objective === "tau_p" && tradeOff(job),
    h("div", { class: "cards" }, found && settings(result), result.certificate && certificate(job), asked(job)));
  showFigures(figures, figuresOf(id), fileName(id));
}

/** @param {string} id */
const fileName = (id) => `mutune-${id.slice(0, 8)}`;

/** @param {any} job */
function headline({ result, request: { performance } }) {
  const byTime = result.objective === "tau_p";
  const value = byTime ? result.tau_p : result.peaks.robust_performance.value;
  const met = byTime || value <= 1;
  const what = byTime
    ? "Closed-loop time constant τₚ that holds"
    : `Peak of μ at τₚ = ${number(performance.tau_p)}: the demand is ${met ? "met" : "not met"}`;
  const unit = byTime ? unitTag("time") : h("span", { class: "unit" }, "μ");
  return h("section", { class: `card hero${met ? "" : " missed"}` },
    h("p", {}, h("strong", { class: "big" }, number(value)), " ", unit),
    h("p", {}, what, " for every plant within the uncertainty."),
    result.comparison && gain(result), result.optimality && limit(result.optimality),
    result.peaks && peaks(result.peaks), result.integrity && help(sentence(result.integrity)));
}

/** How much better any settings can be. @param {any} proof */
function limit({ lower_bound: least, gap, status }) {
  if (!least) return help("How far from the best possible one: nothing was proven in the time.");
  return h("p", {}, h("strong", {}, `Proven${status === "reached" ? "" : " in the time"}:`),
    ` no settings in such groups and within the bounds go below ${number(least)} ${timeUnit()},`,
    ` ${number(100 * gap, 3)} % less than here.`);
}

const WORTH_IT = 2; // per cent, below which a plant does not feel the difference

/** What asymmetry buys. @param {any} result */
function gain({ comparison: { gain_percent: percent, identical_value: value, identical_loop: loop }, objective }) {
  if (!(percent >= 1e-4)) return h("p", { class: "gain" }, `Identical settings reach ${number(value)} too.`);
  const [better, unit] = objective === "tau_p" ? ["faster", ` ${timeUnit()}`] : ["lower", ""];
  const lead = loop.derivative_time ? `, derivative time ${number(loop.derivative_time)}` : "";
  const identical = `${number(value)}${unit} with gain ${number(loop.gain)}, integral time `
    + `${number(loop.integral_time)}${lead}.`;
  if (percent < WORTH_IT) {
    return help(`Identical settings would do: ${identical} These are ${number(percent, 3)} % ${better}.`);
  }
  return h("p", { class: "gain" }, h("strong", {}, `${number(percent, 3)} % ${better}`),
    ` than the best identical settings: those reach ${identical}`);
}

/** @param {any} found */
const peaks = (found) => h("div", { class: "peaks" }, h("h2", {}, "Peaks of μ"),
  Object.entries(found).map(([name, { value, omega }]) =>
    h("div", { class: "peak" }, h("span", {}, label(name)),
      h("meter", { min: 0, max: 1.25, high: 1.0000011, value: value ?? 1.25, "aria-label": label(name) }),
      h("span", { class: "value" }, value === null ? "–" : value.toFixed(4)),
      h("span", { class: "help" }, `at ${number(omega, 3)} ${unitText("rad/time")}`))),
  help("At most 1: the demand holds for every plant within the uncertainty."));

/** @param {any} job */
function infeasible({ result: { reason, omega }, request: { uncertainty } }) {
  const worst = Math.max(...[uncertainty.epsilon ?? 0].flat());
  const large = worst >= 1 && h("p", {}, `The error ε = ${number(worst)} means ${number(100 * worst)} %; ${HINT}`);
  const where = omega > 0 && h("p", {}, `The frequency that forbids it: ${number(omega)} ${unitText("rad/time")}.`);
  const advice = omega === 0 ? ADVICE_AT_REST : ADVICE;
  return h("section", { class: "card hero missed" }, h("h2", {}, "No settings meet this demand"),
    large, h("p", {}, sentence(reason)), where,
    h("h3", {}, "What to try"), h("ul", {}, advice.map((text) => h("li", {}, text))));
}

/** Units that share settings, as ranges: 1–3, 5. @param {number[]} group */
function units(group) {
  const ranges = [];
  for (let i = 0; i < group.length; ) {
    let end = i;
    while (group[end + 1] === group[end] + 1) end++;
    ranges.push(end > i ? `${group[i] + 1}–${group[end] + 1}` : group[i] + 1);
    i = end + 1;
  }
  return `${group.length > 1 ? "Units" : "Unit"} ${ranges.join(", ")}`;
}

/** @param {string} key of a controller's form */
function unitOfSetting(key) {
  if (key.endsWith("_time")) return timeUnit();
  return { integral_gain: `1/${timeUnit()}`, derivative_gain: timeUnit() }[key] ?? "";
}

/** @param {number | null | undefined} value */
const sixDigits = (value) => (value ? String(Number(value.toPrecision(6))) : "");

/** The tuning table in the form of the user's control system. @param {any} result */
function settings({ loops, groups }) {
  const place = h("div", {});
  const said = h("span", { class: "help", role: "status" });
  const { node, read } = segments("Form of the controller", FORMS.map(label), 0);
  const schema = resolve(resolve(operation("/v1/controller-forms").output).properties.forms.items);
  const converted = request("POST", "/v1/controller-forms", { body: { loops: groups.map(([first]) => loops[first]) } });
  let sheet = /** @type {string[][]} */ ([]);
  const show = async () => {
    const form = FORMS[read()];
    const { forms } = await converted;
    const given = forms.map((one) => one[form] ?? {});
    const { description: _, ...part } = schema.properties[form]; // its own says less than the form's
    const described = resolve(part);
    const keys = Object.keys(described.properties).filter((key) => given.some((one) => one[key]));
    const names = keys.map((key) => [label(key), unitOfSetting(key)].filter(Boolean).join(", "));
    sheet = [["Unit", ...names], ...groups.flatMap((group, i) =>
      group.map((unit) => [String(unit + 1), ...keys.map((key) => sixDigits(given[i][key]))]))];
    const rows = groups.map((group, i) => [units(group), ...keys.map((key) => number(given[i][key], 5))]);
    const reasons = forms.filter((one) => !one[form]).map((one) => sentence(one.reason));
    put(place, table("Controller settings", ["", ...names], rows),
      help([described.description, ...new Set(reasons)].join(" ")));
  };
  node.addEventListener("change", show);
  show();
  const copyTable = async () => {
    await copy(sheet.map((row) => row.join("\t")).join("\n"));
    said.textContent = "Copied, six digits.";
  };
  const csv = () => sheet.map((row) => row.map((cell) => `"${cell.replaceAll('"', '""')}"`).join(",")).join("\r\n");
  return card("Settings in three forms", node, place, h("div", { class: "buttons" },
    button("Copy table", copyTable), button("CSV", () => download("settings.csv", csv(), "text/csv")), said));
}

/** @param {any} job @param {boolean} found */
function actions({ id, request: body, result }, found) {
  const report = async () => {
    const page = await request("GET", inUnit(`/v1/tunings/${id}/report`), { text: true });
    download(`${fileName(id)}.html`, page, "text/html");
  };
  const share = button("Copy link", async () => {
    await copy(`${location.origin}/#/tunings/${id}?unit=${encodeURIComponent(timeUnit())}`);
    share.textContent = "Link copied";
  });
  const taken = { ...body, loops: result.loops, performance: { ...body.performance, tau_p: result.tau_p } };
  // Without settings there is the plant to look at.
  const further = analyses().map(({ name, input }) => ({ name, needs: resolve(input) }))
    .filter(({ needs }) => needs.properties.plant && (found || !needs.properties.loops))
    .filter(({ needs }) => faults(needs, fitting(needs, taken)).length === 0);
  return h("nav", { class: "buttons", "aria-label": "What next" },
    button("Download report", report, "main"), link("Change and run again", `#/?from=${id}`),
    link("Compare", `#/compare?a=${id}`), share, h("span", { class: "help" }, "Look further:"),
    further.map(({ name }) => link(label(name), `#/analyses/${name}?from=${id}`, "quiet")));
}

/** @param {any} job */
function certificate({ id, result: { certificate: proof } }) {
  const save = () => download(`${fileName(id)}-certificate.json`, JSON.stringify(proof, null, 1));
  return card("Certificate",
    h("p", {}, h("strong", {}, `μ ≤ ${number(proof.gamma, 8)} at every frequency`),
      `, proven on ${proof.intervals.length} intervals from 0 to infinity.`),
    help("Anyone can check it from the file alone: mutune verify FILE."), button("Download certificate", save));
}

/** @param {any} job */
function asked({ id, request: body, result: { search } }) {
  const text = JSON.stringify(body, null, 2);
  const effort = `${search.starts} starts in ${duration(search.elapsed_seconds)}, seed ${search.seed}`;
  return card("What was asked", help(`${effort}, ${search.local_optima.length} local optima.`),
    h("details", {}, h("summary", {}, "Request"), h("pre", { tabindex: "0" }, text)),
    button("Download request", () => download(`${fileName(id)}-request.json`, text)));
}
