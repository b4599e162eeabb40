// SPDX-License-Identifier: GPL-3.0-or-later
// Bring all graphs in line with the chosen variables, models, colours, filters, points and selection.
// source, passing, graphs, variables, pairs, models, columns, palettes, looks, students, begin, edited, other, selection:
// see core/analysis/linked_graphs.py; fits and scores: fits.js

const LISTED = 4, GROUPS_LISTED = 12, TEXTS_LISTED = 100, MEASURED = '<circle r="3.8"/>';

const escaped = (text) => String(text).replace(/[&<>"']/g, (sign) => `&#${sign.charCodeAt(0)};`);

const number = (value) => Number(value.toPrecision(3)).toString().replace("-", "−");

const withUnit = (value, variable) =>
  number(value) + (variable.unit === "°" ? "°" : variable.unit ? ` ${variable.unit}` : "");

const byId = (id) => document.getElementById(id);

const dark = matchMedia("(prefers-color-scheme: dark)");

// what the reader chose, kept from one call to the next
const state = (window.rockfallPage ??= { shown: new Set(begin), colour: "", filters: [], kept: new Map() });

const look = () => looks[dark.matches ? "dark" : "light"];

const modelColour = (model) => (state.shown.size === 1 ? look().model : model.colour);

function set(model, values) {
  for (const [name, value] of Object.entries(values)) if (model[name] !== value) model[name] = value;
}

function setFields(glyphs, fields) {
  for (const glyph of glyphs) {
    for (const [property, field] of Object.entries(fields)) {
      if (glyph[property].field !== field) glyph[property] = { field };
    }
  }
}

function setColour(glyphs, key, names, colour) {
  for (const glyph of glyphs) {
    const done = `${key}`;
    if (state.kept.get(glyph) === done) continue;
    state.kept.set(glyph, done);
    for (const name of names) glyph[name] = colour;
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
  set(axis, { axis_label: variable.label });
  // a pan or zoom stays as long as the axis shows the same
  const key = `${direction} ${variable.label} ${log}`;
  graph.shown ??= {};
  if (graph.shown[direction] !== key) {
    graph.shown[direction] = key;
    range.setv({ start, end, reset_start: start, reset_end: end });
  }
  return [start, end];
}

function setScheme() {
  const scheme = dark.matches ? "dark" : "light";
  if (state.scheme === scheme) return;
  state.scheme = scheme;
  const { ink, muted, grid, axis, paper, link } = look();
  for (const { plot, models: shown } of graphs) {
    set(plot, { background_fill_color: paper, border_fill_color: paper });
    for (const one of [...plot.below, ...plot.left]) {
      set(one, {
        axis_label_text_color: ink, major_label_text_color: muted, axis_line_color: axis, major_tick_line_color: axis,
      });
    }
    for (const one of plot.center) set(one, { grid_line_color: grid });
    for (const { links } of shown) setColour(links, scheme, ["line_color"], link);
  }
}

// the column of a variable: a model's own value, or the measured one where models do not change it
const column = (prefix, name) => (variables[name].restituted ? prefix : "m_") + name;

// which rows pass all filters, null for all
function passingRows() {
  const active = state.filters.filter((one) => (one.texts ? one.texts.size : one.low !== null || one.high !== null));
  if (!active.length) return null;
  const near = (value, limit, side) => (value - limit) * side <= 1e-6 * Math.abs(limit);
  return Array.from(source.data.trajectory, (_, i) => active.every(({ key, texts, low, high }) => {
    const value = source.data[key][i];
    if (texts) return texts.has(value);
    return Number.isFinite(value) && (low === null || near(value, low, -1)) && (high === null || near(value, high, 1));
  }));
}

// finite pairs of two columns among the rows that pass, and their places in the table
function pairsOf(xName, yName) {
  const xs = source.data[xName], ys = source.data[yName], x = [], y = [], row = [];
  for (let i = 0; i < xs.length; i++) {
    if ((state.rows && !state.rows[i]) || !Number.isFinite(xs[i]) || !Number.isFinite(ys[i])) continue;
    x.push(xs[i]);
    y.push(ys[i]);
    row.push(i);
  }
  return { x, y, row };
}

// the result of `work` for some columns, computed again only when one of them, or the filter, is another
function kept(key, names, work) {
  const from = [state.rows, ...names.map((name) => source.data[name])], known = state.kept.get(key);
  if (known && known.from.every((each, i) => each === from[i])) return known.result;
  const result = work();
  state.kept.set(key, { from, result });
  return result;
}

const fitOf = (trend, x, y) => kept(`fit ${trend} ${x} ${y}`, [x, y], () => {
  const found = pairsOf(x, y);
  return fitted(trend, found.x, found.y);
});

const scoreOf = (prefix, name) => kept(`score ${prefix} ${name}`, [`m_${name}`, prefix + name], () => {
  const { x, y, row } = pairsOf(`m_${name}`, prefix + name);
  return scored(name, x, y, row.map((i) => source.data.fall[i]));
});

function beyond(prefix, x, y, xLimits, yLimits) {
  const outside = (value, [low, high]) => {
    const rounding = 1e-6 * Math.max(Math.abs(low), Math.abs(high));
    return value < low - rounding || value > high + rounding;
  };
  const found = pairsOf(column(prefix, x), column(prefix, y)), points = [];
  found.x.forEach((value, i) => {
    if (outside(value, xLimits) || outside(found.y[i], yLimits)) points.push([value, found.y[i]]);
  });
  return points.sort((a, b) => b[1] - a[1]);
}

function listed(word, found, x, y) {
  if (!found.length) return "";
  const points = found.slice(0, LISTED).map(([a, b]) => `${withUnit(b, y)} at ${withUnit(a, x)}`);
  const more = found.length > LISTED ? ` and ${found.length - LISTED} more` : "";
  return `<div class="beyond">Beyond the axes, ${word}: ${y.symbol} ${points.join("; ")}${more}</div>`;
}

function drawGraph(graph) {
  const x = graph.x.value, y = graph.y.value;
  const xLog = graph.log.active.includes(0), yLog = graph.log.active.includes(1);
  const xLimits = setAxis(graph, "x", variables[x], xLog), yLimits = setAxis(graph, "y", variables[y], yLog);
  const trend = trendOf(x, y, xLog, yLog), lines = { xs: [], ys: [], colour: [] }, fits = [], far = [];

  const series = (prefix, title, colour, mark) => {
    const fit = fitOf(trend, column(prefix, x), column(prefix, y));
    const named = title ? `${escaped(title)}: ` : "";
    const drawing = `<svg viewBox="-8 -8 16 16" style="fill:${colour};stroke:${colour}">${mark}</svg>`;
    if (fit) fits.push(`<div class="fit">${drawing}${named}${said(fit, x, y)}</div>`);
    if (fit && !fit.why) {
      const [xs, ys] = drawn(fit, xLimits, yLimits);
      lines.xs.push(xs);
      lines.ys.push(ys);
      lines.colour.push(colour);
    }
    far.push(listed(title || "model", beyond(prefix, x, y, xLimits, yLimits), variables[x], variables[y]));
  };

  setFields(graph.measured, { x: `m_${x}`, y: `m_${y}` });
  const coloured = columns.find((one) => one.name === state.colour);
  const palette = coloured && `${coloured.name} ${state.scheme}`;
  setColour(graph.measured, palette ?? state.scheme, ["fill_color"], coloured ? mapped(coloured) : look().measured);
  series("m_", "measured", look().measured, MEASURED);
  const several = state.shown.size > 1;
  models.forEach((model, i) => {
    const prefix = `p${i}_`, is = state.shown.has(model.name), { points, links, renderers } = graph.models[i];
    for (const renderer of renderers) set(renderer, { visible: is });
    if (!is) return;
    setFields(points, { x: column(prefix, x), y: column(prefix, y) });
    setFields(links, { x0: `m_${x}`, y0: `m_${y}`, x1: column(prefix, x), y1: column(prefix, y) });
    const colour = modelColour(model);
    setColour(points, colour, ["fill_color", "line_color"], colour);
    series(prefix, several ? model.title : "", colour, model.mark);
    for (const name of x === y ? [y] : [y, x]) {
      if (!variables[name].restituted) continue;
      const symbol = variables[x].restituted && x !== y ? `${variables[name].symbol}: ` : "";
      fits.push(`<div class="score">${symbol}${scoreOf(prefix, name)}</div>`);
    }
  });
  graph.lines.data = lines;
  set(graph.note, { text: `<div class="fits">${fits.join("")}</div>${far.join("")}` });
}

// colours of the measured points by a column
function mapped(chosen) {
  const { mappers } = chosen;
  return { field: chosen.key, transform: mappers[state.scheme] };
}

function drawLegend() {
  const chosen = columns.find((one) => one.name === state.colour), legend = byId("colours-legend");
  if (!chosen) { legend.innerHTML = ""; return; }
  const values = source.data[chosen.key], inside = (i) => !state.rows || state.rows[i];
  if (chosen.groups) {
    const counts = new Map();
    for (let i = 0; i < values.length; i++) if (inside(i)) counts.set(values[i], (counts.get(values[i]) ?? 0) + 1);
    const colours = palettes[state.scheme];
    const lines = chosen.groups.flatMap((text, i) => !counts.has(text) ? [] : [
      `<li><i class="dot" style="background:${colours[i % colours.length]}"></i>` +
      `<span>${escaped(text) || "(empty)"}</span><small>${counts.get(text)}</small></li>`]);
    const more = lines.length > GROUPS_LISTED ? `<li>and ${lines.length - GROUPS_LISTED} more</li>` : "";
    legend.innerHTML = `<ul>${lines.slice(0, GROUPS_LISTED).join("")}${more}</ul>`;
  } else {
    const empty = Array.from(values).filter((value, i) => inside(i) && !Number.isFinite(value)).length;
    legend.innerHTML =
      `<div class="ramp" style="background:linear-gradient(90deg,${palettes.scale.join(",")})"></div>` +
      `<div class="ends"><span>${number(chosen.ends[0])}</span><span>${number(chosen.ends[1])}</span></div>` +
      (empty ? `<small>${empty} without a value in grey</small>` : "");
  }
}

function drawModels() {
  for (const model of models) {
    const item = byId(`model-${model.name}`);
    item.querySelector("input").checked = state.shown.has(model.name);
    item.style.setProperty("--mark", state.shown.has(model.name) ? modelColour(model) : model.colour);
  }
}

function draw() {
  setScheme();
  const rows = passingRows();
  if (JSON.stringify(rows) !== JSON.stringify(state.rows ?? null)) {
    state.rows = rows;
    passing.booleans = rows;
  }
  graphs.forEach(drawGraph);
  drawLegend();
  drawModels();
  const all = source.data.trajectory.length, left = rows ? rows.filter(Boolean).length : all;
  byId("left").textContent = rows ? `${left} of ${all} impacts pass the filters` : "";
  const chosen = source.selected.indices;
  const names = chosen.slice(0, 12).map((i) => `${escaped(source.data.trajectory[i])}/${source.data.impact[i]}`);
  set(selection, {
    text: chosen.length
      ? `<b>${chosen.length} selected:</b> ${names.join(", ")}${chosen.length > 12 ? " …" : ""}`
      : "Drag a box in a graph, or click a point: the same impacts light up in all graphs.",
  });
}

// The reader's choices

function made(tag, fields = {}, ...inside) {
  const element = Object.assign(document.createElement(tag), fields);
  element.append(...inside);
  return element;
}

function listModels() {
  for (const model of models) {
    const box = made("input", { type: "checkbox" });
    box.onchange = () => {
      if (box.checked) state.shown.add(model.name); else state.shown.delete(model.name);
      draw();
    };
    const only = made("button", { type: "button", textContent: "only", title: `Show ${model.title} alone` });
    only.onclick = () => { state.shown = new Set([model.name]); draw(); };
    const mark = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    mark.setAttribute("viewBox", "-8 -8 16 16");
    mark.innerHTML = model.mark;
    const item = made("li", { id: `model-${model.name}` }, made("label", {}, box, mark, made("span", { textContent: model.title })), only);
    byId("models").append(item);
  }
}

function chooseRun() {
  if (!other) return;
  ["Mean", "One draw per impact"].forEach((text, run) => {
    const button = made("input", { type: "radio", name: "run", checked: run === 1 });
    button.onchange = () => {  // the other run's values for those that are shown
      const shown = Object.fromEntries(Object.keys(other).map((name) => [name, source.data[name]]));
      const next = { ...other };
      Object.assign(other, shown);
      source.data = { ...source.data, ...next };
    };
    byId("run").append(made("label", {}, button, text));
  });
}

const options = (first) => [
  made("option", { value: "", textContent: first }),
  ...columns.map((one) => made("option", { value: one.name, textContent: one.title })),
];

function chooseColours() {
  const select = byId("colours");
  select.append(...options("one colour"));
  select.onchange = () => { state.colour = select.value; draw(); };
}

function chooseFilters() {
  const select = byId("filter");
  select.append(...options("add a filter …"));
  select.onchange = () => {
    const chosen = columns.find((one) => one.name === select.value);
    select.value = "";
    if (chosen && !state.filters.some((one) => one.key === chosen.key)) addFilter(chosen);
  };
}

function addFilter(chosen) {
  const filter = { key: chosen.key, low: null, high: null, texts: chosen.groups ? new Set() : null };
  const remove = made("button", { type: "button", textContent: "×", title: "Remove this filter" });
  const part = made("div", { className: "filter" }, made("div", { className: "of" }, chosen.title, remove));
  remove.onclick = () => {
    state.filters = state.filters.filter((one) => one !== filter);
    part.remove();
    draw();
  };
  state.filters.push(filter);
  byId("filters").append(part);
  if (chosen.groups) part.append(...textFilter(chosen, filter)); else part.append(rangeFilter(chosen, filter));
}

function rangeFilter(chosen, filter) {
  const values = Array.from(source.data[chosen.key]).filter(Number.isFinite);
  const end = (name, value, hint) => {
    const field = made("input", { type: "number", step: "any", placeholder: String(Number(value.toPrecision(4))) });
    field.setAttribute("aria-label", `${hint} ${chosen.title}`);
    field.onchange = () => { filter[name] = field.value === "" ? null : Number(field.value); draw(); };
    return field;
  };
  return made("div", { className: "range" }, end("low", least(values), "lowest"), "to", end("high", greatest(values), "highest"));
}

function textFilter(chosen, filter) {
  const list = made("div", { className: "texts" });
  const fill = (wanted) => {
    const found = chosen.groups.filter((text) => text.toLowerCase().includes(wanted.toLowerCase()));
    list.replaceChildren(...found.slice(0, TEXTS_LISTED).map((text) => {
      const box = made("input", { type: "checkbox", checked: filter.texts.has(text) });
      box.onchange = () => {
        if (box.checked) filter.texts.add(text); else filter.texts.delete(text);
        draw();
      };
      return made("label", {}, box, text || "(empty)");
    }));
    if (found.length > TEXTS_LISTED) list.append(`and ${found.length - TEXTS_LISTED} more: type a part of the name`);
  };
  fill("");
  if (chosen.groups.length <= GROUPS_LISTED) return [list];
  const search = made("input", { type: "search", placeholder: "part of the name" });
  search.oninput = () => fill(search.value);
  return [search, list];
}

if (!state.ready) {
  state.ready = true;
  listModels();
  chooseRun();
  chooseColours();
  chooseFilters();
  dark.addEventListener("change", draw);
  state.edited = edited?.value;
}
if (edited && edited.value !== state.edited) {  // the model whose parameters are moved is among those that are shown
  if (state.shown.size < 2) state.shown.clear();
  state.edited = edited.value;
  state.shown.add(edited.value);
}
draw();
