/** What is typed into the control system: its own form and units, rounded, and judged as typed. */

import { Problem, request } from "./api.js";
import { button, card, copy, csv, download, h, help, put, table } from "./dom.js";
import { newId } from "./fields.js";
import { loopsOf, namedUnit, number, sentence } from "./format.js";

const CHOSEN = "mutune.controller";
const DIGITS = 4; // as typed; the service judges the rounded values
const AS_GOOD = 1e-3; // of mu above 1: less than anybody knows the plant
const FORMS = /** @type {[string, string][]} */ ([
  ["ideal", "Any, ideal form"], ["cascade", "Any, cascade form"], ["parallel", "Any, parallel form"]]);

/** @param {string} name @returns {any} */
const targetOf = (name) => {
  const isForm = FORMS.some(([form]) => form === name);
  return { ...(isForm ? { form: name } : { controller: name }), digits: DIGITS };
};

/** @param {any} job */
export function handOver({ request: asked, result }) {
  const id = newId("f");
  const select = h("select", { id }, FORMS.map(([form, text]) => h("option", { value: form }, text)));
  const place = h("div", { "aria-live": "polite" });
  const tagged = (asked.instruments ?? []).some(({ tag }) => tag);
  // Room for the table and its notes, so that nothing below moves when they come.
  place.style.minHeight = `${11 + 2.6 * (tagged ? result.loops.length : result.groups.length)}rem`;
  const said = h("span", { class: "help", role: "status" });
  let sheet = /** @type {string[][]} */ ([]);
  let chosen = false;
  const unit = namedUnit();
  const body = (judged) => ({
    loops: result.loops, time_unit: unit, instruments: asked.instruments ?? null, target: targetOf(select.value),
    ...(judged && { plant: asked.plant, pairing: result.pairing, scan_time: asked.controller.scan_time,
      uncertainty: asked.uncertainty,
      performance: { ...asked.performance, tau_p: result.tau_p ?? asked.performance.tau_p } }),
  });
  const show = async () => {
    const asks = select.value;
    const verdict = h("p", { class: "help" }, "Checking the values as typed …");
    try {
      const { hand_over: found } = await request("POST", "/v1/controller-forms", { body: body(false) });
      // Of the plain forms one is taken that all loops have, unless somebody has chosen.
      if (!chosen && asks === "ideal" && found.loops.some(({ reason }) => reason)) {
        select.value = "cascade";
        return void show();
      }
      sheet = rowsOf(found, result);
      for (const each of buttons) each.disabled = false;
      put(place, table("Values to type", sheet[0], sheet.slice(1)),
        h("p", { class: "formula" }, h("code", {}, found.equation)),
        help(`From the deviation to the output, both in per cent of span; s in 1/${found.time_unit}.`),
        verdict, notesOf(found).map(help), found.source && help(`Source: ${found.source}.`));
      const judged = await request("POST", "/v1/controller-forms", { body: body(true) });
      if (asks === select.value) put(verdict, verdictOf(judged.hand_over));
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      put(place, h("p", { class: "error" }, error.faults[0]?.detail ?? error.message));
    }
  };
  select.addEventListener("change", () => {
    chosen = true;
    localStorage.setItem(CHOSEN, select.value);
    void show();
  });
  request("GET", "/v1/controllers").then(({ items }) => {
    select.append(...items.map(({ name, title }) => h("option", { value: name }, title)));
    const before = localStorage.getItem(CHOSEN);
    chosen = [...select.options].some(({ value }) => value === before);
    if (chosen && before) select.value = before;
    show();
  });
  const copyValues = async () => {
    await copy(sheet.map((row) => row.join("\t")).join("\n"));
    said.textContent = "Copied, as shown.";
  };
  const buttons = [button("Copy values", copyValues),
    button("Save values", () => download("values.csv", csv(sheet), "text/csv"))];
  for (const each of buttons) each.disabled = true; // until there are values
  return card("What do I type in?",
    h("div", { class: "field" }, h("label", { for: id }, "Control system"), select), place,
    h("div", { class: "buttons" }, buttons, said));
}

/** A row a loop with its tag, or a row a group where none has one. @param {any} found @param {any} result */
function rowsOf({ loops }, { groups }) {
  const columns = /** @type {Map<string, string>} */ (new Map());
  for (const { values } of loops) for (const { name, unit } of values) columns.set(name, unit);
  const heads = [...columns].map(([name, unit]) => (unit ? `${name}, ${unit}` : name));
  const tagged = loops.some(({ tag }) => tag);
  const lines = tagged ? loops.map((_, i) => [i]) : groups;
  const rows = lines.map((group) => {
    const { tag, action, values } = loops[group[0]];
    const typed = [...columns.keys()].map((column) => values.find(({ name }) => name === column)?.value);
    const name = tagged ? tag ?? `Loop ${group[0] + 1}` : loopsOf(group);
    const cell = (value) => (values.length === 0 ? "–" : value == null ? "off" : String(value));
    return [name, action, ...typed.map(cell)];
  });
  return [["Loop", "Action", ...heads], ...rows];
}

/** @param {any} found @returns {string[]} */
const notesOf = ({ notes, loops }) => {
  const own = loops.flatMap(({ tag, notes: told, reason }, i) => [...told, ...(reason ? [reason] : [])]
    .map((text) => `${tag ?? `Loop ${i + 1}`}: ${text.replaceAll("_", " ")}`)).map(sentence);
  const lacking = loops.some(({ reason }) => reason);
  const advice = lacking ? ["Choose a system with the cascade form, or a filter on the measurement."] : [];
  return [...own, ...advice, ...notes];
};

/** @param {any} found */
function verdictOf({ nominally_stable: stable, peaks, demand_met: met }) {
  if (stable === false) return h("strong", {}, "As typed, the loops are unstable.");
  if (!peaks) return "There is nothing to judge: not every loop can be typed.";
  const { value } = peaks.robust_performance;
  if (met) return `As typed, the demand is met: μ is at most ${number(value, 5)}.`;
  const over = `${number(100 * (value - 1), 2)} %`;
  return value < 1 + AS_GOOD ? `As typed, the demand is met but for ${over}: rounding.`
    : h("strong", {}, `As typed, the demand is not met: μ is ${over} above 1.`);
}
