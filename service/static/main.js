/** The page: which view is shown, and what stands around it. */

import { connection, onKeyNeeded, Problem } from "./api.js";
import { h, lead } from "./dom.js";
import { label, plain } from "./format.js";
import { requestView } from "./request.js";
import { analyses, loadSchema } from "./schema.js";

const main = /** @type {HTMLElement} */ (document.querySelector("main"));
const banner = /** @type {HTMLElement} */ (document.querySelector("#connection"));
const dialog = /** @type {HTMLDialogElement} */ (document.querySelector("#key"));
let current = new AbortController();
let first = true;

/**
 * Show a view; all but the first one that people see are loaded when they are wanted.
 * @param {View} view @param {string} path @param {URLSearchParams} query
 */
async function show(view, path, query) {
  const [place, name] = path.split("/");
  const from = query.get("from");
  if (place === "tunings" && name) return (await import("./job.js")).jobView(view, name, query);
  if (place === "tunings") return (await import("./history.js")).historyView(view);
  if (place === "record") return (await import("./record.js")).recordView(view);
  if (place === "compare") return (await import("./compare.js")).compareView(view, query);
  if (place !== "analyses") return requestView(view, "/v1/tunings", from);
  const analysis = analyses().find((one) => one.name === name);
  return analysis ? requestView(view, analysis.path, from) : analysesView(view);
}

/** @param {View} view */
async function analysesView({ main: place }) {
  const items = analyses().map(({ name, description }) => h("li", { class: "card" },
    h("h2", {}, h("a", { href: `#/analyses/${name}` }, label(name))),
    h("p", {}, plain(description.replace(/^Return /, "Shows ")))));
  place.replaceChildren(lead("Analyse"), h("ul", { class: "cards links" }, items));
}

async function route() {
  current.abort();
  const { signal } = (current = new AbortController());
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  const area = path.split("/")[0];
  for (const link of document.querySelectorAll("nav.site a")) {
    const own = link.getAttribute("href") === `#/${{ compare: "tunings", record: "" }[area] ?? area}`;
    if (own) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  const failed = (error) => {
    if (signal.aborted) return;
    if (!(error instanceof Problem)) throw error;
    main.replaceChildren(lead(error.title, h("p", { class: "error" }, error.message)));
  };
  const view = { main, signal, go: (hash) => { location.hash = hash; }, keep: (work) => void work.catch(failed) };
  main.setAttribute("aria-busy", "true");
  await loadSchema().then(() => show(view, path, new URLSearchParams(query))).catch(failed);
  if (!signal.aborted) arrived();
}

/** Tell where we are: to the title, and to those who do not see the page. */
function arrived() {
  main.removeAttribute("aria-busy");
  const heading = main.querySelector("h1");
  document.title = heading ? `${heading.textContent} · mutune` : "mutune";
  if (!first) heading?.focus({ preventScroll: true });
  first = false;
}

connection.addEventListener("change", (event) => {
  banner.hidden = !(/** @type {CustomEvent} */ (event).detail);
});

/** @type {Promise<string> | undefined} */
let asking;
onKeyNeeded(() => {
  const input = /** @type {HTMLInputElement} */ (dialog.querySelector("input"));
  asking ??= new Promise((done) => {
    dialog.showModal();
    dialog.addEventListener("close", () => {
      asking = undefined;
      done(input.value.trim());
      input.value = "";
    }, { once: true });
  });
  return asking;
});

addEventListener("hashchange", route);
route();
