// Draws labels, proposals, and what is doubtful about them.

import { colours, font, stateColour, stateLineColour } from "../web/theme.js";
import { cutText, hatch, line, shape } from "./pen.js";
import { LEFT, RIGHT } from "./view.js";
import { labelWord, percent, stateKey, stateWord } from "./words.js";

const TINT = { stable: 0.15, unstable: 0.25, "no-contact": 0.09 };

/** Left and right of an interval within the plot; null where it is out of sight. */
export function sides(view, { start, end }) {
  if (end <= view.start || start >= view.end) return null;
  const left = Math.max(LEFT, view.x(start)), right = Math.min(view.width - RIGHT, view.x(end));
  return [left, Math.max(left + 1, right)];
}

const seen = (view, items) => items.map((item) => [item, sides(view, item)]).filter(([, at]) => at);

/** Ground of plots and strips. */
export function grounds(pen, view, row) {
  pen.fillStyle = colours.base;
  for (const [top, bottom] of [row.force, row.sigma, row.labels, row.proposals]) {
    pen.fillRect(LEFT, top - (top === row.force[0] ? 3 : 0), view.inner, bottom - top + (top === row.force[0] ? 3 : 0));
  }
}

/** The state behind the lines. */
export function tints(pen, view, row, labels) {
  for (const [{ state }, [left, right]] of seen(view, labels)) {
    const key = stateKey(state);
    pen.fillStyle = stateLineColour(key);
    pen.globalAlpha = TINT[key] ?? 0.1;
    pen.fillRect(left, row.force[0] - 3, right - left, row.sigma[1] - row.force[0] + 3);
  }
  pen.globalAlpha = 1;
}

/** The strip of labels: colour, shape and word. */
export function strip(pen, view, row, labels) {
  const [top, bottom] = row.labels, tall = bottom - top;
  for (const [label, [left, right]] of seen(view, labels)) {
    const key = stateKey(label.state), width = right - left;
    pen.fillStyle = stateColour(key);
    // No contact is told apart by its lightness as well.
    pen.globalAlpha = key === "no-contact" ? 0.55 : 1;
    pen.fillRect(left, top, width, tall);
    pen.globalAlpha = 1;
    if (width > 3) line(pen, left + 0.5, top, left + 0.5, bottom, colours.panel);
    if (width < 18) continue;
    const size = Math.min(15, tall - 6);
    shape(pen, key, left + 5, top + (tall - size) / 2, size, colours.ink, stateColour(key));
    pen.font = font(12, 650);
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.fillStyle = colours.ink;
    pen.fillText(cutText(pen, labelWord(label), width - size - 14), left + size + 9, (top + bottom) / 2 + 0.5);
  }
}

/** Proposals, hatched; the surer, the stronger; what is done with already is dim. */
export function proposed(pen, view, row, items, open) {
  const [top, bottom] = row.proposals;
  for (const [item, [left, right]] of seen(view, items)) {
    const key = stateKey(item.state), todo = open.has(item);
    pen.globalAlpha = (0.25 + 0.75 * item.confidence) * (todo ? 1 : 0.3);
    pen.fillStyle = stateLineColour(key);
    if (key !== "no-contact") hatch(pen, left, top, right - left, bottom - top, stateLineColour(key), key === "stable" ? 7 : 4, key === "stable" ? 3 : 2);
    else {
      pen.globalAlpha *= 0.5;
      pen.fillRect(left, top, right - left, bottom - top);
      pen.globalAlpha *= 2;
    }
    pen.fillRect(left, top, right - left, 2);
    pen.fillRect(left, bottom - 2, right - left, 2);
    pen.globalAlpha = 1;
    line(pen, left + 0.5, top, left + 0.5, bottom, colours.panel);
  }
}

/** The proposal that Enter accepts. */
export function meant(pen, view, row, item) {
  const at = sides(view, item), [top, bottom] = row.proposals;
  if (at) frame(pen, at[0] - 1, top - 2, at[1] - at[0] + 2, bottom - top + 4, colours.text, 2);
}

export function frame(pen, left, top, width, height, colour, thick = 2, dash = []) {
  pen.strokeStyle = colour;
  pen.lineWidth = thick;
  pen.setLineDash(dash);
  pen.strokeRect(left + thick / 2, top + thick / 2, Math.max(1, width - thick), height - thick);
  pen.setLineDash([]);
}

/** Outlines of what a person should look at. */
export function outlines(pen, view, row, doubts, focus) {
  for (const each of doubts) {
    const at = sides(view, each.item);
    if (!at) continue;
    if (each.kind === "proposal") {
      const [high, low] = row.proposals;
      frame(pen, at[0], high - 1, at[1] - at[0], low - high + 2, colours["unknown-line"], 2, [2, 3]);
      continue;
    }
    const [left, right] = at, audit = each.kind === "suspect", top = row.force[0] - 2;
    const strong = focus && focus.item === each.item;
    frame(pen, left, top, right - left, row.labels[1] + 1 - top, colours["unknown-line"], strong ? 3 : 2, audit ? [7, 4] : [2, 3]);
    const { item } = each, text = audit ? `${stateWord(item.expected)}? ${percent(item.confidence)}` : `doubtful ${percent(item.confidence)}`;
    pen.font = font(11, 700);
    const short = cutText(pen, text, Math.max(right - left - 8, 0)), long = pen.measureText(short).width;
    if (!short) continue;
    pen.fillStyle = colours["unknown-line"];
    pen.fillRect(left, top, long + 8, 15);
    pen.fillStyle = colours.ground;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.fillText(short, left + 4, top + 8);
  }
}

/** The selected label: framed, with a grip at each edge. */
export function selection(pen, view, row, label, fresh) {
  const at = sides(view, label);
  if (!at) return;
  const [left, right] = at, [top, bottom] = row.labels;
  frame(pen, left - 1, top - 2, right - left + 2, bottom - top + 4, colours.text, fresh ? 1 : 2.5, fresh ? [3, 3] : []);
  if (fresh) return;
  pen.fillStyle = colours.text;
  for (const [x, inside] of [[left, label.start >= view.start], [right, label.end <= view.end]]) {
    if (inside) pen.fillRect(x - 2.5, top - 5, 5, bottom - top + 10);
  }
}
