/** What a demand costs: the same tuning at several errors of the inputs, or permitted peaks. */

import { once, request } from "./api.js";
import { button, card, h, help, put } from "./dom.js";
import { figuresOfAnswer, showFigures } from "./figures.js";
import { faults, operation } from "./schema.js";

const PARAMETERS = {
  epsilon: { text: "Over the error ε", group: "uncertainty", values: [0.25, 0.5, 0.75, 1, 1.25, 1.5, 2] },
  max_peak: { text: "Over the peak M", group: "performance", values: [0.7, 0.8, 0.9, 1, 1.25, 1.5, 2] },
};

/** @param {any} job */
export function tradeOff({ id, request: asked }) {
  const figures = h("div", { class: "figures", "aria-live": "polite" });
  const choices = Object.entries(PARAMETERS).filter(([name, { group }]) => asked[group][name] != null);
  const buttons = choices.map(([name, { text }]) => button(text, async () => {
    for (const each of buttons) each.disabled = true;
    put(figures, h("p", { class: "busy" }, "Tuning at several values …"));
    await showFigures(figures, sweep(asked, name), `mutune-${id.slice(0, 8)}`);
    for (const each of buttons) each.disabled = false;
  }));
  return card("What the demand costs",
    help("The same tuning with other demands: how much faster if less were asked, how much slower if more."),
    h("div", { class: "buttons" }, buttons), figures);
}

/** @param {any} asked @param {string} parameter @returns {Promise<Figures>} */
async function sweep(asked, parameter) {
  const { group, values } = PARAMETERS[parameter];
  const { input } = operation("/v1/tunings");
  const tunings = values.map((factor) => Number((factor * asked[group][parameter]).toPrecision(3)))
    .map((value) => ({ ...asked, certificate: "none", [group]: { ...asked[group], [parameter]: value } }))
    .filter((one) => faults(input, one).length === 0);
  const { id } = await request("POST", "/v1/batches", { body: { tunings }, headers: once() });
  const answered = await request("GET", `/v1/batches/${id}/results`, { text: true });
  const lines = answered.trim().split("\n").map((line) => JSON.parse(line));
  const points = lines.map(({ index, result }) => ({
    value: tunings[index][group][parameter],
    tau_p: result?.tau_p ?? null, identical: result?.comparison?.identical_value ?? null,
  }));
  return figuresOfAnswer("trade-offs", { parameter, points });
}
