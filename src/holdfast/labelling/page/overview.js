// Overview of the whole recording, with the time window as a frame that can be dragged, and the
// time axis of the window below it.

import { colours, fingerColour, font, stateColour } from "../web/theme.js";
import { drawLine, prepareCanvas } from "./canvas.js";
import { niceStep, stateKey, timeText } from "./format.js";
import { LEFT_MARGIN, RIGHT_MARGIN } from "./view.js";

const BOX = [4, 46]; // [px], top and bottom of the overview; above it are the marks of review items
const AXIS_HEIGHT = 22; // [px]
const MAX_RIBBON_HEIGHT = 5; // [px], of the labels of one finger
const HANDLE_REACH = 9; // [px], from an edge of the frame
const TICK_SPACING = 80; // [px], at least

export const OVERVIEW_HEIGHT = BOX[1] + 2 + AXIS_HEIGHT; // [px], including the time axis

const xOf = (view, time) => LEFT_MARGIN + ((time - view.low) / (view.high - view.low)) * view.plotWidth;
const timeAt = (view, x) => view.low + ((x - LEFT_MARGIN) / view.plotWidth) * (view.high - view.low);

// The recording is drawn once and then copied, until one of the sources changes.
const cache = { canvas: document.createElement("canvas"), sources: [] };

export function drawOverview(context, view, editor, signals) {
  const sources = [view.width, view.low, view.high, signals.coarse, editor.reviewItems, editor.state, editor.preview, colours.base, window.devicePixelRatio];
  if (sources.some((value, k) => value !== cache.sources[k])) {
    drawRecording(prepareCanvas(cache.canvas, view.width, BOX[1]), view, editor, signals);
    cache.sources = sources;
  }
  context.drawImage(cache.canvas, 0, 0, view.width, BOX[1]);
  drawWindowFrame(context, view);
  drawTimeAxis(context, view);
}

function drawRecording(context, view, editor, signals) {
  const [top, bottom] = BOX, n = editor.fingers.length;
  const ribbonHeight = Math.max(2, Math.min(MAX_RIBBON_HEIGHT, 20 / n)), ribbonTop = bottom - n * ribbonHeight - 1;
  context.fillStyle = colours.base;
  context.fillRect(LEFT_MARGIN, top, view.plotWidth, bottom - top);
  editor.fingers.forEach((finger, k) => {
    drawForce(context, view, signals.coarse?.fingers.get(finger), [top + 1, ribbonTop - 2], fingerColour(k));
    for (const { start, end, state } of editor.labels(finger)) {
      const left = xOf(view, start);
      context.fillStyle = stateColour(stateKey(state));
      context.fillRect(left, ribbonTop + k * ribbonHeight, Math.max(1, xOf(view, end) - left), ribbonHeight - 1);
    }
  });
  for (const { item } of editor.reviewItems) {
    const left = xOf(view, item.start), width = Math.max(3, xOf(view, item.end) - left);
    context.fillStyle = colours["unknown-line"];
    context.fillRect(left, top - 4, width, 3);
  }
}

// Draw the force of a finger, scaled to its own maximum.
function drawForce(context, view, data, [top, bottom], colour) {
  if (!data) return;
  let largest = 0;
  for (const value of data.F_a) if (value > largest) largest = value;
  context.strokeStyle = colour;
  context.globalAlpha = 0.8;
  context.lineWidth = 1;
  context.beginPath();
  let connected = false;
  for (let k = 0; k < data.t.length; k += 1) {
    const value = data.F_a[k];
    if (Number.isNaN(value)) { connected = false; continue; }
    const x = xOf(view, data.t[k]), y = bottom - (value / (largest || 1)) * (bottom - top);
    if (connected) context.lineTo(x, y);
    else context.moveTo(x, y);
    connected = true;
  }
  context.stroke();
  context.globalAlpha = 1;
}

function drawWindowFrame(context, view) {
  const [top, bottom] = BOX, [left, right] = [view.start, view.end].map((time) => xOf(view, time));
  context.fillStyle = colours.ground;
  context.globalAlpha = 0.6;
  context.fillRect(LEFT_MARGIN, top, left - LEFT_MARGIN, bottom - top);
  context.fillRect(right, top, view.width - RIGHT_MARGIN - right, bottom - top);
  context.globalAlpha = 1;
  context.strokeStyle = colours.text;
  context.lineWidth = 2;
  context.strokeRect(left, top, Math.max(2, right - left), bottom - top);
  context.fillStyle = colours.text;
  for (const x of [left, right]) context.fillRect(x - 2.5, (top + bottom) / 2 - 8, 5, 16);
}

// Return the ticks of the time axis as (time, x), and their step [s].
function timeTicks(view) {
  const step = niceStep((view.span * TICK_SPACING) / view.plotWidth), ticks = [];
  for (let k = Math.ceil(view.start / step - 1e-9); k * step <= view.end + 1e-9 * step; k += 1) {
    ticks.push([k * step, Math.round(view.x(k * step)) + 0.5]);
  }
  return [ticks, step];
}

function drawTimeAxis(context, view) {
  const top = BOX[1] + 2, [ticks, step] = timeTicks(view);
  context.font = font(12);
  context.textBaseline = "middle";
  context.textAlign = "center";
  context.fillStyle = colours.muted;
  ticks.forEach(([time, x], k) => {
    drawLine(context, x, top + AXIS_HEIGHT - 5, x, top + AXIS_HEIGHT, colours.outline);
    const unit = k === ticks.length - 1 ? " s" : "";
    context.fillText(timeText(time, step) + unit, Math.min(x, view.width - 22), top + 9);
  });
}

/** Draw grid lines at the ticks of the time axis through boxes [top, bottom]. */
export function drawTimeGrid(context, view, boxes) {
  for (const [, x] of timeTicks(view)[0]) {
    for (const [top, bottom] of boxes) drawLine(context, x, top, x, bottom, colours.grid);
  }
}

/** Mouse and touch on the overview: move the window, move one of its edges, or zoom. */
export class OverviewPointer {
  constructor(canvas, view) {
    Object.assign(this, { canvas, view, drag: null });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.drag = null; });
    canvas.addEventListener("dblclick", () => view.showAll());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  position(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  // Return what is at a position: "start", "end", "window", "outside" of the window, or "axis".
  partAt(x, y) {
    if (y > BOX[1]) return "axis";
    const [left, right] = [this.view.start, this.view.end].map((time) => xOf(this.view, time));
    const reach = Math.min(HANDLE_REACH, Math.max(3, (right - left) / 4));
    if (Math.abs(x - left) <= reach) return "start";
    if (Math.abs(x - right) <= reach) return "end";
    return x > left && x < right ? "window" : "outside";
  }

  press(event) {
    const [x, y] = this.position(event), { view } = this;
    this.canvas.setPointerCapture(event.pointerId);
    let part = this.partAt(x, y);
    if (part === "outside") {
      const time = timeAt(view, x);
      view.setWindow(time - view.span / 2, time + view.span / 2);
      part = "window";
    }
    this.drag = { part, x };
  }

  move(event) {
    const [x, y] = this.position(event), { view, drag } = this;
    if (!drag) {
      const part = this.partAt(x, y);
      this.canvas.style.cursor = part === "start" || part === "end" ? "ew-resize" : part === "outside" ? "pointer" : "grab";
      return;
    }
    const time = timeAt(view, x);
    if (drag.part === "axis") view.pan((drag.x - x) * view.secondsPerPixel);
    else if (drag.part === "window") view.pan(time - timeAt(view, drag.x));
    else if (drag.part === "start") view.setWindow(Math.min(time, view.end - view.minSpan), view.end);
    else view.setWindow(view.start, Math.max(time, view.start + view.minSpan));
    drag.x = x;
  }

  wheel(event) {
    event.preventDefault();
    const [x, y] = this.position(event), time = y > BOX[1] ? this.view.time(x) : timeAt(this.view, x);
    const fixed = Math.max(this.view.start, Math.min(this.view.end, time));
    this.view.zoom(Math.exp(event.deltaY * (event.deltaMode === 1 ? 16 : 1) * 0.002), fixed);
  }
}
