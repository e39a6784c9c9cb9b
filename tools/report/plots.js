'use strict';
// Draws what the page's data say: `curves` by Chart.js, `courses` over time by dygraphs.

// Told apart without red and green (Okabe and Ito); points differ in shape as well.
const colours = ['#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000',
                 '#8C8C8C'];
const shapes = ['circle', 'triangle', 'rect', 'crossRot', 'star'];
const dashes = [5, 4];
const bandColour = 'rgba(0, 0, 0, 0.10)', spanColour = 'rgba(0, 114, 178, 0.10)';
// What bears the same name has the same colour in every chart of the page.
const names = [];
const colourOf = (name) => {
  if (!names.includes(name)) names.push(name);
  return colours[names.indexOf(name) % colours.length];
};

// The first are drawn with the page, so that who takes its picture at once has them. What is not in
// sight of the rest is drawn once it comes there, or before it is printed.
const atOnce = 24;
const waiting = new Map();
const drawWaiting = (element) => {
  const draw = waiting.get(element);
  waiting.delete(element);
  observer.unobserve(element);
  if (draw) draw();
};
const observer = new IntersectionObserver(
  (entries) => entries.filter((e) => e.isIntersecting).forEach((e) => drawWaiting(e.target)),
  {rootMargin: '600px'});
let asked = 0;
const drawInSight = (element, draw) => {
  if (asked++ < atOnce) return draw();
  waiting.set(element, draw);
  observer.observe(element);
};

const drawCurve = ([id, title, xLabel, yLabel, series]) => {
  let shape = 0;  // of the next points
  const datasets = series.map(([label, line, dashed, band, xy]) => {
    const points = [];
    for (let k = 0; k + 1 < xy.length; k += 2) points.push({x: xy[k], y: xy[k + 1]});
    const colour = band ? 'transparent' : colourOf(label);
    return {label, data: points, showLine: line, borderColor: colour,
            backgroundColor: band ? bandColour : colour, fill: band && label ? '-1' : false,
            borderWidth: line ? 1.5 : 1, borderDash: dashed ? dashes : [],
            // The lowest lies on top.
            order: band ? 2 : line ? 1 : points.length === 1 ? -1 : 0,
            pointStyle: line ? 'line' : shapes[shape++ % shapes.length],
            pointBorderWidth: points.length === 1 ? 2 : 1,
            pointRadius: line ? 0 : points.length === 1 ? 7 : 3};
  });
  const chart = new Chart(document.getElementById(id), {
    type: 'scatter',
    data: {datasets},
    options: {
      animation: false, maintainAspectRatio: false, normalized: true,
      interaction: {mode: 'nearest', intersect: false},
      plugins: {title: {display: true, text: title},
                legend: {display: datasets.length > 1,
                         labels: {boxWidth: 12, filter: (item) => item.text !== ''}}},
      scales: {x: {title: {display: true, text: xLabel}}, y: {title: {display: true, text: yLabel}}}
    }
  });
  zoomByDrag(chart);
  return chart;
};

// The mouse draws the part to be seen; a double click shows everything again. A tap makes the plot
// as wide as the page, another one small again.
const zoomByDrag = (chart) => {
  const {canvas} = chart;
  const frame = canvas.parentElement.appendChild(document.createElement('div'));
  frame.className = 'frame';
  let from = null;
  const at = (event) => {
    const box = canvas.getBoundingClientRect(), area = chart.chartArea;
    return [Math.min(area.right, Math.max(area.left, event.clientX - box.left)),
            Math.min(area.bottom, Math.max(area.top, event.clientY - box.top))];
  };
  const spanned = (event) => {
    const [x, y] = at(event);
    return [Math.min(x, from[0]), Math.max(x, from[0]), Math.min(y, from[1]), Math.max(y, from[1])];
  };
  const show = (x, y) => {
    Object.assign(chart.options.scales.x, {min: x[0], max: x[1]});
    Object.assign(chart.options.scales.y, {min: y[0], max: y[1]});
    chart.update();
  };
  canvas.addEventListener('pointerdown', (event) => {
    if (event.pointerType !== 'mouse') return;
    from = at(event);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!from) return;
    const [left, right, top, bottom] = spanned(event);
    frame.style.cssText = `display:block;left:${left}px;top:${top}px;width:${right - left}px;` +
                          `height:${bottom - top}px`;
  });
  canvas.addEventListener('pointerup', (event) => {
    if (!from) return;
    const [left, right, top, bottom] = spanned(event);
    from = null;
    frame.style.display = 'none';
    const {x, y} = chart.scales, least = 8;  // pixels: less is a click
    if (right - left < least || bottom - top < least) return;
    show([x.getValueForPixel(left), x.getValueForPixel(right)],
         [y.getValueForPixel(bottom), y.getValueForPixel(top)]);
  });
  canvas.addEventListener('dblclick', () => show([undefined, undefined], [undefined, undefined]));
  canvas.addEventListener('click', () => {
    if (!matchMedia('(pointer: coarse)').matches) return;
    canvas.parentElement.classList.toggle('wide');
    chart.resize();
  });
};
const charts = [];
for (const curve of curves) {
  drawInSight(document.getElementById(curve[0]), () => charts.push(drawCurve(curve)));
}

const missing = 65535;  // code of no value

// First index from `from` on whose time is not before t.
const lowerBound = (times, t, from = 0, to = times.length) => {
  while (from < to) {
    const middle = (from + to) >> 1;
    if (times[middle] < t) from = middle + 1; else to = middle;
  }
  return from;
};

const decoded = ([name, style, low, step, text]) => {
  const bytes = atob(text);
  const codes = new Uint16Array(bytes.length / 2);
  for (let i = 0; i < codes.length; ++i) {
    codes[i] = bytes.charCodeAt(2 * i) | bytes.charCodeAt(2 * i + 1) << 8;
  }
  return {name, style, low, step, codes};
};

// Panels over one time axis. A view shows each sample; where they outnumber the pixels, the least
// and the greatest of each pixel.
class Courses {
  constructor(spec) {
    this.spec = spec;
    this.times = new Float64Array(spec.count);
    this.begins = spec.runs.map(([first]) => first);  // of runs without a gap
    spec.runs.forEach(([first, t], r) => {
      const end = r + 1 < spec.runs.length ? spec.runs[r + 1][0] : spec.count;
      for (let i = first; i < end; ++i) this.times[i] = t + (i - first) * spec.period;
    });
    this.panels = spec.panels.map((panel) => ({...panel, series: panel.series.map(decoded)}));
    this.named = this.panels.find((panel) => panel.lanes.length === 0);  // has the marks' names
    this.from = this.times[0];
    this.to = this.times[spec.count - 1];
    this.gap = (spec.period || 1) / 2;
    if (!spec.period || this.from === this.to) { this.from -= this.gap; this.to += this.gap; }
    this.graphs = [];
    this.busy = false;
  }

  // Ranges of samples, one a pixel; null: a gap.
  pieces(first, end, from, width) {
    const {times, begins} = this;
    const out = [];
    let run = lowerBound(begins, first);
    for (let i = first; i < end;) {
      if (i > 0 && begins[run] === i) out.push(null);
      if (begins[run] === i) ++run;
      const most = Math.min(end, run < begins.length ? begins[run] : end);
      const limit = from + (Math.floor((times[i] - from) / width) + 1) * width;
      const j = lowerBound(times, limit, i + 1, most);
      out.push([i, j]);
      i = j;
    }
    return out;
  }
  // What is in view, a sample beyond either side.
  view(from, to) {
    const {times} = this;
    const first = Math.max(0, lowerBound(times, from) - 1);
    const end = Math.min(times.length, lowerBound(times, to) + 2);
    return this.pieces(first, end, from, (to - from) / this.pixels());
  }
  rows(panel, pieces) {
    const {series, levels} = panel;
    const heights = panel.lanes.length ? [0] : levels.map((level) => level[1]);  // lanes have no line
    const out = [];
    let before = this.from;
    for (const piece of pieces) {
      if (piece === null) {
        out.push([before + this.gap, ...series.map(() => null), ...heights]);
        continue;
      }
      const [i, end] = piece;
      before = this.times[end - 1];
      const head = [this.times[i]], tail = [before];
      for (const {low, step, codes} of series) {
        let least = missing, greatest = -1, atLeast = 0, atGreatest = 0;
        for (let k = i; k < end; ++k) {
          const code = codes[k];
          if (code === missing) continue;
          if (code < least) { least = code; atLeast = k; }
          if (code > greatest) { greatest = code; atGreatest = k; }
        }
        const value = (code) => greatest < 0 ? null : low + code * step;
        const rises = atLeast <= atGreatest;
        head.push(value(rises ? least : greatest));
        tail.push(value(rises ? greatest : least));
      }
      out.push(head.concat(heights));
      if (end - i > 1) out.push(tail.concat(heights));
    }
    return out;
  }

  // Beside the view what one may move to, as coarse as a view of everything.
  show(from, to) {
    this.busy = true;
    this.shown = [from, to];
    const whole = from <= this.from && to >= this.to;
    const pieces = whole ? [] : this.view(from, to);
    this.graphs.forEach((graph, p) => {
      if (whole) {
        graph.updateOptions({file: this.overview[p], dateWindow: [from, to]});
        return;
      }
      const rows = this.rows(this.panels[p], pieces), all = this.overview[p];
      const first = rows[0][0], last = rows[rows.length - 1][0];
      const file = [...all.filter((row) => row[0] < first), ...rows,
                    ...all.filter((row) => row[0] > last)];
      graph.updateOptions({file, dateWindow: [from, to]});
    });
    this.busy = false;
  }
  pixels() { return Math.max(100, this.element.clientWidth - 60); }

  draw(element) {
    this.element = element;
    this.shown = [this.from, this.to];
    const pieces = this.view(this.from, this.to);
    this.overview = this.panels.map((panel) => this.rows(panel, pieces));
    this.time = element.appendChild(document.createElement('div'));
    this.time.className = 'time';
    this.panels.forEach((panel, p) => this.drawPanel(panel, p));
    this.tellTime();
  }
  tellTime(t) {
    const {spec} = this;
    this.time.textContent = t === undefined
      ? matchMedia('(pointer: coarse)').matches
        ? 'two fingers: zoom; bar below: move' : 'drag: zoom, shift and drag: move, double click: everything'
      : spec.names.length > 0 ? spec.names[lowerBound(this.times, t)]
      : (t + spec.offset).toFixed(3) + ' s';
  }
  drawPanel(panel, p) {
    const {spec, element} = this;
    const last = p + 1 === this.panels.length;
    const legend = element.appendChild(document.createElement('div'));
    legend.className = 'legend';
    const place = element.appendChild(document.createElement('div'));
    place.className = 'course';
    const {lanes} = panel;
    place.style.height = (lanes.length ? 26 * lanes.length : 120 + (last ? 0 : 16)) + (last ? 66 : 4) + 'px';
    const labels = [...panel.series.map((s) => s.name), ...panel.levels.map((level) => level[0])];
    if (lanes.length) labels.push('lanes');
    const series = {};
    panel.series.forEach(({name, style}) => {
      series[name] = {
        strokePattern: style === 'dashed' ? dashes : null, stepPlot: style === 'steps',
        ...(style === 'points' ? {plotter: pointsOf, pointSize: 4} : {}),
        ...(style === 'whiskers' ? {plotter: whiskersOf} : {}),
        ...(style === 'hidden' ? {plotter: () => {}} : {})};
    });
    panel.levels.forEach(([name]) => { series[name] = {strokePattern: dashes}; });
    if (lanes.length) series.lanes = {plotter: () => {}, pointSize: 0, highlightCircleSize: 0};
    const axes = {
      x: {drawAxis: last, axisLabelFormatter: (t) => String(Number(t.toPrecision(9))),
          ticker: spec.names.length ? wholeTicks : Dygraph.numericTicks, valueFormatter: String},
      y: {axisLabelWidth: 55, pixelsPerLabel: 22, valueFormatter: shortly, axisLabelFormatter: shortly,
          ...(lanes.length ? {ticker: () => [], drawGrid: false} : {})}};
    const graph = new Dygraph(place, this.overview[p], {
      labels: [spec.label, ...labels], series, axes,
      colors: labels.map(colourOf), labelsDiv: legend, legend: 'always',
      legendFormatter: (data) => this.legend(panel, data), strokeWidth: 1.2, xRangePad: 0,
      dateWindow: [this.from, this.to], valueRange: lanes.length ? [0, lanes.length] : null,
      xlabel: last ? spec.label : null, xLabelHeight: 16, highlightCircleSize: 3,
      yRangePad: lanes.length ? 0 : 6, connectSeparatedPoints: false, drawGapEdgePoints: false,
      showRangeSelector: last && spec.period > 0, rangeSelectorHeight: 22,
      interactionModel: interaction,
      underlayCallback: (context, area, g) => this.underlay(panel, context, area, g),
      highlightCallback: (event, t, points, row) => this.point(graph, t, row),
      unhighlightCallback: () => this.point(graph),
      drawCallback: (g, initial) => {
        if (this.busy || initial) return;
        const [from, to] = g.xAxisRange();
        if (from !== this.shown[0] || to !== this.shown[1]) {
          this.show(Math.max(from, this.from), Math.min(to, this.to));
        }
      }});
    this.graphs.push(graph);
  }
  // The same instant in every panel.
  point(graph, t, row) {
    this.tellTime(t);
    for (const each of this.graphs) {
      if (each === graph) continue;
      if (t === undefined) each.clearSelection(); else each.setSelection(row);
    }
  }
  legend(panel, data) {
    const what = '<span class="what">' + escaped(panel.label) + '</span>';
    if (panel.lanes.length) {
      const standing = data.x === undefined ? [] : panel.lanes.filter(([, , spans]) =>
        spans.some((t, i) => i % 2 === 0 && t <= data.x && data.x <= spans[i + 1]));
      return what + standing.map(([name]) => '<span class="series">' + escaped(name) +
                                 '</span>').join('');
    }
    const hidden = panel.series.filter((s) => s.style === 'hidden').map((s) => s.name);
    return what + data.series.filter((s) => !hidden.includes(s.label)).map((s) =>
      '<span class="series" style="color:' + s.color + '">' + s.dashHTML + ' ' +
      escaped(s.label) + (s.yHTML === undefined ? '' : ' <b>' + s.yHTML + '</b>') +
      '</span>').join('');
  }
  underlay(panel, context, area, graph) {
    const {spec} = this;
    const box = (from, to, top, height, colour) => {
      const left = Math.max(area.x, graph.toDomXCoord(from));
      const right = Math.min(area.x + area.w, graph.toDomXCoord(to));
      if (right < left) return;
      context.fillStyle = colour;
      context.fillRect(left, top, Math.max(1, right - left), height);
    };
    context.save();
    for (let i = 0; i < spec.spans.length; i += 2) {
      box(spec.spans[i], spec.spans[i + 1], area.y, area.h, spanColour);
    }
    for (const [low, high] of panel.bands) {
      const top = graph.toDomYCoord(high);
      context.fillStyle = bandColour;
      context.fillRect(area.x, top, area.w, graph.toDomYCoord(low) - top);
    }
    panel.lanes.forEach(([name, kind, spans], lane) => {
      const top = area.y + 26 * lane;
      let drawn = -1;  // pixel: thousands of spans are as many as there are pixels
      for (let i = 0; i < spans.length; i += 2) {
        const right = graph.toDomXCoord(spans[i + 1]);
        if (right < drawn) continue;
        box(spans[i], spans[i + 1], top + 15, 9, colours[kind]);
        drawn = right + 0.5;
      }
      context.fillStyle = '#222';
      context.font = '11px sans-serif';
      context.fillText(name, area.x + 3, top + 12);
    });
    context.strokeStyle = '#888';
    context.fillStyle = '#222';
    context.font = '11px sans-serif';
    context.setLineDash(dashes);
    let named = area.x;  // up to there a name stands already
    for (const [t, name] of spec.marks) {
      const x = graph.toDomXCoord(t);
      if (x < area.x || x > area.x + area.w) continue;
      context.beginPath();
      context.moveTo(x, area.y);
      context.lineTo(x, area.y + area.h);
      context.stroke();
      if (panel !== this.named) continue;
      const width = context.measureText(name).width + 6;
      const left = x + width < area.x + area.w ? x : x - width;
      if (left < named) continue;
      context.fillText(name, left + 3, area.y + 11);
      named = left + width;
    }
    context.restore();
  }
}

const shortly = (y) => String(Number(y.toPrecision(4)));
const escaped = (text) =>
  text.replace(/[&<>"]/g, (c) => ({'&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;'})[c]);

// A value with its interval, in the two series after it.
const pointsOf = (e) => {
  e.drawingContext.fillStyle = e.color;
  for (const p of e.points) {
    if (!Number.isFinite(p.canvasy)) continue;
    e.drawingContext.beginPath();
    e.drawingContext.arc(p.canvasx, p.canvasy, 3, 0, 2 * Math.PI);
    e.drawingContext.fill();
  }
};
const whiskersOf = (e) => {
  const {drawingContext: context, allSeriesPoints: all, seriesIndex: at} = e;
  context.strokeStyle = e.color;
  context.lineWidth = 1;
  e.points.forEach((p, i) => {
    const low = all[at + 1][i], high = all[at + 2][i];
    if (!low || !high || !Number.isFinite(low.canvasy) || !Number.isFinite(high.canvasy)) return;
    context.beginPath();
    context.moveTo(p.canvasx, low.canvasy);
    context.lineTo(p.canvasx, high.canvasy);
    context.stroke();
  });
  pointsOf(e);
};

const wholeTicks = (...all) => Dygraph.numericTicks(...all).filter(({v}) => Number.isInteger(v));

// One finger scrolls the page, two zoom.
const interaction = {
  ...Dygraph.defaultInteractionModel,
  touchstart: (event, graph, context) => {
    if (event.touches.length > 1) {
      Dygraph.defaultInteractionModel.touchstart(event, graph, context);
    }
  }
};

const stacks = [];
for (const spec of courses) {
  const element = document.getElementById(spec.id);
  drawInSight(element, () => {
    const stack = new Courses(spec);
    stacks.push(stack);
    stack.draw(element);
  });
}

// Of a chart's title, legend and axes, pixels.
const letters = (chart, size) => {
  const {plugins, scales} = chart.options, font = {size};
  plugins.title.font = {size, weight: 'bold'};
  plugins.title.padding = size / 2;
  Object.assign(plugins.legend.labels, {font, boxWidth: size, boxHeight: size, padding: size / 2});
  for (const scale of [scales.x, scales.y]) {
    scale.title.font = font;
    scale.ticks.font = font;
  }
  chart.update();
};

// A page of paper is narrower than most windows.
const paperWidth = 660;
window.addEventListener('beforeprint', () => {
  [...waiting.keys()].forEach(drawWaiting);
  for (const {graphs} of stacks) {
    for (const graph of graphs) graph.resize(paperWidth, graph.graphDiv.parentElement.clientHeight);
  }
  for (const chart of charts) {
    letters(chart, 8);
    if (chart.canvas.closest('.beside')) chart.resize(paperWidth / 2, 250);
    else chart.resize(paperWidth / 3, 190);
  }
});
window.addEventListener('afterprint', () => {
  for (const {graphs} of stacks) {
    for (const graph of graphs) {
      graph.graphDiv.parentElement.style.width = '';
      graph.resize();
    }
  }
  for (const chart of charts) {
    letters(chart, 12);
    chart.resize();
  }
});
