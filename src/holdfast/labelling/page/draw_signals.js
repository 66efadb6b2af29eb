// Draw force and sigma of each finger, with their axes.

import { colours, fingerColour, font } from "../web/theme.js";
import { drawClipped, drawLine } from "./canvas.js";
import { MINUS, niceStep } from "./format.js";
import { indexAt } from "./signals.js";
import { LEFT_MARGIN, RIGHT_MARGIN } from "./view.js";

const MIN_DOT_SPACING = 7; // [px], samples that are farther apart are drawn as dots

/** Return key, colour and name of each force line; `force` is "xyz" or one series. */
export function forceLines(force, fingerIndex) {
  if (force === "xyz") return ["x", "y", "z"].map((axis) => ({ key: `F_${axis}`, colour: colours[`axis-${axis}`], name: `F${axis}` }));
  return [{ key: force, colour: fingerColour(fingerIndex), name: force === "F_a" ? "|F|" : `F${force.at(-1)}` }];
}

// Return the indices of the samples of a segment, with one more on either side: [first, last).
const sampleRange = (times, from, to) =>
  [Math.max(0, indexAt(times, from) - 1), Math.min(times.length, indexAt(times, to) + 1)];

function* segmentValues(segments, keys) {
  for (const [data, from, to] of segments) {
    const [first, last] = sampleRange(data.t, from, to);
    for (const key of keys) for (let k = first; k < last; k += 1) yield data[key][k];
  }
}

/**
 * Return minimum and maximum of some series over segments; null if they have no values.
 *
 * @param positive whether values up to 0 are ignored, for a logarithmic axis.
 * @param lowQuantile quantile that is returned as the minimum; on a logarithmic axis, a few tiny
 *   values would otherwise take most of the height.
 */
export function valueRange(segments, keys, positive = false, lowQuantile = 0) {
  const values = [];
  for (const value of segmentValues(segments, keys)) if (!Number.isNaN(value) && !(positive && value <= 0)) values.push(value);
  if (!values.length) return null;
  const sorted = Float64Array.from(values).sort();
  return [sorted[Math.floor(lowQuantile * (sorted.length - 1))], sorted.at(-1)];
}

/** Return a linear scale with a margin above; it begins at 0 if `fromZero`, else below the minimum. */
export function forceScale(range, fromZero) {
  let [low, high] = range ?? [0, 1];
  if (fromZero) low = 0;
  if (high - low < 1e-9) high = low + 1;
  const margin = 0.06 * (high - low);
  return { low: fromZero ? 0 : low - margin, high: high + margin, log: false };
}

/** Return a logarithmic scale of whole decades; low and high are exponents. */
export function sigmaScale(range) {
  const [low, high] = range ?? [1, 10];
  const from = Math.floor(Math.log10(low)), to = Math.max(from + 1, Math.ceil(Math.log10(high)));
  return { low: from, high: to, log: true };
}

/** Return the height of a value in a box [top, bottom]. */
function heightOf({ low, high, log }, [top, bottom], value) {
  const position = log ? Math.log10(value) : value;
  return bottom - ((position - low) / (high - low)) * (bottom - top);
}

function tickValues({ low, high, log }, height) {
  if (log) {
    const step = Math.max(1, Math.ceil(((high - low) * 13) / height));
    return Array.from({ length: Math.floor((high - low) / step) + 1 }, (_, k) => 10 ** (low + k * step));
  }
  const step = niceStep((high - low) / Math.max(2, height / 17));
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, k) => (first + k) * step);
}

const tickText = (value) => {
  const size = Math.abs(value);
  const text = size >= 10000 ? `${Number((size / 1000).toPrecision(3))}k` : String(Number(size.toPrecision(3)));
  return (value < 0 && size > 0 ? MINUS : "") + text;
};

/** Draw numbers and grid lines of a vertical axis. */
export function drawAxis(context, view, scale, box) {
  context.font = font(11);
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const value of tickValues(scale, box[1] - box[0])) {
    const y = Math.round(heightOf(scale, box, value)) + 0.5;
    drawLine(context, LEFT_MARGIN, y, view.width - RIGHT_MARGIN, y, value === 0 ? colours.outline : colours.grid);
    context.fillStyle = colours.muted;
    context.fillText(tickText(value), LEFT_MARGIN - 6, Math.max(box[0] + 3, Math.min(box[1] - 3, y)));
  }
}

/** Draw a series over its segments; missing values leave gaps. */
export function drawSeries(context, view, segments, key, scale, box, colour) {
  drawClipped(context, LEFT_MARGIN, box[0] - 2, view.plotWidth, box[1] - box[0] + 4, () => {
    context.strokeStyle = context.fillStyle = colour;
    context.lineJoin = "bevel";
    for (const [data, from, to] of segments) {
      drawSegment(context, view, data, data[key], from, to, (value) => heightOf(scale, box, value), scale.log);
    }
  });
}

function drawSegment(context, view, { t }, values, from, to, height, log) {
  const [first, last] = sampleRange(t, from, to);
  const dots = last - first > 1 && (t[last - 1] - t[first]) / (last - 1 - first) / view.secondsPerPixel > MIN_DOT_SPACING;
  // Browsers draw lines of width 1 many times faster; dense lines look the same.
  context.lineWidth = (last - first) * view.secondsPerPixel > to - from ? 1 : 1.4;
  let connected = false;
  context.beginPath();
  for (let k = first; k < last; k += 1) {
    const value = values[k];
    if (Number.isNaN(value) || (log && value <= 0)) { connected = false; continue; }
    const x = view.x(t[k]), y = height(value);
    if (connected) context.lineTo(x, y);
    else context.moveTo(x, y);
    connected = true;
    if (dots) context.rect(x - 1.5, y - 1.5, 3, 3);
    if (dots) context.moveTo(x, y);
  }
  context.stroke();
}
