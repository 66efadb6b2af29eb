// Map of the taxels of one sensor: a disc for the normal reading, an arrow for the shear.

import { number, unitWord } from "../web/text.js";
import { colours, font, lightTheme } from "../web/theme.js";
import { hull, layout, toMapFrame } from "./layout.js";

const FONT = font(11);
// Minimum full scale by unit: smaller readings are noise.
const MIN_SCALES = { count: 50, N: 0.1 };
// Number of the first taxel: documents count taxels from it, arrays from 0.
const FIRST_TAXEL = 1;
// Length of an arrow at full scale, in radii of a disc; the margin of the map has room for it.
const ARROW = 2.2;
const LABEL_HEIGHT = 14; // [px]
// Time constant of the scale [s]: long enough that discs stay comparable while a grasp changes.
const DECAY_TIME = 6;
// Colour scales from dim to bright, in equal steps of lightness: readable for colour-blind people
// and in print.
const DARK_SCALE = [[62, 96, 190], [46, 134, 190], [48, 176, 164], [150, 212, 96], [253, 231, 76]];
const LIGHT_SCALE = [[176, 205, 230], [110, 170, 210], [50, 130, 170], [40, 85, 140], [45, 20, 95]];

/** Return the colour of a fraction of the full scale, from 0 to 1. */
function scaleColour(fraction) {
  const stops = lightTheme.matches ? LIGHT_SCALE : DARK_SCALE, at = fraction * (stops.length - 1);
  const k = Math.min(stops.length - 2, Math.floor(at));
  return `rgb(${stops[k].map((low, c) => Math.round(low + (at - k) * (stops[k + 1][c] - low))).join(" ")})`;
}

function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 3, 4, 5, 7, 10].find((step) => step * power >= value * 0.999) * power;
}

/** Full scale of discs or arrows: a round number, common to all fingers of one unit. */
export class Scale {
  constructor(unit) {
    this.peak = this.minimum = MIN_SCALES[unit] ?? 1e-3;
    this.lastTime = NaN;
  }

  get full() { return roundUp(this.peak); }

  /** Reduce the scale with time; `now` on the source's clock [s]. */
  decay(now) {
    const elapsed = Math.max(0, now - this.lastTime) || 0;
    this.lastTime = now;
    this.peak = Math.max(this.minimum, this.peak * Math.exp(-elapsed / DECAY_TIME));
  }

  /** Extend the scale to a reading. */
  include(value) { if (value > this.peak && value < Infinity) this.peak = value; }
}

const line = (context, ...points) => points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));

export class TaxelMap {
  /** @param scales {disc, arrow}: shears have their own scale, because they are smaller. */
  constructor(canvas, sensor, scales) {
    Object.assign(this, { canvas, sensor, scales, layout: layout(sensor.positions, sensor.rotations, sensor.normal) });
    this.hull = hull(this.layout.points);
    this.values = null; // readings in the frame of the map; null if there are none
    this.faulty = new Set();
    this.size = [0, 0];
    // Reading the layout of the page is slow: the size is kept.
    this.observer = new ResizeObserver(([{ contentRect: { width, height } }]) => this.resize(width, height));
  }

  /**
   * Update the map.
   * @param taxels tared readings in taxel frames; null if there are none.
   * @param faulty numbers of the faulty taxels.
   */
  update(taxels, faulty) {
    const { right, up, points } = this.layout;
    this.faulty = new Set(faulty.map((number) => number - FIRST_TAXEL));
    this.values = taxels?.length === points.length
      ? taxels.map((reading, k) => toMapFrame(reading, this.sensor.rotations[k], right[k], up[k])) : null;
    this.values?.forEach(([x, y, z], k) => {
      if (this.faulty.has(k)) return;
      this.scales.disc.include(Math.abs(z));
      this.scales.arrow.include(Math.hypot(x, y));
    });
  }

  resize(width, height) {
    const ratio = window.devicePixelRatio || 1;
    this.size = [width, height];
    [this.canvas.width, this.canvas.height] = [width, height].map((length) => Math.round(length * ratio));
    this.draw();
  }

  // Return the map from metres to pixels that fits all discs and the outline.
  toPixels() {
    const room = [this.size[0], this.size[1] - LABEL_HEIGHT], { points, spacing } = this.layout;
    const ends = [0, 1].map((axis) => {
      const values = points.map((point) => point[axis]);
      return [Math.min(...values), Math.max(...values)];
    });
    const zoom = Math.min(...ends.map(([low, high], axis) => (room[axis] - 4) / (high - low + ARROW * spacing)));
    const at = (point) => point.map((value, axis) => room[axis] / 2 + zoom * (value - (ends[axis][0] + ends[axis][1]) / 2) * (axis ? -1 : 1));
    return { at, radius: 0.49 * zoom * spacing };
  }

  draw() {
    const context = this.canvas.getContext("2d"), ratio = window.devicePixelRatio || 1, [width, height] = this.size;
    if (width < 20 || height < 30) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.lineJoin = context.lineCap = "round";
    const { at, radius } = this.toPixels(), points = this.layout.points.map(at);
    this.drawOutline(context, this.hull.map(at), radius);
    points.forEach((point, k) => this.drawDisc(context, point, k, radius));
    if (this.values) points.forEach((point, k) => this.drawArrow(context, point, k, radius));
    this.drawLabel(context, width, height);
  }

  // A wide line with round corners around the hull, and a narrower one on top, give an outline.
  drawOutline(context, corners, radius) {
    context.beginPath();
    line(context, ...corners);
    context.closePath();
    for (const [colour, lineWidth] of [[colours.outline, 3 * radius], [colours.base, 3 * radius - 3]]) {
      context.lineWidth = Math.max(1, lineWidth);
      context.strokeStyle = context.fillStyle = colour;
      context.stroke();
      context.fill();
    }
  }

  // A disc shows pressure, a ring a pull, a cross a faulty taxel.
  drawDisc(context, [x, y], k, radius) {
    const normal = this.values?.[k][2], fraction = Math.min(1, Math.abs(normal) / this.scales.disc.full), size = 0.7 * radius;
    const circle = (r, colour, isFilled) => {
      context.beginPath();
      context.arc(x, y, r, 0, 2 * Math.PI);
      context.fillStyle = context.strokeStyle = colour;
      if (isFilled) context.fill();
      else context.stroke();
    };
    context.lineWidth = 1;
    circle(radius, colours.outline, false);
    if (this.faulty.has(k)) {
      context.lineWidth = 2;
      context.strokeStyle = colours["unstable-line"];
      context.beginPath();
      for (const side of [-size, size]) line(context, [x - size, y - side], [x + size, y + side]);
      context.stroke();
    } else if (fraction > 0.002) circle(Math.max(1, radius * Math.sqrt(fraction)), scaleColour(fraction), normal > 0);
  }

  drawArrow(context, [x, y], k, radius) {
    const [right, up] = this.values[k], length = ARROW * radius * Math.min(1, Math.hypot(right, up) / this.scales.arrow.full);
    // Too short an arrow is only its head.
    if (this.faulty.has(k) || !(length > 3)) return;
    const head = Math.min(6, 0.45 * length);
    context.save();
    context.translate(x, y);
    context.rotate(Math.atan2(-up, right));
    context.beginPath();
    line(context, [0, 0], [length, 0]);
    line(context, [length - head, -0.6 * head], [length, 0], [length - head, 0.6 * head]);
    // Dark below and light above: visible on a bright disc and on the background.
    for (const [colour, lineWidth] of [[colours.base, 3.6], [colours.text, 1.6]]) {
      context.strokeStyle = colour;
      context.lineWidth = lineWidth;
      context.stroke();
    }
    context.restore();
  }

  drawLabel(context, width, height) {
    context.font = FONT;
    context.textAlign = "center";
    context.fillStyle = colours.muted;
    const [disc, arrow] = [this.scales.disc, this.scales.arrow].map((scale) => number(scale.full).replace(/\.0+$/, ""));
    const long = `full disc ${disc}, arrow ${arrow} ${unitWord(this.sensor.unit)}`;
    const text = context.measureText(long).width < width ? long : `● ${disc}  → ${arrow}`;
    context.fillText(this.values ? text : "no readings", width / 2, height - 2);
  }
}
