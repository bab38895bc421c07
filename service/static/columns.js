/** A record of plant data: its columns as numbers, read by the service, and what they seem to be. */

import { request } from "./api.js";

/** @typedef {{name: string, unit: string | null, values: (number | null)[]}} Column */
/** @typedef {{name: string, content: string}} Kept */
/** @typedef {{time: number[], unit: string | null, columns: Column[], faults: string[]}} Columns */

const HELD = 0.2; // share of samples at which an input moves at most; measurements move at nearly all

/** A file as it goes to the service. @param {File} file @returns {Promise<Kept>} */
export const kept = (file) => new Promise((done, failed) => {
  const reader = new FileReader();
  reader.onerror = () => failed(reader.error);
  reader.onload = () => done({ name: file.name, content: String(reader.result).replace(/^[^,]*,?/, "") });
  reader.readAsDataURL(file);
});

/** @param {Kept} body @param {AbortSignal} signal @returns {Promise<Columns>} */
export async function columnsOf(body, signal) {
  const { time, unit, columns } = await request("POST", "/v1/record-columns", { body, signal });
  const readable = (/** @type {any} */ column) => column.values !== null;
  return { time, unit, columns: columns.filter(readable),
    faults: columns.filter((one) => !readable(one)).map(({ fault }) => fault) };
}

/** Each gap filled with the reading before it, as an input is held. @param {Column["values"]} values */
export function held(values) {
  let last = /** @type {number | null} */ (null);
  return values.map((value) => (last = value ?? last));
}

/** What a column seems to be: an input is held, a measurement moves. @param {Column} column */
export function roleOf({ values }) {
  const known = values.filter((value) => value !== null);
  const moves = known.filter((value, i) => i > 0 && value !== known[i - 1]).length;
  return moves === 0 ? "none" : moves <= HELD * known.length ? "input" : "output";
}
