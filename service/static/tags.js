/** Loops by the tags of their instruments, in texts that count them from 1. */

import { loopsOf } from "./format.js";

const NUMBERS = String.raw`\d+(?:-\d+)?(?:(?:, | and )\d+(?:-\d+)?)*`;
const COUNTED = new RegExp(String.raw`(?<!['\w])(?<!\d )[Ll]oop(?: (\d+)|s (${NUMBERS})`
  + String.raw`(?!(?:, | and )\d+(?![\d ]*%)))(?![\d-]|\.\d| %|,? \.\.\.)`, "g");
const ALONE = new RegExp(`^${NUMBERS}$`);

/** @param {string} list of numbers from 1, and ranges */
const placesOf = (list) => list.split(/, | and /).flatMap((part) => {
  const [first, last = first] = part.split("-").map(Number);
  return Array.from({ length: last - first + 1 }, (_, i) => first - 1 + i);
});

/** A text that counts loops, with their tags instead. @param {string} text @param {any[] | null} [signals] */
export const tagged = (text, signals) => text.replace(COUNTED, (found, one, many) => {
  const group = placesOf(one ?? many);
  return group.every((unit) => signals?.[unit]?.tag) ? loopsOf(group, signals ?? []) : found;
});

/** The same of a cell that holds numbers alone. @param {string} text @param {any[] | null} [signals] */
export const taggedCell = (text, signals) => (ALONE.test(text) ? tagged(`loops ${text}`, signals).replace(/^loops /, "")
  : tagged(text, signals));
