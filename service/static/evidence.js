/** The evidence of a result, folded: mu, sensitivity, responses, landscape, proof, forms, request. */

import { request } from "./api.js";
import { button, card, copy, csv, download, h, help, put, table } from "./dom.js";
import { segments } from "./fields.js";
import { figuresOf, showFigures, waiting } from "./figures.js";
import { duration, label, loopsOf, number, plain, sentence, timed, timeUnit, unitText } from "./format.js";
import { operation, resolve } from "./schema.js";
import { tagged } from "./tags.js";

const FORMS = ["cascade", "ideal", "parallel"];

/** @param {any} job @param {string} name of the files saved */
export function evidence(job, name) {
  const { id, result } = job;
  const found = result.loops.length > 0;
  const inside = h("div", { class: "inside" });
  const fold = h("details", { class: "evidence" },
    h("summary", {}, found ? "Evidence: peaks of μ, curves, local optima, proof, request" : "What was asked"), inside);
  fold.addEventListener("toggle", () => {
    if (!fold.open || inside.hasChildNodes()) return;
    if (!found) return put(inside, result.as_found && today(job), asked(job, name));
    const figures = h("div", { class: "figures" }, waiting(4));
    put(inside, h("div", { class: "cards" }, result.peaks && peaks(result.peaks), settings(job),
      result.demands.length > 0 && demands(job), result.settings_tolerance && ranges(job),
      result.as_found && today(job), result.limit?.alternatives.some((one) => one.value) && others(result),
      result.certificate && certificate(job, name), asked(job, name)), figures);
    showFigures(figures, figuresOf(id), name);
  });
  return fold;
}

/** @param {any} found */
const peaks = (found) => h("section", { class: "card peaks" }, h("h2", {}, "Peaks of μ"),
  Object.entries(found).map(([name, { value, omega }]) =>
    h("div", { class: "peak" }, h("span", {}, label(name)),
      h("meter", { min: 0, max: 1.25, high: 1.0000011, value: value ?? 1.25, "aria-label": label(name) }),
      h("span", { class: "value" }, value === null ? "–" : value.toFixed(4)),
      h("span", { class: "help" }, `at ${number(omega, 3)} ${unitText("rad/time")}`))),
  help("At most 1: the demand holds for every plant within the uncertainty."));

/** How far settings may be moved. @param {any} job */
function ranges({ request: { instruments }, result: { settings_tolerance: near, groups, resolution: price } }) {
  const signals = instruments ?? [];
  const rows = near.alone.map((/** @type {any} */ one) =>
    [`${loopsOf(groups[one.group], signals)}, ${label(one.parameter)}`,
      ...[one.low, one.value, one.high].map((value) => number(value))]);
  return card("How far they may be moved",
    price && h("p", {},
      `As typed in τₚ is ${number(price.tau_p_rounded)}; with any digits ${number(price.tau_p_exact)}.`),
    table("Ranges of the settings", ["", "from", "now", "to"], rows),
    help(`Each alone, before μ exceeds ${number(near.mu)} at τₚ = ${timed(near.tau_p)}.`));
}

/** What else is demanded of the settings. @param {any} job */
function demands({ result: { demands: asked } }) {
  const rows = asked.map(({ name, limit, value, met, active }) =>
    [label(name), number(limit), number(value), met ? (active ? "binds" : "met") : "not met"]);
  return card("Demands", table("Value of the worst loop", ["", "limit", "value", ""], rows));
}

/** What other kinds of controllers could do. @param {any} result */
function others({ objective, limit: { alternatives, limit, lower_bound: bound } }) {
  const best = alternatives.find((/** @type {any} */ one) => one.ratio === 1);
  const over = (value) => (best && value > 0 ? number(value / best.value, 2) : "");
  const row = (title, value, manual = "") => [title, value > 0 ? number(value) : value, over(value), manual];
  const rows = alternatives.map(({ title, value, time_limit: ended, manual }) =>
    row(title, value ?? (ended ? "out of time" : "none found"),
      manual ? (manual.stable ? number(manual.peak, 3) : "unstable") : ""));
  if (limit) rows.push(row("any controller", limit));
  if (bound?.value) rows.push(row("none below, proven", bound.value));
  return card("What other controllers could do", table("For the same demand under the same uncertainty",
    ["", objective === "tau_p" ? `τₚ, ${timeUnit()}` : "μ", best ? `over ${best.title}` : "", "μ, one in manual"],
    rows),
  help("Last column: peak of μ of the others while the worst unit is in manual."));
}

/** Today's settings beside these. @param {any} job */
function today({ request: { instruments }, result: { as_found: old, peaks: now, tau_p: tau } }) {
  const rows = [["Time constant τₚ", number(old.tau_p), number(tau)], ...Object.keys(now ?? {}).map((name) =>
    [label(name), number(old.peaks?.[name].value), number(now[name].value)])];
  return card("Today's settings", table("Today's settings beside these", ["", "today", "found"], rows),
    old.reason && help(tagged(plain(sentence(old.reason)), instruments)));
}

/** @param {string} key of a controller's form */
function unitOfSetting(key) {
  if (key.endsWith("_time")) return timeUnit();
  return { integral_gain: `1/${timeUnit()}`, derivative_gain: timeUnit() }[key] ?? "";
}

/** @param {number | null | undefined} value */
const sixDigits = (value) => (value ? String(Number(value.toPrecision(6))) : "");

/** The tuning table in three forms. @param {any} job */
function settings({ request: { instruments }, result: { loops, groups } }) {
  const named = (group) => loopsOf(group, instruments ?? []);
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
    sheet = [["Loop", ...names], ...groups.flatMap((group, i) =>
      group.map((unit) => [instruments?.[unit]?.tag ?? String(unit + 1),
        ...keys.map((key) => sixDigits(given[i][key]))]))];
    const rows = groups.map((group, i) => [named(group), ...keys.map((key) => number(given[i][key], 5))]);
    const reasons = forms.filter((one) => !one[form]).map((one) => sentence(one.reason));
    put(place, table("Controller settings", ["", ...names], rows),
      help(plain([described.description, ...new Set(reasons)].join(" "))));
  };
  node.addEventListener("change", show);
  show();
  const copyTable = async () => {
    await copy(sheet.map((row) => row.join("\t")).join("\n"));
    said.textContent = "Copied, six digits.";
  };
  return card("Settings in three forms", node, place, h("div", { class: "buttons" },
    button("Copy table", copyTable), button("CSV", () => download("settings.csv", csv(sheet), "text/csv")), said));
}

/** @param {any} job @param {string} name */
function certificate({ result: { certificate: proof } }, name) {
  const save = () => download(`${name}-certificate.json`, JSON.stringify(proof, null, 1));
  return card("Certificate",
    h("p", {}, h("strong", {}, `μ ≤ ${number(proof.gamma, 8)} at every frequency`),
      `, proven on ${proof.intervals.length} intervals from 0 to infinity.`),
    help("Anyone can check it from the file alone: mutune verify FILE."), button("Download certificate", save));
}

/** @param {any} job @param {string} name */
function asked({ request: body, result: { search } }, name) {
  const text = JSON.stringify(body, null, 2);
  const effort = `${search.starts} starts in ${duration(search.elapsed_seconds)}, seed ${search.seed}, `
    + `${search.local_optima.length} local optima.`;
  return card("What was asked", help(search.starts ? effort : "No search: the plant and the demand rule it out."),
    h("details", {}, h("summary", {}, "Request"), h("pre", { tabindex: "0" }, text)),
    button("Download request", () => download(`${name}-request.json`, text)));
}
