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
// Time constant of the scale [s]: long enough that discs stay comparable while a grasp changes.
const DECAY_TIME = 6;
// Colour scales from dim to bright, in equal steps of lightness: readable for colour-blind people
// and in print.
const DARK_SCALE = [[62, 96, 190], [46, 134, 190], [48, 176, 164], [150, 212, 96], [253, 231, 76]];
const LIGHT_SCALE = [[176, 205, 230], [110, 170, 210], [50, 130, 170], [40, 85, 140], [45, 20, 95]];

/** Return the colour of a fraction of the full scale, from 0 to 1. */
function scaleColour(fraction) {
  const stops = lightTheme.matches ? LIGHT_SCALE : DARK_SCALE;
  const at = Math.min(1, Math.max(0, fraction)) * (stops.length - 1);
  const k = Math.min(stops.length - 2, Math.floor(at));
  const mix = stops[k].map((low, c) => Math.round(low + (at - k) * (stops[k + 1][c] - low)));
  return `rgb(${mix.join(" ")})`;
}

/** Full scale of discs or arrows: a round number, common to all fingers of one unit. */
export class Scale {
  constructor(unit) {
    this.peak = this.minimum = MIN_SCALES[unit] ?? 1e-3;
    this.lastTime = null;
    this.full = this.minimum;
  }

  /** Reduce the scale with time; `now` on the source's clock [s]. */
  decay(now) {
    const elapsed = this.lastTime === null ? 0 : Math.max(0, now - this.lastTime);
    this.lastTime = now;
    this.peak = Math.max(this.minimum, this.peak * Math.exp(-elapsed / DECAY_TIME));
    this.full = roundUp(this.peak);
  }

  /** Extend the scale to a reading. */
  include(value) {
    if (Number.isFinite(value) && value > this.peak) {
      this.peak = value;
      this.full = roundUp(value);
    }
  }
}

function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 3, 4, 5, 7, 10].find((step) => step * power >= value * 0.999) * power;
}

export class TaxelMap {
  /** @param scales {disc, arrow}: shears have their own scale, because they are smaller. */
  constructor(canvas, sensor, scales) {
    this.canvas = canvas;
    this.sensor = sensor;
    this.scales = scales;
    this.layout = layout(sensor.positions, sensor.rotations, sensor.normal);
    this.hull = hull(this.layout.points);
    this.values = sensor.positions.map(() => [0, 0, 0]);
    this.faulty = new Set();
    this.known = false;
    this.size = [0, 0];
  }

  /**
   * Update the map.
   * @param taxels tared readings in taxel frames; null if there are none.
   * @param faulty numbers of the faulty taxels.
   */
  update(taxels, faulty) {
    const { right, up } = this.layout;
    this.faulty = new Set(faulty.map((number) => number - FIRST_TAXEL));
    this.known = Array.isArray(taxels) && taxels.length === this.values.length;
    if (!this.known) return;
    this.values = taxels.map((reading, k) => toMapFrame(reading, this.sensor.rotations[k], right[k], up[k]));
    this.values.forEach(([x, y, z], k) => {
      if (this.faulty.has(k)) return;
      this.scales.disc.include(Math.abs(z));
      this.scales.arrow.include(Math.hypot(x, y));
    });
  }

  /** Resize the canvas; called by a ResizeObserver, because reading the layout is slow. */
  resize(width, height) {
    const ratio = window.devicePixelRatio || 1;
    this.size = [width, height];
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.draw();
  }

  // Return the map from metres to pixels that fits all discs and the outline.
  toPixels() {
    const [width, height] = this.size, { points, spacing } = this.layout;
    const ends = [0, 1].map((axis) => {
      const values = points.map((point) => point[axis]);
      return [Math.min(...values), Math.max(...values)];
    });
    const margin = 0.5 * ARROW * spacing, label = 14;
    const zoom = Math.min(
      (width - 4) / (ends[0][1] - ends[0][0] + 2 * margin),
      (height - 4 - label) / (ends[1][1] - ends[1][0] + 2 * margin),
    );
    const middle = ends.map(([low, high]) => (low + high) / 2);
    const at = ([x, y]) => [
      width / 2 + zoom * (x - middle[0]), (height - label) / 2 - zoom * (y - middle[1]),
    ];
    return { zoom, at };
  }

  draw() {
    const context = this.canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
    const [width, height] = this.size;
    if (width < 20 || height < 30) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const { zoom, at } = this.toPixels();
    const radius = 0.49 * zoom * this.layout.spacing;
    this.drawOutline(context, at, radius);
    const points = this.layout.points.map(at);
    points.forEach((point, k) => this.drawDisc(context, point, k, radius));
    if (this.known) points.forEach((point, k) => this.drawArrow(context, point, k, radius));
    this.drawLabel(context, width, height);
  }

  drawOutline(context, at, radius) {
    context.lineJoin = context.lineCap = "round";
    context.beginPath();
    for (const point of this.hull) context.lineTo(...at(point));
    context.closePath();
    // A wide line with round corners around the hull, and a narrower one on top, give an outline.
    for (const [colour, lineWidth] of [[colours.outline, 3 * radius], [colours.base, 3 * radius - 3]]) {
      context.lineWidth = Math.max(1, lineWidth);
      context.strokeStyle = context.fillStyle = colour;
      context.stroke();
      context.fill();
    }
  }

  drawDisc(context, [x, y], k, radius) {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.lineWidth = 1;
    context.strokeStyle = colours.outline;
    context.stroke();
    if (this.faulty.has(k)) return this.drawCross(context, x, y, 0.7 * radius);
    const normal = this.values[k][2], fraction = Math.min(1, Math.abs(normal) / this.scales.disc.full);
    if (!this.known || !(fraction > 0.002)) return undefined;
    context.beginPath();
    context.arc(x, y, Math.max(1, radius * Math.sqrt(fraction)), 0, 2 * Math.PI);
    if (normal > 0) {
      context.fillStyle = scaleColour(fraction);
      context.fill();
    } else {
      context.strokeStyle = scaleColour(fraction);
      context.stroke();
    }
    return undefined;
  }

  drawCross(context, x, y, size) {
    context.lineWidth = 2;
    context.strokeStyle = colours["unstable-line"];
    context.beginPath();
    for (const side of [-1, 1]) {
      context.moveTo(x - size, y - side * size);
      context.lineTo(x + size, y + side * size);
    }
    context.stroke();
  }

  drawArrow(context, [x, y], k, radius) {
    const [right, up] = this.values[k], size = Math.hypot(right, up) / this.scales.arrow.full;
    // Too short an arrow is only its head.
    const length = ARROW * radius * Math.min(1, size);
    if (this.faulty.has(k) || !(length > 3)) return;
    const head = Math.min(6, 0.45 * length), angle = Math.atan2(-up, right);
    context.save();
    context.translate(x, y);
    context.rotate(angle);
    context.beginPath();
    context.moveTo(0, 0);
    context.lineTo(length, 0);
    context.moveTo(length - head, -0.6 * head);
    context.lineTo(length, 0);
    context.lineTo(length - head, 0.6 * head);
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
    context.textBaseline = "alphabetic";
    context.fillStyle = colours.muted;
    const [disc, arrow] = [this.scales.disc, this.scales.arrow].map((scale) => number(scale.full).replace(/\.0+$/, ""));
    const long = `full disc ${disc}, arrow ${arrow} ${unitWord(this.sensor.unit)}`;
    const text = context.measureText(long).width < width ? long : `● ${disc}  → ${arrow}`;
    context.fillText(this.known ? text : "no readings", width / 2, height - 2);
  }
}
