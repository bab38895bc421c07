/** A record of plant data as CSV: its columns as numbers, and what they seem to be. */

/** @typedef {{name: string, unit: string | null, values: (number | null)[]}} Column */

const HELD = 0.2; // share of samples at which an input moves at most; measurements move at nearly all
const UNITS = /^(.*?)\s*[([]([^)\]]+)[)\]]\s*$/; // a name with its unit in brackets

/** @param {string} text @returns {Column[]} */
export function columnsOf(text) {
  const lines = text.trim().split(/\r?\n/).filter((line) => line.trim() && !line.startsWith("#"));
  const gap = [";", "\t", ","].find((sign) => lines[0].includes(sign)) ?? ",";
  const point = gap === "," ? (cell) => cell : (/** @type {string} */ cell) => cell.replace(",", ".");
  const rows = lines.map((line) => line.split(gap).map((cell) => cell.trim().replace(/^"|"$/g, "")));
  const heads = rows[0].some((cell) => cell && Number.isNaN(Number(point(cell)))) ? rows.shift() : undefined;
  if (!rows.length) throw new Error("There are no rows of numbers.");
  return rows[0].map((_, k) => {
    const [, name = heads?.[k] ?? `Column ${k + 1}`, unit = null] = UNITS.exec(heads?.[k] ?? "") ?? [];
    return { name, unit, values: rows.map((row) => read(point(row[k] ?? ""))) };
  });
}

/** A number, or a moment as seconds; null where there is none. @param {string} cell */
function read(cell) {
  if (cell === "") return null;
  const value = Number(cell);
  if (Number.isFinite(value)) return value;
  const moment = Date.parse(cell);
  return Number.isNaN(moment) ? null : moment / 1000;
}

/** The column of time: the first that rises at every sample. @param {Column[]} columns */
export const timeOf = (columns) => Math.max(0, columns.findIndex(({ values }) =>
  values.every((value, i) => value !== null && (i === 0 || value > /** @type {number} */ (values[i - 1])))));

/** What a column seems to be: an input is held, a measurement moves. @param {Column} column */
export function roleOf({ values }) {
  const known = values.filter((value) => value !== null);
  const moves = known.filter((value, i) => i > 0 && value !== known[i - 1]).length;
  return moves === 0 ? "none" : moves <= HELD * known.length ? "input" : "output";
}
