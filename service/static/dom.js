/** Making elements. Text is always text: nothing here parses HTML. */

/** @typedef {Node | string | number | null | undefined | false} Child */
/** @typedef {Record<string, any>} Props attributes; `on...` are listeners */

/**
 * @param {Element} node
 * @param {Props} props
 * @param {(Child | Child[])[]} children
 */
function fill(node, props, children) {
  for (const [key, value] of Object.entries(props)) {
    if (typeof value === "function") node.addEventListener(key.slice(2), value);
    else if (value !== false && value != null) node.setAttribute(key, value === true ? "" : value);
  }
  for (const child of children.flat()) {
    if (child !== false && child != null) node.append(child instanceof Node ? child : `${child}`);
  }
}

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Props} [props]
 * @param {...(Child | Child[])} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function h(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  fill(node, props, children);
  return node;
}

/** @param {string} namespace */
function maker(namespace) {
  /** @param {string} tag @param {Props} props @param {(Child | Child[])[]} children */
  function make(tag, props = {}, ...children) {
    const node = document.createElementNS(namespace, tag);
    fill(node, props, children);
    return node;
  }
  return make;
}

export const svg = maker("http://www.w3.org/2000/svg");
export const math = maker("http://www.w3.org/1998/Math/MathML");

/**
 * Replace what is in a place.
 * @param {Element} place
 * @param {...(Child | Child[])} children
 */
export function put(place, ...children) {
  place.replaceChildren();
  fill(place, {}, children);
}

/**
 * A table with its caption and headers.
 * @param {string} caption
 * @param {Child[]} head
 * @param {Child[][]} rows the first cell of a row is its header
 */
export function table(caption, head, rows) {
  const cell = (/** @type {Child} */ content, column) =>
    column ? h("td", {}, content) : h("th", { scope: "row" }, content);
  return scroller(caption, "scroll",
    h("table", {},
      h("caption", {}, caption),
      h("thead", {}, h("tr", {}, head.map((text) => (text ? h("th", { scope: "col" }, text) : h("td"))))),
      h("tbody", {}, rows.map((row) => h("tr", {}, row.map(cell))))));
}

/** A box that scrolls, by keyboard too. @param {string} name @param {string} kind @param {...Child} inside */
export const scroller = (name, kind, ...inside) =>
  h("div", { class: kind, tabindex: "0", role: "group", "aria-label": name }, inside);

/** @param {string} text @param {() => void} onclick @param {string} [kind] */
export const button = (text, onclick, kind) => h("button", { type: "button", class: kind, onclick }, text);

/** The head of a view. @param {Child} title @param {...Child} rest */
export const lead = (title, ...rest) => h("header", { class: "lead" }, h("h1", { tabindex: "-1" }, title), rest);

/** @param {string} name @param {BlobPart} content @param {string} [type] */
export function download(name, content, type = "application/json") {
  const url = URL.createObjectURL(new Blob([content], { type }));
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/**
 * Put text on the clipboard; the modern interface exists over HTTPS and on localhost only.
 * @param {string} text
 */
export async function copy(text) {
  if (navigator.clipboard) return navigator.clipboard.writeText(text);
  const area = h("textarea", {}, text);
  document.body.append(area);
  area.select();
  document.execCommand("copy");
  area.remove();
}
