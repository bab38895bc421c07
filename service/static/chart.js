/** Columns of a record as curves one below the other, of which a part can be marked. */

import { h, put, svg } from "./dom.js";
import { number } from "./format.js";

const [WIDE, HIGH] = [800, 64];
const POINTS = 800; // of a curve: as many as pixels

/** @param {(number | null)[]} time @param {(number | null)[]} values */
function curve(time, values) {
  const known = values.filter((value) => value !== null);
  const [low, high] = known.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
  const [start, end] = [Number(time[0]), Number(time.at(-1))];
  const step = Math.ceil(values.length / POINTS);
  const points = [];
  for (let i = 0; i < values.length; i += step) {
    const value = values[i];
    if (value === null) continue;
    points.push(`${((WIDE * (Number(time[i]) - start)) / (end - start)).toFixed(1)},`
      + `${(HIGH - 4 - ((HIGH - 8) * (value - low)) / (high - low || 1)).toFixed(1)}`);
  }
  return { points: points.join(" "), range: `${number(low, 4)} … ${number(high, 4)}` };
}

/**
 * @param {(number | null)[]} time @param {import("./columns.js").Column[]} columns
 * @param {(from: number, to: number) => void} marked
 */
export function chart(time, columns, marked) {
  const [start, end] = [Number(time[0]), Number(time.at(-1))];
  const marks = /** @type {Element[]} */ ([]);
  const mark = (from, to) => {
    for (const rect of marks) {
      rect.setAttribute("x", String((WIDE * (from - start)) / (end - start)));
      rect.setAttribute("width", String(Math.max(0, (WIDE * (to - from)) / (end - start))));
    }
  };
  const rows = columns.map(({ name, unit, values }) => {
    const { points, range } = curve(time, values);
    marks.push(svg("rect", { y: 0, height: HIGH, class: "marked" }));
    return h("div", { class: "curve" },
      h("span", {}, name, unit ? ` (${unit})` : "", " ", h("span", { class: "help" }, range)),
      svg("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, preserveAspectRatio: "none", "aria-hidden": "true" },
        marks.at(-1), svg("polyline", { points })));
  });
  const node = h("div", { class: "curves" });
  put(node, rows);
  let from = /** @type {number | null} */ (null);
  const at = (/** @type {PointerEvent} */ event) => {
    const box = /** @type {Element} */ (node.querySelector("svg")).getBoundingClientRect();
    return start + (end - start) * Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
  };
  node.addEventListener("pointerdown", (event) => {
    from = at(event);
    node.setPointerCapture(event.pointerId);
  });
  node.addEventListener("pointermove", (event) => {
    if (from !== null) mark(Math.min(from, at(event)), Math.max(from, at(event)));
  });
  node.addEventListener("pointerup", (event) => {
    if (from === null) return;
    const [low, high] = [Math.min(from, at(event)), Math.max(from, at(event))];
    from = null;
    // A mere click marks nothing: all of it again.
    if (high - low < 0.01 * (end - start)) marked(start, end);
    else marked(low, high);
  });
  return { node, mark };
}
