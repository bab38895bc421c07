/** Any result of the service as terms and tables, by its schema. */

import { h, help, table } from "./dom.js";
import { label, number, option, unitTag } from "./format.js";
import { resolve, variantOf } from "./schema.js";

const LONG = 12; // numbers, or rows, that are told one by one; the file holds them all
const TEXT = 60; // characters that fit beside other terms

const isComplex = (value) => value !== null && Object.keys(value).join() === "re,im";
const isScalar = (value) => value === null || typeof value !== "object" || isComplex(value);
const isList = (value) => Array.isArray(value) && value.every(isScalar) && typeof value[0] !== "string";
const isPair = (value) =>
  !Array.isArray(value) && Object.keys(value).length < 4 && Object.values(value).every(isScalar);
const isShort = (value) => isScalar(value) || (isList(value) ? value.length <= LONG : isPair(value));
/** Numbers that a figure shows and no table can: long lists, and stacks of matrices. */
const isData = (value) => depth(value) > 0 && (depth(value) > 2 || value.length > LONG || value[0].length > LONG);
const depth = (value) => {
  if (!Array.isArray(value)) return 0;
  if (isList(value)) return 1;
  return value.every(depth) ? 1 + depth(value[0]) : 0;
};
const isRecord = (value) => !isScalar(value) && !Array.isArray(value) && Object.values(value).every(isShort);

/** @param {any} value one that is short @returns {string} */
function short(value) {
  if (value === null) return "–";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "number") return number(value, 5);
  if (typeof value === "string") return value;
  if (isComplex(value)) {
    if (value.im === 0) return number(value.re);
    return `${number(value.re)} ${value.im < 0 ? "−" : "+"} ${number(Math.abs(value.im))}i`;
  }
  if (Array.isArray(value)) return value.map(short).join(", ");
  if (Object.keys(value).join() === "value,omega") return `${short(value.value)} at ω = ${short(value.omega)}`;
  return Object.entries(value).map(([key, item]) => `${label(key).toLowerCase()} ${short(item)}`).join(", ");
}

/** @param {Schema} schema @param {any} value */
function partOf(schema, value) {
  const s = resolve(schema);
  return s.variants ? { ...s, ...variantOf(s.variants, value) } : s;
}

/** @type {(value: any, schema: Schema, name: string, level?: number) => HTMLElement} */
export function record(value, schema, name, level = 2) {
  const s = partOf(schema, value);
  if (Array.isArray(value)) return list(value, s, name, level);
  const parts = Object.values(value);
  const kinds = new Set(parts.map((item) => (isRecord(item) ? Object.keys(item).join() : "")));
  if (parts.length > 1 && kinds.size === 1 && !kinds.has("")) {
    const part = partOf(Object.values(s.properties ?? {})[0] ?? {}, parts[0]);
    return sheet(name, Object.keys(value).map(label), parts, part);
  }
  const heading = h(/** @type {"h2"} */ (`h${Math.min(level, 6)}`), {}, label(name));
  return h("section", { class: level === 2 ? "card" : "part" }, heading, members(value, s, level));
}

/** @param {any} value @param {Schema} s @param {number} level of the heading above */
function members(value, s, level) {
  const entries = Object.entries(value)
    .filter(([, item]) => item !== null && item.length !== 0)
    .map(([key, item]) => ({ key, item, s: partOf(s.properties?.[key] ?? {}, item) }));
  const long = entries.filter(({ item }) => isData(item));
  const terms = entries.filter(({ item }) => isShort(item)).map(({ key, item, s: part }) =>
    h("div", { class: String(item).length > TEXT && typeof item === "string" ? "text" : "" }, h("dt", {}, label(key)),
      h("dd", {}, short(item), " ", unitTag(part["x-unit"])),
      part.description && h("dd", { class: "help" }, part.description)));
  const rest = entries.filter(({ item }) => !isShort(item) && !isData(item));
  const filed = long.map(({ key, item }) => `${label(key).toLowerCase()} (${item.length} values)`).join(", ");
  return [
    terms.length > 0 && h("dl", {}, terms),
    ...rest.map(({ key, item, s: part }) => record(item, part, key, level + 1)),
    long.length > 0 && help(`In the file: ${filed}.`),
  ];
}

/** @type {(items: any[], s: Schema, name: string, level: number) => HTMLElement} */
function list(items, s, name, level) {
  if (items.every((item) => typeof item === "string")) return h("ul", {}, items.map((item) => h("li", {}, item)));
  const item = partOf(s.items ?? {}, items[0]);
  const numbered = items.map((_, i) => String(i + 1));
  if (items.every(isRecord)) return sheet(name, numbered, items, item);
  if (items.every(isList)) {
    const rows = items.slice(0, LONG).map((row, r) => [numbered[r], ...row.slice(0, LONG).map(short)]);
    return first(items, table(label(name), rows[0].map((_, k) => (k ? String(k) : "")), rows));
  }
  const one = label(name).replace(/ies$/, "y").replace(/s$/, "");
  return first(items, h("div", {}, items.slice(0, LONG).map((entry, i) =>
    h("details", { open: i === 0 }, h("summary", {}, `${one} ${i + 1}`),
      isShort(entry) ? short(entry) : members(entry, item, level - 1)))));
}

/** Things of one kind, a row each. @type {(name: string, heads: string[], items: any[], s: Schema) => HTMLElement} */
function sheet(name, heads, items, s) {
  const keys = Object.keys(items[0]).filter((key) => items.some((item) => item[key] !== null));
  const columns = keys.map((key) => h("span", {}, label(key), " ", unitTag(s.properties?.[key]?.["x-unit"])));
  const rows = items.slice(0, LONG).map((item, i) => [heads[i], ...keys.map((key) => short(item[key]))]);
  return first(items, table(label(name), ["", ...columns], rows));
}

/** @param {any[]} items @param {HTMLElement} node the first of them */
const first = (items, node) => h("div", { class: "part" }, node,
  items.length > LONG && help(`${items.length - LONG} more in the file.`));

/** What a request asks for, in a line. @param {any} request */
export function summary(request) {
  const { plant, controller, objective, performance } = request;
  const { kind, n, elements, time_constant, interaction } = plant;
  const size = kind === "matrix" ? `${elements.length} × ${elements.length} plant` : `${n} unit${n > 1 ? "s" : ""}`;
  const lag = kind === "first_order" ? `, τ = ${number(time_constant)}, a = ${number(interaction)}` : "";
  const aim = objective === "mu" ? `least μ at τₚ = ${number(performance.tau_p)}` : "least τₚ";
  const how = `${controller.kind} ${option(controller.arrangement).toLowerCase()}`;
  return { title: request.title ?? `${size}${lag}`, aim: `${how}, ${aim}` };
}
