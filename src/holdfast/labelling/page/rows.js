// Plots of all fingers, one below the other, each with its labels and proposals; lines across them.

import { byId, legendEntry, make, setText, swatch } from "../web/dom.js";
import { TimePlot, decadeRange, drawLevel, roundedRange, shadeStates } from "../web/plot.js";
import { number, stateKey, timeText, unitWord } from "../web/text.js";
import { colours, fingerColour } from "../web/theme.js";
import { doubtElement, labelElement, place, placeAll, proposalElement } from "./intervals.js";

const LINES = ["play", "snap", "hover"]; // across all rows, each an element

// Return key, name and colour of each force line; `force` is "xyz" or one series.
function forceLines(force, finger) {
  if (force === "xyz") return ["x", "y", "z"].map((axis) => ({ key: `F_${axis}`, name: `F${axis}`, colour: `axis-${axis}` }));
  return [{ key: force, name: force === "F_a" ? "|F|" : `F${force.at(-1)}`, colour: fingerColour(finger) }];
}

// A row of one finger: a legend, plots of force and sigma, and strips of labels and proposals.
class Row {
  constructor(rows, finger, index) {
    Object.assign(this, { rows, finger });
    const { view, editor, force } = rows, name = make("h3", "", swatch(fingerColour(index)), make("span", "", finger));
    name.title = finger;
    this.lines = [...forceLines(force, index), { key: "sigma", name: "σ", colour: "muted" }];
    this.values = new Map();
    const entries = this.lines.map((line) => {
      const [entry, value] = legendEntry(line.colour, line.name);
      this.values.set(line.key, value);
      return entry;
    });
    const legend = make("section", "finger-legend", name, make("small", "unit", unitWord(editor.recording.unit[finger])), ...entries);
    const [forceBox, sigmaBox] = ["force", "sigma"].map((kind) => make("div", `holder ${kind}`));
    this.parts = { force: forceBox, sigma: sigmaBox, ...Object.fromEntries(["labels", "proposals", "doubts"].map((kind) => [kind, make("div", kind)])) };
    this.element = make("div", "finger-row", legend, make("div", "signals", ...Object.values(this.parts)));
    byId("stack").append(this.element);
    const shared = { window: () => [view.start, view.end], behind: (plot) => shadeStates(plot, this.states()) };
    this.plots = [
      new TimePlot(forceBox, { ...shared, lines: this.lines.slice(0, -1).map(({ colour }) => colour), range: (_, low, high) => this.forceRange(low, high) }),
      new TimePlot(sigmaBox, { ...shared, lines: [this.lines.at(-1).colour], range: decadeRange, log: true, front: (plot) => this.drawChangePoints(plot) }),
    ];
  }

  states() { return this.rows.editor.labels(this.finger).map(({ state, start, end }) => [stateKey(state), start, end]); }

  // Return the range of the visible window, or else of the whole recording.
  forceRange(low, high) {
    const { scaleToWindow, force, signals } = this.rows;
    this.range ??= this.wholeRange(signals.coarse?.fingers[this.finger]);
    const [from, to] = (scaleToWindow ? [low, high] : this.range ?? [0, 1]).map((value) => value ?? 0);
    return roundedRange(force === "F_a" ? 0 : from, to, 1e-3);
  }

  wholeRange(columns) {
    if (!columns) return null;
    const values = this.lines.slice(0, -1).flatMap(({ key }) => columns[key]).filter((value) => value !== null);
    return values.length ? [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))] : null;
  }

  // Mark the change points, unless they are too dense to be distinguished.
  drawChangePoints(plot) {
    const { changePoints, view } = this.rows;
    const visible = (changePoints[this.finger] ?? []).filter((time) => time > view.start && time < view.end);
    if (visible.length > view.width / 8) return;
    for (const time of visible) drawLevel(plot, "x", time, colours.muted, [3, 1000]);
  }

  drawSignals() {
    const columns = this.rows.signals.columns(this.finger);
    if (!columns) return;
    const { t, sigma } = columns;
    this.plots[0].draw([t, ...this.lines.slice(0, -1).map(({ key }) => columns[key])]);
    this.plots[1].draw([t, sigma.map((value) => (value > 0 ? value : null))]);
  }

  drawLabels(target) {
    const { view, editor } = this.rows, { finger, parts } = this, open = new Set(editor.proposals.map(({ item }) => item));
    const selected = editor.preview || editor.selected?.finger !== finger ? null : editor.selected;
    const doubtful = editor.reviewItems.filter((each) => each.finger === finger);
    const isDoubtful = (item) => doubtful.some((each) => each.kind === "proposal" && each.item === item);
    const proposals = (editor.recording.proposals[finger] ?? []).filter((item) => !editor.isRejected(finger, item));
    placeAll(parts.labels, view, editor.labels(finger), (item) => labelElement(view, item, selected));
    placeAll(parts.proposals, view, proposals, (item) => proposalElement(item, open.has(item), target?.item === item, isDoubtful(item)));
    placeAll(parts.doubts, view, doubtful.filter(({ kind }) => kind === "label").map(({ item }) => item), (item) => doubtElement(item, editor.focus?.item === item));
    for (const plot of this.plots) plot.repaint();
  }

  /** Show values in the legend; null shows dashes. */
  showValues(values) {
    for (const [key, element] of this.values) setText(element, number(values?.[key]));
  }

  /** Return the part at a height of the screen [px]: "labels", "proposals" or "plot". */
  zoneAt(y) {
    const [labels, proposals] = [this.parts.labels, this.parts.proposals].map((part) => part.getBoundingClientRect().top);
    return y < labels ? "plot" : y < proposals ? "labels" : "proposals";
  }
}

export class Rows {
  constructor(editor, view, signals) {
    Object.assign(this, { editor, view, signals });
    this.force = "F_a"; // the series that is drawn, or "xyz"
    this.scaleToWindow = false; // vertical axes fit the window, or else the whole recording
    this.changePoints = {}; // times [s] by finger
    this.hover = null; // what is under the pointer
    this.hoveredProposal = null;
    this.playTime = this.snapTime = null; // [s]
    this.target = () => null; // the item that Enter accepts
    this.rows = [];
    this.pending = null; // parts to draw at the next frame
    new ResizeObserver(() => this.resize()).observe(byId("surface"));
  }

  /** Show the recording of the editor. */
  open() {
    this.changePoints = {};
    this.hover = this.snapTime = this.hoveredProposal = null;
    this.build();
    this.resize();
  }

  build() {
    for (const row of this.rows) row.plots.forEach((plot) => plot.destroy());
    this.rows.forEach((row) => row.element.remove());
    this.rows = this.editor.fingers.map((finger, index) => new Row(this, finger, index));
    this.redraw("signals", "labels");
  }

  resize() {
    this.view.width = Math.max(50, byId("surface").clientWidth);
    this.view.changed();
  }

  showForce(force) {
    this.force = force;
    this.build();
  }

  rowAt(y) { return this.rows.find(({ element }) => y < element.getBoundingClientRect().bottom) ?? this.rows.at(-1); }

  /** Draw parts at the next frame of the browser: "signals", "labels"; the lines in any case. */
  redraw(...parts) {
    if (!this.pending) requestAnimationFrame(() => this.draw());
    this.pending = new Set([...(this.pending ?? []), ...parts]);
  }

  draw() {
    const parts = this.pending, target = this.target();
    this.pending = null;
    for (const row of this.rows) {
      if (parts.has("signals")) row.drawSignals();
      if (parts.has("labels")) row.drawLabels(target);
    }
    this.drawLines();
    // Tests wait for this attribute.
    if (parts.has("signals") && this.signals.coarse) document.body.dataset.painted = "1";
  }

  drawLines() {
    const { view, hover } = this, times = { play: this.playTime, snap: this.snapTime, hover: hover?.time ?? null };
    const at = (element, time) => place(element, view, { start: time, end: time + 1e-9 });
    for (const name of LINES) byId(`${name}-line`).hidden = times[name] === null || !at(byId(`${name}-line`), times[name]);
    if (hover) setText(byId("hover-time"), `${timeText(hover.time, view.secondsPerPixel)} s`);
    byId("hover-line").classList.toggle("turned", view.x(times.hover) > view.width - 80);
    byId("markers").replaceChildren(...(this.editor.recording.markers ?? []).map(
      ([time, text]) => at(make("div", "marker", make("span", "", text)), time)).filter(Boolean));
    const time = times.hover ?? times.play;
    for (const row of this.rows) row.showValues(time === null ? null : this.signals.valuesAt(row.finger, time));
  }
}
