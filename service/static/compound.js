/** Fields of fields: records, unions, optional parts, lists and matrices. */

import { button, h, help, put, scroller } from "./dom.js";
import { key, segments } from "./fields.js";
import { label, option, plain } from "./format.js";
import { faults, initial, variantOf } from "./schema.js";
import { transferFunction } from "./symbols.js";

/** Parts that most people leave as they are. */
const FOLDED = new Set(["search", "bounds", "scenario"]);
const MORE = new Set(["demands", "scenarios", "spread", "pairing", "mixing", "as_found", "model_tolerance",
  "certificate", "search"]);
const ALWAYS = new Set(["model_tolerance", "certificate", "search"]); // there in every request
/** Fields that make sense with certain values of others only. @type {Record<string, (value: any) => boolean>} */
const RELEVANT = {
  "/controller/group_sizes": (value) => value.controller?.arrangement === "grouped",
  "/performance/tau_p": (value) => value.objective !== "tau_p",
};

/** @type {Builder} */
export function object(form, s, value, pointer) {
  const name = key(pointer);
  const asked = Object.entries(s.properties ?? {}).filter(([, part]) => !part["x-record"]);
  const parts = asked.map(([property, part]) => {
    const below = `${pointer}/${property}`;
    const given = value && property in value ? value[property] : initial(part, false);
    const widget = form.build(part, given, below);
    if (RELEVANT[below]) form.conditions.set(below, { node: widget.node, holds: RELEVANT[below] });
    return { property, widget };
  });
  const read = () => {
    const entries = parts.map(({ property, widget }) => [property, isIrrelevant(widget) ? null : widget.read()]);
    return Object.fromEntries(entries.filter(([, item]) => item !== undefined));
  };
  const later = parts.filter(({ property }) => pointer === "" && MORE.has(property));
  const first = later.length > 2 ? parts.filter((part) => !later.includes(part)) : parts;
  const fields = h("div", { class: "fields" }, first.map(({ widget }) => widget.node));
  if (first !== parts) fields.append(more(later, value));
  if (s.title === "TransferFunction") {
    const view = scroller(`Formula of ${label(name)}`, "formula");
    const draw = () => put(view, transferFunction(read()));
    fields.addEventListener("input", draw);
    fields.append(view);
    draw();
  }
  const node = FOLDED.has(name)
    ? h("details", { class: "part" }, h("summary", {}, label(name)))
    : h("fieldset", { class: pointer.split("/").length === 2 ? "part card" : "part" }, h("legend", {}, label(name)));
  form.place(pointer, node, s, []);
  node.append(fields);
  return { node, read };
}

/** What few people need, folded unless something of it is given. */
function more(parts, value) {
  const open = parts.some(({ property }) => !ALWAYS.has(property) && isGiven(value?.[property]));
  const names = parts.map(({ property }) => label(property).toLowerCase()).join(", ");
  return h("details", { class: "more", open }, h("summary", {}, `More: ${names}`),
    h("div", { class: "fields" }, parts.map(({ widget }) => widget.node)));
}

/** @param {any} value @returns {boolean} */
const isGiven = (value) => value != null && value !== "none"
  && (typeof value !== "object" || Object.values(value).some(isGiven));

/** @param {Schema} s the word that tells a form of a union from the others */
const tagOf = ({ properties }) => (properties?.kind ?? properties?.form)?.const;

/** Several forms of one thing. @type {Builder} */
export function union(form, s, value, pointer) {
  const forms = /** @type {Schema[]} */ (s.variants);
  const name = label(key(pointer));
  const titles = forms.map((form) => form.type === "array" ? "List"
    : option(tagOf(form) ?? form.const ?? form.title).replace(`${name} `, ""));
  const content = h("div");
  let chosen = forms.indexOf(variantOf(forms, value));
  /** @type {Widget} */
  let inner;
  const show = (given) => {
    form.forget(pointer);
    const isObject = forms[chosen].type === "object";
    inner = isObject ? object(form, forms[chosen], given, pointer) : form.build(forms[chosen], given, pointer);
    if (isObject) inner.node.className = "bare";
    put(content, inner.node);
  };
  const { node, read } = segments(`${name}, given as`, titles, chosen);
  node.addEventListener("change", () => {
    const old = inner.read() ?? {};
    chosen = read();
    if (forms[chosen].type !== "object") return void (show(initial({ ...s, ...forms[chosen] })), form.update());
    const kept = Object.entries(forms[chosen].properties ?? {}).map(([name, part]) =>
      [name, sameKind(part, old[name]) ? old[name] : initial(part)]);
    show(Object.fromEntries(kept));
    form.update();
  });
  show(value);
  const whole = h("fieldset", { class: "part union" }, h("legend", {}, name), node, content);
  return { node: whole, read: () => inner.read() };
}

/** @type {Builder} */
export function optional(form, s, value, pointer) {
  const { nullable: _, ...given } = s;
  const box = h("input", { type: "checkbox", checked: value != null });
  const content = h("div");
  /** @type {Widget | undefined} */
  let inner;
  const show = (start) => {
    form.forget(pointer);
    inner = box.checked ? form.build(given, start, pointer) : undefined;
    put(content, inner?.node);
  };
  box.addEventListener("change", () => (show(initial({ ...given, default: undefined })), form.update()));
  show(value);
  const name = h("label", { class: "check" }, box, label(key(pointer)));
  const node = h("div", { class: "part optional" }, name, s.description && help(plain(s.description)), content);
  return { node, read: () => inner?.read() ?? null };
}

/** A list of compound things. @type {Builder} */
export function rows(form, s, value, pointer) {
  const list = h("div", { class: "rows" });
  const name = label(key(pointer));
  let widgets = /** @type {Widget[]} */ ([]);
  const show = (items) => {
    form.forget(pointer);
    widgets = items.map((item, i) => form.build(s.items, item, `${pointer}/${i}`));
    put(list, widgets.map((widget, i) => {
      const remove = () => (show(read().filter((_, k) => k !== i)), form.update());
      const cross = button("✕", remove, "quiet");
      cross.setAttribute("aria-label", `Remove ${name} ${i + 1}`);
      return h("div", { class: "row" }, widget.node, cross);
    }));
  };
  const read = () => widgets.map((widget) => widget.read());
  const add = () => (show([...read(), read().at(-1) ?? initial(s.items)]), form.update());
  show(value ?? []);
  const node = h("fieldset", { class: "part card" }, h("legend", {}, name));
  form.place(pointer, node, s, []);
  node.append(list, button("+ Add", add, "quiet"));
  return { node, read };
}

/** @param {Widget} widget hidden, and not because it is a constant */
const isIrrelevant = ({ node }) => node.hidden && node.dataset.pointer;

/** @param {Schema} part @param {any} value */
const sameKind = (part, value) => !("const" in part) && faults(part, value).length === 0;
