/** Plain fields: a line of text, or options to choose from. */

import { h } from "./dom.js";
import { label, option, unitTag } from "./format.js";
import { resolve } from "./schema.js";

const SEGMENTS = 4; // options that fit side by side
let serial = 0;

/** An id that no other element has. @param {string} kind */
export const newId = (kind) => `${kind}${++serial}`;

/** @type {Builder} */
export function input(form, given, start, pointer) {
  // Loops and units are counted from 1 by people, from 0 in requests.
  const by = given["x-index"] || resolve(given.items ?? {})["x-index"] ? 1 : 0;
  const s = given;
  const value = shifted(start, by);
  const id = newId("f");
  const example = shifted((s.examples ?? []).find((e) => typeof e === "number" || Array.isArray(e)), by);
  const input = h("input", {
    id, type: "text", autocomplete: "off", spellcheck: "false", value: shown(value),
    inputmode: s.type === "string" ? "text" : "decimal",
    placeholder: s.nullable ? "optional" : shown(example),
  });
  const name = h("label", { for: id }, label(key(pointer)));
  const node = h("div", { class: "field" }, name, h("div", { class: "box" }, input, unitTag(s["x-unit"])));
  const parse = s["x-list"] ? oneOrMore : s.type === "array" ? numbers : s.type === "string" ? String : numeric;
  const empty = s.nullable ? null : undefined;
  return {
    node: form.place(pointer, node, s, [input]),
    read: () => (input.value.trim() === "" ? empty : shifted(parse(input.value.trim()), -by)),
  };
}

/** Numbers counted from another one. @param {any} value @param {number} by @returns {any} */
const shifted = (value, by) => (Array.isArray(value) ? value.map((one) => shifted(one, by))
  : typeof value === "number" ? value + by : value);

/** @type {Builder} */
export function choice(form, s, value, pointer) {
  const options = s.enum ?? [true, false];
  const text = (o) => (o === true ? "Yes" : o === false ? "No" : option(o));
  const name = label(key(pointer));
  if (options.length <= SEGMENTS && !s.nullable) {
    const { node, read, radios } = segments(name, options.map(text), options.indexOf(value));
    return { node: form.place(pointer, node, s, radios), read: () => options[read()] };
  }
  const all = s.nullable ? [null, ...options] : options;
  const id = newId("f");
  const select = h("select", { id },
    all.map((o) => h("option", { selected: o === value }, o === null ? "automatic" : text(o))));
  const node = h("div", { class: "field" }, h("label", { for: id }, name), select);
  return { node: form.place(pointer, node, s, [select]), read: () => all[select.selectedIndex] };
}

/** Options side by side, of which one is chosen. @param {string} name @param {string[]} texts @param {number} chosen */
export function segments(name, texts, chosen) {
  const group = newId("g");
  const radios = texts.map((_, i) => h("input", { type: "radio", name: group, checked: i === chosen }));
  const items = texts.map((text, i) => h("label", {}, radios[i], h("span", {}, text)));
  const node = h("fieldset", { class: "field choice" }, h("legend", {}, name), h("div", { class: "segments" }, items));
  return { node, radios, read: () => radios.findIndex((radio) => radio.checked) };
}

/** The name of a value: its own, or its place in a list. @param {string} pointer */
export function key(pointer) {
  const parts = pointer.split("/");
  const numbers = parts.filter((part) => /^\d+$/.test(part)).map((part) => Number(part) + 1);
  if (!/^\d+$/.test(parts.at(-1) ?? "")) return parts.at(-1) ?? "";
  if (numbers.length > 1) return `Row ${numbers.at(-2)}, column ${numbers.at(-1)}`;
  return `${parts.at(-2)?.replace(/s$/, "")} ${numbers.at(-1)}`;
}

/** @param {string} text a number, with a point or a comma; other text stays, to be found faulty */
const numeric = (text) => (Number.isFinite(Number(text.replace(",", "."))) ? Number(text.replace(",", ".")) : text);

/** @param {string} text numbers separated by spaces, commas or semicolons */
const numbers = (text) => text.split(/[\s,;]+/).filter(Boolean).map(numeric);

/** A number, or several for one a loop; a single comma is that of a number. @param {string} text */
function oneOrMore(text) {
  if (/^-?\d*,\d+$/.test(text)) return numeric(text);
  const found = numbers(text);
  return found.length > 1 ? found : numeric(text);
}

/** @param {any} value */
const shown = (value) => (Array.isArray(value) ? value.join(", ") : value == null ? "" : String(value));
