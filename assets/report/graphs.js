// SPDX-License-Identifier: GPL-3.0-or-later
// Bring all graphs in line with the chosen variables, the points and the selection.
// source, graphs, variables, selection: see core/analysis/linked_graphs.py

const LISTED = 4;

const escaped = (text) => String(text).replace(/[&<>"']/g, (sign) => `&#${sign.charCodeAt(0)};`);

const number = (value) => Number(value.toPrecision(3)).toString().replace("-", "−");

const withUnit = (value, variable) =>
  number(value) + (variable.unit === "°" ? "°" : variable.unit ? ` ${variable.unit}` : "");

function setFields(looks, fields) {
  for (const glyph of looks) {
    for (const [property, field] of Object.entries(fields)) {
      if (glyph[property].field !== field) glyph[property] = { field };
    }
  }
}

function setAxis(graph, direction, variable, log) {
  const place = direction === "x" ? 0 : 1;
  const { plot } = graph;
  const axis = (direction === "x" ? plot.below : plot.left)[0];
  const range = plot[`${direction}_range`];
  const [start, end] = log ? variable.log : variable.linear;
  const scale = graph.scales[place][log ? 1 : 0];
  if (plot[`${direction}_scale`] !== scale && (log || plot[`${direction}_scale`].type !== scale.type)) {
    plot[`${direction}_scale`] = scale;
    axis.ticker = graph.tickers[place][log ? 1 : 0];
  }
  if (axis.axis_label !== variable.label) axis.axis_label = variable.label;
  // a pan or zoom stays as long as the axis shows the same
  const key = `${direction} ${variable.label} ${log}`;
  graph.shown ??= {};
  if (graph.shown[direction] !== key) {
    graph.shown[direction] = key;
    range.setv({ start, end, reset_start: start, reset_end: end });
  }
  return [start, end];
}

function beyond(prefix, x, y, xLimits, yLimits) {
  const xs = source.data[prefix + x], ys = source.data[prefix + y];
  const outside = (value, [low, high]) => value < low || value > high;
  const found = [];
  for (let i = 0; i < xs.length; i++) {
    if (Number.isFinite(xs[i]) && Number.isFinite(ys[i]) && (outside(xs[i], xLimits) || outside(ys[i], yLimits))) {
      found.push([xs[i], ys[i], i]);
    }
  }
  return found.sort((a, b) => b[1] - a[1]);
}

function listed(word, found, x, y) {
  if (!found.length) return "";
  const points = found.slice(0, LISTED).map(([a, b]) => `${withUnit(b, y)} at ${withUnit(a, x)}`);
  const more = found.length > LISTED ? ` and ${found.length - LISTED} more` : "";
  return `<div class="beyond">Beyond the axes, ${word}: ${y.symbol} ${points.join("; ")}${more}</div>`;
}

for (const graph of graphs) {
  const x = graph.x.value, y = graph.y.value;
  const xLog = graph.log.active.includes(0), yLog = graph.log.active.includes(1);
  setFields(graph.measured, { x: `m_${x}`, y: `m_${y}` });
  setFields(graph.modelled, { x: `p_${x}`, y: `p_${y}` });
  setFields(graph.links, { x0: `m_${x}`, y0: `m_${y}`, x1: `p_${x}`, y1: `p_${y}` });
  const xLimits = setAxis(graph, "x", variables[x], xLog);
  const yLimits = setAxis(graph, "y", variables[y], yLog);

  const fits = x === graph.default[0] && y === graph.default[1];
  graph.fitted.visible = fits;
  const { text, colour } = graph.curves.data;
  const curves = fits ? text.map((each, i) => `<span style="color:${colour[i]}">${each}</span>`) : [];
  const lines = [
    `<div class="curves">${curves.join(" &ensp; ")}&nbsp;</div>`,
    listed("measured", beyond("m_", x, y, xLimits, yLimits), variables[x], variables[y]),
    listed("model", beyond("p_", x, y, xLimits, yLimits), variables[x], variables[y]),
  ];
  const note = lines.join("");
  if (graph.note.text !== note) graph.note.text = note;
}

const chosen = source.selected.indices;
const names = chosen.slice(0, 12).map((i) => `${escaped(source.data.trajectory[i])}/${source.data.impact[i]}`);
selection.text = chosen.length
  ? `<b>${chosen.length} selected:</b> ${names.join(", ")}${chosen.length > 12 ? " …" : ""}`
  : "Drag a box in a graph, or click a point: the same impacts light up in all graphs.";
