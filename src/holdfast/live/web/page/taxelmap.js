// The map of one sensor on a canvas: a disc for the normal reading, an arrow for the shear.

import { colours, font } from "../web/theme.js";
import { heat } from "./heat.js";
import { hull, layout, turned } from "./layout.js";
import { number, unitWord } from "./format.js";

const FONT = font(11);
// Readings under this are noise: the scale never gets finer.
const FLOORS = { count: 50, N: 0.1 };
const DECAY = 6; // [s] to fall to 1/e: discs keep their meaning while a grasp changes

/** A round number that the largest readings fill, common to all fingers of one unit. */
export class Scale {
  constructor(unit) {
    this.peak = this.floor = FLOORS[unit] ?? 1e-3;
    this.last = null;
    this.full = this.floor;
  }

  /** Lets the scale fall for the time gone by [s]. */
  decay(now) {
    const gone = this.last === null ? 0 : Math.max(0, now - this.last);
    this.last = now;
    this.peak = Math.max(this.floor, this.peak * Math.exp(-gone / DECAY));
    this.full = nice(this.peak);
  }

  take(value) {
    if (Number.isFinite(value) && value > this.peak) {
      this.peak = value;
      this.full = nice(value);
    }
  }
}

export function nice(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 3, 4, 5, 7, 10].find((step) => step * power >= value * 0.999) * power;
}

export class TaxelMap {
  /** @param scales {disc, arrow}: shears are smaller than presses, and have a scale of their own. */
  constructor(canvas, sensor, scales) {
    this.canvas = canvas;
    this.sensor = sensor;
    this.scales = scales;
    this.layout = layout(sensor.positions, sensor.rotations, sensor.normal);
    this.hull = hull(this.layout.places);
    this.values = sensor.positions.map(() => [0, 0, 0]);
    this.faulty = new Set();
    this.known = false;
    this.size = [0, 0];
  }

  /** Takes the tared readings in taxel frames, or null while there are none. */
  update(taxels, faulty) {
    const { right, up } = this.layout;
    this.faulty = new Set(faulty);
    this.known = Array.isArray(taxels) && taxels.length === this.values.length;
    if (!this.known) return;
    this.values = taxels.map((reading, k) => turned(reading, this.sensor.rotations[k], right[k], up[k]));
    this.values.forEach(([x, y, z], k) => {
      if (this.faulty.has(k)) return;
      this.scales.disc.take(Math.abs(z));
      this.scales.arrow.take(Math.hypot(x, y));
    });
  }

  /** Called by a ResizeObserver only: reading a layout in each drawing would be slow. */
  resize(width, height) {
    const ratio = window.devicePixelRatio || 1;
    this.size = [width, height];
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.draw();
  }

  // From metres to pixels, all discs and the outline within the canvas.
  fit() {
    const [width, height] = this.size, { places, spacing } = this.layout;
    const ends = [0, 1].map((axis) => {
      const values = places.map((place) => place[axis]);
      return [Math.min(...values), Math.max(...values)];
    });
    const margin = 0.75 * spacing, label = 14;
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
    const pen = this.canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
    const [width, height] = this.size;
    if (width < 20 || height < 30) return;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const { zoom, at } = this.fit();
    const most = 0.49 * zoom * this.layout.spacing;
    this.outline(pen, at, most);
    const places = this.layout.places.map(at);
    places.forEach((place, k) => this.disc(pen, place, k, most));
    if (this.known) places.forEach((place, k) => this.arrow(pen, place, k, most));
    this.label(pen, width, height);
  }

  outline(pen, at, most) {
    pen.lineJoin = pen.lineCap = "round";
    pen.beginPath();
    for (const point of this.hull) pen.lineTo(...at(point));
    pen.closePath();
    // A wide line with round corners around the hull, and a narrower one on top: an outline.
    for (const [colour, wide] of [[colours.outline, 3 * most], [colours.base, 3 * most - 3]]) {
      pen.lineWidth = Math.max(1, wide);
      pen.strokeStyle = pen.fillStyle = colour;
      pen.stroke();
      pen.fill();
    }
  }

  disc(pen, [x, y], k, most) {
    pen.beginPath();
    pen.arc(x, y, most, 0, 2 * Math.PI);
    pen.lineWidth = 1;
    pen.strokeStyle = colours.outline;
    pen.stroke();
    if (this.faulty.has(k)) return this.cross(pen, x, y, 0.7 * most);
    const normal = this.values[k][2], share = Math.min(1, Math.abs(normal) / this.scales.disc.full);
    if (!this.known || !(share > 0.002)) return undefined;
    pen.beginPath();
    pen.arc(x, y, Math.max(1, most * Math.sqrt(share)), 0, 2 * Math.PI);
    if (normal > 0) {
      pen.fillStyle = heat(share);
      pen.fill();
    } else {
      pen.strokeStyle = heat(share);
      pen.stroke();
    }
    return undefined;
  }

  cross(pen, x, y, size) {
    pen.lineWidth = 2;
    pen.strokeStyle = colours["unstable-line"];
    pen.beginPath();
    for (const side of [-1, 1]) {
      pen.moveTo(x - size, y - side * size);
      pen.lineTo(x + size, y + side * size);
    }
    pen.stroke();
  }

  arrow(pen, [x, y], k, most) {
    const [right, up] = this.values[k], size = Math.hypot(right, up) / this.scales.arrow.full;
    // One and a half discs long at full scale; shorter than its head it would be a blot.
    const length = 3 * most * Math.min(1, size);
    if (this.faulty.has(k) || !(length > 3)) return;
    const head = Math.min(6, 0.45 * length), angle = Math.atan2(-up, right);
    pen.save();
    pen.translate(x, y);
    pen.rotate(angle);
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.lineTo(length, 0);
    pen.moveTo(length - head, -0.6 * head);
    pen.lineTo(length, 0);
    pen.lineTo(length - head, 0.6 * head);
    // Dark beneath, light above: it shows on a bright disc and on the ground.
    for (const [colour, wide] of [[colours.base, 3.6], [colours.text, 1.6]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = wide;
      pen.stroke();
    }
    pen.restore();
  }

  label(pen, width, height) {
    pen.font = FONT;
    pen.textAlign = "center";
    pen.textBaseline = "alphabetic";
    pen.fillStyle = colours.muted;
    const [disc, arrow] = [this.scales.disc, this.scales.arrow].map((scale) => number(scale.full).replace(/\.0+$/, ""));
    const long = `full disc ${disc}, arrow ${arrow} ${unitWord(this.sensor.unit)}`;
    const text = pen.measureText(long).width < width ? long : `● ${disc}  → ${arrow}`;
    pen.fillText(this.known ? text : "no readings", width / 2, height - 2);
  }
}
