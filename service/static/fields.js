/** Forms made from a schema: fields, units, bounds and help are those of the service. */

import { h } from "./dom.js";
import { label, option, unitTag } from "./format.js";
import { faults, initial, resolve, variantOf } from "./schema.js";
import { transferFunction } from "./symbols.js";

/** @typedef {import("./schema.js").Schema} Schema */
/** @typedef {import("./api.js").Fault} Fault */
/** @typedef {{node: HTMLElement, read: () => any}} Widget undefined: left open */
/** @typedef {{node: HTMLElement, error: HTMLElement, controls: HTMLElement[]}} Slot */

/** Parts that most people leave as they are. */
const FOLDED = new Set(["search", "bounds", "scenario"]);
/** Fields that make sense with certain values of others only. @type {Record<string, (value: any) => boolean>} */
const RELEVANT = {
  "/controller/group_sizes": (value) => value.controller?.arrangement === "grouped",
  "/performance/tau_p": (value) => value.objective !== "tau_p",
};
const SEGMENTS = 4; // options that fit side by side
let serial = 0;

/** A form whose value is checked against its schema while it is filled in. */
export class Form {
  /** @param {Schema} schema @param {any} value @param {() => void} changed after every change */
  constructor(schema, value, changed) {
    this.schema = schema;
    this.changed = changed;
    this.slots = /** @type {Map<string, Slot>} */ (new Map());
    this.conditions = /** @type {{node: HTMLElement, holds: (value: any) => boolean}[]} */ ([]);
    this.touched = /** @type {Set<string>} */ (new Set());
    this.refused = /** @type {Fault[]} */ ([]);
    const root = this.object(resolve(schema), value, "");
    this.read = root.read;
    this.node = root.node;
    this.node.className = "root";
    this.node.addEventListener("input", (event) => this.edited(event));
    this.node.addEventListener("focusout", (event) => this.left(event));
    this.update();
  }

  /** @param {Event} event */
  pointer(event) {
    const field = /** @type {HTMLElement} */ (event.target).closest("[data-pointer]");
    return /** @type {HTMLElement | null} */ (field)?.dataset.pointer ?? "";
  }

  /** @param {Event} event */
  edited(event) {
    const here = this.pointer(event);
    this.refused = this.refused.filter(({ pointer }) => !pointer.startsWith(here) && !here.startsWith(pointer));
    this.update();
  }

  /** @param {FocusEvent} event */
  left(event) {
    this.touched.add(this.pointer(event));
    this.update();
  }

  /** Show what the service refused, beside its fields. @param {Fault[]} found */
  refuse(found) {
    this.refused = found;
    this.update();
  }

  /** @returns {Fault[]} all faults, shown in their places from now on */
  submit() {
    for (const pointer of this.slots.keys()) this.touched.add(pointer);
    const found = this.update();
    const first = this.node.querySelector("[aria-invalid]");
    if (first instanceof HTMLElement) first.focus();
    return found;
  }

  /** Show and hide fields and faults as the value demands. @returns {Fault[]} */
  update() {
    const value = this.read();
    for (const { node, holds } of this.conditions) node.hidden = !holds(value);
    const found = faults(this.schema, this.read());
    const shown = /** @type {Map<Slot, string[]>} */ (new Map());
    for (const fault of [...found, ...this.refused]) {
      let pointer = fault.pointer;
      while (!this.slots.has(pointer)) pointer = pointer.slice(0, Math.max(pointer.lastIndexOf("/"), 0));
      const slot = /** @type {Slot} */ (this.slots.get(pointer));
      const known = this.refused.includes(fault);
      if (known || this.touched.has(pointer)) shown.set(slot, [...(shown.get(slot) ?? []), fault.detail]);
    }
    for (const slot of this.slots.values()) {
      const text = [...new Set(shown.get(slot))].join(" ");
      slot.error.textContent = text;
      for (const control of slot.controls) control.toggleAttribute("aria-invalid", Boolean(text));
      if (text) for (const fold of ancestors(slot.node)) fold.open = true;
    }
    this.changed();
    return found;
  }

  /** @param {Schema} schema @param {any} value @param {string} pointer @returns {Widget} */
  build(schema, value, pointer) {
    const s = resolve(schema);
    if ("const" in s) return { node: h("div", { hidden: true }), read: () => s.const };
    const compound = s.variants || s.type === "object" || (s.type === "array" && !isFlat(s));
    if (s.nullable && compound) return this.optional(s, value, pointer);
    if (s.variants) return this.union(s, value, pointer);
    if (s.type === "object") return this.object(s, value, pointer);
    if (s.enum || s.type === "boolean") return this.choice(s, value, pointer);
    if (s.type === "array" && !isFlat(s)) {
      return resolve(s.items).type === "array" ? this.grid(s, value, pointer) : this.rows(s, value, pointer);
    }
    return this.input(s, value, pointer);
  }

  /**
   * Put a field and its help where faults can find them.
   * @param {string} pointer @param {HTMLElement} node @param {Schema} s @param {HTMLElement[]} controls
   */
  place(pointer, node, s, controls) {
    const error = h("p", { class: "error", id: `e${++serial}` });
    const help = s.description ? h("p", { class: "help", id: `h${serial}` }, s.description) : null;
    const described = `${help ? `h${serial} ` : ""}e${serial}`;
    for (const control of controls) control.setAttribute("aria-describedby", described);
    node.dataset.pointer = pointer;
    node.append(...(help ? [help] : []), error);
    this.slots.set(pointer, { node, error, controls });
    return node;
  }

  /** @param {Schema} s @param {any} value @param {string} pointer @returns {Widget} */
  input(s, value, pointer) {
    const id = `f${++serial}`;
    const example = s.examples?.find((e) => e !== null);
    const input = h("input", {
      id, type: "text", autocomplete: "off", spellcheck: "false", value: shown(value),
      inputmode: s.type === "string" ? "text" : "decimal",
      placeholder: s.nullable ? "optional" : shown(example),
    });
    const name = h("label", { for: id }, label(key(pointer)));
    const node = h("div", { class: "field" }, name, h("div", { class: "box" }, input, unitTag(s["x-unit"])));
    const parse = s.type === "array" ? numbers : s.type === "string" ? String : numeric;
    const empty = s.nullable ? null : undefined;
    return {
      node: this.place(pointer, node, s, [input]),
      read: () => (input.value.trim() === "" ? empty : parse(input.value.trim())),
    };
  }

  /** @param {Schema} s @param {any} value @param {string} pointer @returns {Widget} */
  choice(s, value, pointer) {
    const options = s.enum ?? [true, false];
    const text = (o) => (o === true ? "Yes" : o === false ? "No" : option(o));
    const few = options.length <= SEGMENTS && !s.nullable;
    const name = label(key(pointer));
    if (few) {
      const { node, read, radios } = segments(name, options.map(text), options.indexOf(value));
      return { node: this.place(pointer, node, s, radios), read: () => options[read()] };
    }
    const all = s.nullable ? [null, ...options] : options;
    const id = `f${++serial}`;
    const select = h("select", { id },
      all.map((o) => h("option", { selected: o === value }, o === null ? "automatic" : text(o))));
    const node = h("div", { class: "field" }, h("label", { for: id }, name), select);
    return { node: this.place(pointer, node, s, [select]), read: () => all[select.selectedIndex] };
  }

  /** @param {Schema} s @param {any} value @param {string} pointer @returns {Widget} */
  object(s, value, pointer) {
    const name = key(pointer);
    const parts = Object.entries(s.properties ?? {}).map(([property, part]) => {
      const below = `${pointer}/${property}`;
      const given = value && property in value ? value[property] : initial(part, false);
      const widget = this.build(part, given, below);
      if (RELEVANT[below]) this.conditions.push({ node: widget.node, holds: RELEVANT[below] });
      return { property, widget };
    });
    const read = () => {
      const entries = parts.map(({ property, widget }) => [property, widget.node.hidden && !isConst(widget) ? null : widget.read()]);
      return Object.fromEntries(entries.filter(([, item]) => item !== undefined));
    };
    const fields = h("div", { class: "fields" }, parts.map(({ widget }) => widget.node));
    if (s.title === "TransferFunction") {
      const view = h("div", { class: "formula" });
      const draw = () => view.replaceChildren(transferFunction(read()) ?? "");
      fields.addEventListener("input", draw);
      fields.append(view);
      draw();
    }
    const folded = FOLDED.has(name);
    const node = folded
      ? h("details", { class: "part" }, h("summary", {}, label(name)))
      : h("fieldset", { class: pointer.split("/").length === 2 ? "part card" : "part" },
        h("legend", {}, label(name)));
    this.place(pointer, node, s, []);
    node.append(fields);
    return { node, read };
  }

  /** Several forms of one thing. @param {Schema} s @param {any} value @param {string} pointer @returns {Widget} */
  union(s, value, pointer) {
    const forms = /** @type {Schema[]} */ (s.variants);
    const name = label(key(pointer));
    const titles = forms.map((form) => option(form.properties?.kind?.const ?? form.title).replace(`${name} `, ""));
    const content = h("div");
    let chosen = forms.indexOf(variantOf(forms, value));
    /** @type {Widget} */
    let inner;
    const show = (given) => {
      this.forget(pointer);
      inner = this.object(forms[chosen], given, pointer);
      inner.node.className = "bare";
      content.replaceChildren(inner.node);
    };
    const { node, read } = segments(`${name}, given as`, titles, chosen);
    node.addEventListener("change", () => {
      const old = inner.read();
      chosen = read();
      const blank = Object.entries(forms[chosen].properties ?? {}).map(([k, part]) => [k, old[k] !== undefined && sameKind(part, old[k]) ? old[k] : initial(part)]);
      show(Object.fromEntries(blank));
      this.update();
    });
    show(value);
    const whole = h("fieldset", { class: "part union" }, h("legend", {}, name), node, content);
    return { node: whole, read: () => inner.read() };
  }

  /** @param {Schema} s @param {any} value @param {string} pointer @returns {Widget} */
  optional(s, value, pointer) {
    const { nullable: _, ...given } = s;
    const box = h("input", { type: "checkbox", checked: value != null });
    const content = h("div");
    /** @type {Widget | undefined} */
    let inner;
    const show = (start) => {
      this.forget(pointer);
      inner = box.checked ? this.build(given, start, pointer) : undefined;
      content.replaceChildren(...(inner ? [inner.node] : []));
    };
    box.addEventListener("change", () => (show(initial({ ...given, default: undefined })), this.update()));
    show(value);
    const help = s.description ? h("p", { class: "help" }, s.description) : null;
    const name = h("label", { class: "check" }, box, label(key(pointer)));
    return { node: h("div", { class: "part optional" }, name, help, content), read: () => inner?.read() ?? null };
  }

  /** A list of compound things. @param {Schema} s @param {any} value @param {string} pointer @returns {Widget} */
  rows(s, value, pointer) {
    const list = h("div", { class: "rows" });
    const widgets = /** @type {Widget[]} */ ([]);
    const name = label(key(pointer));
    const show = (items) => {
      this.forget(pointer);
      widgets.length = 0;
      list.replaceChildren(...items.map((item, i) => {
        const widget = this.build(s.items, item, `${pointer}/${i}`);
        widgets.push(widget);
        const remove = () => (show(read().filter((_, k) => k !== i)), this.update());
        return h("div", { class: "row" }, widget.node,
          h("button", { type: "button", class: "quiet", "aria-label": `Remove ${name} ${i + 1}`, onclick: remove }, "✕"));
      }));
    };
    const read = () => widgets.map((widget) => widget.read());
    const add = () => (show([...read(), read().at(-1) ?? initial(s.items)]), this.update());
    show(value ?? []);
    const node = h("fieldset", { class: "part card" }, h("legend", {}, name));
    this.place(pointer, node, s, []);
    node.append(list, h("button", { type: "button", class: "quiet", onclick: add }, "+ Add"));
    return { node, read };
  }

  /** A square matrix of compound things. @param {Schema} s @param {any} value @param {string} pointer @returns {Widget} */
  grid(s, value, pointer) {
    const id = `f${++serial}`;
    const largest = s.maxItems ?? 10;
    const size = h("input", { id, type: "number", min: 1, max: largest, value: value?.length ?? 2 });
    const cells = h("div", { class: "grid" });
    const item = resolve(s.items).items;
    let widgets = /** @type {Widget[][]} */ ([]);
    const show = (given) => {
      const n = Math.min(Math.max(Math.round(Number(size.value)) || 1, 1), largest);
      this.forget(pointer);
      widgets = Array.from({ length: n }, (_, r) => Array.from({ length: n }, (_, c) =>
        this.build(item, given[r]?.[c] ?? given[0]?.[0] ?? initial(item), `${pointer}/${r}/${c}`)));
      cells.replaceChildren(...widgets.flat().map((widget) => widget.node));
      cells.dataset.columns = String(n);
    };
    const read = () => widgets.map((row) => row.map((widget) => widget.read()));
    size.addEventListener("change", () => (show(read()), this.update()));
    show(value ?? []);
    const node = h("fieldset", { class: "part" }, h("legend", {}, label(key(pointer))),
      h("div", { class: "field size" }, h("label", { for: id }, "Size"), size));
    this.place(pointer, node, s, []);
    node.append(cells);
    return { node, read };
  }

  /** Drop the fields below a part that is built anew. @param {string} pointer */
  forget(pointer) {
    for (const known of this.slots.keys()) if (known.startsWith(`${pointer}/`)) this.slots.delete(known);
    this.conditions = this.conditions.filter(({ node }) => node.isConnected);
  }
}

/**
 * Options side by side, of which one is chosen.
 * @param {string} name @param {string[]} texts @param {number} chosen
 */
export function segments(name, texts, chosen) {
  const group = `g${++serial}`;
  const radios = texts.map((_, i) => h("input", { type: "radio", name: group, checked: i === chosen }));
  const items = texts.map((text, i) => h("label", {}, radios[i], h("span", {}, text)));
  const node = h("fieldset", { class: "field choice" }, h("legend", {}, name), h("div", { class: "segments" }, items));
  return { node, radios, read: () => radios.findIndex((radio) => radio.checked) };
}

/** @param {Schema} s a list of plain numbers, which one line of text holds */
const isFlat = (s) => s.prefixItems || ["number", "integer", "string"].includes(resolve(s.items ?? {}).type);

/** @param {Widget} widget */
const isConst = (widget) => widget.node.hidden && !widget.node.dataset.pointer;

/** @param {Schema} part @param {any} value */
const sameKind = (part, value) => !("const" in part) && faults(part, value).length === 0;

/** @param {string} pointer */
function key(pointer) {
  const parts = pointer.split("/");
  const numbers = parts.filter((part) => /^\d+$/.test(part)).map((part) => Number(part) + 1);
  if (!/^\d+$/.test(parts.at(-1) ?? "")) return parts.at(-1) ?? "";
  return numbers.length > 1 ? `Row ${numbers.at(-2)}, column ${numbers.at(-1)}` : `${parts.at(-2)?.replace(/s$/, "")} ${numbers.at(-1)}`;
}

/** @param {string} text a number, with a point or a comma; other text stays, to be found faulty */
const numeric = (text) => (Number.isFinite(Number(text.replace(",", "."))) ? Number(text.replace(",", ".")) : text);

/** @param {string} text numbers separated by spaces, commas or semicolons */
const numbers = (text) => text.split(/[\s,;]+/).filter(Boolean).map(numeric);

/** @param {any} value */
const shown = (value) => (Array.isArray(value) ? value.join(", ") : value == null ? "" : String(value));

/** @param {HTMLElement} node @returns {HTMLDetailsElement[]} */
function ancestors(node) {
  const fold = node.closest("details");
  return fold ? [fold, ...(fold.parentElement ? ancestors(fold.parentElement) : [])] : [];
}
