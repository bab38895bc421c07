/** Times of a request that hardly are in one unit. */

import { h } from "./dom.js";
import { number, timeUnit } from "./format.js";
import { numbersOf } from "./matrix_table.js";

const LONG = 1000; // times θ that the slowest time constant may be; minutes for seconds are 60, hours 3600
const SHORT = 0.1;

/** @param {any} plant @returns {number} its slowest time constant, NaN where it is not known */
function slowest({ kind, time_constant: tau, elements, process }) {
  if (kind === "first_order") return tau;
  const times = (elements ?? [[process]]).flat().map((/** @type {any} */ one) => numbersOf(one)?.time ?? NaN);
  return Math.max(...times);
}

/** A doubt, where there is one. @param {any} request */
export function farApart({ plant, uncertainty }) {
  const tau = plant ? slowest(plant) : NaN;
  for (const theta of [uncertainty?.theta ?? NaN].flat()) {
    const ratio = tau / theta;
    if (!(ratio > LONG || (ratio > 0 && ratio < SHORT))) continue;
    return h("p", { class: "doubt" }, `The time constant ${number(tau)} and the time scale θ = ${number(theta)} of `
      + `the error are far apart. Are both in ${timeUnit()}?`);
  }
  return null;
}
