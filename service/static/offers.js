/** What can follow a tuning: the analyses that its plant, and its settings, can be sent to. */

import { label } from "./format.js";
import { analyses, faults, fitting, resolve } from "./schema.js";

const DIGITS = 9; // of what is handed on: far more than anybody types, and it can be read

/** @param {any} value @returns {any} */
const readable = (value) => (typeof value === "number" ? Number(value.toPrecision(DIGITS))
  : value === null || typeof value !== "object" ? value
    : Object.fromEntries(Object.entries(value).map(([key, one]) => [key, readable(one)])));

/**
 * What a tuning hands on to an analysis. The controller of a tuning is the kind of its loops, that of an
 * analysis a whole controller.
 * @param {any} job
 */
export function handedOn({ request: body, result }) {
  return { ...body, controller: null, loops: result.loops.map(readable), pairing: result.pairing,
    scan_time: body.controller.scan_time, performance: { ...body.performance, tau_p: readable(result.tau_p) } };
}

/** Fill the form of a tuning, which is opened next. @param {any} body */
export const openAs = (body) => sessionStorage.setItem("mutune.draft/v1/tunings", JSON.stringify(body));

/**
 * The analyses whose forms open without faults from this tuning.
 * @param {any} job @param {boolean} found whether there are settings; else there is the plant to look at
 */
export function furtherOf(job, found) {
  const taken = handedOn(job);
  return analyses().map(({ name, input }) => ({ name, needs: resolve(input) }))
    .filter(({ needs }) => needs.properties.plant && (found || !needs.properties.loops))
    .filter(({ needs }) => faults(needs, fitting(needs, taken)).length === 0)
    .map(({ name }) => ({ text: label(name), href: `#/analyses/${name}?from=${job.id}` }));
}
