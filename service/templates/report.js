"use strict";
const { template, figures } = JSON.parse(document.getElementById("figures").textContent);
for (const [name, figure] of Object.entries(figures)) {
  const place = document.getElementById(`figure-${name}`);
  Plotly.newPlot(place, figure.data, { ...figure.layout, template }, { displayModeBar: false, responsive: true });
}
