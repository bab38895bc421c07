/** From a record: plant data of a file are drawn, marked and fitted, and the plant goes on to tuning. */

import { follow, once, Problem, request } from "./api.js";
import { answered } from "./answer.js";
import { chart } from "./chart.js";
import { columnsOf, held, kept, roleOf } from "./columns.js";
import { button, card, h, help, lead, put } from "./dom.js";
import { newId, segments } from "./fields.js";
import { namedUnit, setTimeUnit, timeUnit } from "./format.js";
import { takeFiles } from "./intro.js";
import { openAs } from "./offers.js";
import { initial, operation } from "./schema.js";

/** @typedef {import("./columns.js").Column} Column */

const KEPT = "mutune.record"; // the record in hand, for as long as the tab is open
const ROLES = [["none", "not used"], ["input", "input (valve, drive)"], ["output", "output (measured)"]];
const LEAST = 20; // samples of a part that can check a model

/** @param {View} view */
export async function recordView({ main, signal, go }) {
  const place = h("div", { class: "answer" });
  const problem = h("p", { class: "error", role: "alert" });
  const show = async (/** @type {import("./columns.js").Kept} */ read) => {
    problem.textContent = "";
    try {
      put(place, fitted(read.name, await columnsOf(read, signal), signal, go));
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof Problem)) throw error;
      put(place);
      problem.textContent = told(error);
    }
  };
  const open = async (/** @type {File} */ file) => {
    const read = await kept(file);
    try {
      sessionStorage.setItem(KEPT, JSON.stringify(read));
    } catch { /* too large to be kept: it is shown all the same */ }
    await show(read);
  };
  const file = h("input", { type: "file", accept: ".csv,.txt,.tsv,.parquet,.pq,text/*", id: "record",
    onchange: ({ target }) => target.files[0] && open(target.files[0]) });
  takeFiles(main, signal, open);
  main.replaceChildren(
    lead("From a record", h("p", {}, "Step tests or other moves of the inputs, as a file: a column of time, a "
      + "column for each input and output; CSV of any form, or Parquet. What the record cannot tell is said, and "
      + "which test would.")),
    h("section", { class: "card" },
      h("div", { class: "field" }, h("label", { for: "record" }, "Record, CSV or Parquet"), file),
      help("Or drop it here. The service reads it and keeps nothing of it."), problem), place);
  const before = sessionStorage.getItem(KEPT);
  if (before) await show(JSON.parse(before));
}

/** @param {Problem} problem */
const told = ({ faults, message }) => (faults.length ? faults.map(({ detail }) => detail).join("; ") : message);

/**
 * @param {string} name @param {import("./columns.js").Columns} file
 * @param {AbortSignal} signal @param {(hash: string) => void} go
 */
function fitted(name, { time, unit, columns: others, faults }, signal, go) {
  if (unit) setTimeUnit(unit);
  const [start, end] = [Number(time[0]), Number(time.at(-1))];
  const roles = others.map((column) => {
    const id = newId("f");
    const select = h("select", { id }, ROLES.map(([value, text]) =>
      h("option", { value, selected: roleOf(column) === value }, text)));
    return { select, node: h("div", { class: "field" }, h("label", { for: id }, column.name), select) };
  });
  const limit = (text, value) => {
    const id = newId("f");
    const input = h("input", { id, type: "text", inputmode: "decimal", value: String(value) });
    return { input, node: h("div", { class: "field" }, h("label", { for: id }, text), input) };
  };
  const [from, to] = [limit(`Use from, ${timeUnit()}`, start), limit(`to, ${timeUnit()}`, end)];
  const curves = chart(time, others, (low, high) => {
    from.input.value = String(Number(low.toPrecision(6)));
    to.input.value = String(Number(high.toPrecision(6)));
    curves.mark(low, high);
  });
  const marked = () => curves.mark(Number(from.input.value), Number(to.input.value));
  for (const { input } of [from, to]) input.addEventListener("input", marked);
  marked();
  const alike = segments("Units", ["All alike", "Each its own", "Every pair its own"], 2);
  const order = segments("Order of an element", ["As the record tells", "First", "Second"], 0);
  const rest = h("input", { type: "checkbox" });
  const outcome = h("div", { class: "outcome", "aria-live": "polite" });
  const problem = h("p", { class: "error", role: "alert" });
  const send = button("Find the model", async () => {
    problem.textContent = "";
    const part = (/** @type {(t: number) => boolean} */ inside) => {
      const having = (role) => others.filter((_, k) => roles[k].select.value === role);
      const inputs = having("input").map((column) => ({ ...column, values: held(column.values) }));
      // A record begins where every input has been read.
      const begin = Math.max(0, ...inputs.map(({ values }) => values.findIndex((value) => value !== null)));
      const rows = time.map((t, i) => (inside(t) && i >= begin ? i : -1)).filter((i) => i >= 0);
      const of = (/** @type {Column[]} */ columns) => Object.fromEntries(columns
        .map(({ name: column, values }) => [column, rows.map((i) => values[i])]));
      return { name, time: rows.map((i) => time[i]), inputs: of(inputs), outputs: of(having("output")) };
    };
    const [low, high] = [Number(from.input.value), Number(to.input.value)];
    const records = [part((t) => t >= low && t <= high)];
    const later = part((t) => t > high);
    if (rest.checked && later.time.length >= LEAST) records.push({ ...later, name: `${name}, rest`, use: "validate" });
    const body = { records, structure: ["parallel", "units", "matrix"][alike.read()],
      order: ["auto", "first", "second"][order.read()] };
    send.disabled = true;
    put(outcome, h("p", { class: "busy" }, "Fitting …"));
    try {
      const headers = { ...once(), Prefer: "wait=30" };
      const started = await request("POST", "/v1/identifications", { body, signal, headers });
      const job = await follow("identifications", started.id, () => {}, signal);
      if (!job.result) throw new Problem(422, job.error ?? { title: "The identification was cancelled" });
      const found = job.result;
      const on = button("Tune with this model", () => handOn(name, found, others, go), "main");
      put(outcome, h("p", { class: "buttons" }, on), answered(operation("/v1/identifications"), found));
      outcome.scrollIntoView({ block: "start" });
    } catch (error) {
      if (signal.aborted) return;
      put(outcome);
      if (!(error instanceof Problem)) throw error;
      problem.textContent = told(error);
    } finally {
      send.disabled = false;
    }
  }, "main");
  return [card(name, help("Drag over the curves to mark the part to use; a click marks all of it."), curves.node,
    h("div", { class: "fields" }, from.node, to.node, roles.map(({ node }) => node)),
    faults.length > 0 && help(`Not numbers: ${faults.join("; ")}.`),
    alike.node, order.node,
    h("label", { class: "check" }, rest, "Check the model on what comes after the marked part"), problem,
    h("p", {}, send)), outcome];
}

/** @param {string} name @param {any} found @param {Column[]} columns @param {(hash: string) => void} go */
function handOn(name, { plant, uncertainty, epsilon, theta, outputs, origin }, columns, go) {
  const { num, den } = uncertainty.weight;
  // The weight of an error and a time scale is told by these two, which can be moved.
  const same = (a, b) => Math.abs(a - b) <= 1e-9 * Math.abs(b);
  const simple = epsilon && theta && num.length === 2 && same(num[0] / num[1], theta / epsilon)
    && same(den[0] / den[1], theta / 2) && same(num[1] / den[1], epsilon);
  const unitOf = (/** @type {string} */ output) => columns.find((column) => column.name === output)?.unit ?? null;
  const body = {
    ...initial(operation("/v1/tunings").input), title: name.replace(/\.csv$/i, ""), time_unit: namedUnit(), plant,
    origin,
    uncertainty: simple ? { epsilon, theta, structure: uncertainty.structure } : uncertainty,
    instruments: outputs.map((/** @type {string} */ tag) => ({ tag, output_unit: unitOf(tag) })),
  };
  openAs(body);
  go("#/");
}
