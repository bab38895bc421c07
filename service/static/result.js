/** The result of a tuning: what to type in, how it will behave, what can go wrong; the evidence below. */

import { request } from "./api.js";
import { button, copy, download, h, help, link, put } from "./dom.js";
import { evidence } from "./evidence.js";
import { handOver } from "./hand_over.js";
import { inUnit } from "./figures.js";
import { picture } from "./picture.js";
import { loopsOf, number, plain, sentence, timed, timeUnit, unitTag, unitText } from "./format.js";
import { furtherOf, openAs } from "./offers.js";
import { sheet } from "./sheet.js";
import { plantFormula } from "./symbols.js";
import { tagged } from "./tags.js";
import { tradeOff } from "./trade_off.js";
import { whatIf } from "./what_if.js";

const ADVICE = [
  "Permit a larger peak M of the sensitivity, or a longer time constant τₚ.",
  "Reduce the uncertainty: a smaller error ε or a shorter time scale θ, if the plant allows it.",
  "Widen the bounds of the controller's parameters, or use PID.",
];
const HINT = "20 % is 0.2.";
const SLIP = 2; // an error of the inputs from which per cent were meant
const AT_REST = "No controller with integral action can do this, whatever its settings: look at the plant.";
const WORTH_IT = 2; // per cent, below which a plant does not feel the difference

/** @param {HTMLElement} body @param {any} job */
export function resultView(body, job) {
  const { result } = job;
  const found = result.loops.length > 0;
  const name = fileName(job.id);
  const signals = job.request.instruments;
  if (!found) {
    const warnings = result.warnings.map((text) => h("li", {}, said(text, signals)));
    put(body, infeasible(job), warnings.length > 0 && h("section", { class: "card warning" }, h("ul", {}, warnings)),
      actions(job, found), evidence(job, name));
    return;
  }
  const { node, show } = sheet(job, name);
  put(body, h("div", { class: "cards" }, headline(job), handOver(job)), node, actions(job, found),
    whatIf(job), result.objective === "tau_p" && tradeOff(job), evidence(job, name));
  show();
}

/** @param {string} id */
const fileName = (id) => `mutune-${id.slice(0, 8)}`;

const CUT = /** @type {Record<string, string>} */ ({
  cancelled: "Stopped before the search had ended: the best up to then.",
  timed_out: "The time was up before the search had ended: the best up to then.",
});

/** @param {any} job */
function headline({ result, status, request: asked }) {
  const { performance } = asked;
  const byTime = result.objective === "tau_p";
  const value = byTime ? result.tau_p : result.peaks.robust_performance.value;
  const met = result.demand_met !== false;
  const what = byTime
    ? `Closed-loop time constant τₚ that ${met ? "holds" : "was found, the demand not met,"}`
    : `Peak of μ at τₚ = ${number(performance.tau_p)}: the demand is ${met ? "met" : "not met"}`;
  const unit = byTime ? unitTag("time") : h("span", { class: "unit" }, "μ");
  return h("section", { class: `card hero${met ? "" : " missed"}` },
    h("p", {}, h("strong", { class: "big" }, number(value)), " ", unit),
    h("p", {}, what, " for every plant within the uncertainty."),
    CUT[status] && h("p", { class: "doubt" }, CUT[status], " A whole search may find better ones."),
    result.comparison && gain(result), result.optimality && limit(result),
    result.limit && h("ul", {}, result.limit.verdict.split("\n").map((line) => h("li", {}, plain(line))),
      byTime && h("li", {}, `Times in ${timeUnit()}.`)),
    guaranteed(result.guarantee, asked.instruments), scenarios(result, asked.instruments),
    result.integrity && help(said(result.integrity, asked.instruments)),
    plate(asked));
}

/** What was tuned, and for what. @param {any} asked */
function plate({ plant, uncertainty: { epsilon, theta }, performance: { max_peak: peak } }) {
  const several = (/** @type {any} */ value, text = number) => [value].flat().map((one) => text(one)).join(", ");
  const errors = epsilon == null ? "" : `Errors of the inputs: ε = ${several(epsilon)} at rest, growing to 1 near the `
    + `frequency 1/θ, θ = ${several(theta, timed)}. `;
  // On a phone the settings come first.
  const open = !matchMedia("(max-width: 40rem)").matches;
  return h("details", { class: "asked-for", open }, h("summary", {}, "What was tuned, and for what"),
    picture(plant), plantFormula(plant), help(`${errors}Permitted peak of the sensitivity: M = ${number(peak)}.`));
}

/** A sentence of the service as people read it here. @param {string} text @param {any[] | null} signals */
const said = (text, signals) => tagged(plain(sentence(text)), signals);

/** What each scenario makes of the settings. @param {any} result @param {any[] | null} signals */
function scenarios({ scenarios: found, active, spread }, signals) {
  if (!found?.length) return null;
  const proof = spread?.proof;
  const told = proof && help(proof.reason ? `Not all plants of the spread are proven: ${said(proof.reason, signals)}`
    : `Every plant of the spread is proven: μ is at most ${number(proof.level, 5)}.`);
  return h("div", {}, h("ul", {}, found.map(({ name, in_service: units, sets, tau_p: own, peaks }) => h("li", {},
    h("strong", {}, name), name === active ? " decides" : "", `: μ ${number(peaks.robust_performance.value)}`,
    own ? `, alone ${timed(own)}` : "",
    sets > 1 ? `, worst of ${sets} sets: ${loopsOf(units, signals ?? [])} in service` : ""))), told);
}

/** @param {any} guarantee @param {any[] | null} signals */
function guaranteed(guarantee, signals) {
  if (!guarantee) return null;
  return help(guarantee.status === "proven" ? `Proven: μ is at most ${number(guarantee.level, 5)} at every frequency.`
    : `Not proven over all frequencies: ${said(guarantee.reason, signals)}`);
}

/** How much better any settings can be. @param {any} result */
function limit({ objective, optimality: { lower_bound: least, gap, status } }) {
  if (!least) return help("How far from the best possible one: nothing was proven in the time.");
  const bound = objective === "tau_p" ? timed(least) : number(least);
  return h("p", {}, h("strong", {}, `Proven${status === "reached" ? "" : " in the time"}:`),
    ` no settings in such groups and within the bounds go below ${bound},`,
    ` ${number(100 * gap, 3)} % less than here.`);
}

/** What different settings gain. @param {any} result */
function gain({ comparison: { gain_percent: percent, identical_value: value, identical_loop: loop }, objective }) {
  if (!(percent >= 1e-4)) return h("p", { class: "gain" }, `Identical settings reach ${number(value)} too.`);
  const [better, unit] = objective === "tau_p" ? ["faster", ` ${timeUnit()}`] : ["lower", ""];
  const lead = loop.derivative_time ? `, derivative time ${timed(loop.derivative_time)}` : "";
  const identical = `${number(value)}${unit} with gain ${number(loop.gain)}, integral time `
    + `${timed(loop.integral_time)}${lead}.`;
  if (percent < WORTH_IT) {
    return help(`Identical settings would do: ${identical} These are ${number(percent, 3)} % ${better}.`);
  }
  return h("p", { class: "gain" }, h("strong", {}, `${number(percent, 3)} % ${better}`),
    ` than the best identical settings: those reach ${identical}`);
}

/** @param {any} job */
function infeasible({ id, result: { reason, omega }, request: asked }) {
  const worst = Math.max(...[asked.uncertainty.epsilon ?? 0].flat());
  const large = worst >= 1 && h("p", {}, `The error ε = ${number(worst)} means ${number(100 * worst)} %; ${HINT}`);
  const where = omega > 0 && h("p", {}, `The frequency that forbids it: ${number(omega)} ${unitText("rad/time")}.`);
  const href = (place) => `#/analyses/${place}?from=${id}`;
  const anew = h("li", {}, "Choose other inputs or outputs, or pair them anew: ",
    h("a", { href: href("interaction") }, "Interaction"), " tells which.");
  const drives = /parallel-drives/.test(reason) && h("li", {}, "Integral action of several units on one load: ",
    h("a", { href: "#/analyses/parallel-drives" }, "Parallel drives"), " tells what to do.");
  const advice = worst >= 1 ? slips(asked, worst) : omega === 0 ? [AT_REST, anew] : ADVICE;
  return h("section", { class: "card hero missed" }, h("h2", {}, "No settings meet this demand"),
    large, h("p", {}, said(reason, asked.instruments)), where,
    h("h3", {}, "What to try"), h("ul", {}, [...advice, drives].map((one) =>
      (typeof one === "string" ? h("li", {}, one) : one))));
}

/** What to try where inputs may err by all that they are. @param {any} asked @param {number} worst */
function slips(asked, worst) {
  const less = "Reduce the error ε at rest below 1: integral action needs to know at least the sign of each input.";
  if (worst < SLIP) return [less];
  const meant = [asked.uncertainty.epsilon].flat().map((one) => Number((one / 100).toPrecision(12)));
  const epsilon = meant.length > 1 ? meant : meant[0];
  const take = button(`Open the request with ε = ${meant.map((one) => number(one)).join(", ")}`, () => {
    openAs({ ...asked, uncertainty: { ...asked.uncertainty, epsilon } });
    location.hash = "#/";
  });
  return [h("li", {}, "If per cent were meant: ", take), less];
}

/** @param {any} job @param {boolean} found */
function actions(job, found) {
  const { id } = job;
  const report = async () => {
    const page = await request("GET", inUnit(`/v1/tunings/${id}/report`), { text: true });
    download(`${fileName(id)}.html`, page, "text/html");
  };
  const share = button("Copy link", async () => {
    await copy(`${location.origin}/${inUnit(`#/tunings/${id}`)}`);
    share.textContent = "Link copied";
  });
  return h("nav", { class: "buttons", "aria-label": "What next" },
    button("Download report", report, "main"), link("Change and run again", `#/?from=${id}`),
    link("Compare", `#/compare?ids=${id}`), share, h("span", { class: "help" }, "Look further:"),
    furtherOf(job, found).map(({ href, text }) => link(text, href, "quiet")));
}
