// The fingers one under the other. Three canvases lie on each other, so that what moves with the
// pointer does not draw the signals anew: labels below, lines, and the cursor on top.

import { byId } from "../web/dom.js";
import { colours, font } from "../web/theme.js";
import { grounds, meant, outlines, proposed, selection, strip, tints } from "./bands.js";
import { Gutters } from "./gutters.js";
import { axis, extent, forceLines, forceScale, series, sigmaScale } from "./lines.js";
import { overview, timeAxis, timeGrid, STRIP, AXIS } from "./overview.js";
import { line, penOf } from "./pen.js";
import { rowsOf } from "./rows.js";
import { LEFT, RIGHT } from "./view.js";
import { timeWord, niceStep } from "./words.js";

const LEAST = 120; // [px], a row; where there is less room the rows scroll
const PARTS = ["head", "under", "lines", "over"];

export class Plot {
  constructor(editor, view, signals) {
    Object.assign(this, { editor, view, signals });
    this.canvas = Object.fromEntries(PARTS.map((part) => [part, byId(part)]));
    this.gutters = new Gutters(byId("gutters"));
    this.kind = "F_a";
    this.close = false; // heights by what is in view, not by the whole recording
    this.changes = {};
    this.hover = this.playhead = this.snapped = this.aimed = null; // aimed: the proposal that the pointer went to
    this.target = () => null; // what Enter means
    this.rows = [];
    this.arrived = false;
    new ResizeObserver(() => this.fit()).observe(byId("rows"));
  }

  open() {
    this.changes = {};
    this.hover = this.snapped = this.aimed = this.scales = null;
    this.gutters.open(this.editor.recording, this.kind);
    this.fit();
  }

  fit() {
    const { clientWidth, clientHeight } = byId("rows"), n = this.editor.fingers.length;
    this.height = Math.max(clientHeight, n * LEAST);
    this.view.width = Math.max(LEFT + RIGHT + 50, clientWidth - byId("gutters").offsetWidth);
    this.rows = rowsOf(n, this.height);
    byId("gutters").style.height = `${this.height}px`;
    this.redraw(...PARTS);
    this.view.changed();
  }

  show(kind) {
    this.kind = kind;
    this.scales = null;
    this.gutters.open(this.editor.recording, kind);
    this.redraw("lines", "over");
  }

  /** Data are here: what lies in them is to be drawn. */
  data() {
    this.arrived = true;
    this.scales = this.close ? this.scales : null;
    this.redraw("head", "lines", "over");
  }

  redraw(...parts) {
    this.dirty = new Set([...(this.dirty ?? []), ...parts]);
    this.asked ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.asked = null;
    const parts = this.dirty;
    this.dirty = null;
    for (const part of parts) {
      const height = part === "head" ? STRIP[1] + 2 + AXIS : this.height;
      this[part](penOf(this.canvas[part], this.view.width, height));
    }
    if (!parts.has("lines") || !this.signals.whole) return;
    // For tests and benchmarks: what came has been drawn.
    document.body.dataset.painted = "1";
    if (this.arrived) document.body.dataset.drawn = String(Number(document.body.dataset.drawn ?? 0) + 1);
    this.arrived = false;
  }

  head(pen) {
    overview(pen, this.view, this.editor, this.signals);
    this.texts = timeAxis(pen, this.view, this.editor.recording.markers ?? []);
  }

  under(pen) {
    const { editor, view } = this, todo = new Set(editor.proposals.map(({ item }) => item));
    this.rows.forEach((row, k) => {
      const finger = editor.fingers[k], labels = editor.labels(finger);
      grounds(pen, view, row);
      tints(pen, view, row, labels);
      this.ticks(pen, row, finger);
      strip(pen, view, row, labels);
      const own = (editor.recording.proposals[finger] ?? []).filter((item) => !editor.isRejected(finger, item));
      proposed(pen, view, row, own, todo);
    });
  }

  // Where edges snap to.
  ticks(pen, row, finger) {
    const shown = (this.changes[finger] ?? []).filter((time) => time > this.view.start && time < this.view.end);
    if (shown.length > this.view.inner / 8) return;
    for (const time of shown) {
      const x = Math.round(this.view.x(time)) + 0.5;
      line(pen, x, row.labels[0] - 5, x, row.labels[0], colours.muted, 1.5);
    }
  }

  lines(pen) {
    const { view } = this;
    timeGrid(pen, view, this.rows.flatMap((row) => [row.force, row.sigma]));
    this.rows.forEach((row, k) => {
      const finger = this.editor.fingers[k], pieces = this.signals.pieces(finger, view.start, view.end);
      const [force, sigma] = this.scale(finger, pieces);
      const found = forceLines(this.kind, k);
      axis(pen, view, force, row.force);
      axis(pen, view, sigma, row.sigma);
      for (const { key, colour } of found) series(pen, view, pieces, key, force, row.force, colour);
      series(pen, view, pieces, "sigma", sigma, row.sigma, colours.muted);
      this.caption(pen, row);
    });
  }

  scale(finger, pieces) {
    const keys = forceLines(this.kind, 0).map(({ key }) => key), from0 = this.kind === "F_a";
    const of = (some) => [forceScale(extent(some, keys), from0), sigmaScale(extent(some, ["sigma"], true, 0.01))];
    if (this.close) return of(pieces);
    this.scales ??= {};
    const data = this.signals.whole?.fingers.get(finger);
    return (this.scales[finger] ??= of(data ? [[data, -Infinity, Infinity]] : []));
  }

  caption(pen, row) {
    pen.font = font(10.5);
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.fillStyle = colours.muted;
    pen.fillText("labels", LEFT - 6, (row.labels[0] + row.labels[1]) / 2);
    pen.fillText("proposed", LEFT - 6, (row.proposals[0] + row.proposals[1]) / 2);
  }

  over(pen) {
    const { editor, view } = this, target = this.target();
    this.rows.forEach((row, k) => {
      const own = editor.doubts.filter(({ finger }) => finger === editor.fingers[k]);
      outlines(pen, view, row, own, editor.focus);
      if (target?.kind === "proposal" && target.finger === editor.fingers[k]) meant(pen, view, row, target.item);
      const { selected } = editor;
      if (selected?.finger === editor.fingers[k] && !editor.preview) selection(pen, view, row, selected.label, selected.fresh);
    });
    this.markers(pen);
    this.vertical(pen, this.playhead, colours["finger-1"], 2, []);
    this.vertical(pen, this.snapped, colours.focus, 2, [3, 3]);
    if (this.hover) this.cursor(pen);
    this.values();
  }

  markers(pen) {
    pen.font = font(11, 600);
    pen.textBaseline = "top";
    pen.textAlign = "left";
    for (const [time, text] of this.editor.recording.markers ?? []) {
      if (!this.vertical(pen, time, colours.marker, 1.2, [2, 4])) continue;
      const x = placeOf(this, time) + 4, width = pen.measureText(text).width;
      pen.fillStyle = colours.panel;
      pen.globalAlpha = 0.8;
      pen.fillRect(x - 2, 2, width + 4, 14);
      pen.globalAlpha = 1;
      pen.fillStyle = colours.text;
      pen.fillText(text, x, 3);
    }
  }

  vertical(pen, time, colour, width, dash) {
    if (time === null || time < this.view.start || time > this.view.end) return false;
    const x = placeOf(this, time);
    line(pen, x, 0, x, this.height, colour, width, dash);
    return true;
  }

  cursor(pen) {
    const { x, time, row } = this.hover;
    if (x < LEFT || x > this.view.width - RIGHT) return;
    line(pen, x, 0, x, this.height, colours.text, 1);
    const text = `${timeWord(time, niceStep(this.view.perPixel))} s`, top = this.rows[row]?.force[0] ?? 0;
    pen.font = font(12, 600);
    const width = pen.measureText(text).width + 10;
    const left = x + 8 + width > this.view.width ? x - 8 - width : x + 8;
    pen.fillStyle = colours.text;
    pen.fillRect(left, top, width, 18);
    pen.fillStyle = colours.ground;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.fillText(text, left + 5, top + 9.5);
  }

  // At the cursor, else at the playhead.
  values() {
    const time = this.hover?.time ?? this.playhead;
    for (const finger of this.editor.fingers) {
      this.gutters.show(finger, time === null ? null : this.signals.at(finger, time));
    }
  }
}

const placeOf = (plot, time) => Math.round(plot.view.x(time)) + 0.5;
