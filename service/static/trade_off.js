/** What a demand costs: the same tuning at several errors of the inputs, peaks, or limits of a demand. */

import { once, pause, request } from "./api.js";
import { button, card, h, help, put } from "./dom.js";
import { figuresOfAnswer, showFigures } from "./figures.js";
import { faults, operation } from "./schema.js";

const PERIOD = 1000; // milliseconds

/** @param {string} text */
function demand(text) {
  return { text, group: "demands", values: [0.7, 0.8, 0.9, 1, 1.25, 1.5, 2] };
}

const PARAMETERS = {
  epsilon: { text: "Over the error ε", group: "uncertainty", values: [0.25, 0.5, 0.75, 1, 1.25, 1.5, 2] },
  max_peak: { text: "Over the peak M", group: "performance", values: [0.7, 0.8, 0.9, 1, 1.25, 1.5, 2] },
  max_load_error: demand("Over the load error"),
  max_controller_gain: demand("Over the controller's gain"),
  max_sensitivity_alone: demand("Over the peak alone"),
};

/** @param {any} job */
export function tradeOff({ id, request: asked, result }) {
  const figures = h("div", { class: "figures", "aria-live": "polite" });
  const choices = Object.entries(PARAMETERS).filter(([name, { group }]) => typeof asked[group]?.[name] === "number");
  const buttons = choices.map(([name, { text }]) => button(text, async () => {
    for (const each of buttons) each.disabled = true;
    const told = h("p", { class: "busy" }, "Tuning at several values …");
    put(figures, told);
    const made = sweep(asked, name, result, (text) => {
      if (told.textContent !== text) told.textContent = text;
    });
    await showFigures(figures, made.then(({ drawn }) => drawn), `mutune-${id.slice(0, 8)}`);
    const ids = await made.then(({ jobs }) => jobs, () => []);
    const plot = /** @type {any} */ (figures.querySelector(".plot"));
    plot?.on?.("plotly_click", ({ points: [{ x }] }) => {
      const job = ids.find(({ request: one }) => valueIn(one, name) === x);
      if (job) location.hash = `#/tunings/${job.id}`;
    });
    for (const each of buttons) each.disabled = false;
  }));
  return card("What the demand costs",
    help("The same tuning with other demands: how much faster if less were asked, how much slower if more. "
      + "A point that is clicked opens its tuning."),
    h("div", { class: "buttons" }, buttons), figures);
}

/** @param {any} asked @param {string} parameter */
const valueIn = (asked, parameter) => asked[PARAMETERS[parameter].group][parameter];

/**
 * @param {any} asked @param {string} parameter @param {any} result what stands at the value asked for
 * @param {(text: string) => void} tell how far it is
 * @returns {Promise<{drawn: Figures, jobs: any[]}>}
 */
async function sweep(asked, parameter, result, tell) {
  const { group, values } = PARAMETERS[parameter];
  const { input } = operation("/v1/tunings");
  const tunings = values.map((factor) => Number((factor * asked[group][parameter]).toPrecision(3)))
    .map((value) => ({ ...asked, certificate: "none", model_tolerance: false,
      [group]: { ...asked[group], [parameter]: value } }))
    .filter((one) => faults(input, one).length === 0);
  const { id } = await request("POST", "/v1/batches", { body: { tunings }, headers: once() });
  let open = true;
  const follow = async () => {
    for (await pause(PERIOD); open; await pause(PERIOD)) {
      const { count, states: { queued, running } } = await request("GET", `/v1/batches/${id}`);
      tell(`Tuning at several values: ${count - queued - running} of ${count} done …`);
    }
  };
  follow().catch(() => {}); // what fails is told by the results
  const answered = await request("GET", `/v1/batches/${id}/results`, { text: true }).finally(() => (open = false));
  const lines = answered.trim().split("\n").map((line) => JSON.parse(line));
  const points = lines.map(({ index, result }) => ({
    value: tunings[index][group][parameter],
    tau_p: result?.tau_p ?? null, identical: result?.comparison?.identical_value ?? null,
  }));
  const drawn = await figuresOfAnswer("trade-offs", { parameter, points });
  const { data } = Object.values(drawn.figures)[0];
  data.push({ type: "scatter", mode: "markers+text", name: "you are here", x: [valueIn(asked, parameter)],
    y: [result.tau_p], text: ["you are here"], textposition: "top center", showlegend: false, cliponaxis: false,
    marker: { symbol: "star", size: 15, color: data[0].line.color } });
  const { items } = await request("GET", `/v1/tunings?batch=${id}&limit=100`);
  return { drawn, jobs: items };
}
