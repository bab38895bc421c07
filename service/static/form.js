/** A form made from a schema: fields, units, bounds and help are those of the service. */

import { object, optional, rows, union } from "./compound.js";
import { h, help } from "./dom.js";
import { choice, input, newId } from "./fields.js";
import { grid } from "./matrix.js";
import { plain } from "./format.js";
import { onceReleased } from "./press.js";
import { faults, resolve } from "./schema.js";

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
    this.node.addEventListener("input", (event) => {
      const here = pointerOf(event);
      this.refuse(this.refused.filter(({ pointer }) => !pointer.startsWith(here) && !here.startsWith(pointer)));
    });
    this.node.addEventListener("focusout", (event) => {
      this.touched.add(pointerOf(event));
      onceReleased(() => this.update());
    });
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
    const shown = /** @type {Map<string, Set<string>>} */ (new Map());
    for (const fault of [...found, ...this.refused]) {
      let { pointer } = fault;
      while (!this.slots.has(pointer)) pointer = pointer.slice(0, Math.max(pointer.lastIndexOf("/"), 0));
      if (!this.touched.has(pointer) && !this.refused.includes(fault)) continue;
      shown.set(pointer, (shown.get(pointer) ?? new Set()).add(fault.detail));
    }
    for (const [pointer, { node, error, controls }] of this.slots) {
      const text = [...(shown.get(pointer) ?? [])].join(" ");
      error.textContent = text;
      for (const control of controls) control.toggleAttribute("aria-invalid", Boolean(text));
      if (text) unfold(node);
    }
    this.changed();
    return found;
  }

  /** @type {(schema: Schema, value: any, pointer: string) => Widget} */
  build(schema, value, pointer) {
    const s = resolve(schema);
    if ("const" in s) return { node: h("div", { hidden: true }), read: () => s.const };
    const one = s.variants && scalarOrList(s.variants);
    if (one) return input(this, { ...one, ...s, variants: undefined, type: one.type, "x-list": true }, value, pointer);
    const isList = s.type === "array" && !isFlat(s);
    const compound = s.variants || s.type === "object" || isList;
    const line = isList ? resolve(s.items) : {};
    const isMatrix = line.type === "array" && !resolve(line.items)["x-index"];
    const build = s.nullable && compound ? optional : s.variants ? union : s.type === "object" ? object
      : isMatrix ? grid : isList ? rows : s.enum || s.type === "boolean" ? choice : input;
    return build(this, s, value, pointer);
  }

  /**
   * Put a field and its help where faults can find them.
   * @param {string} pointer @param {HTMLElement} node @param {Schema} s @param {HTMLElement[]} controls
   */
  place(pointer, node, s, controls) {
    const error = h("p", { class: "error", id: newId("e") });
    const notes = s.description ? [help(plain(s.description)), error] : [error];
    notes[0].id ||= newId("h");
    const described = notes.map(({ id }) => id).join(" ");
    for (const control of controls) control.setAttribute("aria-describedby", described);
    node.dataset.pointer = pointer;
    node.append(...notes);
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

/** @param {Event} event */
const pointerOf = ({ target }) =>
  /** @type {HTMLElement | null} */ (/** @type {Element} */ (target).closest("[data-pointer]"))?.dataset.pointer ?? "";

/** @param {Schema} s a list of plain numbers, which one line of text holds */
const isFlat = (s) => s.prefixItems || ["number", "integer", "string"].includes(resolve(s.items ?? {}).type);

/** The number of a union of one number for all loops and a list of one a loop. @param {Schema[]} variants */
const scalarOrList = (variants) => variants.length === 2 && variants.some(({ type, items }) => type === "array"
  && ["number", "integer"].includes(resolve(items ?? {}).type)) && variants.find(({ type }) => type === "number");

/** Open what a field is folded in. @param {Element | null | undefined} node */
function unfold(node) {
  const fold = node?.closest("details");
  if (!fold) return;
  fold.open = true;
  unfold(fold.parentElement);
}
