/** Square matrices: a field an entry, or tables of K, τ and θ where the entries permit. */

import { h, put } from "./dom.js";
import { key, newId, segments } from "./fields.js";
import { label } from "./format.js";
import { matrixTable, numbersOf } from "./matrix_table.js";
import { onceReleased } from "./press.js";
import { initial, resolve } from "./schema.js";

const WAYS = ["Tables of K, τ and θ", "Transfer functions"];

/** A square matrix. @type {Builder} */
export function grid(form, s, value, pointer) {
  const id = newId("f");
  const largest = s.maxItems ?? 10;
  const size = h("input", { id, type: "number", min: 1, max: largest, value: value?.length ?? 2 });
  const cells = h("div", {});
  const item = resolve(s.items).items;
  const simple = resolve(item).title === "TransferFunction";
  const isSimple = (given) => simple && given.flat().every(numbersOf);
  const { node: ways, read: way, radios } = segments("Elements, given as", WAYS, isSimple(value ?? [[]]) ? 0 : 1);
  let read = () => value ?? [];
  const show = (given) => {
    const n = Math.min(Math.max(Math.round(Number(size.value)) || 1, 1), largest);
    const element = (r, c) => given[r]?.[c] ?? given[0]?.[0] ?? initial(item);
    const all = Array.from({ length: n }, (_, r) => Array.from({ length: n }, (_, c) => element(r, c)));
    form.forget(pointer);
    radios[0].disabled = !isSimple(all);
    if (simple && way() === 0 && isSimple(all)) {
      const sheet = matrixTable(all, largest, () => form.update(), (rows) => { size.value = String(rows); });
      read = sheet.read;
      put(cells, sheet.node);
      return;
    }
    const widgets = all.map((row, r) => row.map((one, c) => form.build(item, one, `${pointer}/${r}/${c}`)));
    read = () => widgets.map((row) => row.map((widget) => widget.read()));
    const places = h("div", { class: "grid" }, widgets.flat().map((widget) => widget.node));
    places.dataset.columns = String(n);
    put(cells, places);
  };
  const anew = () => onceReleased(() => (show(read()), form.update()));
  for (const control of [size, ways]) control.addEventListener("change", anew);
  show(value ?? []);
  const node = h("fieldset", { class: "part" }, h("legend", {}, label(key(pointer))),
    h("div", { class: "field size" }, h("label", { for: id }, "Size"), size), simple && ways);
  form.place(pointer, node, s, []);
  node.append(cells);
  return { node, read: () => read() };
}
