/** A request in a line, and the names that this browser has for tunings. */

import { number, option } from "./format.js";

const NAMES = "mutune.names";

/** @returns {Record<string, string>} */
const names = () => JSON.parse(localStorage.getItem(NAMES) ?? "{}");

/** Call a tuning something, in this browser; by no name it is called what its request says. @param {string} id */
export function rename(id, /** @type {string} */ name) {
  const { [id]: _, ...others } = names();
  localStorage.setItem(NAMES, JSON.stringify(name.trim() ? { ...others, [id]: name.trim() } : others));
}

/** What a job asks for, in a line, by the name that it has here. @param {any} job */
export const summaryOf = ({ id, request }) => {
  const found = summary(request);
  return { ...found, title: names()[id] ?? found.title };
};

/** What a request asks for, in a line. @param {any} request */
function summary(request) {
  const { plant, controller, objective, performance } = request;
  const { kind, n, elements, time_constant, interaction } = plant;
  const size = kind === "matrix" ? `${elements.length} × ${elements.length} plant` : `${n} unit${n > 1 ? "s" : ""}`;
  const lag = kind === "first_order" ? `, τ = ${number(time_constant)}, a = ${number(interaction)}` : "";
  const aim = objective === "mu" ? `least μ at τₚ = ${number(performance.tau_p)}` : "least τₚ";
  const how = `${controller.kind} ${option(controller.arrangement).toLowerCase()}`;
  return { title: request.title ?? `${size}${lag}`, aim: `${how}, ${aim}` };
}
