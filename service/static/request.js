/** The view of a request: a form, examples to start from, and what comes of it. */

import { once, Problem, request } from "./api.js";
import { button, h, lead, put } from "./dom.js";
import { Form } from "./form.js";
import { label, namedUnit, plain, rememberUnit, setTimeUnit, timeUnit, unitOf } from "./format.js";
import { intro, takeFiles } from "./intro.js";
import { picture } from "./picture.js";
import { analyses, faults, fitting, initial, operation, resolve } from "./schema.js";
import { handedOn } from "./offers.js";
import { plantFormula } from "./symbols.js";
import { farApart } from "./times.js";

/** What says whose the request is, and which signals: it stands first. @param {Schema} input @returns {Schema} */
function plateOf(input) {
  const known = resolve(input).properties;
  const parts = ["title", "instruments"].filter((key) => known[key])
    .map((key) => [key, { ...known[key], "x-record": false }]);
  return { type: "object", title: "Plate", properties: Object.fromEntries(parts) };
}

/** What a form can take over from a tuning. @param {string} id @param {boolean} again */
async function fromTuning(id, again) {
  const job = await request("GET", `/v1/tunings/${id}`);
  return again || !job.result ? job.request : handedOn(job);
}

/** Requests to start from, by name. @param {Operation} op */
async function offersFor({ name: area, input }) {
  const { items } = await request("GET", "/v1/examples");
  // Examples are called after their analysis; its own come first, then the plants of the others.
  const prefix = (/** @type {string} */ name) => name.replaceAll("-", "_").replace(/s$/, "");
  const areas = new RegExp(`^(${analyses().map(({ name }) => prefix(name)).join("|")})s?_`);
  const isOwn = ({ name }) => Number(name.startsWith(prefix(area)));
  const offers = /** @type {Map<string, any>} */ (new Map());
  for (const item of items.sort((a, b) => isOwn(b) - isOwn(a))) {
    const name = label(item.name.replace(areas, ""));
    const value = fitting(input, item.request);
    if (!offers.has(name) && faults(input, value).length === 0) offers.set(name, value);
  }
  if (!offers.size) offers.set("Example", initial(input));
  return offers.set("Empty form", initial(input, false));
}

/** @param {View} view @param {string} path @param {string | null} from the tuning to start from */
export async function requestView({ main, signal, go }, path, from) {
  const op = operation(path);
  const isJob = path === "/v1/tunings";
  const draft = `mutune.draft${path}`;
  const saved = sessionStorage.getItem(draft);
  const start = from ? fitting(op.input, await fromTuning(from, isJob)) : saved ? JSON.parse(saved) : initial(op.input);
  const offers = await offersFor(op);
  // What a tuning hands on has that tuning's unit, or none.
  setTimeUnit(start.time_unit || (from ? unitOf(from) ?? "" : unitOf("last") || timeUnit()));

  const place = h("div", { class: "form" });
  const formulas = h("div", {});
  const problem = h("p", { class: "error", role: "alert" });
  const outcome = h("div", { class: "outcome", "aria-live": "polite" });
  const send = h("button", { type: "submit", class: "main", form: "request" }, isJob ? "Start tuning" : "Analyse");
  const unit = h("input", { id: "unit", list: "units", maxlength: 20, autocomplete: "off", placeholder: "s, min, h",
    value: namedUnit() ?? "" });
  /** @type {Form} */
  let form;
  /** @type {Form} */
  let plate;
  const named = () => (namedUnit() ? { time_unit: timeUnit() } : {});
  const read = () => ({ ...form.read(), ...plate.read(), ...named() });
  let drawn = "";
  const changed = () => {
    const typed = read();
    const text = JSON.stringify([typed, timeUnit()]);
    if (text === drawn) return;
    drawn = text;
    sessionStorage.setItem(draft, JSON.stringify(typed));
    put(formulas, typed.plant && picture(typed.plant), typed.plant && plantFormula(typed.plant),
      farApart(typed));
    problem.textContent = "";
  };
  const show = (value) => {
    if (value.time_unit) setTimeUnit(unit.value = value.time_unit);
    plate = new Form(plateOf(op.input), value, () => {});
    plate.node.classList.add("plate");
    form = new Form(op.input, value, changed);
    form.update();
    put(place, h("form", { id: "request", novalidate: true, onsubmit: submit }, plate.node, form.node));
    plate.node.addEventListener("input", changed);
  };

  const submit = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const count = plate.submit().length + form.submit().length;
    if (count) {
      problem.textContent = count === 1 ? "One field needs attention." : `${count} fields need attention.`;
      return;
    }
    send.disabled = true;
    const body = read();
    try {
      if (isJob) {
        const job = await request("POST", path, { body, signal, headers: once() });
        rememberUnit(job.id);
        go(`#/tunings/${job.id}`);
      } else {
        put(outcome, h("p", { class: "busy" }, "Computing …"));
        const [{ answered }, answer] = await Promise.all([
          import("./answer.js"), request("POST", path, { body, signal })]);
        put(outcome, answered(op, answer, body.instruments));
        outcome.scrollIntoView({ block: "start" });
      }
    } catch (error) {
      if (signal.aborted) return;
      put(outcome);
      if (!(error instanceof Problem)) throw error;
      const ofPlate = ({ pointer }) => /^\/(title|instruments)/.test(pointer);
      plate.refuse(error.faults.filter(ofPlate));
      form.refuse(error.faults.filter((fault) => !ofPlate(fault)));
      form.submit();
      problem.textContent = error.faults.length ? `${error.title}.` : `${error.title}: ${error.message}`;
    } finally {
      send.disabled = false;
    }
  };

  const open = async (/** @type {File} */ file) => {
    const text = await file.text();
    if (/\.csv$/i.test(file.name)) {
      sessionStorage.setItem("mutune.record", JSON.stringify({ name: file.name, text }));
      return go("#/record");
    }
    try {
      show(fitting(op.input, JSON.parse(text)));
      problem.textContent = `${file.name} is in the form.`;
    } catch {
      problem.textContent = `${file.name} holds no JSON: drop a request file, or a record as CSV.`;
    }
  };
  takeFiles(main, signal, open);
  const chips = [...offers]; // the last one is the empty form
  unit.addEventListener("input", () => (setTimeUnit(unit.value), rememberUnit("last"), changed()));
  show(start);
  main.replaceChildren(
    lead(isJob ? "Tune parallel loops" : op.summary, h("p", {}, plain(resolve(op.input).description ?? "")),
      h("div", { class: "field unit-of-time" }, h("label", { for: "unit" }, "Unit of time"), unit),
      h("datalist", { id: "units" }, ["s", "min", "h"].map((value) => h("option", { value })))),
    isJob && !from ? intro(chips.splice(0, chips.length - 1), show, open) : "",
    h("div", { class: "chips" }, h("span", {}, "Start from"),
      chips.map(([name, value]) => button(name, () => show(value), "chip"))),
    h("div", { class: "split" }, place, h("aside", { class: "card" }, formulas, problem, send)),
    outcome);
}
