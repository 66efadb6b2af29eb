// Visible time window of a recording, and its mapping to the width of the plots.

const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

export class View {
  /** @param changed called after every change of the window. */
  constructor(changed) {
    this.changed = changed;
    this.width = 600; // of the plots [px]
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
  get secondsPerPixel() { return this.span / this.width; }

  x(time) { return (time - this.start) / this.secondsPerPixel; }
  time(x) { return this.start + clamp(x, 0, this.width) * this.secondsPerPixel; }

  contains({ start, end }) { return start >= this.start && end <= this.end; }

  /** Show [start, end], or the nearest window within the recording. */
  setWindow(start, end) {
    const span = clamp(end - start, this.minSpan, this.high - this.low);
    const first = clamp((start + end - span) / 2, this.low, this.high - span);
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
