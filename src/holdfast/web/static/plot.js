// Plot over time by uPlot, a script of index.html: lines, with states behind them.

import { indexAt } from "./store.js";
import { colours, font } from "./theme.js";
import { MINUS } from "./text.js";

export const AXIS_WIDTH = 52, RIGHT_MARGIN = 14; // [px], beside the lines; --axis and --margin of style.css
const FONT = font(11);
// The lightness differs too, because many people cannot distinguish red and green.
const OPACITY = { unknown: 0.3, "no-contact": 0.1, unstable: 0.34, stable: 0.16 };
const MAX_DECADES = 4; // of a logarithmic axis

export const pixelRatio = () => window.devicePixelRatio || 1;

/** Return the ends of an axis, rounded so that they do not change with every small change. */
export function roundedRange(low, high, minSize) {
  const size = Math.max(high - low, minSize), step = 10 ** Math.floor(Math.log10(size)) / 4;
  return [Math.floor(low / step) * step, Math.ceil(high / step) * step];
}

/** Return whole decades: a few tiny values do not take most of the height. */
export function decadeRange(_, low, high) {
  if (!(low > 0 && high > 0)) return [0.1, 10];
  const top = Math.max(Math.ceil(Math.log10(high)), Math.floor(Math.log10(low)) + 1);
  return [10 ** Math.max(Math.floor(Math.log10(low)), top - MAX_DECADES), 10 ** top];
}

// Return ticks at whole decades, fewer if they would be too close.
function decadeTicks(plot, _, low, high) {
  const [from, to] = [low, high].map((value) => Math.round(Math.log10(value)));
  const step = Math.max(1, Math.ceil((15 * (to - from)) / Math.max(16, plot.height - 14)));
  return Array.from({ length: Math.floor((to - from) / step) + 1 }, (__, k) => 10 ** (from + k * step));
}

const tickText = (v) => (v === null ? null : (Math.abs(v) >= 10000 ? `${v / 1000}k` : String(Number(v.toPrecision(3)))).replace("-", MINUS));

export class TimePlot {
  /**
   * @param options
   *   lines: names of their colours; width: of the lines [px];
   *   window: returns the times at the left and the right end [s];
   *   range: returns the ends of the vertical axis, of (plot, low, high); log: whether it is
   *   logarithmic; ticks: its values, if fixed; none are shown if it is null;
   *   times: returns the text of ticks of the horizontal axis, of (ticks, step), if it is shown;
   *   behind, front: draw on the canvas; moved: is called when the cursor moves.
   */
  constructor(holder, options) {
    this.holder = holder;
    this.plot = new window.uPlot(uplotOptions(options), [[], ...options.lines.map(() => [])], holder);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(holder);
    this.resize();
  }

  resize() {
    const { width, height } = this.holder.getBoundingClientRect();
    if (width > 50 && height > 10) this.plot.setSize({ width: Math.floor(width), height: Math.floor(height) });
  }

  /** Draw columns: times, and the values of each line, null for a gap. Without them, draw the same again. */
  draw(data = this.plot.data) { this.plot.setData(data); }

  /** Draw what is behind and in front of the same lines. */
  repaint() { this.plot.redraw(false); }

  destroy() {
    this.observer.disconnect();
    this.plot.destroy();
  }
}

function uplotOptions({ lines, width = 1, window: ends, range, log = false, ticks, times, behind, front, moved, padding = [5, 5] }) {
  const axis = { font: FONT, stroke: () => colours.muted, grid: { stroke: () => colours.grid, width: 1 }, ticks: { show: false } };
  return {
    width: 300, height: 100, padding: [padding[0], RIGHT_MARGIN, padding[1], 0], legend: { show: false },
    cursor: moved ? { sync: { key: "time" }, drag: { x: false, y: false }, y: false, points: { size: 6 } } : { show: false },
    scales: { x: { time: false, range: ends }, y: { range, distr: log ? 3 : 1 } },
    axes: [
      { ...axis, size: times ? 22 : 0, gap: 3, values: (_, at, __, ___, step) => at.map((time) => (times ? times(time, step) : "")) },
      {
        ...axis, size: AXIS_WIDTH, gap: 5, space: log ? 16 : 20,
        ...(ticks ? { splits: ticks } : log ? { splits: decadeTicks, filter: (_, at) => at } : {}),
        values: (_, at) => at.map(tickText),
      },
    ],
    series: [{}, ...lines.map((colour) => ({ stroke: () => colours[colour], width, points: { show: false }, spanGaps: false }))],
    hooks: { drawClear: behind ? [behind] : [], draw: front ? [front] : [], setCursor: moved ? [moved] : [] },
  };
}

/** Return the index of the sample nearest to a time. */
export function nearestIndex(times, time) {
  const index = Math.min(times.length - 1, indexAt(times, time));
  return index > 0 && time - times[index - 1] < times[index] - time ? index - 1 : index;
}

/** Return the pixels of the canvas of two times, within the plot. */
export function pixelRange(plot, from, to) {
  const { left, width } = plot.bbox;
  return [from, to].map((time) => Math.min(left + width, Math.max(left, plot.valToPos(time, "x", true))));
}

// Unknown is hatched, so that it differs without its colour.
function hatch(context, left, top, width, height) {
  const step = 9 * pixelRatio();
  context.save();
  context.beginPath();
  context.rect(left, top, width, height);
  context.clip();
  context.beginPath();
  for (let x = Math.floor(left / step) * step - height; x < left + width; x += step) {
    context.moveTo(x, top + height);
    context.lineTo(x + height, top);
  }
  context.lineWidth = 2 * pixelRatio();
  context.stroke();
  context.restore();
}

/** Fill the background of a plot with states: (key, from, to) each. */
export function shadeStates(plot, intervals) {
  const { top, height } = plot.bbox, context = plot.ctx;
  for (const [key, from, to] of intervals) {
    const [left, right] = pixelRange(plot, from, to);
    context.fillStyle = context.strokeStyle = colours[`${key}-line`];
    context.globalAlpha = OPACITY[key];
    if (key === "unknown") hatch(context, left, top, right - left, height);
    else context.fillRect(left, top, right - left, height);
  }
  context.globalAlpha = 1;
}

/** Draw a dashed line across a plot, at a value or at a time. */
export function drawLevel(plot, scale, value, colour, dash) {
  const { left, top, width, height } = plot.bbox, context = plot.ctx, at = plot.valToPos(value, scale, true);
  const upright = scale === "x";
  if (upright && (at < left || at > left + width)) return;
  context.save();
  context.setLineDash(dash.map((length) => length * pixelRatio()));
  context.lineWidth = 1.5 * pixelRatio();
  context.strokeStyle = colour;
  context.beginPath();
  context.moveTo(upright ? at : left, upright ? top : at);
  context.lineTo(upright ? at : left + width, upright ? top + height : at);
  context.stroke();
  context.restore();
}
