// The whole recording in a strip, with the window in it; below it the time axis of the window.

import { colours, fingerColour, font, stateColour } from "../web/theme.js";
import { line, penOf } from "./pen.js";
import { LEFT, RIGHT } from "./view.js";
import { niceStep, stateKey, timeWord } from "./words.js";

export const STRIP = [4, 46], AXIS = 22; // [px]
const RIBBON = 5;

/** Where a time of the whole recording is. */
export const wholeX = (view, time) => LEFT + ((time - view.low) / (view.high - view.low)) * view.inner;
export const wholeTime = (view, x) => view.low + ((x - LEFT) / view.inner) * (view.high - view.low);

// What does not change with the window is drawn once.
const still = { canvas: document.createElement("canvas"), of: [] };

export function overview(pen, view, editor, signals) {
  const of = [view.width, view.low, view.high, signals.whole, editor.doubts, editor.state, editor.preview, colours.base, window.devicePixelRatio];
  if (of.some((value, k) => value !== still.of[k])) {
    whole(penOf(still.canvas, view.width, STRIP[1]), view, editor, signals);
    still.of = of;
  }
  pen.drawImage(still.canvas, 0, 0, view.width, STRIP[1]);
  frame(pen, view);
}

function whole(pen, view, editor, signals) {
  const [top, bottom] = STRIP, n = editor.fingers.length;
  const ribbon = Math.max(2, Math.min(RIBBON, 20 / n)), ribbons = bottom - n * ribbon - 1;
  pen.fillStyle = colours.base;
  pen.fillRect(LEFT, top, view.inner, bottom - top);
  editor.fingers.forEach((finger, k) => {
    profile(pen, view, signals.whole?.fingers.get(finger), [top + 1, ribbons - 2], fingerColour(k));
    for (const { start, end, state } of editor.labels(finger)) {
      const left = wholeX(view, start);
      pen.fillStyle = stateColour(stateKey(state));
      pen.fillRect(left, ribbons + k * ribbon, Math.max(1, wholeX(view, end) - left), ribbon - 1);
    }
  });
  for (const { item } of editor.doubts) {
    const left = wholeX(view, item.start), width = Math.max(3, wholeX(view, item.end) - left);
    pen.fillStyle = colours["unknown-line"];
    pen.fillRect(left, top - 4, width, 3);
  }
}

// The force, of each finger to its own height.
function profile(pen, view, data, [top, bottom], colour) {
  if (!data) return;
  let most = 0;
  for (const value of data.F_a) if (value > most) most = value;
  pen.strokeStyle = colour;
  pen.globalAlpha = 0.8;
  pen.lineWidth = 1;
  pen.beginPath();
  let on = false;
  for (let k = 0; k < data.t.length; k += 1) {
    const value = data.F_a[k];
    if (Number.isNaN(value)) { on = false; continue; }
    const x = wholeX(view, data.t[k]), y = bottom - (value / (most || 1)) * (bottom - top);
    if (on) pen.lineTo(x, y);
    else pen.moveTo(x, y);
    on = true;
  }
  pen.stroke();
  pen.globalAlpha = 1;
}

function frame(pen, view) {
  const [top, bottom] = STRIP, [left, right] = [view.start, view.end].map((time) => wholeX(view, time));
  pen.fillStyle = colours.ground;
  pen.globalAlpha = 0.6;
  pen.fillRect(LEFT, top, left - LEFT, bottom - top);
  pen.fillRect(right, top, view.width - RIGHT - right, bottom - top);
  pen.globalAlpha = 1;
  pen.strokeStyle = colours.text;
  pen.lineWidth = 2;
  pen.strokeRect(left, top, Math.max(2, right - left), bottom - top);
  pen.fillStyle = colours.text;
  for (const x of [left, right]) pen.fillRect(x - 2.5, (top + bottom) / 2 - 8, 5, 16);
}

/** Times along the window, and markers of the recording. */
export function timeAxis(pen, view, markers) {
  const top = STRIP[1] + 2, step = niceStep((view.span * 80) / view.inner);
  pen.font = font(12);
  pen.textBaseline = "middle";
  pen.textAlign = "center";
  pen.fillStyle = colours.muted;
  for (let k = Math.ceil(view.start / step - 1e-9); k * step <= view.end + 1e-9 * step; k += 1) {
    const x = Math.round(view.x(k * step)) + 0.5;
    line(pen, x, top + AXIS - 5, x, top + AXIS, colours.outline);
    // The last names the unit.
    const last = (k + 1) * step > view.end;
    pen.fillText(timeWord(k * step, step) + (last ? " s" : ""), Math.min(x, view.width - 22), top + 9);
  }
  return markers.filter(([time]) => time >= view.start && time <= view.end);
}

/** Grid lines of the same times through boxes [top, bottom]. */
export function timeGrid(pen, view, boxes) {
  const step = niceStep((view.span * 80) / view.inner);
  for (let k = Math.ceil(view.start / step - 1e-9); k * step <= view.end + 1e-9 * step; k += 1) {
    const x = Math.round(view.x(k * step)) + 0.5;
    for (const [top, bottom] of boxes) line(pen, x, top, x, bottom, colours.grid);
  }
}
