/** What an analysis found: figures, and the tables that the command line prints. */

import { request } from "./api.js";
import { button, download, h, put, table } from "./dom.js";
import { figuresOfAnswer, inUnit, showFigures } from "./figures.js";
import { unitText } from "./format.js";
import { exists } from "./schema.js";

/** @param {Operation} op @param {any} answer */
export function answered({ name, summary }, answer) {
  const tables = h("section", { class: "card" }, h("h2", {}, summary),
    h("p", { class: "busy" }, "Reading the result …"));
  const figures = h("div", { class: "figures" });
  if (exists(`/v1/figures/${name}`)) showFigures(figures, figuresOfAnswer(name, answer), name);
  const save = () => download(`${name}.json`, JSON.stringify(answer, null, 2));
  request("POST", inUnit(`/v1/tables/${name}`), { body: answer }).then(({ parts }) => {
    put(tables, h("h2", {}, summary), partsOf(parts), h("p", {}, button("Download all of it as JSON", save, "quiet")));
  });
  return h("div", { class: "answer" }, tables, figures);
}

const inOwnUnit = (/** @type {string} */ text) =>
  text.replace(/rad\/time(?! unit)/, unitText("rad/time")).replace(/\bmu\b/g, "μ");

/** Lines and tables of the service as elements. @param {any[]} parts */
export const partsOf = (parts) => parts.filter(({ text }) => text !== "").map((part) => {
  if (part.text !== undefined) {
    const text = inOwnUnit(part.text);
    return h("p", { class: `said ${part.style}` }, part.style === "plain" ? text : h("strong", {}, text));
  }
  const heads = part.heads.map((head) => inOwnUnit(head).replace(/^[a-z]/, (first) => first.toUpperCase()));
  return table("", heads, part.rows);
});
