// Geometry of the plots: the visible time window, and the rows of the fingers.

const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

export const LEFT_MARGIN = 52; // [px], for the numbers of the axes
export const RIGHT_MARGIN = 10; // [px]

/** Visible time window of a recording, and its mapping to pixels. */
export class View {
  /** @param changed called after every change of the window. */
  constructor(changed) {
    this.changed = changed;
    this.width = 600; // of the canvas [px]
    this.open(0, 1, 0.01);
  }

  /** Show a recording from `start` to `end` [s]; no window is shorter than `minSpan` [s]. */
  open(start, end, minSpan) {
    this.low = start;
    this.high = Math.max(end, start + minSpan);
    this.minSpan = Math.min(minSpan, this.high - this.low);
    [this.start, this.end] = [this.low, this.high];
    this.changed();
  }

  get span() { return this.end - this.start; }
  get plotWidth() { return Math.max(1, this.width - LEFT_MARGIN - RIGHT_MARGIN); }
  get secondsPerPixel() { return this.span / this.plotWidth; }

  x(time) { return LEFT_MARGIN + (time - this.start) / this.secondsPerPixel; }
  time(x) { return this.start + (x - LEFT_MARGIN) * this.secondsPerPixel; }

  contains({ start, end }) { return start >= this.start && end <= this.end; }

  /** Show [start, end], or the nearest window within the recording. */
  setWindow(start, end) {
    const span = clamp(end - start, this.minSpan, this.high - this.low);
    const middle = (start + end) / 2;
    const first = clamp(middle - span / 2, this.low, this.high - span);
    if (first === this.start && first + span === this.end) return;
    [this.start, this.end] = [first, first + span];
    this.changed();
  }

  showAll() { this.setWindow(this.low, this.high); }

  /** Multiply the span by a factor; `time` keeps its place on the screen. */
  zoom(factor, time) {
    const span = clamp(this.span * factor, this.minSpan, this.high - this.low);
    const fraction = (time - this.start) / this.span;
    this.setWindow(time - fraction * span, time + (1 - fraction) * span);
  }

  pan(seconds) {
    const shift = clamp(seconds, this.low - this.start, this.high - this.end);
    this.setWindow(this.start + shift, this.end + shift);
  }

  /** Show an interval with a margin, unless it is visible and wide enough. */
  reveal({ start, end }) {
    const duration = end - start;
    if (this.contains({ start, end }) && duration > 0.02 * this.span) return;
    const span = Math.max(4 * duration, Math.min(2, this.high - this.low));
    this.setWindow((start + end - span) / 2, (start + end + span) / 2);
  }

  /** Move the window if a playing time leaves it. */
  follow(time) {
    if (time < this.start || time > this.end) this.setWindow(time - 0.1 * this.span, time + 0.9 * this.span);
  }
}

const ROW_GAP = 8; // [px], between fingers
const TOP_GAP = 5; // [px], above the force
const PLOT_GAP = 4; // [px], between the parts of a row
const TALL_ROW = 170; // [px], taller rows have thicker strips

/** Divide a height [px] into rows of equal height; each part of a row is [top, bottom]. */
export function rowLayout(n, height) {
  const each = height / Math.max(1, n), tall = each > TALL_ROW;
  const labelHeight = tall ? 28 : 22, proposalHeight = tall ? 14 : 10;
  return Array.from({ length: n }, (_, k) => {
    const top = k * each, bottom = top + each - ROW_GAP;
    const proposals = [bottom - proposalHeight, bottom];
    const labels = [proposals[0] - 2 - labelHeight, proposals[0] - 2];
    const plotHeight = labels[0] - PLOT_GAP - (top + TOP_GAP);
    const split = top + TOP_GAP + Math.round(0.62 * plotHeight);
    return { top, bottom, force: [top + TOP_GAP, split - PLOT_GAP], sigma: [split + PLOT_GAP, labels[0] - PLOT_GAP], labels, proposals };
  });
}

/** Return the index of the row at a height; above and below the rows, that of the nearest row. */
export const rowAt = (rows, y) =>
  Math.max(0, Math.min(rows.length - 1, rows.findIndex((row) => y < row.bottom + ROW_GAP / 2) >>> 0));

/** Return the part of a row at a height: "labels", "proposals" or "plot". */
export function zoneAt(row, y) {
  if (y >= row.labels[0] && y < row.labels[1] + 1) return "labels";
  return y >= row.proposals[0] - 1 ? "proposals" : "plot";
}
