/** How the loops of a tuning behave, and what can go wrong with them: the service's loop sheet. */

import { Problem, request } from "./api.js";
import { card, h, help, put, table } from "./dom.js";
import { drawFigures, inUnit, waiting } from "./figures.js";
import { number, plain, timeUnit } from "./format.js";
import { onceReleased } from "./press.js";

const SETTINGS = /** @type {Record<string, string>} */ ({
  found: "proposed", identical: "identical", "as found": "as found" });
const LEVELS = /** @type {Record<string, string>} */ ({
  bad: "✕ Stop", warning: "! Careful", note: "Note", good: "✓ Good" });

/** The second and third question of a result. @param {any} job @param {string} name of files saved */
export function sheet(job, name) {
  const figures = h("div", { class: "figures", "aria-busy": "true" }, waiting(2));
  const measures = h("div", { class: "measures" });
  const list = h("ul", { class: "risks", "aria-busy": "true" }, h("li", {}, help("Looking at what can go wrong …")));
  const show = async () => {
    try {
      const { behaviour, risks, figures: drawn } = await request("GET", inUnit(`/v1/tunings/${job.id}/sheet`));
      await new Promise((done) => onceReleased(() => done(null)));
      put(list, risks.map(({ level, text }) =>
        h("li", { class: level }, h("strong", {}, LEVELS[level]), h("span", {}, plain(text)))));
      put(measures, behaviour.length > 0 && measured(behaviour, job.request.instruments ?? []));
      list.removeAttribute("aria-busy");
      await drawFigures(figures, drawn, name);
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      put(figures, h("p", { class: "error" }, error.message));
      put(list);
    }
    for (const place of [list, figures]) place.removeAttribute("aria-busy");
  };
  const cards = h("div", { class: "questions" },
    card("How will it behave?", figures, measures), card("What can go wrong?", list));
  return { node: cards, show };
}

/** The unit that all signals of a kind share. @param {any[]} signals @param {string} key */
function shared(signals, key) {
  const units = new Set(signals.map((one) => one[key] ?? ""));
  return units.size === 1 ? [...units][0] : "";
}

/** @param {any[]} rows @param {any[]} signals of the request */
function measured(rows, signals) {
  const [output, input] = [shared(signals, "output_unit"), shared(signals, "input_unit")];
  const of = (text, unit, gap = ", ") => (unit ? `${text}${gap}${unit}` : text);
  const [{ set_point_step: step, load_step: load }] = rows;
  const per = (/** @type {number | null} */ share) => (share === null ? "–" : `${number(100 * share, 3)} %`);
  const heads = ["Loop", "Settings", `Settles in, ${timeUnit()}`, "Overshoot", of("Valve moves by up to", input),
    of("Error after load", output), `Load gone in, ${timeUnit()}`,
    "Gain margin", "Phase margin", `Delay margin, ${timeUnit()}`];
  const lines = rows.map((row) => {
    const name = SETTINGS[row.settings] ?? row.settings;
    const loop = row.loop.replace(/^(loop|all)/, (first) => first.replace(/^./, (c) => c.toUpperCase()));
    if (!row.stable) return [loop, name, "unstable", ...Array(7).fill("–")];
    return [loop, name, number(row.settling_time, 3), per(row.overshoot), number(row.input_peak, 3),
      number(row.load_error, 3), number(row.load_settling_time, 3), limit(row.gain_margin, "×"),
      limit(row.phase_margin, "°"), limit(row.delay_margin, "")];
  });
  return h("div", {}, table("In numbers, all loops closed", heads, lines),
    help(`Set point stepped by ${of(number(step, 3), output, " ")}, load of ${of(number(load, 3), input, " ")} `
      + "at the input of the same loop. "
      + "Settled: within 2 % of the step, or 5 % of the largest error. A dash: not within the time shown. "
      + "Margins: what this loop alone may change by, all others closed; “any”: no limit."));
}

/** @param {number | null} value @param {string} unit */
const limit = (value, unit) => (value === null ? "any" : `${number(value, 3)}${unit && ` ${unit}`}`);
