/** What if: the demand moved by sliders, the settings tuned anew beside the last ones meanwhile. */

import { once, Problem, request } from "./api.js";
import { card, h, help, put, table } from "./dom.js";
import { newId } from "./fields.js";
import { loopsOf, number, plain, timed, timeUnit } from "./format.js";

const STEPS = 48; // of a slider, half of them to either side
const WIDE = 4; // times the value asked for, at the ends
const NOTHING = 0.05; // per cent of change that is none
const WAIT = { Prefer: "wait=60" };
/** What can be moved: its part of the request, its name and unit. */
const MOVED = /** @type {[string, string, string, string, string][]} */ ([
  ["uncertainty", "epsilon", "Error ε of the inputs", "1", "ε"],
  ["uncertainty", "theta", "Time scale θ of the error", "time", "θ"],
  ["uncertainty", "gain_error", "Error of the gains", "1", "gain error"],
  ["uncertainty", "dead_time_error", "Error of the dead times", "time", "dead-time error"],
  ["performance", "max_peak", "Permitted peak M", "1", "M"],
]);

/** @param {any} job */
export function whatIf({ request: asked, result }) {
  const known = MOVED.filter(([part, key]) => typeof asked[part]?.[key] === "number" && asked[part][key] > 0);
  const body = structuredClone(asked);
  const place = h("div", { "aria-live": "polite" });
  const keep = h("a", { class: "button", hidden: true }, "Open as a tuning of its own");
  let start = result.loops;
  let busy = false;
  let waiting = false;
  const valueOf = ({ objective, tau_p, peaks }) => (objective === "tau_p" ? tau_p : peaks?.robust_performance.value);
  const tell = (found, how) => {
    if (!found.loops.length) {
      put(place, h("p", { class: "error" }, `No settings meet this demand: ${plain(found.reason ?? "")}`));
      return;
    }
    const [now, before] = [valueOf(found), valueOf(result)];
    const unit = result.objective === "tau_p" ? ` ${timeUnit()}` : "";
    const change = 100 * (now / before - 1);
    const more = `${number(Math.abs(change), 3)} % ${change > 0 ? "more" : "less"} than ${number(before)}${unit}`;
    const value = `${result.objective === "tau_p" ? "τₚ" : "μ"} = ${number(now)}${unit}`;
    put(place, h("p", {}, h("strong", {}, value), Math.abs(change) < NOTHING ? ", as before. " : `, ${more}. `,
      h("span", { class: "help" }, how)), settingsOf(found, asked.instruments ?? []));
  };
  const local = async () => {
    if (busy) return void (waiting = true);
    busy = true;
    keep.hidden = true;
    try {
      const search = { ...body.search, start, optimality_gap: false, limit: false };
      const quick = { ...body, search, certificate: "none", model_tolerance: false };
      const found = await request("POST", "/v1/retunings", { body: quick });
      if (found.loops.length) start = found.loops;
      tell(found, "Nearly the best beside the last settings; a whole search follows when you let go.");
    } catch (error) {
      refused(error);
    }
    busy = false;
    if (waiting) {
      waiting = false;
      await local();
    }
  };
  const whole = async () => {
    const moved = known.map(([part, key, , , symbol]) => `${symbol} = ${number(body[part][key], 3)}`);
    const title = `${asked.title ?? "What if"}: ${moved.join(", ")}`.slice(0, 200);
    try {
      const job = await request("POST", "/v1/tunings", { body: { ...body, title }, headers: { ...once(), ...WAIT } });
      if (!job.result) return;
      tell(job.result, "Confirmed by a whole search.");
      keep.href = `#/tunings/${job.id}`;
      keep.hidden = false;
    } catch (error) {
      refused(error);
    }
  };
  const refused = (error) => {
    if (!(error instanceof Problem)) throw error;
    put(place, h("p", { class: "error" }, error.faults[0]?.detail ?? error.message));
  };
  const sliders = known.map(([part, key, name, kind]) => {
    const id = newId("f");
    const given = asked[part][key];
    const shown = h("output", { for: id });
    const input = h("input", { id, type: "range", min: -STEPS / 2, max: STEPS / 2, value: 0 });
    const move = () => {
      const moved = Number((given * WIDE ** ((2 * Number(input.value)) / STEPS)).toPrecision(3));
      body[part][key] = Number(input.value) === 0 ? given : moved;
      shown.textContent = kind === "time" ? timed(body[part][key], 3) : number(body[part][key], 3);
      input.setAttribute("aria-valuetext", shown.textContent);
    };
    input.addEventListener("input", () => (move(), local()));
    input.addEventListener("change", whole);
    move();
    return h("div", { class: "field slider" }, h("label", { for: id }, name), shown, input);
  });
  return known.length > 0 && card("What if?",
    help("Drag: the settings are tuned anew while you do. Let go: a whole search confirms them."),
    h("div", { class: "sliders" }, sliders), place, h("div", { class: "buttons" }, keep));
}

/** @param {any} found @param {any[]} signals */
function settingsOf({ loops, groups }, signals) {
  const keys = ["gain", "integral_time", "derivative_time", "filter_time"]
    .filter((key) => loops.some((loop) => loop[key]));
  const heads = { gain: "Gain", integral_time: `Integral time, ${timeUnit()}`,
    derivative_time: `Derivative time, ${timeUnit()}`, filter_time: `Filter time, ${timeUnit()}` };
  const rows = groups.map((group) => [loopsOf(group, signals),
    ...keys.map((key) => number(loops[group[0]][key]))]);
  return table("Settings, cascade form", ["", ...keys.map((key) => heads[key])], rows);
}
