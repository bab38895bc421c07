/** What the first screen says and shows before the form: what this is for, and where to start. */

import { button, h } from "./dom.js";
import { picture } from "./picture.js";

const SENTENCES = [
  "Units on one header, feed or load pull at each other: what one loop does, the others feel.",
  "mutune finds the PI or PID settings with which all loops together are as fast as the errors of your model "
    + "permit, and proves what it promises.",
  "It gives them in the form and units of your control system, shows how the loops will behave and says what "
    + "can go wrong.",
];
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
