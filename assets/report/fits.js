// SPDX-License-Identifier: GPL-3.0-or-later
// Fits and scores of any pair of variables, as in core/analysis/curves.py, robust_slope.py and graph_scores.py

const ROUNDING = 1e-7, POINTS = 60, LISTED_PAIRS = 400;

function digits(value) {
  if (!Number.isFinite(value)) return "–";
  const tiny = value !== 0 && Math.abs(value) < 1e-4;
  const [mantissa, exponent] = (tiny ? value.toExponential(2) : value.toPrecision(3)).split("e");
  const power = exponent ? `·10<sup>${Number(exponent)}</sup>` : "";
  return (mantissa + power).replaceAll("-", "−");
}

const twoDecimals = (value) => value.toFixed(2).replace("-", "−");

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

const least = (values) => values.reduce((low, value) => Math.min(low, value), Infinity);

const greatest = (values) => values.reduce((high, value) => Math.max(high, value), -Infinity);

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
  if (x.length <= LISTED_PAIRS) {
    const slopes = [];
    for (let i = 0; i < x.length; i++) {
      for (let j = 0; j < i; j++) if (x[i] !== x[j]) slopes.push((y[i] - y[j]) / (x[i] - x[j]));
    }
    return median(slopes);
  }
  const order = Array.from(x.keys()).sort((a, b) => x[a] - x[b] || y[a] - y[b]);
  const below = (slope) => inversions(Float64Array.from(order, (i) => y[i] - slope * x[i]));
  let pairs = 0;
  for (let i = 1, same = 0; i < order.length; i++) {
    same = x[order[i]] === x[order[i - 1]] ? same + 1 : 0;
    pairs += i - same;
  }
  const rank = (pairs - 1) / 2;
  let low = -1, high = 1;
  while (below(low) > rank) low *= 2;
  while (below(high) <= rank) high *= 2;
  while (high - low > 1e-7 * Math.max(Math.abs(low), Math.abs(high))) {
    const middle = (low + high) / 2;
    if (below(middle) > rank) high = middle; else low = middle;
  }
  return (low + high) / 2;
}

function trendOf(x, y, xLog, yLog) {
  return pairs[`${x} ${y}`] ?? (xLog ? (yLog ? "power" : "logarithm") : yLog ? "exponential" : "line");
}

// the trend of finite points, null when there are none; `why` where nothing can be fitted
function fitted(trend, x, y) {
  if (!x.length) return null;
  const constant = greatest(y) - least(y) <= ROUNDING * greatest(y.map(Math.abs));
  if (constant) y = y.map(() => y[0]);
  const alike = greatest(x) - least(x) <= ROUNDING * greatest(x.map(Math.abs));
  const noRank = x.length < 3 || constant || alike;
  const result = { trend, n: x.length, rank: noRank ? NaN : regression(ranks(x), ranks(y)).correlation };
  const onX = trend === "power" || trend === "logarithm", onY = trend === "power" || trend === "exponential";
  const placed = Array.from(x.keys()).filter((i) => (!onX || x[i] > 0) && (!onY || y[i] > 0));
  x = placed.map((i) => x[i]);
  y = placed.map((i) => y[i]);
  const [low, high] = [least(x), greatest(x)];
  const one = trend === "origin" ? x.every((value) => value === 0) : high - low <= ROUNDING * greatest(x.map(Math.abs));
  if (x.length < 3 || one) {
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
  const rest = (Number.isFinite(fit.rank) ? `, ρ\u00a0=\u00a0${twoDecimals(fit.rank)}` : "") + `, n\u00a0=\u00a0${fit.n}`;
  if (fit.why) return fit.why + rest;
  const [xs, ys] = [variables[x].symbol, variables[y].symbol], { slope, intercept, trend } = fit;
  const sign = slope < 0 ? "−" : "+", isRt = x === "vt1_mps" && y === "vt2_mps";
  const equation =
    trend === "origin" ? (isRt ? "<i>R</i><sub>T</sub>" : ys) + ` = ${digits(slope)}` + (isRt ? "" : ` ${xs}`)
    : slope === 0 ? `${ys} = ${digits(fit.at(fit.low))}`
    : trend === "power" ? `${ys} = ${digits(Math.exp(intercept))} ${xs}<sup>${digits(slope)}</sup>`
    : trend === "exponential" ? `${ys} = ${digits(Math.exp(intercept))} exp(${digits(slope)} ${xs})`
    : `${ys} = ${digits(intercept)} ${sign} ${digits(Math.abs(slope))} ${trend === "logarithm" ? "ln " : ""}${xs}`;
  return equation + (Number.isFinite(fit.r2) ? `, R²\u00a0=\u00a0${twoDecimals(fit.r2)}` : "") + rest;
}

function drawn(fit, xLimits, yLimits) {
  const low = Math.max(xLimits[0], fit.trend === "origin" ? 0 : fit.low), high = Math.min(xLimits[1], fit.high);
  const even = low <= 0 || fit.trend === "exponential";
  const xs = Array.from({ length: low < high ? POINTS : 0 }, (_, i) =>
    even ? low + (high - low) * i / (POINTS - 1) : low * (high / low) ** (i / (POINTS - 1)));
  const seen = xs.filter((x) => fit.at(x) >= yLimits[0] && fit.at(x) <= yLimits[1]);
  return [seen, seen.map(fit.at)];
}

// model − measured in words; the interval by falls, whose impacts' errors are alike
function scored(name, measured, modelled, falls) {
  if (!measured.length) return "no impact has both points";
  const errors = modelled.map((value, i) => value - measured[i]), squares = errors.map((each) => each ** 2);
  const sums = new Map(), counts = new Map(), square = mean(squares), rmse = Math.sqrt(square);
  falls.forEach((fall, i) => {
    sums.set(fall, (sums.get(fall) ?? 0) + squares[i]);
    counts.set(fall, (counts.get(fall) ?? 0) + 1);
  });
  let interval = "";
  if (sums.size > 1 && square > 0) {
    const off = Array.from(sums, ([fall, sum]) => (sum - square * counts.get(fall)) ** 2);
    const error = Math.sqrt(mean(off) * sums.size * sums.size / (sums.size - 1)) / errors.length / square;
    const reach = students[Math.min(sums.size - 1, students.length) - 1] * error / 2;
    interval = ` (${digits(rmse * Math.exp(-reach))}–${digits(rmse * Math.exp(reach))})`;
  }
  const unit = variables[name].unit === "°" ? "°" : variables[name].unit ? ` ${variables[name].unit}` : "";
  const bias = mean(errors);
  return `RMSE ${digits(rmse)}${interval}${unit}, bias ${bias > 0 ? "+" : ""}${digits(bias)}${unit}, ` +
    `median error ${digits(median(errors.map(Math.abs)))}${unit}, n\u00a0=\u00a0${errors.length}`;
}
