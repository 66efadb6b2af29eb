// Draw labels, proposals and review items in the row of a finger.

import { colours, font, stateColour, stateLineColour } from "../web/theme.js";
import { drawFrame, drawHatch, drawLine, drawStateShape, shortenText } from "./canvas.js";
import { labelText, percent, stateKey } from "./format.js";
import { LEFT_MARGIN, RIGHT_MARGIN } from "./view.js";

const STATE_OPACITY = { stable: 0.15, unstable: 0.25, "no-contact": 0.09 };
const MIN_WIDTH_FOR_EDGE = 3; // [px], narrower labels have no line at their start
const MIN_WIDTH_FOR_SHAPE = 18; // [px], narrower labels have neither shape nor text
const SLIP_BAND = 4; // [px], height of the band below a slip
const MIN_SLIP_WIDTH = 2; // [px], a short slip stays visible within a disturbance

/** Return the left and right pixel of an interval in the plot; null if it is not visible. */
function pixelRange(view, { start, end }) {
  if (end <= view.start || start >= view.end) return null;
  const left = Math.max(LEFT_MARGIN, view.x(start)), right = Math.min(view.width - RIGHT_MARGIN, view.x(end));
  return [left, Math.max(left + 1, right)];
}

// Return the visible items, each with its pixel range.
const visible = (view, items) => items.map((item) => [item, pixelRange(view, item)]).filter(([, range]) => range);

/** Fill the background of the plots and strips. */
export function drawBackground(context, view, row) {
  context.fillStyle = colours.base;
  for (const part of [row.force, row.sigma, row.labels, row.proposals]) {
    const [top, bottom] = [part[0] - (part === row.force ? 3 : 0), part[1]];
    context.fillRect(LEFT_MARGIN, top, view.plotWidth, bottom - top);
  }
}

/** Shade force and sigma in the colours of the labelled states. */
export function shadeStates(context, view, row, labels) {
  for (const [{ state }, [left, right]] of visible(view, labels)) {
    const key = stateKey(state);
    context.fillStyle = stateLineColour(key);
    context.globalAlpha = STATE_OPACITY[key] ?? 0.1;
    context.fillRect(left, row.force[0] - 3, right - left, row.sigma[1] - row.force[0] + 3);
  }
  context.globalAlpha = 1;
}

/** Draw the strip of labels, each with colour, shape and text, and a band below each slip. */
export function drawLabels(context, view, row, labels) {
  const shown = visible(view, labels);
  for (const [label, [left, right]] of shown) drawLabel(context, row.labels, label, left, right);
  drawSlips(context, row.labels, shown);
}

// A slip has the colour of its state, unstable, as a disturbance that touches it: the band shows
// where it begins and ends, also where there is no room for its text.
function drawSlips(context, [top, bottom], shown) {
  context.globalAlpha = 1;
  for (const [{ cause }, [left, right]] of shown) {
    if (cause !== "slip") continue;
    const width = Math.max(MIN_SLIP_WIDTH, right - left);
    context.fillStyle = colours.slip;
    context.fillRect(left, bottom - SLIP_BAND, width, SLIP_BAND);
    context.fillRect(left, top, MIN_SLIP_WIDTH, bottom - top);
    if (width > 2 * MIN_SLIP_WIDTH) context.fillRect(right - MIN_SLIP_WIDTH, top, MIN_SLIP_WIDTH, bottom - top);
  }
}

function drawLabel(context, [top, bottom], label, left, right) {
  const key = stateKey(label.state), width = right - left, height = bottom - top;
  context.fillStyle = stateColour(key);
  // No contact also differs from the other states by its brightness.
  context.globalAlpha = key === "no-contact" ? 0.55 : 1;
  context.fillRect(left, top, width, height);
  context.globalAlpha = 1;
  if (width > MIN_WIDTH_FOR_EDGE) drawLine(context, left + 0.5, top, left + 0.5, bottom, colours.panel);
  if (width < MIN_WIDTH_FOR_SHAPE) return;
  const size = Math.min(15, height - 6);
  drawStateShape(context, key, left + 5, top + (height - size) / 2, size, colours.ink, stateColour(key));
  context.font = font(12, 650);
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillStyle = colours.ink;
  context.fillText(shortenText(context, labelText(label), width - size - 14), left + size + 9, (top + bottom) / 2 + 0.5);
}

/** Draw hatched proposals: stronger with more confidence, and weak if they are not in `open`. */
export function drawProposals(context, view, row, items, open) {
  const [top, bottom] = row.proposals, shown = visible(view, items);
  for (const [item, [left, right]] of shown) {
    const key = stateKey(item.state), width = right - left;
    context.globalAlpha = (0.25 + 0.75 * item.confidence) * (open.has(item) ? 1 : 0.3);
    context.fillStyle = stateLineColour(key);
    if (key === "no-contact") {
      context.globalAlpha *= 0.5;
      context.fillRect(left, top, width, bottom - top);
      context.globalAlpha *= 2;
    } else {
      const [step, thickness] = key === "stable" ? [7, 3] : [4, 2];
      drawHatch(context, left, top, width, bottom - top, stateLineColour(key), step, thickness);
    }
    context.fillRect(left, top, width, 2);
    context.fillRect(left, bottom - 2, width, 2);
    context.globalAlpha = 1;
    drawLine(context, left + 0.5, top, left + 0.5, bottom, colours.panel);
  }
  drawSlips(context, row.proposals, shown);
}

/** Frame the proposal that Enter accepts. */
export function drawTarget(context, view, row, item) {
  const range = pixelRange(view, item), [top, bottom] = row.proposals;
  if (range) drawFrame(context, range[0] - 1, top - 2, range[1] - range[0] + 2, bottom - top + 4, colours.text, 2);
}

/** Outline the review items; `focus` is drawn stronger. */
export function drawReviewItems(context, view, row, reviewItems, focus) {
  for (const each of reviewItems) {
    const range = pixelRange(view, each.item);
    if (!range) continue;
    const [left, right] = range;
    if (each.kind === "proposal") {
      const [top, bottom] = row.proposals;
      drawFrame(context, left, top - 1, right - left, bottom - top + 2, colours["unknown-line"], 2, [2, 3]);
      continue;
    }
    const top = row.force[0] - 2, thickness = focus && focus.item === each.item ? 3 : 2;
    drawFrame(context, left, top, right - left, row.labels[1] + 1 - top, colours["unknown-line"], thickness, [2, 3]);
    drawReviewText(context, each.item, left, top, right - left);
  }
}

function drawReviewText(context, item, left, top, width) {
  context.font = font(11, 700);
  const short = shortenText(context, `unsure ${percent(item.confidence)}`, Math.max(width - 8, 0)), textWidth = context.measureText(short).width;
  if (!short) return;
  context.fillStyle = colours["unknown-line"];
  context.fillRect(left, top, textWidth + 8, 15);
  context.fillStyle = colours.ground;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillText(short, left + 4, top + 8);
}

/** Frame the selected label, with a handle at each edge; a fresh label has a thin dashed frame. */
export function drawSelection(context, view, row, label, fresh) {
  const range = pixelRange(view, label);
  if (!range) return;
  const [left, right] = range, [top, bottom] = row.labels;
  drawFrame(context, left - 1, top - 2, right - left + 2, bottom - top + 4, colours.text, fresh ? 1 : 2.5, fresh ? [3, 3] : []);
  if (fresh) return;
  context.fillStyle = colours.text;
  for (const [x, isVisible] of [[left, label.start >= view.start], [right, label.end <= view.end]]) {
    if (isVisible) context.fillRect(x - 2.5, top - 5, 5, bottom - top + 10);
  }
}
