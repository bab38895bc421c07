/** The unit of a tuning's times, asked for where its request does not name it. */

import { h } from "./dom.js";
import { namedUnit, rememberUnit, setTimeUnit } from "./format.js";

const USUAL = ["s", "min", "h", "d"];

/** @param {any} job */
export function unitAsked({ id, request }) {
  if (request.time_unit || namedUnit()) return null;
  const select = h("select", { id: "unit-asked", onchange: ({ target }) => {
    setTimeUnit(target.value);
    rememberUnit(id);
    dispatchEvent(new HashChangeEvent("hashchange")); // shown anew, in that unit
  } }, h("option", { value: "" }, "not named"), USUAL.map((unit) => h("option", { value: unit }, unit)));
  return h("p", { class: "asked" }, h("label", { for: "unit-asked" },
    "The request does not name the unit of its times. Of the plant's times it is "), select);
}
