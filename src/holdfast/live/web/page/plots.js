// Plots of force, instability and probabilities over time, drawn by uPlot, a script of index.html.

import { make, setText } from "../web/dom.js";
import { colours, fingerColour, font } from "../web/theme.js";
import { RIBBON_HEIGHT, drawLevel, drawMarkers, drawRibbons, shadeStates } from "./plot_layers.js";
import { downsample } from "./store.js";
import { hasSlipRule, number, unitWord } from "./format.js";

const FONT = font(11);
const MAX_MARKERS = 50;
const MAX_BINS = 600;
const PROBABILITIES = ["probability", "slip"];
const AXES = [["fx", "x"], ["fy", "y"], ["fz", "z"]];

// Round the ends of an axis, so that they do not change with every small change of the data.
function roundedRange(low, high, minSize) {
  const size = Math.max(high - low, minSize), step = 10 ** Math.floor(Math.log10(size)) / 4;
  return [Math.floor(low / step) * step, Math.ceil(high / step) * step];
}

const decadeRange = (plot, low, high) => (low > 0 && high > 0
  ? [10 ** Math.floor(Math.log10(low)), 10 ** Math.max(Math.ceil(Math.log10(high)), Math.floor(Math.log10(low)) + 1)]
  : [0.1, 10]);

export class Plots {
  constructor(stack) {
    this.stack = stack;
    this.window = 10;
    this.chosen = null; // a finger's name, or null for all
    this.markers = []; // times [s]
    this.thresholds = {}; // of the live detector, by finger
    this.rows = [];
    this.observer = new ResizeObserver(() => this.resizePlots());
  }

  /** Start with the fingers of a hello message. */
  start(hello, store) {
    this.fingers = hello.fingers;
    this.names = Object.keys(hello.fingers);
    this.store = store;
    this.markers = [];
    this.thresholds = {};
    if (!this.names.includes(this.chosen)) this.chosen = null;
    this.build();
  }

  addMarker(time) {
    this.markers = [...this.markers, time].slice(-MAX_MARKERS);
  }

  /** Create the plots for the chosen finger and window. */
  build() {
    for (const row of this.rows) row.plot.destroy();
    this.observer.disconnect();
    this.stack.querySelectorAll(".plot").forEach((old) => old.remove());
    this.rows = this.plotKinds().map((kind, k, all) => this.makeRow(kind, k === all.length - 1));
    this.resizePlots();
    for (const row of this.rows) this.observer.observe(row.holder);
  }

  plotKinds() {
    const unit = unitWord((this.fingers[this.chosen ?? this.names[0]] ?? {}).unit);
    const brief = this.chosen === null; // the first plot or the buttons show the names
    const lines = (column) => (this.chosen === null
      ? this.names.map((name, k) => ({ finger: name, column, label: name, colour: fingerColour(k) }))
      : [{ finger: this.chosen, column, label: this.chosen, colour: fingerColour(this.names.indexOf(this.chosen)) }]);
    const force = this.chosen === null
      ? { title: "Force |F|", lines: lines("force"), range: (plot, low, high) => this.rangeBelowRibbons(plot, high) }
      : {
        title: "Force", range: (plot, low, high) => roundedRange(low ?? 0, high ?? 0, 10),
        lines: AXES.map(([column, axis]) => ({ finger: this.chosen, column, label: `F${axis}`, colour: colours[`axis-${axis}`] })),
      };
    const kinds = [
      { ...force, key: "force", unit, brief: brief && this.names.length > 4 },
      { key: "sigma", title: "Instability σ", brief, lines: lines("sigma"), range: decadeRange, log: true },
      { key: "probability", title: "P(stable)", brief, lines: lines("probability"), range: () => [-0.04, 1.04] },
      { key: "slip", title: "P(slip)", brief, lines: lines("slip"), range: () => [-0.04, 1.04] },
    ];
    return this.shown().some((name) => hasSlipRule(this.fingers[name])) ? kinds : kinds.slice(0, -1);
  }

  // Names of the fingers in the plots.
  shown() { return this.chosen === null ? this.names : [this.chosen]; }

  // Range from zero, with room for the ribbons above the lines.
  rangeBelowRibbons(plot, high) {
    const height = Math.max(40, plot.bbox.height / (window.devicePixelRatio || 1));
    const share = (this.names.length * RIBBON_HEIGHT + 6) / height;
    return [0, roundedRange(0, Math.max(high ?? 0, 0) / (1 - Math.min(0.5, share)), 10)[1]];
  }

  makeRow(kind, last) {
    const values = kind.lines.map(() => make("span", "value", number(null)));
    const legend = make("div", `legend${kind.brief ? " brief" : ""}${this.chosen === null ? " of-all" : ""}`, ...kind.lines.map((entry, k) => {
      const swatch = make("i", "swatch");
      swatch.style.background = entry.colour;
      const item = make("span", "entry", swatch, make("span", "label", entry.label), values[k]);
      item.title = entry.label;
      return item;
    }));
    const title = make("h3", "", kind.title, make("small", "", kind.unit ?? ""));
    const holder = make("div", "holder");
    const box = make("div", `plot ${kind.key}${last ? " last" : ""}`, make("div", "plot-legend", title, legend), holder);
    this.stack.append(box);
    const row = { kind, holder, values, x: [0], indices: [] };
    row.plot = new window.uPlot(this.options(row, last), [[], ...kind.lines.map(() => [])], holder);
    return row;
  }

  options(row, last) {
    const axis = { font: FONT, stroke: colours.muted, grid: { stroke: colours.grid, width: 1 }, ticks: { show: false } };
    const { kind } = row;
    return {
      width: 300, height: 100, padding: [8, 14, last ? 0 : 2, 0], legend: { show: false },
      cursor: { sync: { key: "time" }, drag: { x: false, y: false }, y: false, points: { size: 6 } },
      scales: {
        x: { time: false, range: () => [-this.window, 0] },
        y: { range: kind.range, distr: kind.log ? 3 : 1 },
      },
      axes: [
        { ...axis, size: last ? 22 : 4, gap: 3, values: (_, ticks) => ticks.map((t) => (last ? timeLabel(t) : "")) },
        {
          ...axis, size: 50, gap: 5, space: kind.log ? 16 : 22,
          ...(PROBABILITIES.includes(kind.key) ? { splits: [0, 0.5, 1] } : {}),
          ...(kind.log ? { splits: decadeTicks, filter: (_, ticks) => ticks } : {}),
          values: (_, ticks) => ticks.map((v) => (v === null ? null : valueLabel(v))),
        },
      ],
      series: [{}, ...kind.lines.map((entry) => ({
        // Without a graphics card, long jagged lines wider than a pixel are slow to draw.
        stroke: entry.colour, width: this.window > 10 ? 1 : 1.75, points: { show: false }, spanGaps: false,
      }))],
      hooks: {
        drawClear: [(plot) => this.drawBackground(plot, row)],
        draw: [(plot) => this.drawOverlay(plot, row)],
        setCursor: [() => this.showValues(row)],
      },
    };
  }

  drawBackground(plot, row) {
    const shown = (codes) => row.indices.map((index) => codes[index]);
    const state = this.chosen === null ? this.store.hand : this.store.fingers.get(this.chosen).state;
    shadeStates(plot, row.x, shown(state));
    if (this.chosen !== null || row.kind.key !== "force") return;
    drawRibbons(plot, row.x, this.names.map((name) => shown(this.store.fingers.get(name).state)));
  }

  drawOverlay(plot, row) {
    const now = this.store.latest;
    drawMarkers(plot, this.markers.map((time) => time - now));
    if (!PROBABILITIES.includes(row.kind.key)) return;
    const thresholdOf = row.kind.key === "slip"
      ? (name) => this.fingers[name].slip_threshold
      : (name) => this.thresholds[name] ?? this.fingers[name].probability_threshold;
    for (const value of new Set(this.shown().map(thresholdOf))) {
      // A threshold of 1 is that of a model that reports no slip until it is calibrated.
      if (Number.isFinite(value) && value < 1) drawLevel(plot, value);
    }
  }

  // Show the values at the cursor, or the newest, beside the plot.
  showValues(row) {
    const index = row.plot.cursor.idx ?? row.x.length - 1;
    row.values.forEach((element, k) => setText(element, number(row.plot.data[k + 1]?.[index])));
  }

  draw(store) {
    this.store = store;
    for (const row of this.rows) {
      const arrays = row.kind.lines.map(({ finger, column }) => store.fingers.get(finger)[column]);
      const { x, columns, indices } = downsample(store, this.window, MAX_BINS, arrays);
      // A logarithmic axis cannot show zero.
      const shown = row.kind.log ? columns.map((values) => values.map((v) => (v > 0 ? v : null))) : columns;
      Object.assign(row, { x, indices });
      row.plot.setData([x, ...shown]);
      this.showValues(row);
    }
  }

  resizePlots() {
    for (const { plot, holder } of this.rows) {
      const { width, height } = holder.getBoundingClientRect();
      if (width > 50 && height > 20) plot.setSize({ width: Math.floor(width), height: Math.floor(height) });
    }
  }
}

// Return ticks at whole decades, fewer if they would be too close.
function decadeTicks(plot, _, low, high) {
  const [from, to] = [low, high].map((value) => Math.round(Math.log10(value)));
  const step = Math.max(1, Math.ceil((15 * (to - from)) / Math.max(16, plot.height - 14)));
  return Array.from({ length: Math.floor((to - from) / step) + 1 }, (__, k) => 10 ** (from + k * step));
}

const timeLabel = (t) => (t === 0 ? "now" : `${String(t).replace("-", "−")} s`);
const valueLabel = (v) => (Math.abs(v) >= 10000 ? `${v / 1000}k` : String(Number(v.toPrecision(3))).replace("-", "−"));
