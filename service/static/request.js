/** The view of a request: a form, examples to start from, and what comes of it. */

import { newKey, Problem, request } from "./api.js";
import { button, download, h, lead } from "./dom.js";
import { Form } from "./form.js";
import { figuresOfAnswer, showFigures } from "./figures.js";
import { label, rememberUnit, setTimeUnit, timeUnit, unitOf } from "./format.js";
import { record } from "./record.js";
import { analyses, exists, faults, initial, operation, resolve } from "./schema.js";
import { plantFormula } from "./symbols.js";

/** @typedef {import("./main.js").View} View */

/** The parts of `given` that the schema has a place for. @param {any} schema @param {any} given */
function fitting(schema, given) {
  const known = resolve(schema).properties;
  return Object.fromEntries(Object.entries(given).filter(([key]) => key in known));
}

/** What an analysis can take over from a tuning. @param {string} id @param {boolean} again */
async function fromTuning(id, again) {
  const job = await request("GET", `/v1/tunings/${id}`);
  if (again || !job.result) return job.request;
  const performance = { ...job.request.performance, tau_p: job.result.tau_p };
  return { ...job.request, performance, loops: job.result.loops };
}

/** @param {View} view @param {string} path @param {{from?: string, title?: string}} options */
export async function requestView({ main, signal, go }, path, { from, title }) {
  const op = operation(path);
  const isJob = path === "/v1/tunings";
  const draft = `mutune.draft${path}`;
  const saved = sessionStorage.getItem(draft);
  const start = from ? fitting(op.input, await fromTuning(from, isJob)) : saved ? JSON.parse(saved) : initial(op.input);
  setTimeUnit((from && unitOf(from)) || unitOf("last") || timeUnit());

  const place = h("div", { class: "form" });
  const formulas = h("div", {});
  const problem = h("p", { class: "error", role: "alert" });
  const outcome = h("div", { class: "outcome", "aria-live": "polite" });
  const send = h("button", { type: "submit", class: "main", form: "request" }, isJob ? "Start tuning" : "Analyse");
  /** @type {Form} */
  let form;
  const show = (value) => {
    form = new Form(op.input, value, () => {
      if (!form) return;
      const typed = form.read();
      sessionStorage.setItem(draft, JSON.stringify(typed));
      if (typed.plant) formulas.replaceChildren(plantFormula(typed.plant));
      problem.textContent = "";
    });
    form.update();
    const node = h("form", { id: "request", novalidate: true, onsubmit: submit }, form.node);
    place.replaceChildren(node);
  };

  const submit = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const count = form.submit().length;
    if (count) {
      problem.textContent = count === 1 ? "One field needs attention." : `${count} fields need attention.`;
      return;
    }
    send.disabled = true;
    const body = form.read();
    try {
      if (isJob) {
        const job = await request("POST", path, { body, signal, headers: { "Idempotency-Key": newKey() } });
        rememberUnit(job.id);
        go(`#/tunings/${job.id}`);
      } else {
        outcome.replaceChildren(h("p", { class: "busy" }, "Computing …"));
        outcome.replaceChildren(answered(op, await request("POST", path, { body, signal })));
        outcome.scrollIntoView({ block: "start" });
      }
    } catch (error) {
      if (signal.aborted) return;
      outcome.replaceChildren();
      if (!(error instanceof Problem)) throw error;
      form.refuse(error.faults);
      form.submit();
      problem.textContent = error.faults.length ? `${error.title}.` : `${error.title}: ${error.message}`;
    } finally {
      send.disabled = false;
    }
  };

  const { items } = await request("GET", "/v1/examples", { signal });
  // Examples are called after their analysis; its own come first, then the plants of the others.
  const areas = analyses().map(({ name }) => name.replaceAll("-", "_").replace(/s$/, "s?")).join("|");
  const own = op.name.replaceAll("-", "_").replace(/s$/, "");
  items.sort((a, b) => Number(b.name.startsWith(own)) - Number(a.name.startsWith(own)));
  const offers = /** @type {Map<string, any>} */ (new Map());
  for (const item of items) {
    const name = label(item.name.replace(new RegExp(`^(${areas})_`), ""));
    const value = fitting(op.input, item.request);
    if (!offers.has(name) && faults(op.input, value).length === 0) offers.set(name, value);
  }
  if (!offers.size) offers.set("Example", initial(op.input));
  offers.set("Empty form", initial(op.input, false));
  const unit = h("input", { id: "unit", list: "units", maxlength: 20, value: timeUnit(), autocomplete: "off" });
  unit.addEventListener("input", () => (setTimeUnit(unit.value), rememberUnit("last")));

  show(start);
  main.replaceChildren(
    lead(title ?? op.summary, h("p", {}, resolve(op.input).description),
      h("div", { class: "field unit-of-time" }, h("label", { for: "unit" }, "Unit of time"), unit),
      h("datalist", { id: "units" }, ["s", "min", "h"].map((value) => h("option", { value })))),
    h("div", { class: "chips" }, h("span", {}, "Start from"),
      [...offers].map(([name, value]) => button(name, () => show(value), "chip"))),
    h("div", { class: "split" }, place,
      h("aside", { class: "card" },
        formulas, problem, send)),
    outcome);
}

/** @param {import("./schema.js").Operation} op @param {any} answer */
function answered(op, answer) {
  const figures = h("div", { class: "figures" });
  const path = `/v1/figures/${op.name}`;
  if (exists(path)) showFigures(figures, figuresOfAnswer(path, answer), op.name);
  const save = () => download(`${op.name}.json`, JSON.stringify(answer, null, 2));
  return h("div", {}, figures, record(answer, op.output, "result"), h("p", {}, button("Download JSON", save, "quiet")));
}
