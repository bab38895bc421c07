/** Units of time that can be converted, and requests and results in another one. */

import { unitOf } from "./format.js";

const SECONDS = /** @type {Record<string, number>} */ ({
  ms: 0.001, s: 1, sec: 1, min: 60, minutes: 60, h: 3600, hours: 3600, d: 86400, days: 86400 });
const TIMES = /(_time|time_constant|^theta|^tau_p|^dead_time_error|^time|^derivative_gain|^max_load_error)$/;
const RATES = new Set(["omega", "integral_gain", "A", "B"]); // per unit of time
const SHARES = new Set(["spread"]); // relative errors, called by what they are of
const POLYNOMIALS = new Set(["num", "den"]);

/** The unit of its times: its own, else what this browser called it. @param {any} job */
export const unitOfJob = ({ id, request: asked }) => asked.time_unit ?? unitOf(id);

/**
 * How many of the other unit one of a unit is; NaN where one of them is not known.
 * @param {string | undefined} unit @param {string | undefined} other
 */
export const unitsIn = (unit, other) =>
  unit === other ? 1 : (SECONDS[unit ?? ""] ?? NaN) / (SECONDS[other ?? ""] ?? NaN);

/**
 * The same request or result with its times in a unit of which one of the old is `factor`.
 * @param {any} value @param {number} factor @param {string} [key] @returns {any}
 */
export function rescaled(value, factor, key = "") {
  if (factor === 1 || SHARES.has(key)) return value;
  if (POLYNOMIALS.has(key)) return value.map((c, i) => c * factor ** (value.length - 1 - i));
  if (typeof value === "number")
    return TIMES.test(key) ? value * factor : RATES.has(key) ? value / factor : value;
  if (Array.isArray(value)) return value.map((item) => rescaled(item, factor, key));
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, rescaled(item, factor, name)]));
}
