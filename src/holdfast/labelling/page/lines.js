// Draws the signals: force and sigma of each finger, with their axes.

import { colours, fingerColour, font } from "../web/theme.js";
import { line, within } from "./pen.js";
import { find } from "./signals.js";
import { LEFT, RIGHT } from "./view.js";
import { niceStep } from "./words.js";

const DOTS = 7; // [px] between samples, from which on each is a dot
const MINUS = "\u2212";

/** What is drawn of the force: series and their colours. */
export function forceLines(kind, place) {
  if (kind === "xyz") return ["x", "y", "z"].map((axis) => ({ key: `F_${axis}`, colour: colours[`axis-${axis}`], name: `F${axis}` }));
  return [{ key: kind, colour: fingerColour(place), name: kind === "F_a" ? "|F|" : `F${kind.at(-1)}` }];
}

function* values(pieces, keys) {
  for (const [data, from, to] of pieces) {
    const first = Math.max(0, find(data.t, from) - 1), last = Math.min(data.t.length, find(data.t, to) + 1);
    for (const key of keys) for (let k = first; k < last; k += 1) yield data[key][k];
  }
}

/**
 * The least and the most of some series over a window; null where nothing is known.
 *
 * @param share of values that may lie below the least: a logarithm makes much of next to nothing.
 */
export function extent(pieces, keys, positive = false, share = 0) {
  const known = [];
  for (const value of values(pieces, keys)) if (!Number.isNaN(value) && !(positive && value <= 0)) known.push(value);
  if (!known.length) return null;
  const sorted = Float64Array.from(known).sort();
  return [sorted[Math.floor(share * (sorted.length - 1))], sorted.at(-1)];
}

/** An axis from nought, or about it, with room above. */
export function forceScale(found, from0) {
  let [low, high] = found ?? [0, 1];
  if (from0) low = 0;
  if (high - low < 1e-9) high = low + 1;
  const room = 0.06 * (high - low);
  return { low: from0 ? 0 : low - room, high: high + room, log: false };
}

export function sigmaScale(found) {
  const [low, high] = found ?? [1, 10];
  const from = Math.floor(Math.log10(low)), to = Math.max(from + 1, Math.ceil(Math.log10(high)));
  return { low: from, high: to, log: true };
}

/** The height of a value between [top, bottom]. */
export function heightOf({ low, high, log }, [top, bottom], value) {
  const at = log ? Math.log10(value) : value;
  return bottom - ((at - low) / (high - low)) * (bottom - top);
}

function marks({ low, high, log }, tall) {
  if (log) {
    const step = Math.max(1, Math.ceil(((high - low) * 13) / tall));
    return Array.from({ length: Math.floor((high - low) / step) + 1 }, (_, k) => 10 ** (low + k * step));
  }
  const step = niceStep((high - low) / Math.max(2, tall / 17));
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, k) => (first + k) * step);
}

const markWord = (value) => {
  const size = Math.abs(value);
  const text = size >= 10000 ? `${Number((size / 1000).toPrecision(3))}k` : String(Number(size.toPrecision(3)));
  return (value < 0 && size > 0 ? MINUS : "") + text;
};

/** Numbers and grid lines of an axis. */
export function axis(pen, view, scale, box) {
  pen.font = font(11);
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const value of marks(scale, box[1] - box[0])) {
    const y = Math.round(heightOf(scale, box, value)) + 0.5;
    line(pen, LEFT, y, view.width - RIGHT, y, value === 0 ? colours.outline : colours.grid);
    pen.fillStyle = colours.muted;
    pen.fillText(markWord(value), LEFT - 6, Math.max(box[0] + 3, Math.min(box[1] - 3, y)));
  }
}

/** One series as a line, over the pieces that there are; what is not known is not drawn. */
export function series(pen, view, pieces, key, scale, box, colour) {
  within(pen, LEFT, box[0] - 2, view.inner, box[1] - box[0] + 4, () => {
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineJoin = "bevel";
    for (const [data, from, to] of pieces) trace(pen, view, data, data[key], from, to, (v) => heightOf(scale, box, v), scale.log);
  });
}

function trace(pen, view, { t }, column, from, to, height, log) {
  const first = Math.max(0, find(t, from) - 1), last = Math.min(t.length, find(t, to) + 1);
  const dots = last - first > 1 && (t[last - 1] - t[first]) / (last - 1 - first) / view.perPixel > DOTS;
  // Dense lines are as good as hairlines, which are drawn many times faster.
  pen.lineWidth = (last - first) * view.perPixel > to - from ? 1 : 1.4;
  let on = false;
  pen.beginPath();
  for (let k = first; k < last; k += 1) {
    const value = column[k];
    if (Number.isNaN(value) || (log && value <= 0)) { on = false; continue; }
    const x = view.x(t[k]), y = height(value);
    if (on) pen.lineTo(x, y);
    else pen.moveTo(x, y);
    on = true;
    if (dots) pen.rect(x - 1.5, y - 1.5, 3, 3);
    if (dots) pen.moveTo(x, y);
  }
  pen.stroke();
}
