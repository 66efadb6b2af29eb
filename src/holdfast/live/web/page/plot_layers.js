// Layers behind and above the lines of the plots: states, thresholds, markers.

import { colours, stateLineColour } from "../web/theme.js";
import { NO_CONTACT, STABLE, STATES, UNKNOWN, UNSTABLE, stateKey } from "./format.js";

const OPACITY = { [UNKNOWN]: 0.3, [NO_CONTACT]: 0.1, [UNSTABLE]: 0.34, [STABLE]: 0.16 };
const KEYS = STATES.map(stateKey);
export const RIBBON_HEIGHT = 6; // [px], including the gap

// Yield the runs of equal states over the points of a plot, as (code, from, to) in x.
function* runs(x, codes) {
  let first = 0;
  for (let k = 1; k <= x.length; k += 1) {
    if (k < x.length && codes[k] === codes[first]) continue;
    yield [codes[first], x[first], x[Math.min(k, x.length - 1)]];
    first = k;
  }
}

const pixelRatio = () => window.devicePixelRatio || 1;

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

/** Fill the background of a plot with the states of its points. */
export function shadeStates(plot, x, codes) {
  const { left, top, width, height } = plot.bbox, context = plot.ctx;
  for (const [code, from, to] of runs(x, codes)) {
    const [a, b] = [from, to].map((at) => Math.min(left + width, Math.max(left, plot.valToPos(at, "x", true))));
    context.fillStyle = context.strokeStyle = stateLineColour(KEYS[code] ?? "unknown");
    // The lightness differs too, because many people cannot distinguish red and green.
    context.globalAlpha = OPACITY[code] ?? 0.2;
    if (code === UNKNOWN) hatch(context, a, top, b - a, height);
    else context.fillRect(a, top, b - a, height);
  }
  context.globalAlpha = 1;
}

/** Draw a thin ribbon of states for each finger, along the top of the plot. */
export function drawRibbons(plot, x, rows) {
  const { left, top, width } = plot.bbox, context = plot.ctx;
  rows.forEach((codes, row) => {
    const y = top + (2 + row * RIBBON_HEIGHT) * pixelRatio(), height = (RIBBON_HEIGHT - 2) * pixelRatio();
    for (const [code, from, to] of runs(x, codes)) {
      const [a, b] = [from, to].map((at) => Math.min(left + width, Math.max(left, plot.valToPos(at, "x", true))));
      context.fillStyle = stateLineColour(KEYS[code] ?? "unknown");
      context.fillRect(a, y, Math.max(1, b - a), height);
    }
  });
}

function drawLine(context, points, dash, colour) {
  context.save();
  context.setLineDash(dash.map((length) => length * pixelRatio()));
  context.lineWidth = 1.5 * pixelRatio();
  context.strokeStyle = colour;
  context.beginPath();
  for (const point of points) context.lineTo(...point);
  context.stroke();
  context.restore();
}

/** Draw a dashed line across the plot at a value. */
export function drawLevel(plot, value) {
  const { left, width } = plot.bbox, y = plot.valToPos(value, "y", true);
  drawLine(plot.ctx, [[left, y], [left + width, y]], [6, 4], colours.muted);
}

/** Draw dotted lines at times relative to the newest sample [s]. */
export function drawMarkers(plot, times) {
  const { left, top, width, height } = plot.bbox;
  for (const time of times) {
    const x = plot.valToPos(time, "x", true);
    if (x >= left && x <= left + width) {
      drawLine(plot.ctx, [[x, top], [x, top + height]], [2, 3], colours.marker);
    }
  }
}
