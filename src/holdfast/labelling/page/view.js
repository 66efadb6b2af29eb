// Which part of the recording is looked at, and where a time is on the screen.

const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

export const LEFT = 52; // [px], for the numbers of the axes
export const RIGHT = 10;

export class View {
  /** @param changed is called whenever another part is to be seen. */
  constructor(changed) {
    this.changed = changed;
    this.width = 600; // of the canvas [px]
    this.limit(0, 1, 0.01);
  }

  /** Begins anew with a recording. @param least of a window [s]. */
  limit(start, end, least) {
    this.low = start;
    this.high = Math.max(end, start + least);
    this.least = Math.min(least, this.high - this.low);
    [this.start, this.end] = [this.low, this.high];
    this.changed();
  }

  get span() { return this.end - this.start; }
  get inner() { return Math.max(1, this.width - LEFT - RIGHT); }
  get perPixel() { return this.span / this.inner; }
  get whole() { return this.start <= this.low && this.end >= this.high; }

  x(time) { return LEFT + (time - this.start) / this.perPixel; }
  time(x) { return this.start + (x - LEFT) * this.perPixel; }

  /** Looks at [start, end], or the next to it that the recording has. */
  look(start, end) {
    const span = clamp(end - start, this.least, this.high - this.low);
    const middle = (start + end) / 2;
    const first = clamp(middle - span / 2, this.low, this.high - span);
    if (first === this.start && first + span === this.end) return;
    [this.start, this.end] = [first, first + span];
    this.changed();
  }

  /** Zooms by a factor; the time stays where it is on the screen. */
  zoom(factor, time) {
    const span = clamp(this.span * factor, this.least, this.high - this.low);
    const share = (time - this.start) / this.span;
    this.look(time - share * span, time + (1 - share) * span);
  }

  pan(seconds) {
    const by = clamp(seconds, this.low - this.start, this.high - this.end);
    this.look(this.start + by, this.end + by);
  }

  sees({ start, end }) { return start >= this.start && end <= this.end; }

  fit() { this.look(this.low, this.high); }

  /** Brings an interval into view with room around it; a window that shows it well stays. */
  show({ start, end }) {
    const long = end - start;
    if (this.sees({ start, end }) && long > 0.02 * this.span) return;
    const span = Math.max(4 * long, Math.min(2, this.high - this.low));
    this.look((start + end - span) / 2, (start + end + span) / 2);
  }

  /** Keeps a running time in view. */
  follow(time) {
    if (time < this.start || time > this.end) this.look(time - 0.1 * this.span, time + 0.9 * this.span);
  }
}
