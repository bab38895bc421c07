/** A form made from a schema: fields, units, bounds and help are those of the service. */

import { grid, object, optional, rows, union } from "./compound.js";
import { h } from "./dom.js";
import { choice, input, newId } from "./fields.js";
import { faults, resolve } from "./schema.js";

/** @typedef {import("./schema.js").Schema} Schema */
/** @typedef {import("./api.js").Fault} Fault */
/** @typedef {{node: HTMLElement, read: () => any}} Widget undefined: left open */
/** @typedef {{node: HTMLElement, error: HTMLElement, controls: HTMLElement[]}} Slot */

/** A form whose value is checked against its schema while it is filled in. */
export class Form {
  /** @param {Schema} schema @param {any} value @param {() => void} changed after every change */
  constructor(schema, value, changed) {
    this.schema = schema;
    this.changed = changed;
    this.slots = /** @type {Map<string, Slot>} */ (new Map());
    this.conditions = /** @type {Map<string, {node: HTMLElement, holds: (value: any) => boolean}>} */ (new Map());
    this.touched = /** @type {Set<string>} */ (new Set());
    this.refused = /** @type {Fault[]} */ ([]);
    const root = object(this, resolve(schema), value, "");
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
    for (const { node, holds } of this.conditions.values()) node.hidden = !holds(value);
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
    if (s.nullable && compound) return optional(this, s, value, pointer);
    if (s.variants) return union(this, s, value, pointer);
    if (s.type === "object") return object(this, s, value, pointer);
    if (s.enum || s.type === "boolean") return choice(this, s, value, pointer);
    if (s.type === "array" && !isFlat(s)) {
      return resolve(s.items).type === "array" ? grid(this, s, value, pointer) : rows(this, s, value, pointer);
    }
    return input(this, s, value, pointer);
  }

  /**
   * Put a field and its help where faults can find them.
   * @param {string} pointer @param {HTMLElement} node @param {Schema} s @param {HTMLElement[]} controls
   */
  place(pointer, node, s, controls) {
    const error = h("p", { class: "error", id: newId("e") });
    const help = s.description ? h("p", { class: "help", id: newId("h") }, s.description) : null;
    const described = help ? `${help.id} ${error.id}` : error.id;
    for (const control of controls) control.setAttribute("aria-describedby", described);
    node.dataset.pointer = pointer;
    node.append(...(help ? [help] : []), error);
    this.slots.set(pointer, { node, error, controls });
    return node;
  }

  /** Drop the fields below a part that is built anew. @param {string} pointer */
  forget(pointer) {
    for (const known of [this.slots, this.conditions]) {
      for (const at of known.keys()) if (at.startsWith(`${pointer}/`)) known.delete(at);
    }
  }
}

/** @param {Schema} s a list of plain numbers, which one line of text holds */
const isFlat = (s) => s.prefixItems || ["number", "integer", "string"].includes(resolve(s.items ?? {}).type);

/** @param {HTMLElement} node @returns {HTMLDetailsElement[]} */
function ancestors(node) {
  const fold = node.closest("details");
  return fold ? [fold, ...(fold.parentElement ? ancestors(fold.parentElement) : [])] : [];
}
