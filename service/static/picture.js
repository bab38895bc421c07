/** A sketch of a plant: units on one header, or a process with several inputs and outputs. */

import { svg } from "./dom.js";

const DRAWN = 6; // units; of more, the last stands for the rest

/** A picture of the plant of a request. @param {any} plant @param {boolean} [named] with words */
export function picture(plant, named = false) {
  const given = plant?.n ?? plant?.elements?.length;
  const n = Number.isInteger(given) && given > 0 ? given : 2;
  return plant?.kind === "matrix" ? vessel(n) : header(n, named);
}

/** Parallel units that hang on one header, a valve on each. @param {number} n @param {boolean} named */
function header(n, named) {
  const units = Math.min(n, DRAWN);
  const [left, right, top] = [20, 300, named ? 44 : 24];
  const step = (right - left) / units;
  const middle = (/** @type {number} */ i) => left + step * (i + 0.5);
  const text = (content, x, y) => svg("text", { x, y, "text-anchor": "middle" }, content);
  const one = (/** @type {number} */ i) => {
    const [x, w] = [middle(i), Math.min(step * 0.62, 40)];
    const last = i === units - 1 && n > units;
    return svg("g", {},
      svg("path", { d: `M${x} ${top}V${top + 34}`, class: "pipe" }),
      svg("path", { d: `M${x - 7} ${top + 10}h14l-14 14h14z`, class: "valve" }),
      svg("rect", { x: x - w / 2, y: top + 34, width: w, height: 38, rx: 6, class: "unit-box" }),
      text(last ? `… ${n}` : i + 1, x, top + 58));
  };
  return svg("svg", { viewBox: `0 0 320 ${top + 80}`, class: "picture", role: "img",
    "aria-label": `${n} parallel units on one header` },
  named ? text("shared header", 160, 18) : null,
  svg("path", { d: `M${left} ${top}H${right}`, class: "header" }),
  Array.from({ length: units }, (_, i) => one(i)));
}

/** A process with several inputs and outputs. @param {number} n */
function vessel(n) {
  const rows = Math.min(n, 4);
  const y = (/** @type {number} */ i) => 16 + (72 * (i + 0.5)) / rows;
  return svg("svg", { viewBox: "0 0 320 104", class: "picture", role: "img",
    "aria-label": `A process with ${n} inputs and ${n} outputs` },
  svg("rect", { x: 125, y: 10, width: 70, height: 84, rx: 14, class: "unit-box" }),
  Array.from({ length: rows }, (_, i) => svg("g", {},
    svg("path", { d: `M40 ${y(i)}H125`, class: "pipe" }),
    svg("path", { d: `M75 ${y(i) - 7}h14l-14 14h14z`, class: "valve" }),
    svg("path", { d: `M195 ${y(i)}H280m-8-5 8 5-8 5`, class: "pipe" }))),
  svg("text", { x: 160, y: 57, "text-anchor": "middle" }, `${n} × ${n}`));
}
