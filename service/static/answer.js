/** What an analysis found: figures, and the tables that the command line prints. */

import { request } from "./api.js";
import { button, download, h, put, table } from "./dom.js";
import { figuresOfAnswer, inUnit, showFigures } from "./figures.js";
import { unitText } from "./format.js";
import { exists } from "./schema.js";
import { tagged, taggedCell } from "./tags.js";

/** @param {Operation} op @param {any} answer */
export function answered({ name, summary }, answer, signals = /** @type {any[] | null} */ (null)) {
  // One entry may be for all loops: it names none of them.
  const tags = (signals?.length ?? 0) > 1 ? signals : null;
  const tables = h("section", { class: "card" }, h("h2", {}, summary),
    h("p", { class: "busy" }, "Reading the result …"));
  const figures = h("div", { class: "figures" });
  if (exists(`/v1/figures/${name}`)) showFigures(figures, figuresOfAnswer(name, answer), name, tags);
  const save = () => download(`${name}.json`, JSON.stringify(answer, null, 2));
  request("POST", inUnit(`/v1/tables/${name}`), { body: answer }).then(({ parts }) => {
    put(tables, h("h2", {}, summary), partsOf(parts, tags),
      h("p", {}, button("Download all of it as JSON", save, "quiet")));
  });
  return h("div", { class: "answer" }, tables, figures);
}

const inOwnUnit = (/** @type {string} */ text) =>
  text.replace(/rad\/time(?! unit)/, unitText("rad/time")).replace(/\bmu\b/g, "μ");

const OF_LOOPS = ["loop", "loops", "Loop", "worst with units", "settings of output"];

/** Lines and tables of the service as elements. @param {any[]} parts @param {any[] | null} [tags] */
export const partsOf = (parts, tags) => parts.filter(({ text }) => text !== "").map((part) => {
  if (part.text !== undefined) {
    const text = tagged(inOwnUnit(part.text), tags);
    return h("p", { class: `said ${part.style}` }, part.style === "plain" ? text : h("strong", {}, text));
  }
  const heads = part.heads.map((head) => tagged(inOwnUnit(head), tags)
    .replace(/^[a-z]/, (/** @type {string} */ first) => first.toUpperCase()));
  const cell = (/** @type {string} */ text, /** @type {number} */ i) =>
    (OF_LOOPS.includes(part.heads[i]) ? taggedCell : tagged)(text, tags);
  return table("", heads, part.rows.map((row) => row.map(cell)));
});
