/** Any result of the service as headings, terms and tables, by its schema. */

import { h, table } from "./dom.js";
import { label, number, option, unitTag } from "./format.js";
import { resolve, variantOf } from "./schema.js";

/** @typedef {import("./schema.js").Schema} Schema */

const LONG = 16; // numbers that are told one by one

const isScalar = (value) => value === null || typeof value !== "object" || isComplex(value);
const isComplex = (value) => value !== null && Object.keys(value).join() === "re,im";
const isRow = (value) => Array.isArray(value) && value.every(isScalar);
const isNumbers = (value) => isRow(value) && typeof value[0] !== "string";
const isFlat = (value) => !isScalar(value) && !Array.isArray(value) && Object.values(value).every(isShort);
const isShort = (value) => isScalar(value) || (isNumbers(value) && value.length <= LONG);

/** @param {any} value @returns {string} */
function scalar(value) {
  if (value === true) return "yes";
  if (value === false) return "no";
  if (typeof value === "number") return number(value, 5);
  if (value && isComplex(value)) {
    return `${number(value.re)} ${value.im < 0 ? "−" : "+"} ${number(Math.abs(value.im))}i`;
  }
  return value ?? "–";
}

/** @param {any} value */
function short(value) {
  if (!Array.isArray(value)) return scalar(value);
  if (value.length <= LONG) return value.map(scalar).join(", ") || "none";
  return `${value.length} values, ${scalar(value[0])} … ${scalar(value.at(-1))}`;
}

/** @param {Schema} schema @param {any} value */
function partOf(schema, value) {
  const s = resolve(schema);
  return s.variants ? { ...s, ...variantOf(s.variants, value) } : s;
}

/**
 * @param {any} value @param {Schema} schema @param {string} name @param {number} [level] of its heading
 * @returns {HTMLElement}
 */
export function record(value, schema, name, level = 2) {
  const s = partOf(schema, value);
  const heading = h(/** @type {"h2"} */ (`h${Math.min(level, 6)}`), {}, label(name));
  const part = h("section", { class: level === 2 ? "card" : "part" }, heading);
  const parts = Object.values(value);
  const alike = parts.length > 1 && parts.every(isFlat) && new Set(parts.map((item) => Object.keys(item).join())).size === 1;
  if (Array.isArray(value)) part.append(list(value, s, name, level));
  else if (alike) part.append(sheet(name, Object.keys(value).map(label), parts, partOf(Object.values(s.properties ?? {})[0] ?? {}, parts[0])));
  else part.append(...members(value, s, level));
  return part;
}

/** @param {any} value @param {Schema} s @param {number} level */
function members(value, s, level) {
  const entries = Object.entries(value)
    .filter(([, item]) => item !== null && item.length !== 0)
    .map(([key, item]) => ({ key, item, s: partOf(s.properties?.[key] ?? {}, item) }));
  const told = entries.filter(({ item }) => isShort(item) || isNumbers(item));
  const terms = told.map(({ key, item, s: part }) =>
    h("div", {}, h("dt", {}, label(key)),
      h("dd", {}, short(item), " ", unitTag(part["x-unit"])),
      part.description ? h("dd", { class: "help" }, part.description) : null));
  const rest = entries.filter((entry) => !told.includes(entry));
  return [
    ...(terms.length ? [h("dl", {}, terms)] : []),
    ...rest.map(({ key, item, s: part }) => record(item, part, key, level + 1)),
  ];
}

/** @param {any[]} items @param {Schema} s @param {string} name @param {number} level @returns {HTMLElement} */
function list(items, s, name, level) {
  if (items.every((item) => typeof item === "string")) return h("ul", {}, items.map((item) => h("li", {}, item)));
  const item = partOf(s.items ?? {}, items[0]);
  const numbered = items.map((_, i) => String(i + 1));
  if (items.every(isRow)) {
    const columns = Array.from({ length: items[0].length }, (_, k) => String(k + 1));
    if (columns.length > LONG) return h("p", {}, `${items.length} × ${columns.length} values`);
    return table(label(name), ["", ...columns], items.map((row, r) => [numbered[r], ...row.map(scalar)]));
  }
  if (items.every(isFlat)) return sheet(name, numbered, items, item);
  return h("div", {}, items.map((entry, i) =>
    h("details", { class: "part", open: i === 0 }, h("summary", {}, `${label(name)} ${i + 1}`),
      h("div", {}, isShort(entry) ? short(entry) : members(entry, item, level + 1)))));
}

/** Things of one kind, a row each. @param {string} name @param {string[]} heads @param {any[]} items @param {Schema} s */
function sheet(name, heads, items, s) {
  const keys = Object.keys(items[0]);
  const columns = keys.map((key) => h("span", {}, label(key), " ", unitTag(s.properties?.[key]?.["x-unit"])));
  return table(label(name), ["", ...columns], items.map((item, i) => [heads[i], ...keys.map((key) => short(item[key]))]));
}

/** What a request asks for, in a line. @param {any} request */
export function summary(request) {
  const { plant, controller, objective, performance } = request;
  const size = plant.kind === "matrix" ? `${plant.elements.length} × ${plant.elements.length} plant` : `${plant.n} units`;
  const lag = plant.kind === "first_order" ? `, τ = ${number(plant.time_constant)}, a = ${number(plant.interaction)}` : "";
  const aim = objective === "mu" ? `least μ at τₚ = ${number(performance.tau_p)}` : "least τₚ";
  return { title: `${size}${lag}`, aim: `${controller.kind} ${option(controller.arrangement).toLowerCase()}, ${aim}` };
}
