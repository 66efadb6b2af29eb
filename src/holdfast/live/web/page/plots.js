// Plots of force, instability and probabilities over time, of all fingers or of one.

import { legendEntry, make, setText } from "../web/dom.js";
import { TimePlot, decadeRange, drawLevel, pixelRange, pixelRatio, roundedRange, shadeStates } from "../web/plot.js";
import { MINUS, number, stateKey, unitWord } from "../web/text.js";
import { colours, fingerColour } from "../web/theme.js";
import { STATES, hasSlipRule } from "./format.js";
import { downsample } from "./store.js";

const MAX_MARKERS = 50;
const MAX_BINS = 600;
const RIBBON_HEIGHT = 6; // [px], including the gap
const PROBABILITIES = ["probability", "slip"];

// Yield the runs of equal states over the points of a plot, as (key, from, to).
function* runs(x, codes) {
  let first = 0;
  for (let k = 1; k <= x.length; k += 1) {
    if (k < x.length && codes[k] === codes[first]) continue;
    yield [stateKey(STATES[codes[first]]), x[first], x[Math.min(k, x.length - 1)]];
    first = k;
  }
}

// Draw a thin ribbon of states for each finger, along the top of the plot.
function drawRibbons(plot, x, rows) {
  const context = plot.ctx, ratio = pixelRatio();
  rows.forEach((codes, row) => {
    for (const [key, from, to] of runs(x, codes)) {
      const [left, right] = pixelRange(plot, from, to);
      context.fillStyle = colours[`${key}-line`];
      context.fillRect(left, plot.bbox.top + (2 + row * RIBBON_HEIGHT) * ratio, Math.max(1, right - left), (RIBBON_HEIGHT - 2) * ratio);
    }
  });
}

export class Plots {
  constructor(stack) {
    this.stack = stack;
    this.window = 10; // [s]
    this.chosen = null; // a finger's name, or null for all
    this.rows = [];
  }

  /** Start with the fingers of a hello message. */
  start(hello, store) {
    Object.assign(this, { fingers: hello.fingers, names: Object.keys(hello.fingers), store });
    this.markers = []; // times [s]
    this.thresholds = {}; // of the live detector, by finger
    this.show(this.names.includes(this.chosen) ? this.chosen : null, this.window);
  }

  addMarker(time) { this.markers = [...this.markers, time].slice(-MAX_MARKERS); }

  // Names of the fingers in the plots.
  get shown() { return this.chosen === null ? this.names : [this.chosen]; }

  /** Create the plots of a finger, null for all, over a window [s]. */
  show(chosen, window) {
    Object.assign(this, { chosen, window });
    for (const row of this.rows) {
      row.plot.destroy();
      row.box.remove();
    }
    this.rows = this.kinds().map((kind, k, all) => this.makeRow(kind, k === all.length - 1));
  }

  kinds() {
    const unit = unitWord(this.fingers[this.shown[0]]?.unit), probability = () => [-0.04, 1.04];
    const lines = (column) => this.shown.map((finger) => ({ finger, column, label: finger, colour: fingerColour(this.names.indexOf(finger)) }));
    const axes = ["x", "y", "z"].map((axis) => ({ finger: this.chosen, column: `f${axis}`, label: `F${axis}`, colour: `axis-${axis}` }));
    const force = this.chosen === null
      ? { title: "Force |F|", lines: lines("force"), range: (plot, _, high) => this.rangeBelowRibbons(plot, high ?? 0) }
      : { title: "Force", lines: axes, range: (_, low, high) => roundedRange(low ?? 0, high ?? 0, 10) };
    const kinds = [
      { ...force, key: "force", unit },
      { key: "sigma", title: "Instability σ", lines: lines("sigma"), range: decadeRange, log: true },
      { key: "probability", title: "P(stable)", lines: lines("probability"), range: probability, ticks: [0, 0.5, 1] },
      { key: "slip", title: "P(slip)", lines: lines("slip"), range: probability, ticks: [0, 0.5, 1] },
    ];
    return kinds.slice(0, this.shown.some((name) => hasSlipRule(this.fingers[name])) ? 4 : 3);
  }

  // Range from zero, with room for the ribbons above the lines.
  rangeBelowRibbons(plot, high) {
    const share = (this.names.length * RIBBON_HEIGHT + 6) / Math.max(40, plot.bbox.height / pixelRatio());
    return [0, roundedRange(0, high / (1 - Math.min(0.5, share)), 10)[1]];
  }

  makeRow(kind, isLast) {
    const entries = kind.lines.map(({ colour, label }) => legendEntry(colour, label));
    const legend = make("div", `legend${this.chosen === null ? " of-all" : ""}`, ...entries.map(([entry]) => entry)), holder = make("div", "holder");
    const title = make("h3", "", kind.title, make("small", "", kind.unit ?? ""));
    const box = make("div", `plot ${kind.key}${isLast ? " last" : ""}`, make("div", "plot-legend", title, legend), holder);
    this.stack.append(box);
    const row = { kind, box, values: entries.map(([, value]) => value), x: [0], indices: [] };
    row.plot = new TimePlot(holder, {
      ...kind, lines: kind.lines.map(({ colour }) => colour), window: () => [-this.window, 0],
      // Without a graphics card, long jagged lines wider than a pixel are slow to draw.
      width: this.window > 10 ? 1 : 1.75, padding: [8, isLast ? 0 : 4],
      times: isLast ? (time) => (time === 0 ? "now" : `${String(time).replace("-", MINUS)} s`) : null,
      behind: (plot) => this.drawBackground(plot, row), front: (plot) => this.drawOverlay(plot, row), moved: () => this.showValues(row),
    });
    return row;
  }

  drawBackground(plot, { x, indices, kind }) {
    const codes = (state) => indices.map((index) => state[index]), { hand, fingers } = this.store;
    shadeStates(plot, runs(x, codes(this.chosen === null ? hand : fingers.get(this.chosen).state)));
    if (this.chosen === null && kind.key === "force") drawRibbons(plot, x, this.names.map((name) => codes(fingers.get(name).state)));
  }

  drawOverlay(plot, { kind }) {
    for (const time of this.markers) drawLevel(plot, "x", time - this.store.latest, colours.marker, [2, 3]);
    if (!PROBABILITIES.includes(kind.key)) return;
    const thresholds = this.shown.map((name) => (kind.key === "slip"
      ? this.fingers[name].slip_threshold : this.thresholds[name] ?? this.fingers[name].probability_threshold));
    for (const value of new Set(thresholds)) {
      // A threshold of 1 is that of a model that reports no slip until it is calibrated.
      if (Number.isFinite(value) && value < 1) drawLevel(plot, "y", value, colours.muted, [6, 4]);
    }
  }

  // Show the values at the cursor, or the newest, beside the plot.
  showValues({ plot: { plot }, x, values }) {
    const index = plot.cursor.idx ?? x.length - 1;
    values.forEach((element, k) => setText(element, number(plot.data[k + 1]?.[index])));
  }

  draw(store) {
    this.store = store;
    for (const row of this.rows) {
      const arrays = row.kind.lines.map(({ finger, column }) => store.fingers.get(finger)[column]);
      const { x, columns, indices } = downsample(store, this.window, MAX_BINS, arrays);
      Object.assign(row, { x, indices });
      // A logarithmic axis cannot show zero.
      row.plot.draw([x, ...(row.kind.log ? columns.map((values) => values.map((v) => (v > 0 ? v : null))) : columns)]);
      this.showValues(row);
    }
  }
}
