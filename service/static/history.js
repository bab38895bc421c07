/** The history of tunings: found by their words, named, deleted, and some chosen to be compared. */

import { FINAL, pause, Problem, request } from "./api.js";
import { button, h, lead, put, table } from "./dom.js";
import { clock, number } from "./format.js";
import { onceReleased } from "./press.js";
import { unitOfJob } from "./units.js";
import { chipOf } from "./chip.js";
import { rename, summaryOf } from "./summary.js";

const EVERY = 2000; // milliseconds between two looks while something runs
const ENOUGH = 10; // tunings that are shown at least, where there are so many

/** @param {any} job */
function line(job) {
  const { title, aim } = summaryOf(job);
  const unit = job.request.objective === "mu" ? "μ" : unitOfJob(job) ?? "time units";
  return [
    h("a", { href: `#/tunings/${job.id}` }, title, h("br"), h("span", { class: "help unit" }, aim)),
    chipOf(job),
    h("span", { class: "value" }, number(job.progress.best), " ",
      job.progress.best !== null && h("span", { class: "unit" }, unit)),
    h("span", { class: "unit" }, clock(job.created_at)),
  ];
}

/** All that a tuning can be found by: title, aim, tags, id, labels. @param {any} job */
function wordsOf(job) {
  const { title, aim } = summaryOf(job);
  const { id, request: asked } = job;
  const tags = (asked.instruments ?? []).map(({ tag }) => tag ?? "");
  return [title, aim, asked.title ?? "", asked.id ?? "", id, ...tags, ...Object.values(asked.labels ?? {})]
    .join(" ").toLowerCase();
}

/** Buttons that name and delete a tuning. @param {any} job @param {() => void} changed */
function actionsOf(job, changed) {
  const { title } = summaryOf(job);
  const place = h("div", { class: "actions" });
  const named = (text, spoken, onclick) => {
    const made = button(text, onclick, "quiet small");
    made.setAttribute("aria-label", `${spoken} ${title}`);
    return made;
  };
  const ask = () => {
    const input = h("input", { value: title, "aria-label": `New name of ${title}`, maxlength: 200 });
    const form = h("form", { onsubmit: (event) => {
      event.preventDefault();
      rename(job.id, input.value);
      changed();
    } }, input, h("button", {}, "Save"));
    put(place, form);
    input.select();
  };
  const remove = async () => {
    try {
      await request("DELETE", `/v1/tunings/${job.id}?forget=true`);
      rename(job.id, "");
      changed();
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      put(place, h("p", { class: "error" }, error.message));
    }
  };
  const sure = () => {
    put(place, named("Delete for ever", "Delete for ever", remove), named("Keep", "Keep", show));
    place.querySelector("button")?.focus();
  };
  const own = FINAL.has(job.status) && !job.batch;
  const show = () => put(place, named("Rename", "Rename", ask), own && named("Delete", "Delete", sure));
  show();
  return place;
}

/** @param {View} view */
export async function historyView({ main, signal, keep }) {
  const chosen = /** @type {Set<string>} */ (new Set());
  const place = h("div", {}, h("p", { class: "busy" }, "Loading …"));
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
  const batches = h("input", { type: "checkbox", onchange: () => void fill() });
  let jobs = /** @type {any[]} */ ([]);
  let next = /** @type {string | null} */ (null);
  let pages = 1;
  const found = () => {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    return jobs.filter((job) => (batches.checked || !job.batch) && words.every((word) => wordsOf(job).includes(word)));
  };
  const changed = async () => {
    await load();
    show();
  };
  const show = () => onceReleased(() => {
    const rows = found().map((job) => [...line(job), choice(job), actionsOf(job, changed)]);
    const none = jobs.length ? h("p", {}, "None of these has such words. Earlier ones may.")
      : h("p", {}, "No tuning yet. ", h("a", { href: "#/" }, "Start the first one."));
    put(place, rows.length ? table("Newest first", ["Plant", "Status", "Best", "Started", "Compare", "Change"], rows)
      : none);
    more.hidden = !next;
    buttons.hidden = false;
  });
  const load = async () => {
    const loaded = [];
    next = "/v1/tunings?limit=20";
    for (let page = 0; page < pages && next; page++) {
      const answer = await request("GET", next, { signal });
      loaded.push(...answer.items);
      next = answer.next;
    }
    jobs = loaded;
    if (!buttons.hidden && !place.contains(document.activeElement)) show();
    return jobs.some((job) => !FINAL.has(job.status));
  };
  // What is sought may be long ago: then pages are fetched until it is there.
  const fill = async () => {
    if (!buttons.hidden) show();
    while (next && found().length < (search.value ? 1 : ENOUGH)) {
      pages += 5;
      await load();
    }
    show();
  };
  search.addEventListener("input", fill);
  const more = button("Earlier ones", () => {
    pages++;
    void changed();
  });
  // What stands below the list comes with it: else it jumps by the height of the list.
  const buttons = h("div", { class: "buttons", hidden: true }, compare, more);
  main.replaceChildren(lead("History"), h("section", { class: "card" },
    h("div", { class: "field search" }, h("label", { for: "search" }, "Find"), search,
      h("label", { class: "check" }, batches, "Also those of batches and trade-offs")),
    place, buttons));
  const poll = async () => {
    do await pause(EVERY);
    while (!signal.aborted && (await load()));
  };
  const running = await load();
  await fill();
  if (running) keep(poll());
}
