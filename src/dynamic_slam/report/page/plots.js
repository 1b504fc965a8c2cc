// Drawing: SVG elements, scales, line and stacked charts, paths, bars. Everything is drawn anew when its width changes.

const SVG_NS = "http://www.w3.org/2000/svg";

function element(tag, attributes, parent, text) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes || {})) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

function shape(tag, attributes, parent, text) {
  const made = document.createElementNS(SVG_NS, tag);
  for (const [key, value] of Object.entries(attributes || {})) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

const isNumber = (value) => typeof value === "number" && Number.isFinite(value);
const colour = (name) => `var(--${name})`;

// About four digits, without an exponent where that is readable.
function short(value) {
  if (!isNumber(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-4)) return value.toExponential(2);
  return String(Number(value.toPrecision(size >= 1000 ? 6 : 4)));
}

// Steps of 1, 2 or 5 times a power of ten, about `count` of them.
function ticks(low, high, count) {
  const raw = (high - low) / Math.max(1, count);
  if (!(raw > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) found.push(Number((k * step).toPrecision(12)));
  return found;
}

// Index of the sorted number nearest to the value.
function nearest(sorted, value) {
  let low = 0, high = sorted.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] < value) low = middle + 1; else high = middle;
  }
  return low > 0 && value - sorted[low - 1] <= sorted[low] - value ? low - 1 : low;
}

function extent(values, low = Infinity, high = -Infinity) {
  for (const value of values) {
    if (!isNumber(value)) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return [low, high];
}

// The moment that all plots of a run point at, in seconds from its start; null: none.
const cursor = {
  time: null,
  times: [],
  watchers: [],
  set(time) {
    this.time = time;
    for (const watch of this.watchers) watch(time);
  },
  step(by) {
    if (this.times.length === 0) return;
    const at = this.time === null ? (by > 0 ? -1 : this.times.length) : nearest(this.times, this.time);
    this.set(this.times[Math.min(this.times.length - 1, Math.max(0, at + by))]);
  },
};

function handleKeys(svg) {
  svg.setAttribute("tabindex", "0");
  svg.addEventListener("keydown", (event) => {
    const by = event.shiftKey ? 10 : 1;
    const last = cursor.times.length - 1;
    if (event.key === "ArrowLeft") cursor.step(-by);
    else if (event.key === "ArrowRight") cursor.step(by);
    else if (event.key === "Home" && last >= 0) cursor.set(cursor.times[0]);
    else if (event.key === "End" && last >= 0) cursor.set(cursor.times[last]);
    else if (event.key === "Escape") cursor.set(null);
    else return;
    event.preventDefault();
  });
}

// Calls draw(svg, width) now and when the width changes.
function drawing(parent, label, height, draw) {
  const svg = shape("svg", { role: "img", "aria-label": label, height }, parent);
  let width = 0;
  const redraw = () => {
    const now = Math.round(parent.clientWidth);
    if (now <= 0 || now === width) return;
    width = now;
    svg.replaceChildren();
    svg.setAttribute("viewBox", `0 0 ${width} ${typeof height === "number" ? height : svg.clientHeight}`);
    draw(svg, width);
  };
  new ResizeObserver(redraw).observe(parent);
  redraw();
  return svg;
}

function legend(parent, entries, isStroke) {
  const row = element("div", { class: "legend" }, parent);
  return entries.map(({ name, colour: c, unit }) => {
    const item = element("span", {}, row);
    element("i", { style: `background:${colour(c)}`, class: isStroke ? "stroke" : "" }, item);
    item.append(name + " ");
    return { value: element("b", {}, item), unit: unit || "" };
  });
}

// Path of a curve; where there are more points than pixels, the least and the greatest of each pixel's.
function curvePath(xs, ys, toX, toY, gap) {
  let d = "", pen = false, column = null;
  const dense = xs.length > 4 * (toX(xs[xs.length - 1]) - toX(xs[0]));
  const flush = () => {
    if (!column) return;
    const [a, b] = column.lowFirst ? [column.low, column.high] : [column.high, column.low];
    d += `${pen ? "L" : "M"}${column.x} ${toY(a).toFixed(1)}`;
    if (a !== b) d += `L${column.x} ${toY(b).toFixed(1)}`;
    pen = true;
    column = null;
  };
  for (let i = 0; i < xs.length; ++i) {
    if (!isNumber(ys[i])) { flush(); pen = false; continue; }
    if (gap && i > 0 && xs[i] - xs[i - 1] > gap) { flush(); pen = false; }
    if (!dense) {
      d += `${pen ? "L" : "M"}${toX(xs[i]).toFixed(1)} ${toY(ys[i]).toFixed(1)}`;
      pen = true;
      continue;
    }
    const x = Math.round(toX(xs[i]));
    if (column && column.x !== x) flush();
    if (!column) column = { x, low: ys[i], high: ys[i], lowFirst: true };
    else if (ys[i] < column.low) { column.low = ys[i]; column.lowFirst = false; }
    else if (ys[i] > column.high) { column.high = ys[i]; column.lowFirst = true; }
  }
  flush();
  return d;
}

// A gap in time after which a line is broken.
function usualGap(times) {
  const steps = times.slice(1).map((t, i) => t - times[i]).sort((a, b) => a - b);
  return steps.length ? 5 * steps[steps.length >> 1] : 0;
}

const MARGIN = { left: 50, right: 10, top: 8, bottom: 22 };

function axes(svg, width, height, xRange, yRange, unit, xName) {
  const right = width - MARGIN.right, bottom = height - MARGIN.bottom;
  const toX = (x) => MARGIN.left + ((x - xRange[0]) / (xRange[1] - xRange[0] || 1)) * (right - MARGIN.left);
  const toY = (y) => bottom - ((y - yRange[0]) / (yRange[1] - yRange[0] || 1)) * (bottom - MARGIN.top);
  const grid = shape("g", { stroke: colour("grid") }, svg);
  for (const y of ticks(yRange[0], yRange[1], Math.max(2, (bottom - MARGIN.top) / 34))) {
    shape("path", { d: `M${MARGIN.left} ${toY(y)}H${right}` }, grid);
    shape("text", { x: MARGIN.left - 7, y: toY(y) + 4, "text-anchor": "end" }, svg, short(y));
  }
  const name = xName === undefined ? " s" : "";
  for (const x of ticks(xRange[0], xRange[1], (right - MARGIN.left) / 90)) {
    shape("path", { d: `M${toX(x)} ${MARGIN.top}V${bottom}` }, grid);
    shape("text", { x: toX(x), y: bottom + 15, "text-anchor": "middle" }, svg, short(x) + name);
  }
  if (xName) shape("text", { x: right, y: bottom - 5, "text-anchor": "end" }, svg, xName);
  return { toX, toY, right, bottom };
}

// A hair line at the cursor, and the values there in the legend.
function followCursor(svg, width, range, plot, times, series, items) {
  const hair = shape("path", { stroke: colour("ink"), "stroke-opacity": 0.5, display: "none", class: "cursor" }, svg);
  const show = (time) => {
    const isIn = time !== null && times.length > 0;
    hair.setAttribute("display", isIn ? "inline" : "none");
    if (!isIn) { items.forEach((item) => { item.value.textContent = ""; }); return; }
    const at = nearest(times, time);
    hair.setAttribute("d", `M${plot.toX(time)} ${MARGIN.top}V${plot.bottom}`);
    items.forEach((item, i) => { item.value.textContent = isNumber(series[i].v[at]) ? `${short(series[i].v[at])} ${item.unit}` : "–"; });
  };
  const point = (event) => {
    const box = svg.getBoundingClientRect();
    const x = ((event.clientX - box.left) * width) / box.width;
    const time = range[0] + ((x - MARGIN.left) / (plot.right - MARGIN.left)) * (range[1] - range[0]);
    cursor.set(cursor.times[nearest(cursor.times, time)]);
  };
  svg.onpointermove = point;
  svg.onpointerdown = point;
  svg.onpointerleave = () => cursor.set(null);
  svg.showCursor = show;
  show(cursor.time);
}

// chart: {title, unit, kind: line | stack | step, t, series: [{name, v, colour}]}
function timeChart(parent, chart, range) {
  const figure = element("figure", { class: "plot" }, parent);
  element("h3", {}, figure, chart.unit ? `${chart.title} [${chart.unit}]` : chart.title);
  const isStack = chart.kind === "stack";
  const items = legend(figure, chart.series.map((s) => ({ ...s, unit: chart.unit })), !isStack);
  const height = 150;
  let layers = chart.series.map((s) => s.v);
  if (isStack) {
    let below = chart.t.map(() => 0);
    layers = layers.map((values) => (below = below.map((b, i) => b + (values[i] || 0))));
  }
  const top = extent(layers.flat(), 0)[1];
  const gap = usualGap(chart.t);
  const svg = drawing(figure, `${chart.title} over time`, height, (svg, width) => {
    const plot = axes(svg, width, height, range, [0, top > 0 ? top * 1.05 : 1], chart.unit);
    for (let k = layers.length - 1; k >= 0; --k) {
      const c = colour(chart.series[k].colour);
      const d = curvePath(chart.t, layers[k], plot.toX, plot.toY, isStack ? 0 : gap);
      if (isStack && chart.t.length > 1) {
        const end = plot.toX(chart.t[chart.t.length - 1]), begin = plot.toX(chart.t[0]);
        shape("path", { d: `${d}L${end.toFixed(1)} ${plot.bottom}L${begin.toFixed(1)} ${plot.bottom}Z`, fill: c, class: "curve" }, svg);
      } else {
        shape("path", { d, fill: "none", stroke: c, "stroke-width": chart.series[k].wide ? 4 : 1.5, "stroke-linejoin": "round",
                        "stroke-opacity": chart.series[k].wide ? 0.45 : 1, class: "curve" }, svg);
      }
    }
    followCursor(svg, width, range, plot, chart.t, chart.series, items);
  });
  handleKeys(svg);
  cursor.watchers.push((time) => svg.showCursor && svg.showCursor(time));
}

// chart: {title, xName, yName, curves: [{name, colour, x, y}]}, over any axis.
function lineChart(parent, chart) {
  const figure = element("figure", { class: "plot" }, parent);
  element("h3", {}, figure, chart.title);
  legend(figure, chart.curves, true);
  const height = 260;
  const [, xMax] = extent(chart.curves.flatMap((c) => c.x)), [, yMax] = extent(chart.curves.flatMap((c) => c.y));
  const [xMin] = extent(chart.curves.flatMap((c) => c.x), 0), [yMin] = extent(chart.curves.flatMap((c) => c.y), 0);
  const xRange = [xMin, chart.xMax || xMax], yRange = [yMin, chart.yMax || yMax * 1.05];
  drawing(figure, chart.title, height, (svg, width) => {
    const plot = axes(svg, width, height, xRange, yRange, "", chart.xName || "");
    shape("text", { x: MARGIN.left + 6, y: MARGIN.top + 10 }, svg, chart.yName || "");
    for (const c of chart.curves) {
      shape("path", { d: curvePath(c.x, c.y, plot.toX, plot.toY, 0), fill: "none", stroke: colour(c.colour),
                      "stroke-width": 2, "stroke-linejoin": "round", class: "curve" }, svg);
    }
  });
}

// Blue to red; readable on white and on black, and told apart by brightness too.
const RAMP = ["#3058b8", "#2492b8", "#2fae86", "#a3b83a", "#e6b031", "#e87a2f", "#cf3838"];
const BINS = 28;

function rampColour(share) {
  const at = Math.min(0.9999, Math.max(0, share)) * (RAMP.length - 1), k = Math.floor(at), part = at - k;
  const channel = (hex, c) => parseInt(hex.slice(1 + 2 * c, 3 + 2 * c), 16);
  const mixed = [0, 1, 2].map((c) => Math.round((1 - part) * channel(RAMP[k], c) + part * channel(RAMP[k + 1], c)));
  return `rgb(${mixed.join(",")})`;
}

function colourBar(parent, scale) {
  const figure = element("figure", { class: "colour-bar" }, parent);
  element("h3", {}, figure, `${scale.title} [${scale.unit}]`);
  drawing(figure, `Colours of the ${scale.title}`, 34, (svg, width) => {
    const left = 4, right = Math.min(width - 12, 520);
    for (let k = 0; k < BINS; ++k) {
      const w = (right - left) / BINS;
      shape("rect", { x: left + k * w, y: 2, width: w + 0.6, height: 10, fill: rampColour((k + 0.5) / BINS) }, svg);
    }
    for (const value of ticks(scale.min, scale.max, (right - left) / 90)) {
      const x = left + ((value - scale.min) / (scale.max - scale.min || 1)) * (right - left);
      shape("text", { x, y: 27, "text-anchor": x < left + 12 ? "start" : x > right - 12 ? "end" : "middle" }, svg, short(value));
    }
  });
}

// One view of the paths: two of the three axes, to scale.
function pathView(parent, section, view, height) {
  const figure = element("figure", { class: "plot" }, parent);
  element("h3", {}, figure, view.title);
  const along = (p) => [p[view.x].map((v) => v * view.sx), p[view.y].map((v) => v * view.sy)];
  const tracks = section.tracks.map((track) => ({ ...track, xy: along(track.p), gap: usualGap(track.t) }));
  const truth = section.truth ? along(section.truth) : null;
  const points = section.points ? along(section.points) : null;
  const lines = tracks.map((t) => t.xy).concat(truth ? [truth] : []);
  const [x0, x1] = extent(lines.flatMap((l) => l[0])), [y0, y1] = extent(lines.flatMap((l) => l[1]));
  const svg = drawing(figure, `${section.title}, ${view.title}`, height, (svg, width) => {
    const left = 46, right = 8, top = 6, bottom = 22;
    const scale = 1.14 * Math.max((x1 - x0) / (width - left - right), (y1 - y0) / (height - top - bottom), 1e-9);
    const midX = (left + width - right) / 2, midY = (top + height - bottom) / 2;
    const toX = (x) => midX + (x - (x0 + x1) / 2) / scale, toY = (y) => midY - (y - (y0 + y1) / 2) / scale;
    const fromX = (px) => (px - midX) * scale + (x0 + x1) / 2, fromY = (py) => (midY - py) * scale + (y0 + y1) / 2;
    const clip = `clip${Math.random().toString(36).slice(2)}`;
    shape("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom },
          shape("clipPath", { id: clip }, svg));
    const grid = shape("g", { stroke: colour("grid") }, svg);
    const step = Math.max(width - left, height - top) / 80;
    const xs = ticks(fromX(left), fromX(width - right), step * (width - left) / Math.max(width - left, height - top));
    const gridStep = xs.length > 1 ? xs[1] - xs[0] : 1;
    for (const x of xs) {
      shape("path", { d: `M${toX(x)} ${top}V${height - bottom}` }, grid);
      shape("text", { x: toX(x), y: height - bottom + 15, "text-anchor": "middle" }, svg, short(x));
    }
    for (let k = Math.ceil(fromY(height - bottom) / gridStep); k * gridStep <= fromY(top); ++k) {
      const y = k * gridStep;
      shape("path", { d: `M${left} ${toY(y)}H${width - right}` }, grid);
      shape("text", { x: left - 7, y: toY(y) + 4, "text-anchor": "end" }, svg, short(Number(y.toPrecision(12))));
    }
    shape("text", { x: width - right - 4, y: height - bottom - 5, "text-anchor": "end" }, svg, `${view.xName} [${section.unit}]`);
    shape("text", { x: left + 5, y: top + 12 }, svg, `${view.yName} [${section.unit}]`);
    const inside = shape("g", { "clip-path": `url(#${clip})`, fill: "none", "stroke-linejoin": "round", "stroke-linecap": "round" }, svg);
    if (points) {
      let d = "";
      for (let i = 0; i < points[0].length; ++i) d += `M${toX(points[0][i]).toFixed(1)} ${toY(points[1][i]).toFixed(1)}h0`;
      shape("path", { d, stroke: colour("c6"), "stroke-width": 1.6, "stroke-opacity": 0.45, class: "landmarks" }, inside);
    }
    const line = (xy, from, to) => {
      let d = "";
      for (let i = from; i <= to; ++i) d += `${d ? "L" : "M"}${toX(xy[0][i]).toFixed(1)} ${toY(xy[1][i]).toFixed(1)}`;
      return d;
    };
    if (truth) {
      shape("path", { d: line(truth, 0, truth[0].length - 1), stroke: colour("truth"), "stroke-width": 1.6,
                      "stroke-dasharray": "1.5 4.5", class: "truth" }, inside);
    }
    for (const track of tracks) {
      const bins = new Map();
      for (let i = 1; i < track.t.length; ++i) {
        if (track.gap && track.t[i] - track.t[i - 1] > track.gap) continue;
        const error = track.e ? track.e[i] : null;
        const bin = section.colour && isNumber(error)
          ? Math.min(BINS - 1, Math.floor((BINS * (error - section.colour.min)) / (section.colour.max - section.colour.min || 1))) : -1;
        bins.set(bin, (bins.get(bin) || "") + line(track.xy, i - 1, i));
      }
      for (const [bin, d] of bins) {
        shape("path", { d, stroke: bin < 0 ? colour(track.colour) : rampColour((bin + 0.5) / BINS),
                        "stroke-width": track.e ? 2.6 : 1.8, class: "track" }, inside);
      }
    }
    const marker = shape("circle", { r: 5.5, fill: colour("card"), stroke: colour("ink"), "stroke-width": 2, display: "none", class: "cursor" }, svg);
    const main = tracks[0];
    if (!main || main.t.length === 0) return;
    const ends = shape("g", { "stroke-width": 2, stroke: colour("ink") }, svg);
    shape("circle", { cx: toX(main.xy[0][0]), cy: toY(main.xy[1][0]), r: 3.5, fill: colour("card") }, ends);
    shape("title", {}, ends, "start");
    svg.showCursor = (time) => {
      marker.setAttribute("display", time === null ? "none" : "inline");
      if (time === null) return;
      const i = nearest(main.t, time);
      marker.setAttribute("cx", toX(main.xy[0][i]));
      marker.setAttribute("cy", toY(main.xy[1][i]));
    };
    svg.onpointermove = (event) => {
      const box = svg.getBoundingClientRect();
      const px = ((event.clientX - box.left) * width) / box.width, py = ((event.clientY - box.top) * height) / box.height;
      let best = -1, least = 40 * 40;
      for (let i = 0; i < main.t.length; ++i) {
        const away = (toX(main.xy[0][i]) - px) ** 2 + (toY(main.xy[1][i]) - py) ** 2;
        if (away < least) { least = away; best = i; }
      }
      cursor.set(best < 0 ? null : main.t[best]);
    };
    svg.onpointerleave = () => cursor.set(null);
    svg.showCursor(cursor.time);
  });
  handleKeys(svg);
  cursor.watchers.push((time) => svg.showCursor && svg.showCursor(time));
}

// rows: [{name, values: [{v, lo, hi} or null, ...]}], a value for each of the series.
function barChart(parent, section) {
  const figure = element("figure", { class: "plot" }, parent);
  if (section.series.length > 1) legend(figure, section.series, false);
  const bar = 15, between = 12, row = section.series.length * bar + between;
  const height = section.rows.length * row + 30;
  const high = extent(section.rows.flatMap((r) => r.values.flatMap((v) => (v ? [v.v, v.hi] : []))), 0)[1] || 1;
  drawing(figure, section.title, height, (svg, width) => {
    const left = Math.min(210, 0.36 * width), right = width - 70;
    const toX = (v) => left + (v / (high * 1.02)) * (right - left);
    for (const x of ticks(0, high, (right - left) / 90)) {
      shape("path", { d: `M${toX(x)} 4V${height - 22}`, stroke: colour("grid") }, svg);
      shape("text", { x: toX(x), y: height - 8, "text-anchor": "middle" }, svg, short(x));
    }
    shape("text", { x: width, y: height - 8, "text-anchor": "end" }, svg, section.unit);
    section.rows.forEach((r, k) => {
      const y = 6 + k * row;
      const most = Math.max(6, Math.floor(left / 6.4));
      const name = r.name.length > most ? "…" + r.name.slice(1 - most) : r.name;
      const text = shape("text", { x: left - 8, y: y + (row - between) / 2 + 4, "text-anchor": "end" }, svg, name);
      shape("title", {}, text, r.name);
      r.values.forEach((value, s) => {
        if (!value) { shape("text", { x: left + 4, y: y + s * bar + 11 }, svg, "–"); return; }
        shape("rect", { x: left, y: y + s * bar + 1, width: Math.max(1, toX(value.v) - left), height: bar - 3, rx: 3,
                        fill: colour(section.series[s].colour), class: "bar" }, svg);
        const end = isNumber(value.hi) ? value.hi : value.v, middle = y + s * bar + bar / 2 - 0.5;
        if (isNumber(value.hi) && value.hi > value.lo) {
          shape("path", { d: `M${toX(value.lo)} ${middle}H${toX(value.hi)}M${toX(value.hi)} ${middle - 3}v6`, stroke: colour("ink"),
                          "stroke-opacity": 0.6, fill: "none" }, svg);
        }
        shape("text", { x: toX(end) + 6, y: middle + 4 }, svg, short(value.v));
      });
    });
  });
}
