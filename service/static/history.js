/** The history of tunings: found by their words, and some chosen to be compared. */

import { FINAL, pause, request } from "./api.js";
import { button, h, lead, put, table } from "./dom.js";
import { clock, number } from "./format.js";
import { unitOfJob } from "./compare.js";
import { chipOf } from "./job.js";
import { summary } from "./summary.js";

const EVERY = 2000; // milliseconds between two looks while something runs

/** @param {any} job */
function line(job) {
  const { title, aim } = summary(job.request);
  const unit = job.request.objective === "mu" ? "μ" : unitOfJob(job) ?? "";
  return [
    h("a", { href: `#/tunings/${job.id}` }, title, h("br"), h("span", { class: "help unit" }, aim)),
    chipOf(job),
    h("span", { class: "value" }, number(job.progress.best), " ", h("span", { class: "unit" }, unit)),
    h("span", { class: "unit" }, clock(job.created_at)),
  ];
}

/** All that a tuning can be found by: title, aim, tags, id, labels. @param {any} job */
function wordsOf({ id, request: asked }) {
  const { title, aim } = summary(asked);
  const tags = (asked.instruments ?? []).map(({ tag }) => tag ?? "");
  return [title, aim, asked.id ?? "", id, ...tags, ...Object.values(asked.labels ?? {})].join(" ").toLowerCase();
}

/** @param {View} view */
export async function historyView({ main, signal, keep }) {
  const chosen = /** @type {Set<string>} */ (new Set());
  const place = h("div", {});
  const compare = button("Compare the chosen", () => {
    location.hash = `#/compare?ids=${[...chosen].join(",")}`;
  });
  compare.disabled = true;
  const choice = ({ id, created_at }) => h("input", {
    type: "checkbox", "aria-label": `Choose the tuning of ${clock(created_at)}`, checked: chosen.has(id),
    onchange: ({ target }) => {
      if (target.checked) chosen.add(id);
      else chosen.delete(id);
      compare.disabled = chosen.size < 2;
    },
  });
  const search = h("input", { id: "search", type: "search", placeholder: "title, tag, label", autocomplete: "off" });
  let jobs = /** @type {any[]} */ ([]);
  let next = /** @type {string | null} */ (null);
  let pages = 1;
  const show = () => {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = jobs.filter((job) => words.every((word) => wordsOf(job).includes(word)));
    const rows = found.map((job) => [...line(job), choice(job)]);
    const none = jobs.length ? h("p", {}, "None of these has such words. Earlier ones may.")
      : h("p", {}, "No tuning yet. ", h("a", { href: "#/" }, "Start the first one."));
    put(place, rows.length ? table("Newest first", ["Plant", "Status", "Best", "Started", "Compare"], rows) : none);
  };
  const load = async () => {
    const loaded = [];
    next = "/v1/tunings?limit=20";
    for (let page = 0; page < pages && next; page++) {
      const answer = await request("GET", next, { signal });
      loaded.push(...answer.items);
      next = answer.next;
    }
    jobs = loaded;
    more.hidden = !next;
    if (!place.contains(document.activeElement)) show();
    return jobs.some((job) => !FINAL.has(job.status));
  };
  // What is sought may be long ago: then pages are fetched until it is there.
  search.addEventListener("input", async () => {
    show();
    while (search.value && next && !place.querySelector("tbody")) {
      pages += 5;
      await load();
      show();
    }
  });
  const more = button("Earlier ones", async () => {
    pages++;
    await load();
    show();
  });
  main.replaceChildren(lead("History"), h("section", { class: "card" },
    h("div", { class: "field search" }, h("label", { for: "search" }, "Find"), search),
    place, h("div", { class: "buttons" }, compare, more)));
  const poll = async () => {
    do await pause(EVERY);
    while (!signal.aborted && (await load()));
  };
  if (await load()) keep(poll());
}
