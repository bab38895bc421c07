/** A matrix of first-order elements as tables of K, τ and θ, which take a paste from a spreadsheet. */

import { h, help, put } from "./dom.js";
import { newId } from "./fields.js";
import { number, unitTag } from "./format.js";

const TABLES = /** @type {[string, string, string][]} */ ([
  ["gain", "Gain K", "gain"], ["time", "Time constant τ", "time"], ["delay", "Dead time θ", "time"]]);

const FITS = 7; // characters that a cell shows at least

/** The three numbers of an element, null where it has other dynamics. @param {any} element */
export function numbersOf(element) {
  const { num, den, dead_time: delay = 0 } = element ?? {};
  if (num?.length !== 1 || !(den?.length === 1 || den?.length === 2)) return null;
  const last = den.at(-1);
  return last ? { gain: num[0] / last, time: den.length === 2 ? den[0] / last : 0, delay: delay ?? 0 } : null;
}

/** @param {{gain: any, time: any, delay: any}} element */
const elementOf = ({ gain, time, delay }) => ({
  num: [gain], den: time === 0 ? [1] : [time, 1], dead_time: delay ?? 0 });

/** A number as it fits a cell; the cell shows the whole of it while it is edited. @param {string} [text] */
const short = (text = "") => (text.length > FITS && Number.isFinite(Number(text))
  ? String(Number(Number(text).toPrecision(5))) : text);

const GAPS = /\t|;|,(?=\s)|\s{2,}|(?<=\d) (?=[\d+-])/; // between the cells of a line

/** Numbers of a block copied from a spreadsheet, with points or commas. @param {string} text */
export const block = (text) => text.trim().split(/\r?\n/).map((line) =>
  line.split(GAPS).map((cell) => cell.trim().replace(",", ".").replace("−", "-")));

/**
 * @param {any[][]} elements first-order ones @param {number} largest
 * @param {() => void} changed @param {(rows: number) => void} resized
 */
export function matrixTable(elements, largest, changed, resized) {
  let cells = elements.map((row) => row.map((element) =>
    /** @type {Record<string, string>} */ (Object.fromEntries(Object.entries(numbersOf(element) ?? {})
      .map(([key, value]) => [key, String(Number(value.toPrecision(15)))])))));
  const place = h("div", { class: "tables" });
  const value = (text) => (text?.trim() && Number.isFinite(Number(text.replace(",", ".")))
    ? Number(text.replace(",", ".")) : text || undefined);
  const read = () => cells.map((row) => row.map((cell) => elementOf({
    gain: value(cell.gain), time: value(cell.time), delay: value(cell.delay) ?? 0 })));
  const paste = (/** @type {ClipboardEvent} */ event, table, r, c) => {
    const rows = block(event.clipboardData?.getData("text/plain") ?? "");
    if (rows.length === 1 && rows[0].length === 1) return;
    event.preventDefault();
    const size = Math.min(Math.max(cells.length, r + rows.length), largest);
    cells = Array.from({ length: size }, (_, i) => Array.from({ length: size }, (_, k) =>
      cells[i]?.[k] ?? { gain: "0", time: cells[0][0].time, delay: "0" }));
    rows.forEach((row, i) => row.forEach((text, k) => {
      // A block of three times the width holds K, τ and θ side by side.
      const [which, column] = [table + Math.floor((c + k) / size), (c + k) % size];
      if (TABLES[which] && cells[r + i]) cells[r + i][column][TABLES[which][0]] = text;
    }));
    resized(size);
    show();
    changed();
  };
  const show = () => put(place, TABLES.map(([key, name, unit], t) => {
    const id = newId("t");
    return h("div", { class: "scroll", tabindex: "0", role: "group", "aria-labelledby": id },
      h("table", { class: "sheet" }, h("caption", { id }, name, " ", unitTag(unit)),
        h("tbody", {}, cells.map((row, r) => h("tr", {}, row.map((cell, c) => h("td", {}, h("input", {
          type: "text", inputmode: "decimal", value: short(cell[key]), autocomplete: "off", title: cell[key],
          "aria-label": `${name}, output ${r + 1}, input ${c + 1}`,
          oninput: ({ target }) => {
            cell[key] = target.value;
            changed();
          },
          onfocus: ({ target }) => {
            target.value = cell[key] ?? "";
          },
          onblur: ({ target }) => {
            target.value = short(cell[key]);
            target.title = cell[key] ?? "";
          },
          onpaste: (event) => paste(event, t, r, c),
        }))))))));
  }));
  show();
  const node = h("div", {}, place,
    help("Rows are outputs, columns inputs. Copy a block of cells in a spreadsheet and paste it into a first cell: "
      + `the table grows to it, up to ${number(largest)}. K/(τ s + 1) e^(−θ s).`));
  return { node, read };
}
