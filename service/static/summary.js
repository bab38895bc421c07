/** A request in a line. */

import { number, option } from "./format.js";

/** What a request asks for, in a line. @param {any} request */
export function summary(request) {
  const { plant, controller, objective, performance } = request;
  const { kind, n, elements, time_constant, interaction } = plant;
  const size = kind === "matrix" ? `${elements.length} × ${elements.length} plant` : `${n} unit${n > 1 ? "s" : ""}`;
  const lag = kind === "first_order" ? `, τ = ${number(time_constant)}, a = ${number(interaction)}` : "";
  const aim = objective === "mu" ? `least μ at τₚ = ${number(performance.tau_p)}` : "least τₚ";
  const how = `${controller.kind} ${option(controller.arrangement).toLowerCase()}`;
  return { title: request.title ?? `${size}${lag}`, aim: `${how}, ${aim}` };
}
