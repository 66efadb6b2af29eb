// Plots of all fingers, one below the other. Each layer has its own canvas, so that a movement of
// the pointer redraws only the cursor: labels at the bottom, then signals, then the cursor.

import { byId, make, setText } from "../web/dom.js";
import { colours, fingerColour, font } from "../web/theme.js";
import { drawLine, prepareCanvas } from "./canvas.js";
import { drawBackground, drawLabels, drawProposals, drawReviewItems, drawSelection, drawTarget, shadeStates } from "./draw_labels.js";
import { drawAxis, drawSeries, forceLines, forceScale, sigmaScale, valueRange } from "./draw_signals.js";
import { niceStep, number, timeText, unitWord } from "./format.js";
import { OVERVIEW_HEIGHT, drawOverview, drawTimeGrid } from "./overview.js";
import { LEFT_MARGIN, RIGHT_MARGIN, rowLayout } from "./view.js";

export const LAYERS = ["overview", "labels", "signals", "cursor"];

const MIN_ROW_HEIGHT = 120; // [px], the rows scroll if they do not fit

// Beside the plots of each finger: its name, the lines, and their values at the cursor.

function swatch(colour) {
  const mark = make("i", "swatch");
  mark.style.background = colour;
  return mark;
}

class Legend {
  constructor(box) {
    this.box = box;
    this.values = new Map();
  }

  open(recording, force) {
    this.values.clear();
    this.box.replaceChildren(...recording.fingers.map((finger, index) => this.fingerLegend(finger, index, recording.unit[finger], force)));
  }

  fingerLegend(finger, index, unit, force) {
    const name = make("h3", "", swatch(fingerColour(index)), make("span", "", finger));
    name.title = finger;
    const values = new Map();
    const entry = (key, label, colour) => {
      const value = make("span", "value", number(null));
      values.set(key, value);
      return make("div", "entry", swatch(colour), make("span", "label", label), value);
    };
    const entries = [...forceLines(force, index).map((each) => entry(each.key, each.name, each.colour)), entry("sigma", "σ", colours.muted)];
    this.values.set(finger, values);
    return make("section", "finger-legend", name, make("small", "unit", unitWord(unit)), ...entries);
  }

  /** Show the values of a finger; null shows dashes. */
  show(finger, values) {
    for (const [key, element] of this.values.get(finger) ?? []) setText(element, number(values?.[key]));
  }
}

export class Plot {
  constructor(editor, view, signals) {
    Object.assign(this, { editor, view, signals });
    this.canvases = Object.fromEntries(LAYERS.map((layer) => [layer, byId(`${layer}-canvas`)]));
    this.legend = new Legend(byId("legend"));
    this.force = "F_a"; // the series that is drawn, or "xyz"
    this.scaleToWindow = false; // vertical axes fit the window, or else the whole recording
    this.changePoints = {}; // times [s] by finger
    this.hover = null; // what is under the pointer
    this.hoveredProposal = null;
    this.playTime = null; // [s]
    this.snapTime = null; // time that the dragged edge snaps to [s]
    this.target = () => null; // the item that Enter accepts
    this.rows = [];
    new ResizeObserver(() => this.resize()).observe(byId("rows"));
  }

  /** Show the recording of the editor. */
  open() {
    this.changePoints = {};
    this.hover = this.snapTime = this.hoveredProposal = this.scales = null;
    this.legend.open(this.editor.recording, this.force);
    this.resize();
  }

  resize() {
    const { clientWidth, clientHeight } = byId("rows"), n = this.editor.fingers.length;
    this.height = Math.max(clientHeight, n * MIN_ROW_HEIGHT);
    this.view.width = Math.max(LEFT_MARGIN + RIGHT_MARGIN + 50, clientWidth - byId("legend").offsetWidth);
    this.rows = rowLayout(n, this.height);
    byId("legend").style.height = `${this.height}px`;
    this.redraw(...LAYERS);
    this.view.changed();
  }

  showForce(force) {
    this.force = force;
    this.scales = null;
    this.legend.open(this.editor.recording, force);
    this.redraw("signals", "cursor");
  }

  /** Draw signals that have arrived. */
  updateSignals() {
    this.scales = this.scaleToWindow ? this.scales : null;
    this.redraw("overview", "signals", "cursor");
  }

  /** Redraw layers at the next frame of the browser. */
  redraw(...layers) {
    this.pending = new Set([...(this.pending ?? []), ...layers]);
    this.frameRequest ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.frameRequest = null;
    const layers = this.pending;
    this.pending = null;
    for (const layer of layers) {
      const height = layer === "overview" ? OVERVIEW_HEIGHT : this.height;
      this.drawLayer(layer, prepareCanvas(this.canvases[layer], this.view.width, height));
    }
    if (!layers.has("signals") || !this.signals.coarse) return;
    // Tests wait for this attribute.
    document.body.dataset.painted = "1";
  }

  drawLayer(layer, context) {
    if (layer === "overview") drawOverview(context, this.view, this.editor, this.signals);
    else if (layer === "labels") this.drawLabels(context);
    else if (layer === "signals") this.drawSignals(context);
    else this.drawCursor(context);
  }

  drawLabels(context) {
    const { editor, view } = this, open = new Set(editor.proposals.map(({ item }) => item));
    this.rows.forEach((row, k) => {
      const finger = editor.fingers[k], labels = editor.labels(finger);
      drawBackground(context, view, row);
      shadeStates(context, view, row, labels);
      this.drawChangePoints(context, row, finger);
      drawLabels(context, view, row, labels);
      const proposals = (editor.recording.proposals[finger] ?? []).filter((item) => !editor.isRejected(finger, item));
      drawProposals(context, view, row, proposals, open);
    });
  }

  // Mark the change points, unless they are too dense to be distinguished.
  drawChangePoints(context, row, finger) {
    const visible = (this.changePoints[finger] ?? []).filter((time) => time > this.view.start && time < this.view.end);
    if (visible.length > this.view.plotWidth / 8) return;
    for (const time of visible) {
      const x = this.pixel(time);
      drawLine(context, x, row.labels[0] - 5, x, row.labels[0], colours.muted, 1.5);
    }
  }

  drawSignals(context) {
    const { view } = this;
    drawTimeGrid(context, view, this.rows.flatMap((row) => [row.force, row.sigma]));
    this.rows.forEach((row, k) => {
      const finger = this.editor.fingers[k], segments = this.signals.segments(finger, view.start, view.end);
      const [force, sigma] = this.scalesOf(finger, segments);
      drawAxis(context, view, force, row.force);
      drawAxis(context, view, sigma, row.sigma);
      for (const { key, colour } of forceLines(this.force, k)) drawSeries(context, view, segments, key, force, row.force, colour);
      drawSeries(context, view, segments, "sigma", sigma, row.sigma, colours.muted);
      this.drawCaptions(context, row);
    });
  }

  // Return the scales of force and sigma of a finger.
  scalesOf(finger, segments) {
    const keys = forceLines(this.force, 0).map(({ key }) => key), fromZero = this.force === "F_a";
    const compute = (some) => [forceScale(valueRange(some, keys), fromZero), sigmaScale(valueRange(some, ["sigma"], true, 0.01))];
    if (this.scaleToWindow) return compute(segments);
    this.scales ??= {};
    const data = this.signals.coarse?.fingers.get(finger);
    return (this.scales[finger] ??= compute(data ? [[data, -Infinity, Infinity]] : []));
  }

  drawCaptions(context, row) {
    context.font = font(10.5);
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.fillStyle = colours.muted;
    for (const [text, [top, bottom]] of [["labels", row.labels], ["proposed", row.proposals]]) {
      context.fillText(text, LEFT_MARGIN - 6, (top + bottom) / 2, LEFT_MARGIN - 8); // narrower if the font is wide
    }
  }

  drawCursor(context) {
    const { editor, view } = this, target = this.target(), { selected } = editor;
    this.rows.forEach((row, k) => {
      const finger = editor.fingers[k];
      drawReviewItems(context, view, row, editor.reviewItems.filter((each) => each.finger === finger), editor.focus);
      if (target?.kind === "proposal" && target.finger === finger) drawTarget(context, view, row, target.item);
      if (selected?.finger === finger && !editor.preview) drawSelection(context, view, row, selected.label, selected.fresh);
    });
    this.drawMarkers(context);
    this.drawVerticalLine(context, this.playTime, colours["finger-1"], 2, []);
    this.drawVerticalLine(context, this.snapTime, colours.focus, 2, [3, 3]);
    if (this.hover) this.drawHover(context);
    this.showValues();
  }

  drawMarkers(context) {
    context.font = font(11, 600);
    context.textBaseline = "top";
    context.textAlign = "left";
    for (const [time, text] of this.editor.recording.markers ?? []) {
      if (!this.drawVerticalLine(context, time, colours.marker, 1.2, [2, 4])) continue;
      const x = this.pixel(time) + 4, width = context.measureText(text).width;
      context.fillStyle = colours.panel;
      context.globalAlpha = 0.8;
      context.fillRect(x - 2, 2, width + 4, 14);
      context.globalAlpha = 1;
      context.fillStyle = colours.text;
      context.fillText(text, x, 3);
    }
  }

  // Draw a line at a time; return false if the time is null or not visible.
  drawVerticalLine(context, time, colour, width, dash) {
    if (time === null || time < this.view.start || time > this.view.end) return false;
    const x = this.pixel(time);
    drawLine(context, x, 0, x, this.height, colour, width, dash);
    return true;
  }

  // Draw the line under the pointer, with its time.
  drawHover(context) {
    const { x, time, row } = this.hover;
    if (x < LEFT_MARGIN || x > this.view.width - RIGHT_MARGIN) return;
    drawLine(context, x, 0, x, this.height, colours.text, 1);
    const text = `${timeText(time, niceStep(this.view.secondsPerPixel))} s`, top = this.rows[row]?.force[0] ?? 0;
    context.font = font(12, 600);
    const width = context.measureText(text).width + 10;
    const left = x + 8 + width > this.view.width ? x - 8 - width : x + 8;
    context.fillStyle = colours.text;
    context.fillRect(left, top, width, 18);
    context.fillStyle = colours.ground;
    context.textAlign = "left";
    context.textBaseline = "middle";
    context.fillText(text, left + 5, top + 9.5);
  }

  // Show the values under the pointer, or else at the playing time, in the legend.
  showValues() {
    const time = this.hover?.time ?? this.playTime;
    for (const finger of this.editor.fingers) {
      this.legend.show(finger, time === null ? null : this.signals.valuesAt(finger, time));
    }
  }

  // Return the middle of the pixel of a time, for sharp vertical lines.
  pixel(time) { return Math.round(this.view.x(time)) + 0.5; }
}
