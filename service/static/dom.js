/** Making elements. Text is always text: nothing here parses HTML. */

const LONG = 40; // characters of a cell that needs some width on phones

/** @type {(kind: string) => (tag: string, props?: Props, ...children: Children) => Element} */
const maker = (kind) => (tag, props = {}, ...children) => {
  const node = document.createElementNS(`http://www.w3.org/${kind}`, tag);
  for (const [key, value] of Object.entries(props)) {
    if (typeof value === "function") node.addEventListener(key.slice(2), value);
    else if (value !== false && value != null) node.setAttribute(key, value === true ? "" : value);
  }
  put(node, ...children);
  return node;
};

export const h = /** @type {Html} */ (maker("1999/xhtml"));
export const svg = maker("2000/svg");
export const math = maker("1998/Math/MathML");

/** Replace what is in a place. @param {Element} place @param {Children} children */
export function put(place, ...children) {
  const shown = children.flat().filter((child) => child !== false && child != null);
  place.replaceChildren(...shown.map((child) => (child instanceof Node ? child : `${child}`)));
}

/**
 * A table with its caption, where it has one, and headers; the first cell of a row is its header.
 * @param {string} caption @param {Child[]} head @param {Child[][]} rows
 */
export function table(caption, head, rows) {
  const cell = (/** @type {Child} */ content, column) => (column || content === ""
    ? h("td", { class: String(content).length > LONG && "text" }, content) : h("th", { scope: "row" }, content));
  return scroller(caption || `${head[0] || "Result"}, table`, "scroll",
    h("table", {}, caption ? h("caption", {}, caption) : null,
      h("thead", {}, h("tr", {}, head.map((text) => (text ? h("th", { scope: "col" }, text) : h("td"))))),
      h("tbody", {}, rows.map((row) => h("tr", {}, row.map(cell))))));
}

/** A box that scrolls, by keyboard too. @param {string} name @param {string} kind @param {Children} inside */
export const scroller = (name, kind, ...inside) =>
  h("div", { class: kind, tabindex: "0", role: "group", "aria-label": name }, ...inside);

/** @param {string} title @param {Children} inside */
export const card = (title, ...inside) => h("section", { class: "card" }, h("h2", {}, title), ...inside);

/** @param {string} text @param {() => void} onclick @param {string} [kind] */
export const button = (text, onclick, kind) => h("button", { type: "button", class: kind, onclick }, text);

/** @param {string} text @param {string} href @param {string} [kind] */
export const link = (text, href, kind = "") => h("a", { class: `button ${kind}`, href }, text);

/** The head of a view. @param {Child} title @param {Children} rest */
export const lead = (title, ...rest) => h("header", { class: "lead" }, h("h1", { tabindex: "-1" }, title), ...rest);

/** @param {Child} text */
export const help = (text) => h("p", { class: "help" }, text);

/** @param {string} name @param {BlobPart} content @param {string} [type] */
export function download(name, content, type = "application/json") {
  const url = URL.createObjectURL(new Blob([content], { type }));
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** Put text on the clipboard; the modern way exists over HTTPS and on localhost only. @param {string} text */
export async function copy(text) {
  if (navigator.clipboard) return navigator.clipboard.writeText(text);
  const area = h("textarea", {}, text);
  document.body.append(area);
  area.select();
  document.execCommand("copy");
  area.remove();
}

/** Rows as a file for spreadsheets. @param {string[][]} rows */
export const csv = (rows) =>
  rows.map((row) => row.map((cell) => `"${cell.replaceAll('"', '""')}"`).join(",")).join("\r\n");
