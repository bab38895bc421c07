/** Plotly, loaded when a figure is first wanted, under a policy that permits no inline style. */

import { request } from "./api.js";
import { h, help, put } from "./dom.js";
import { label, namedUnit, timeUnit } from "./format.js";
import { tagged } from "./tags.js";

const LEGEND = 30; // pixels: room for a legend of one line, which the figures come with

const dark = matchMedia("(prefers-color-scheme: dark)");
const phone = matchMedia("(max-width: 40rem)");
const drawn = /** @type {Set<{plot: HTMLElement, draw: () => void}>} */ (new Set());
const redraw = () => drawn.forEach((one) => (one.plot.isConnected ? one.draw() : drawn.delete(one)));
for (const media of [dark, phone]) media.addEventListener("change", redraw);

/** @type {Promise<any> | undefined} */
let plotly;

/**
 * Plotly writes styles in three ways; the policy of the page lets through what goes over the
 * CSSOM only. Its own rules go into the sheet with the id `plotly.js-style-global`, which is the
 * page's. Style attributes are sent the permitted way. The rules of its maps, which it inserts
 * as it loads and nothing here needs, end in an element that means nothing.
 */
function loadPlotly() {
  plotly ??= new Promise((done, failed) => {
    const { setAttribute } = Element.prototype;
    Element.prototype.setAttribute = function (name, value) {
      if (name === "style" && "style" in this) /** @type {any} */ (this).style.cssText = value;
      else setAttribute.call(this, name, value);
    };
    const { createElement } = document;
    document.createElement = (tag, options) =>
      createElement.call(document, tag === "style" ? "template" : tag, options);
    const onload = () => done(/** @type {any} */ (window).Plotly);
    const onerror = () => {
      plotly = undefined;
      failed(new Error("The drawing library could not be loaded."));
    };
    const src = document.querySelector("meta[name=plotly]")?.getAttribute("content");
    const script = h("script", { src, onload, onerror });
    for (const end of ["load", "error"]) script.addEventListener(end, () => (document.createElement = createElement));
    document.head.append(script);
  });
  return plotly;
}

/** The path that asks for texts in the user's unit. @param {string} path */
export const inUnit = (path) => (namedUnit() ? `${path}?unit=${encodeURIComponent(timeUnit())}` : path);

/** The figures of a tuning. @param {string} id @returns {Promise<Figures>} */
export const figuresOf = (id) => request("GET", inUnit(`/v1/tunings/${id}/figures`));

/** The figures of an analysis. @param {string} name @param {unknown} body @returns {Promise<Figures>} */
export const figuresOfAnswer = (name, body) => request("POST", inUnit(`/v1/figures/${name}`), { body });

/** Room for figures that are on their way, so that nothing jumps when they come. @param {number} count */
export const waiting = (count) => Array.from({ length: count }, () =>
  h("div", { class: "card awaited" }, h("p", { class: "busy" }, "Drawing …")));

/**
 * Fetch figures and draw them; what fails is told in their place.
 * @param {HTMLElement} place @param {Promise<Figures>} answer @param {string} name of the files saved
 */
export async function showFigures(place, answer, name, tags = /** @type {any[] | null} */ (null)) {
  place.setAttribute("aria-busy", "true");
  if (!place.hasChildNodes()) put(place, waiting(1));
  try {
    await drawFigures(place, await answer, name, tags);
  } catch (error) {
    if (place.isConnected) put(place, h("p", { class: "error" }, /** @type {Error} */ (error).message));
  }
  place.removeAttribute("aria-busy");
}

/**
 * Draw figures one after another, so that the page stays usable meanwhile.
 * @param {HTMLElement} place @param {Figures} answer @param {string} name of the files saved
 * @param {any[] | null} [tags] of loops that are counted
 */
export async function drawFigures(place, { templates, figures, omitted }, name, tags) {
  const frames = Object.entries(figures).map(([kind, figure]) => {
    const plot = h("div", { class: "plot" });
    plot.style.minHeight = `${figure.layout.height}px`;
    const [title, description] = ["title", "description"].map((key) => tagged(figure.layout.meta[key], tags));
    for (const trace of figure.data) for (const key of ["name", "legendgroup"]) {
      if (trace[key]) trace[key] = tagged(trace[key], tags);
    }
    const node = h("figure", { class: "card", "data-figure": kind },
      h("figcaption", {}, h("h2", {}, title), help(description)), plot);
    return { kind, figure, plot, node };
  });
  put(place, frames.map(({ node }) => node),
    Object.entries(omitted).map(([kind, reason]) => help(`${label(kind)} is not drawn: ${reason}`)));
  const Plotly = await loadPlotly();
  for (const { kind, figure: { data, layout }, plot } of frames) {
    const paper = { ...layout, template: templates.light, paper_bgcolor: "white" };
    const save = {
      name: "png", title: "Save as PNG", icon: Plotly.Icons.camera,
      click: () => Plotly.downloadImage({ data, layout: paper },
        { format: "png", width: 1000, height: 600, scale: 2, filename: `${name}-${kind}` }),
    };
    const modeBarButtons = [[save], ["zoom2d", "pan2d", "resetScale2d"]];
    const draw = async (more = 0) => {
      const template = dark.matches ? templates.dark : templates.light;
      const font = phone.matches ? { size: 11 } : {};
      await Plotly.react(plot, data, { ...layout, autosize: true, template, font, height: layout.height + more },
        { responsive: true, displaylogo: false, modeBarButtons });
      // Where the legend wraps, as on phones, it must not take its room from the panels.
      const lacking = (plot.querySelector(".legend")?.getBoundingClientRect().height ?? 0) - LEGEND;
      if (more === 0 && lacking > 0) await draw(lacking);
    };
    await draw();
    drawn.add({ plot, draw });
    await new Promise((done) => setTimeout(done));
  }
}
