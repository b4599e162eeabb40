// SPDX-License-Identifier: GPL-3.0-or-later
// Bring all graphs in line with the chosen variables, the points and the selection.
// source, graphs, variables, pairs, colours, selection: see core/analysis/linked_graphs.py

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

// the column of a variable: the model's own value, or the measured one where the model does not change it
const column = (prefix, name) => (variables[name].restituted ? prefix : "m_") + name;

// Fits, as in core/analysis/curves.py and robust_slope.py, for pairs that were not fitted when the page was made

const ROUNDING = 1e-7, POINTS = 60;

function digits(value) {
  if (!Number.isFinite(value)) return "–";
  const tiny = value !== 0 && Math.abs(value) < 1e-4;
  const [mantissa, exponent] = (tiny ? value.toExponential(2) : value.toPrecision(3)).split("e");
  const power = exponent ? `·10<sup>${Number(exponent)}</sup>` : "";
  return (mantissa + power).replaceAll("-", "−");
}

const twoDecimals = (value) => value.toFixed(2).replace("-", "−");

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function median(values) {
  const sorted = Float64Array.from(values).sort();
  const half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

function ranks(values) {
  const order = Array.from(values.keys()).sort((a, b) => values[a] - values[b]);
  const rank = new Float64Array(values.length);
  for (let i = 0; i < order.length; ) {
    let end = i;
    while (end < order.length && values[order[end]] === values[order[i]]) end++;
    for (let k = i; k < end; k++) rank[order[k]] = (i + end - 1) / 2;
    i = end;
  }
  return rank;
}

function regression(x, y) {
  const xMean = mean(x), yMean = mean(y);
  let xx = 0, xy = 0, yy = 0;
  for (let i = 0; i < x.length; i++) {
    xx += (x[i] - xMean) ** 2;
    xy += (x[i] - xMean) * (y[i] - yMean);
    yy += (y[i] - yMean) ** 2;
  }
  const slope = xy / xx;
  return { slope, intercept: yMean - slope * xMean, correlation: xy / Math.sqrt(xx * yy) };
}

// pairs of a sequence that are not in order, by merge sort
function inversions(values) {
  let from = values, to = new Float64Array(values.length), found = 0;
  for (let width = 1; width < values.length; width *= 2) {
    for (let start = 0; start < values.length; start += 2 * width) {
      const middle = Math.min(start + width, values.length), end = Math.min(start + 2 * width, values.length);
      for (let i = start, j = middle, k = start; k < end; k++) {
        if (j >= end || (i < middle && from[i] <= from[j])) to[k] = from[i++];
        else { found += middle - i; to[k] = from[j++]; }
      }
    }
    [from, to] = [to, from];
  }
  return found;
}

// the median of the slopes between all pairs of points (Theil–Sen)
function robustSlope(x, y) {
  const order = Array.from(x.keys()).sort((a, b) => x[a] - x[b] || y[a] - y[b]);
  const below = (slope) => inversions(Float64Array.from(order, (i) => y[i] - slope * x[i]));
  let pairs = 0;
  for (let i = 1, same = 0; i < order.length; i++) {
    same = x[order[i]] === x[order[i - 1]] ? same + 1 : 0;
    pairs += i - same;
  }
  const ranked = (rank) => {
    let low = -1, high = 1;
    while (below(low) > rank) low *= 2;
    while (below(high) <= rank) high *= 2;
    for (let i = 0; i < 60; i++) {
      const middle = (low + high) / 2;
      if (below(middle) > rank) high = middle; else low = middle;
    }
    return (low + high) / 2;
  };
  return pairs % 2 ? ranked((pairs - 1) / 2) : (ranked(pairs / 2 - 1) + ranked(pairs / 2)) / 2;
}

function trendOf(x, y, xLog, yLog) {
  return pairs[`${x} ${y}`] ?? (xLog ? (yLog ? "power" : "logarithm") : yLog ? "exponential" : "line");
}

function fitted(trend, xs, ys) {
  const known = Array.from(xs.keys()).filter((i) => Number.isFinite(xs[i]) && Number.isFinite(ys[i]));
  let x = known.map((i) => xs[i]), y = known.map((i) => ys[i]);
  if (!x.length) return null;
  const constant = Math.max(...y) - Math.min(...y) <= ROUNDING * Math.max(...y.map(Math.abs));
  if (constant) y = y.map(() => y[0]);
  const result = { trend, n: x.length, rank: x.length < 3 || constant ? NaN : regression(ranks(x), ranks(y)).correlation };
  const onX = trend === "power" || trend === "logarithm", onY = trend === "power" || trend === "exponential";
  const placed = Array.from(x.keys()).filter((i) => (!onX || x[i] > 0) && (!onY || y[i] > 0));
  x = placed.map((i) => x[i]);
  y = placed.map((i) => y[i]);
  const [low, high] = [Math.min(...x), Math.max(...x)];
  if (x.length < 3 || (trend !== "origin" && low === high)) {
    const few = x.length < result.n ? "too few points for a fit above zero" : "too few points for a fit";
    return { ...result, why: x.length < 3 ? few : "no fit: all points have one abscissa" };
  }
  const u = onX ? x.map(Math.log) : x, v = onY ? y.map(Math.log) : y;
  let { slope, intercept } = regression(u, v);
  if (trend === "origin") {
    slope = u.reduce((sum, each, i) => sum + each * v[i], 0) / u.reduce((sum, each) => sum + each * each, 0);
    intercept = 0;
  } else if (trend === "power") {
    slope = constant ? 0 : robustSlope(u, v);
    intercept = median(v) - slope * median(u);
  }
  const vMean = mean(v);
  const total = v.reduce((sum, each) => sum + (each - vMean) ** 2, 0);
  const left = v.reduce((sum, each, i) => sum + (each - intercept - slope * u[i]) ** 2, 0);
  const at = (each) => {
    const value = intercept + slope * (onX ? Math.log(each) : each);
    return onY ? Math.exp(value) : value;
  };
  return { ...result, n: x.length, slope, intercept, r2: constant ? NaN : 1 - left / total, low, high, at };
}

function said(fit, x, y) {
  const rest = (Number.isFinite(fit.rank) ? `, ρ = ${twoDecimals(fit.rank)}` : "") + `, n = ${fit.n}`;
  if (fit.why) return fit.why + rest;
  const [xs, ys] = [variables[x].symbol, variables[y].symbol], { slope, intercept, trend } = fit;
  const sign = slope < 0 ? "−" : "+";
  const equation =
    trend === "origin" ? (x === "vt1_mps" && y === "vt2_mps" ? "<i>R</i><sub>T</sub>" : ys) + ` = ${digits(slope)}` +
      (x === "vt1_mps" && y === "vt2_mps" ? "" : ` ${xs}`)
    : slope === 0 ? `${ys} = ${digits(fit.at(fit.low))}`
    : trend === "power" ? `${ys} = ${digits(Math.exp(intercept))} ${xs}<sup>${digits(slope)}</sup>`
    : trend === "exponential" ? `${ys} = ${digits(Math.exp(intercept))} exp(${digits(slope)} ${xs})`
    : `${ys} = ${digits(intercept)} ${sign} ${digits(Math.abs(slope))} ${trend === "logarithm" ? "ln " : ""}${xs}`;
  return equation + (Number.isFinite(fit.r2) ? `, R² = ${twoDecimals(fit.r2)}` : "") + rest;
}

function drawn(fit, xLimits, yLimits) {
  const low = Math.max(xLimits[0], fit.trend === "origin" ? 0 : fit.low), high = Math.min(xLimits[1], fit.high);
  const even = low <= 0 || fit.trend === "exponential";
  const xs = Array.from({ length: low < high ? POINTS : 0 }, (_, i) =>
    even ? low + (high - low) * i / (POINTS - 1) : low * (high / low) ** (i / (POINTS - 1)));
  const seen = xs.filter((x) => fit.at(x) >= yLimits[0] && fit.at(x) <= yLimits[1]);
  return [seen, seen.map(fit.at)];
}

// equations of both series, their curves drawn
function fitBoth(graph, x, y, xLog, yLog, xLimits, yLimits) {
  const lines = { xs: [], ys: [], colour: [] }, texts = [];
  ["m_", "p_"].forEach((prefix, i) => {
    const fit = fitted(trendOf(x, y, xLog, yLog), source.data[column(prefix, x)], source.data[column(prefix, y)]);
    if (!fit) return;
    texts.push(`<span style="color:${colours[i]}">${said(fit, x, y)}</span>`);
    if (fit.why) return;
    const [xs, ys] = drawn(fit, xLimits, yLimits);
    lines.xs.push(xs);
    lines.ys.push(ys);
    lines.colour.push(colours[i]);
  });
  graph.own.data = lines;
  return texts;
}

function beyond(prefix, x, y, xLimits, yLimits) {
  const xs = source.data[column(prefix, x)], ys = source.data[column(prefix, y)];
  const outside = (value, [low, high]) => {
    const rounding = 1e-6 * Math.max(Math.abs(low), Math.abs(high));
    return value < low - rounding || value > high + rounding;
  };
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
  setFields(graph.modelled, { x: column("p_", x), y: column("p_", y) });
  setFields(graph.links, { x0: `m_${x}`, y0: `m_${y}`, x1: column("p_", x), y1: column("p_", y) });
  const xLimits = setAxis(graph, "x", variables[x], xLog);
  const yLimits = setAxis(graph, "y", variables[y], yLog);

  const made = x === graph.default[0] && y === graph.default[1] && !xLog && !yLog;
  graph.fitted.visible = made;
  graph.ownFitted.visible = !made;
  const { text, colour } = graph.curves.data;
  const curves = made
    ? text.map((each, i) => `<span style="color:${colour[i]}">${each}</span>`)
    : fitBoth(graph, x, y, xLog, yLog, xLimits, yLimits);
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
