/** What was typed, as a formula (MathML). */

import { h, math, put, scroller } from "./dom.js";
import { number } from "./format.js";

const mi = (text) => math("mi", {}, text);
const mo = (text) => math("mo", {}, text);
const fence = (text) => math("mo", { stretchy: "false" }, text);
const mn = (value) => math("mn", {}, number(Math.abs(value), 6));

/** @param {any} list */
const isNumbers = (list) => Array.isArray(list) && list.length > 0 && list.every(Number.isFinite);

/** @param {number[]} coefficients descending powers of s */
function polynomial(coefficients) {
  const row = math("mrow");
  coefficients.forEach((c, i) => {
    const power = coefficients.length - 1 - i;
    if (c === 0) return;
    if (c < 0) row.append(mo("−"));
    else if (row.childNodes.length) row.append(mo("+"));
    if (Math.abs(c) !== 1 || power === 0) row.append(mn(c));
    if (power > 1) row.append(math("msup", {}, mi("s"), mn(power)));
    if (power === 1) row.append(mi("s"));
  });
  if (!row.childNodes.length) row.append(mn(0));
  return row;
}

/** @param {any} tf @returns {Element | null} null while it is incomplete */
function row(tf) {
  if (!isNumbers(tf.num) || !isNumbers(tf.den)) return null;
  const constant = tf.den.length === 1 && tf.den[0] === 1;
  const ratio = constant ? polynomial(tf.num) : math("mfrac", {}, polynomial(tf.num), polynomial(tf.den));
  const delay = Number.isFinite(tf.dead_time) ? Number(tf.dead_time) : 0;
  if (delay === 0) return ratio;
  const exponent = math("mrow", {}, mo("−"), delay === 1 ? null : mn(delay), mi("s"));
  return math("mrow", {}, ratio, math("msup", {}, mi("e"), exponent));
}

/** @param {Children} parts */
const formula = (...parts) => math("math", { display: "block" }, math("mrow", {}, ...parts));

/** @param {any} tf a transfer function; none while it is incomplete */
export const transferFunction = (tf) => row(tf) && formula(row(tf));

/** @param {Element[][]} cells */
const matrix = (cells) =>
  math("mtable", {}, cells.map((line) => math("mtr", {}, line.map((cell) => math("mtd", {}, cell)))));

const defined = (/** @type {string | Element} */ name, /** @type {Child} */ content) =>
  formula(typeof name === "string" ? mi(name) : name, fence("("), mi("s"), fence(")"), mo("="), content);

const MOST = 3; // rows of a matrix whose elements are written one below the other

/** A matrix of names, and each element below it. @param {any[][]} elements */
function elementwise(elements) {
  const name = (r, c) => math("msub", {}, mi("g"), mi(`${r + 1}${c + 1}`));
  return [defined("G", matrix(elements.map((line, r) => line.map((_, c) => name(r, c))))),
    ...elements.flatMap((line, r) => line.map((tf, c) => defined(name(r, c), row(tf))))];
}

/**
 * Draw smaller what would be cut, or else in another way.
 * @param {HTMLElement} view @param {(() => Element[]) | null} otherwise
 */
const fit = (view, otherwise) => queueMicrotask(() => { // before it is painted: nothing jumps
  const isCut = () => view.scrollWidth > view.clientWidth;
  for (let size = 1.15; size > 0.85 && isCut(); size -= 0.05) view.style.fontSize = `${size}rem`;
  if (isCut() && otherwise) put(view, ...otherwise());
});

/** The plant of a request, or nothing while it is incomplete. @param {any} plant */
export function plantFormula(plant) {
  const view = scroller("Formula of the plant", "formula");
  if (plant.kind === "matrix") {
    const cells = plant.elements.map((line) => line.map(row));
    const complete = cells.flat().every(Boolean);
    if (complete) put(view, defined("G", matrix(cells)));
    if (complete) fit(view, cells.length > MOST ? null : () => elementwise(plant.elements));
    return view;
  }
  const { n, gain: k, time_constant: tau, interaction: a, dead_time } = plant;
  const lag = (gain) => row({ num: [gain], den: tau === 0 ? [1] : [tau, 1], dead_time });
  const shorthand = plant.kind === "first_order";
  const own = shorthand ? lag(k) : row(plant.process);
  const cross = shorthand ? lag(Number((a * k).toPrecision(12))) : row(plant.interaction);
  if (!own || !cross || !Number.isInteger(n)) return view;
  const line = Array.from({ length: n > 3 ? 4 : n }, (_, i) => i);
  const cells = line.map((r) => line.map((c) => mi(r === c ? "g" : "i")));
  if (n > 3) {
    for (const k of [0, 1, 3]) [cells[2][k], cells[k][2]] = [mo("⋮"), mo("⋯")];
    cells[2][2] = mo("⋱");
  }
  put(view, defined("G", matrix(cells)), n > 3 && h("p", {}, `${n} × ${n}`), defined("g", own),
    n > 1 && defined("i", cross));
  return view;
}
