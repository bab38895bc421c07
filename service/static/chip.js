/** The state of a job, in a word. */

import { h } from "./dom.js";
import { label } from "./format.js";

const MET = 1 + 1e-6; // μ at most 1, but for rounding

/** The state of a job; one that succeeds without a value has found that there is none. @param {any} job */
export function chipOf({ status, progress: { best }, request: { objective } }) {
  const missed = objective === "mu" && best > MET;
  const shown = status === "succeeded" && (best === null || missed) ? "infeasible" : status;
  return h("span", { class: `status ${shown}` }, missed && shown === "infeasible" ? "Demand not met" : label(shown));
}
