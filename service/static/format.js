/** Numbers, names and units as people read them. */

import { h } from "./dom.js";

const NAMES = /** @type {Record<string, string>} */ ({
  n: "Units n", tau_p: "Time constant τₚ", epsilon: "Error ε", theta: "Time scale θ", mu: "μ",
  omega: "Frequency ω", instruments: "Tags and signals", max_peak: "Peak M", offset: "Offset A", num: "Numerator",
  den: "Denominator", rga: "RGA", unit: "Loop", succeeded: "Done", cancelled: "Stopped", mcavoy: "McAvoy",
  wood_berry: "Wood and Berry", relay_johansson: "Johansson's relay",
});
const OPTIONS = /** @type {Record<string, string>} */ ({
  tau_p: "Fastest loop, τₚ", mu: "Most robust, μ", sdp: "SDP",
  ziegler_nichols: "Ziegler and Nichols", tyreus_luyben: "Tyreus and Luyben",
  UncertaintyOfError: "Error and time scale", UncertaintyOfWeight: "Weight w(s)",
  UncertaintyOfGainAndDeadTime: "Errors of gain and dead time",
  OutputsOfError: "Error and time scale", OutputsOfWeight: "Weight w(s)",
  OutputsOfGainAndDeadTime: "Errors of gain and dead time",
});
const FEW = 3; // tags that are told one by one
const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** @param {string} key a name of the API, in snake_case, kebab-case or CamelCase */
function words(key) {
  const text = key.replace(/([a-z])([A-Z])/g, "$1 $2").replace(/[_-]/g, " ");
  return text === text.toUpperCase() ? text : text.charAt(0).toUpperCase() + text.slice(1).toLowerCase();
}

/** @param {string} key */
export const label = (key) => NAMES[key] ?? words(key);

/** @param {unknown} value */
export const option = (value) => OPTIONS[String(value)] ?? words(String(value));

/** @param {number | null | undefined} value @param {number} [digits] significant ones */
export function number(value, digits = 4) {
  if (value == null || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-4)) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
    const raised = exponent.replace("+", "").replace("-", "⁻").replace(/\d/g, (d) => SUPERSCRIPTS[+d]);
    return `${minus(Number(mantissa))}×10${raised}`;
  }
  return minus(Number(value.toPrecision(digits)));
}

const minus = (value) => String(value).replace("-", "−");

/** Places in a list, given from 0, counted from 1, as ranges: 1–3, 5. @param {number[]} places ascending */
export function rangesOf(places) {
  const ranges = [];
  for (let i = 0; i < places.length; ) {
    let end = i;
    while (places[end + 1] === places[end] + 1) end++;
    ranges.push(end > i ? `${places[i] + 1}–${places[end] + 1}` : places[i] + 1);
    i = end + 1;
  }
  return ranges.join(", ");
}

/** Loops that share settings, by their tags where all have one. @param {number[]} group @param {any[]} [signals] */
export function loopsOf(group, signals = []) {
  const tags = group.map((unit) => signals[unit]?.tag);
  if (tags.every(Boolean)) {
    const together = group.every((unit, i) => unit === group[0] + i);
    return tags.length > FEW && together ? `${tags[0]} to ${tags.at(-1)}` : tags.join(", ");
  }
  return `${group.length > 1 ? "Loops" : "Loop"} ${rangesOf(group)}`;
}

/** @param {string | null} text one that may lack its capital and its full stop */
export const sentence = (text) => (text ?? "").replace(/^./, (first) => first.toUpperCase()).replace(/[^.]$/, "$&.");

/** Symbols of the API in texts for people, who count loops from 1. @type {[RegExp, string][]} */
const PLAIN = [
  [/\b[tT]au_([A-Za-z])\b/g, "τ_$1"], [/τ_[Pp]/g, "τₚ"], [/τ_([IDF])/g, "τ$1"],
  [/\bomega_B\b/g, "ωB"], [/\bomega\b/g, "ω"], [/\btheta\b/g, "θ"], [/\bepsilon\b/g, "ε"], [/\btau\b/g, "τ"],
  [/\bmu\b/g, "μ"], [/τP/g, "τₚ"], [/\beps\b/g, "ε"], [/Delta_/g, "Δ_"],
  [/(?<![A-Za-z])([wMKΔ])_(i0|[OIstu])\b/g, "$1$2"],
  [/; null: ?/g, ". Empty: "], [/\bnull: ?/g, "Empty: "], [/\bnull\b/g, "empty"],
  [/\(?\bfrom 0\b\)?(?!\.\d| (to|on)\b)/g, "counted from 1"],
  [/\(mutune tune\)/g, "(Tune)"], [/\(mutune limit\)/g, "(Tune, with the limit asked for under Search)"],
  [/: ask `mutune limit`/g, ""], [/ \(mutune identify\)/g, " (From a record)"], [/: mutune parallel-drives/g, ""],
  [/\bperformance\.(?=\w)/g, ""], [/(?<=[a-z])_(?=[a-z])/g, " "],
];

/** @param {string} text */
export const plain = (text) => PLAIN.reduce((now, [from, to]) => now.replace(from, to), text)
  .replace(/rad(\/time(?! unit)| per time unit)\b/g, unitText("rad/time"));

/** @param {string} moment ISO time */
export const clock = (moment) =>
  new Date(moment).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });

/** @param {number} seconds */
export const duration = (seconds) =>
  seconds < 100 ? `${seconds.toFixed(1)} s` : `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;

/* The unit of time is the user's own, and no part of a request: it is a matter of labels. */

const KNOWN = "mutune.units";
const NAMELESS = "time units";
let time = "min";

export const timeUnit = () => time;

/** A time with its unit. @param {number | null | undefined} value @param {number} [digits] */
export const timed = (value, digits) => `${number(value, digits)} ${value === 1 && time === NAMELESS
  ? NAMELESS.slice(0, -1) : time}`;

/** The unit of time, or null where it has no name. */
export const namedUnit = () => (time === NAMELESS ? null : time);

/** @param {string} unit */
export function setTimeUnit(unit) {
  time = unit.trim() || NAMELESS;
  for (const node of document.querySelectorAll("[data-unit]")) {
    node.textContent = unitText(/** @type {HTMLElement} */ (node).dataset.unit);
  }
}

/** @returns {Record<string, string>} */
const known = () => JSON.parse(localStorage.getItem(KNOWN) ?? "{}");

/** The unit that belongs to a job (or "last": the one typed last). @param {string} id */
export const unitOf = (id) => known()[id];

/** @param {string} id */
export function rememberUnit(id) {
  const recent = Object.fromEntries(Object.entries(known()).slice(-300));
  localStorage.setItem(KNOWN, JSON.stringify({ ...recent, [id]: time, last: time }));
}

/** @param {string} [kind] `x-unit` of the schema @returns {string} */
export const unitText = (kind = "") => {
  const rate = `rad/${namedUnit() ?? "time unit"}`;
  return { time, "rad/time": rate, gain: "", 1: "", "powers of time": "" }[kind] ?? kind;
};

/** @param {string | undefined} kind */
export const unitTag = (kind) =>
  unitText(kind) ? h("span", { class: "unit", "data-unit": kind }, unitText(kind)) : null;
