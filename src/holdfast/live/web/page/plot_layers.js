// What lies behind and over the lines of the plots: states, thresholds, markers.

import { colours, stateLineColour } from "../web/theme.js";
import { NO_CONTACT, STABLE, STATES, UNKNOWN, UNSTABLE, stateKey } from "./format.js";

const ALPHA = { [UNKNOWN]: 0.3, [NO_CONTACT]: 0.1, [UNSTABLE]: 0.34, [STABLE]: 0.16 };
const KEYS = STATES.map(stateKey);
export const RIBBON = 6; // [px], with its gap

// Runs of equal state over the points of a plot, as (code, from, to) in x.
function* runs(x, codes) {
  let first = 0;
  for (let k = 1; k <= x.length; k += 1) {
    if (k < x.length && codes[k] === codes[first]) continue;
    yield [codes[first], x[first], x[Math.min(k, x.length - 1)]];
    first = k;
  }
}

const ratio = () => window.devicePixelRatio || 1;

// Amber and hatched: unknown is told apart without its colour.
function hatch(pen, left, top, width, height) {
  const step = 9 * ratio();
  pen.save();
  pen.beginPath();
  pen.rect(left, top, width, height);
  pen.clip();
  pen.beginPath();
  for (let x = Math.floor(left / step) * step - height; x < left + width; x += step) {
    pen.moveTo(x, top + height);
    pen.lineTo(x + height, top);
  }
  pen.lineWidth = 2 * ratio();
  pen.stroke();
  pen.restore();
}

/** Fills the plot's ground by the states of its points. */
export function shade(plot, x, codes) {
  const { left, top, width, height } = plot.bbox, pen = plot.ctx;
  for (const [code, from, to] of runs(x, codes)) {
    const [a, b] = [from, to].map((at) => Math.min(left + width, Math.max(left, plot.valToPos(at, "x", true))));
    pen.fillStyle = pen.strokeStyle = stateLineColour(KEYS[code] ?? "unknown");
    // Of different lightness too: red and green are one to many people.
    pen.globalAlpha = ALPHA[code] ?? 0.2;
    if (code === UNKNOWN) hatch(pen, a, top, b - a, height);
    else pen.fillRect(a, top, b - a, height);
  }
  pen.globalAlpha = 1;
}

/** A thin line of states for each finger, along the top of the plot. */
export function ribbons(plot, x, rows) {
  const { left, top, width } = plot.bbox, pen = plot.ctx;
  rows.forEach((codes, row) => {
    const y = top + (2 + row * RIBBON) * ratio(), height = (RIBBON - 2) * ratio();
    for (const [code, from, to] of runs(x, codes)) {
      const [a, b] = [from, to].map((at) => Math.min(left + width, Math.max(left, plot.valToPos(at, "x", true))));
      pen.fillStyle = stateLineColour(KEYS[code] ?? "unknown");
      pen.fillRect(a, y, Math.max(1, b - a), height);
    }
  });
}

function line(pen, points, dash, colour) {
  pen.save();
  pen.setLineDash(dash.map((length) => length * ratio()));
  pen.lineWidth = 1.5 * ratio();
  pen.strokeStyle = colour;
  pen.beginPath();
  for (const point of points) pen.lineTo(...point);
  pen.stroke();
  pen.restore();
}

/** A dashed line across the plot at a value. */
export function level(plot, value) {
  const { left, width } = plot.bbox, y = plot.valToPos(value, "y", true);
  line(plot.ctx, [[left, y], [left + width, y]], [6, 4], colours.muted);
}

/** Dotted lines at times before the newest sample [s]. */
export function markers(plot, times) {
  const { left, top, width, height } = plot.bbox;
  for (const time of times) {
    const x = plot.valToPos(time, "x", true);
    if (x >= left && x <= left + width) {
      line(plot.ctx, [[x, top], [x, top + height]], [2, 3], colours.marker);
    }
  }
}
