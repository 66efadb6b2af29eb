// Force, instability and probability over a common time, drawn by uPlot.

import { make, setText } from "../web/dom.js";
import { colours, fingerColour, font } from "../web/theme.js";
import uPlot from "./uplot/uPlot.esm.js";
import { RIBBON, level, markers, ribbons, shade } from "./plot_layers.js";
import { reduce } from "./store.js";
import { number, unitWord } from "./format.js";

const FONT = font(11);
const AXES = [["fx", "x"], ["fy", "y"], ["fz", "z"]];

// Steps that leave the ends of an axis where they are while the data change a little.
function rounded(low, high, least) {
  const size = Math.max(high - low, least), step = 10 ** Math.floor(Math.log10(size)) / 4;
  return [Math.floor(low / step) * step, Math.ceil(high / step) * step];
}

const decades = (plot, low, high) => (low > 0 && high > 0
  ? [10 ** Math.floor(Math.log10(low)), 10 ** Math.max(Math.ceil(Math.log10(high)), Math.floor(Math.log10(low)) + 1)]
  : [0.1, 10]);

export class Plots {
  constructor(stack) {
    this.stack = stack;
    this.window = 10;
    this.chosen = null; // a finger's name, or null for all
    this.marks = []; // times of markers [s]
    this.rows = [];
    this.resize = new ResizeObserver(() => this.fit());
  }

  /** Begins anew for the fingers of a hello. */
  start(hello, store) {
    this.fingers = hello.fingers;
    this.names = Object.keys(hello.fingers);
    this.store = store;
    this.marks = [];
    if (!this.names.includes(this.chosen)) this.chosen = null;
    this.build();
  }

  mark(time) {
    this.marks = [...this.marks, time].slice(-50);
  }

  build() {
    for (const row of this.rows) row.plot.destroy();
    this.resize.disconnect();
    this.stack.querySelectorAll(".plot").forEach((old) => old.remove());
    this.rows = this.kinds().map((kind, k, all) => this.row(kind, k === all.length - 1));
    this.fit();
    for (const row of this.rows) this.resize.observe(row.holder);
  }

  kinds() {
    const unit = unitWord((this.fingers[this.chosen ?? this.names[0]] ?? {}).unit);
    const brief = this.chosen === null; // the names stand at the first plot, or on the buttons
    const own = (column) => (this.chosen === null
      ? this.names.map((name, k) => ({ finger: name, column, label: name, colour: fingerColour(k) }))
      : [{ finger: this.chosen, column, label: this.chosen, colour: fingerColour(this.names.indexOf(this.chosen)) }]);
    const force = this.chosen === null
      ? { title: "Force |F|", lines: own("force"), range: (plot, low, high) => this.above(plot, high) }
      : {
        title: "Force", range: (plot, low, high) => rounded(low ?? 0, high ?? 0, 10),
        lines: AXES.map(([column, axis]) => ({ finger: this.chosen, column, label: `F${axis}`, colour: colours[`axis-${axis}`] })),
      };
    return [
      { ...force, key: "force", unit, brief: brief && this.names.length > 4 },
      { key: "sigma", title: "Instability σ", brief, lines: own("sigma"), range: decades, log: true },
      { key: "probability", title: "P(stable)", brief, lines: own("probability"), range: () => [-0.04, 1.04] },
    ];
  }

  // From nought, with room for the ribbons above the lines.
  above(plot, high) {
    const tall = Math.max(40, plot.bbox.height / (window.devicePixelRatio || 1));
    const share = (this.names.length * RIBBON + 6) / tall;
    return [0, rounded(0, Math.max(high ?? 0, 0) / (1 - Math.min(0.5, share)), 10)[1]];
  }

  row(kind, last) {
    const values = kind.lines.map(() => make("span", "value", number(null)));
    const legend = make("div", kind.brief ? "legend brief" : "legend", ...kind.lines.map((entry, k) => {
      const swatch = make("i", "swatch");
      swatch.style.background = entry.colour;
      const item = make("span", "entry", swatch, make("span", "label", entry.label), values[k]);
      item.title = entry.label;
      return item;
    }));
    const title = make("h3", "", kind.title, make("small", "", kind.unit ?? ""));
    const holder = make("div", "holder");
    const box = make("div", `plot ${kind.key}${last ? " last" : ""}`, make("div", "gutter", title, legend), holder);
    this.stack.append(box);
    const row = { kind, holder, values, x: [0], picks: [] };
    row.plot = new uPlot(this.options(row, last), [[], ...kind.lines.map(() => [])], holder);
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
        { ...axis, size: last ? 22 : 4, gap: 3, values: (_, ticks) => ticks.map((t) => (last ? seconds(t) : "")) },
        {
          ...axis, size: 50, gap: 5, space: kind.log ? 16 : 22,
          ...(kind.key === "probability" ? { splits: [0, 0.5, 1] } : {}),
          ...(kind.log ? { splits: powers, filter: (_, ticks) => ticks } : {}),
          values: (_, ticks) => ticks.map((v) => (v === null ? null : tick(v))),
        },
      ],
      series: [{}, ...kind.lines.map((entry) => ({
        // Jagged lines of more than a pixel are slow to paint without a graphics card.
        stroke: entry.colour, width: this.window > 10 ? 1 : 1.75, points: { show: false }, spanGaps: false,
      }))],
      hooks: {
        drawClear: [(plot) => this.behind(plot, row)],
        draw: [(plot) => this.over(plot, row)],
        setCursor: [() => this.read(row)],
      },
    };
  }

  behind(plot, row) {
    const of = (codes) => row.picks.map((place) => codes[place]);
    const state = this.chosen === null ? this.store.hand : this.store.fingers.get(this.chosen).state;
    shade(plot, row.x, of(state));
    if (this.chosen !== null || row.kind.key !== "force") return;
    ribbons(plot, row.x, this.names.map((name) => of(this.store.fingers.get(name).state)));
  }

  over(plot, row) {
    const now = this.store.latest;
    markers(plot, this.marks.map((time) => time - now));
    if (row.kind.key !== "probability") return;
    const shown = this.chosen === null ? this.names : [this.chosen];
    for (const value of new Set(shown.map((name) => this.fingers[name].probability_threshold))) {
      if (Number.isFinite(value)) level(plot, value);
    }
  }

  // Values beside the plot: under the cursor, or the newest.
  read(row) {
    const at = row.plot.cursor.idx ?? row.x.length - 1;
    row.values.forEach((element, k) => setText(element, number(row.plot.data[k + 1]?.[at])));
  }

  draw(store) {
    this.store = store;
    for (const row of this.rows) {
      const arrays = row.kind.lines.map(({ finger, column }) => store.fingers.get(finger)[column]);
      const { x, columns, picks } = reduce(store, this.window, 600, arrays);
      // A logarithm has no place for nought.
      const shown = row.kind.log ? columns.map((values) => values.map((v) => (v > 0 ? v : null))) : columns;
      Object.assign(row, { x, picks });
      row.plot.setData([x, ...shown]);
      this.read(row);
    }
  }

  fit() {
    for (const { plot, holder } of this.rows) {
      const { width, height } = holder.getBoundingClientRect();
      if (width > 50 && height > 20) plot.setSize({ width: Math.floor(width), height: Math.floor(height) });
    }
  }
}

// Whole decades, every second one where they stand close.
function powers(plot, _, low, high) {
  const [from, to] = [low, high].map((value) => Math.round(Math.log10(value)));
  const step = Math.max(1, Math.ceil((15 * (to - from)) / Math.max(16, plot.height - 14)));
  return Array.from({ length: Math.floor((to - from) / step) + 1 }, (__, k) => 10 ** (from + k * step));
}

const seconds = (t) => (t === 0 ? "now" : `${String(t).replace("-", "−")} s`);
const tick = (v) => (Math.abs(v) >= 10000 ? `${v / 1000}k` : String(Number(v.toPrecision(3))).replace("-", "−"));
