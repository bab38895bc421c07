/** What the first screen says and shows before the form: what this is for, and where to start. */

import { button, h, svg } from "./dom.js";

const SENTENCES = [
  "Units on one header, feed or load pull at each other: what one loop does, the others feel.",
  "mutune finds the PI or PID settings with which all loops together are as fast as the errors of your model "
    + "permit, and proves what it promises.",
  "It gives them in the form and units of your control system, shows how the loops will behave and says what "
    + "can go wrong.",
];
const DRAWN = 6; // units; of more, the last stands for the rest

/** A picture of the plant of a request. @param {any} plant @param {boolean} [named] with words */
export function picture(plant, named = false) {
  const n = plant?.n ?? plant?.elements?.length ?? 2;
  return plant?.kind === "matrix" ? vessel(n) : header(n, named);
}

/** Parallel units that hang on one header, a valve on each. @param {number} n @param {boolean} named */
function header(n, named) {
  const units = Math.min(n, DRAWN);
  const [left, right, top] = [20, 300, named ? 44 : 24];
  const step = (right - left) / units;
  const middle = (/** @type {number} */ i) => left + step * (i + 0.5);
  const text = (content, x, y) => svg("text", { x, y, "text-anchor": "middle" }, content);
  const one = (/** @type {number} */ i) => {
    const [x, w] = [middle(i), Math.min(step * 0.62, 40)];
    const last = i === units - 1 && n > units;
    return svg("g", {},
      svg("path", { d: `M${x} ${top}V${top + 34}`, class: "pipe" }),
      svg("path", { d: `M${x - 7} ${top + 10}h14l-14 14h14z`, class: "valve" }),
      svg("rect", { x: x - w / 2, y: top + 34, width: w, height: 38, rx: 6, class: "unit-box" }),
      text(last ? `… ${n}` : i + 1, x, top + 58));
  };
  return svg("svg", { viewBox: `0 0 320 ${top + 80}`, class: "picture", role: "img",
    "aria-label": `${n} parallel units on one header` },
  named ? text("shared header", 160, 18) : null,
  svg("path", { d: `M${left} ${top}H${right}`, class: "header" }),
  Array.from({ length: units }, (_, i) => one(i)));
}

/** A process with several inputs and outputs. @param {number} n */
function vessel(n) {
  const rows = Math.min(n, 4);
  const y = (/** @type {number} */ i) => 16 + (72 * (i + 0.5)) / rows;
  return svg("svg", { viewBox: "0 0 320 104", class: "picture", role: "img",
    "aria-label": `A process with ${n} inputs and ${n} outputs` },
  svg("rect", { x: 125, y: 10, width: 70, height: 84, rx: 14, class: "unit-box" }),
  Array.from({ length: rows }, (_, i) => svg("g", {},
    svg("path", { d: `M40 ${y(i)}H125`, class: "pipe" }),
    svg("path", { d: `M75 ${y(i) - 7}h14l-14 14h14z`, class: "valve" }),
    svg("path", { d: `M195 ${y(i)}H280m-8-5 8 5-8 5`, class: "pipe" }))),
  svg("text", { x: 160, y: 57, "text-anchor": "middle" }, `${n} × ${n}`));
}

/** @param {[string, any][]} offers @param {(value: any) => void} show @param {(file: File) => void} open */
export function intro(offers, show, open) {
  const file = h("input", { type: "file", accept: ".json,.csv,application/json,text/csv", class: "unseen",
    "aria-label": "Open a file", onchange: ({ target }) => {
      if (target.files[0]) open(target.files[0]);
      target.value = ""; // so that the same file can be opened again
    } });
  const choose = button("Open a file", () => file.click());
  const examples = offers.map(([name, value]) => h("button", { type: "button", class: "card example",
    onclick: () => show(value) }, value.plant ? picture(value.plant) : null, h("strong", {}, value.title ?? name)));
  return h("div", {},
    h("section", { class: "card intro" },
      h("div", {}, SENTENCES.map((text) => h("p", {}, text)),
        h("div", { class: "buttons" }, h("a", { class: "button main", href: "#/record" }, "From a record"),
          h("a", { class: "button", href: "#/", onclick: (event) => {
            event.preventDefault();
            document.querySelector("#request")?.scrollIntoView();
          } }, "From a model"), choose, file,
          h("span", { class: "help" }, "or drop a request, or a record as CSV, anywhere here."))),
      picture({ n: 4 }, true)),
    h("div", { class: "examples", role: "group", "aria-label": "Examples to start from" }, examples));
}

/**
 * Take files that are dropped on a view.
 * @param {HTMLElement} place @param {AbortSignal} signal @param {(file: File) => void} open
 */
export function takeFiles(place, signal, open) {
  const over = (/** @type {DragEvent} */ event) => {
    event.preventDefault();
    place.classList.toggle("dropping", event.type === "dragover");
  };
  for (const kind of ["dragover", "dragleave"]) {
    place.addEventListener(kind, (event) => over(/** @type {DragEvent} */ (event)), { signal });
  }
  place.addEventListener("drop", (event) => {
    over(event);
    const file = event.dataTransfer?.files[0];
    if (file) open(file);
  }, { signal });
}
