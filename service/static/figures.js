/** Plotly, loaded when a figure is first wanted, under a policy that permits no inline style. */

import { request } from "./api.js";
import { h, put } from "./dom.js";
import { label, timeUnit } from "./format.js";
import { takes } from "./schema.js";

/** @typedef {{data: any[], layout: any}} Figure as the service makes it, without a template */
/**
 * @typedef {{templates: {light: any, dark: any}, figures: Record<string, Figure>,
 *   omitted: Record<string, string>}} Figures
 */

const dark = matchMedia("(prefers-color-scheme: dark)");
const drawn = /** @type {Set<{plot: HTMLElement, draw: () => void}>} */ (new Set());
dark.addEventListener("change", () => drawn.forEach((one) => (one.plot.isConnected ? one.draw() : drawn.delete(one))));

/** @type {Promise<any> | undefined} */
let plotly;

/**
 * Plotly writes styles in three ways; the policy of the page lets through what goes over the
 * CSSOM only. Its own rules go into the sheet with the id `plotly.js-style-global`, which is the
 * page's. Style attributes are sent the permitted way. The rules of its maps, which it inserts
 * as it loads and nothing here needs, end in an element that means nothing.
 */
export function loadPlotly() {
  plotly ??= new Promise((done, failed) => {
    const { setAttribute } = Element.prototype;
    Element.prototype.setAttribute = function (name, value) {
      if (name === "style" && "style" in this) /** @type {any} */ (this).style.cssText = value;
      else setAttribute.call(this, name, value);
    };
    const { createElement } = document;
    document.createElement = (tag, options) =>
      createElement.call(document, tag === "style" ? "template" : tag, options);
    const source = document.querySelector("meta[name=plotly]")?.getAttribute("content");
    const onload = () => {
      document.createElement = createElement;
      done(/** @type {any} */ (window).Plotly);
    };
    const onerror = () => {
      document.createElement = createElement;
      plotly = undefined;
      failed(new Error("The drawing library could not be loaded."));
    };
    document.head.append(h("script", { src: source, async: true, onload, onerror }));
  });
  return plotly;
}

/**
 * Fetch figures and draw them; what fails is told in their place.
 * @param {HTMLElement} place @param {Promise<Figures>} answer @param {string} name of the files saved
 */
export async function showFigures(place, answer, name) {
  try {
    await drawFigures(place, await answer, name);
  } catch (error) {
    if (place.isConnected) put(place, h("p", { class: "error" }, /** @type {Error} */ (error).message));
  }
}

/** The path that asks for texts in the user's unit. @param {string} path @param {string} declared its form */
export const inUnit = (path, declared, method = "get") =>
  takes(declared, "unit", method) ? `${path}?unit=${encodeURIComponent(timeUnit())}` : path;

/** The figures of a tuning. @param {string} id @returns {Promise<Figures>} */
export const figuresOf = (id) =>
  request("GET", inUnit(`/v1/tunings/${id}/figures`, "/v1/tunings/{job_id}/figures"));

/** The figures of an analysis. @param {string} path @param {unknown} body @returns {Promise<Figures>} */
export const figuresOfAnswer = (path, body) => request("POST", inUnit(path, path, "post"), { body });

/**
 * Draw figures one after another, so that the page stays usable meanwhile.
 * @param {HTMLElement} place @param {Figures} answer @param {string} name of the files saved
 */
async function drawFigures(place, { templates, figures, omitted }, name) {
  const frames = Object.entries(figures).map(([kind, figure]) => {
    const plot = h("div", { class: "plot" });
    const { title = kind, description = "" } = figure.layout.meta ?? {};
    const node = h("figure", { class: "card", "data-figure": kind },
      h("figcaption", {}, h("h2", {}, title), h("p", { class: "help" }, description)), plot);
    return { kind, figure, plot, node };
  });
  const lacking = Object.entries(omitted).map(([kind, reason]) =>
    h("p", { class: "help" }, `${label(kind)} is not drawn: ${reason}`));
  put(place, frames.map(({ node }) => node), lacking);
  const Plotly = await loadPlotly();
  for (const { kind, figure, plot } of frames) {
    const { data, layout } = figure;
    const save = {
      name: "png", title: "Save as PNG", icon: Plotly.Icons.camera,
      click: () => Plotly.downloadImage(
        { data, layout: { ...layout, template: templates.light, paper_bgcolor: "white" } },
        { format: "png", width: 1000, height: 600, scale: 2, filename: `${name}-${kind}` }),
    };
    const buttons = [[save], ["zoom2d", "pan2d", "resetScale2d"]];
    const draw = () => Plotly.react(plot,
      data, { ...layout, autosize: true, template: dark.matches ? templates.dark : templates.light },
      { responsive: true, displaylogo: false, modeBarButtons: buttons });
    await draw();
    drawn.add({ plot, draw });
    await new Promise((done) => setTimeout(done));
  }
}
