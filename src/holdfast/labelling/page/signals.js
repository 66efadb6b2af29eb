// Signals of the recording: the whole of it coarsely, and what is looked at, finely, with a margin.

import { callService } from "../web/api.js";

export const SERIES = ["F_a", "F_x", "F_y", "F_z", "sigma"];
const MARGIN = 0.4; // of the window, on either side
const PAIRS = 0.75; // of extremes for each pixel: more are not seen, and take time to come
const ENOUGH = 0.6; // pairs for each pixel, with which no finer data are asked for
const PAUSE = 20; // [ms], so that a turn of the wheel is one question

const numbers = (values) => Float64Array.from(values, (v) => (v === null ? NaN : v));

function read(answer, points) {
  const fingers = new Map(Object.entries(answer.fingers).map(([finger, own]) => [
    finger, Object.fromEntries(["t", ...SERIES].map((key) => [key, numbers(own[key] ?? [])])),
  ]));
  return { start: answer.start, end: answer.end, exact: answer.exact, points, fingers };
}

/** The place of the first of some times that is not before `time`. */
export function find(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

export class Signals {
  /** @param arrived is called with null after data came, or an error. */
  constructor(arrived) {
    this.arrived = arrived;
    this.turn = 0; // counts recordings: answers to questions of an earlier one are dropped
    this.close();
  }

  close() {
    this.turn += 1;
    this.whole = this.part = null;
    this.asking = false;
    this.wanted = null;
    this.n_asked = 0;
    this.timer = clearTimeout(this.timer); // none
  }

  async open(id, start, end, width) {
    this.close();
    Object.assign(this, { id, start, end });
    const turn = this.turn;
    const answer = await this.ask(start, end, Math.max(600, Math.round(width)));
    if (turn !== this.turn) return;
    this.whole = answer;
    this.arrived(null);
    if (this.wanted) this.want(...this.wanted);
  }

  async ask(start, end, points) {
    this.n_asked += 1;
    const query = new URLSearchParams({ start, end, points });
    return read(await callService("GET", `recordings/${this.id}/signals?${query}`), points);
  }

  /** Asks for what a window needs, unless it is there: one question at a time, the newest next. */
  want(start, end, width) {
    this.wanted = [start, end, width];
    if (!this.whole || this.asking || this.timer) return;
    this.timer = setTimeout(() => { this.timer = null; this.fetch(); }, PAUSE);
  }

  async fetch() {
    const [start, end, width] = this.wanted, turn = this.turn;
    if (this.enough(start, end, width)) return;
    const margin = MARGIN * (end - start);
    const from = Math.max(this.start, start - margin), to = Math.min(this.end, end + margin);
    const points = Math.min(5000, Math.round((PAIRS * width * (to - from)) / (end - start)));
    this.asking = true;
    let problem = null;
    try {
      const answer = await this.ask(from, to, Math.max(100, points));
      if (turn !== this.turn) return;
      this.part = answer;
    } catch (error) {
      problem = error;
    }
    if (turn !== this.turn) return;
    this.asking = false;
    this.arrived(problem);
    if (!problem && this.wanted.some((value, k) => value !== [start, end, width][k])) this.want(...this.wanted);
  }

  // Whether what is there is fine enough for a window of so many pixels.
  enough(start, end, width) {
    return [this.part, this.whole].some((data) => data && data.start <= start && data.end >= end
      && (data.exact || data.points / (data.end - data.start) >= (ENOUGH * width) / (end - start)));
  }

  /** What there is of a finger over a window, the finest: pieces of (data, from, to). */
  pieces(finger, start, end) {
    const whole = this.whole?.fingers.get(finger), part = this.part?.fingers.get(finger);
    if (!whole) return [];
    const { part: piece } = this;
    if (!part || this.whole.exact || piece.end <= start || piece.start >= end) return [[whole, start, end]];
    const found = [[part, Math.max(start, piece.start), Math.min(end, piece.end)]];
    if (piece.start > start) found.unshift([whole, start, piece.start]);
    if (piece.end < end) found.push([whole, piece.end, end]);
    return found;
  }

  /** The values of a finger at a time, by series; of the nearest sample that is there. */
  at(finger, time) {
    const [[data] = []] = this.pieces(finger, time, time + 1e-9);
    if (!data?.t.length) return null;
    let place = Math.min(data.t.length - 1, find(data.t, time));
    if (place > 0 && time - data.t[place - 1] < data.t[place] - time) place -= 1;
    return Object.fromEntries(SERIES.map((key) => [key, data[key][place]]));
  }
}
