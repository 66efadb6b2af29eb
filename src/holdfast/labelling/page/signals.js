// Signals of the recording from the service: the whole recording at low resolution, and the time
// window with a margin at the resolution of the screen.

import { callService } from "../web/api.js";

const SERIES = ["F_a", "F_x", "F_y", "F_z", "sigma"];
const MARGIN = 0.4; // on either side, as a fraction of the window
const PAIRS_PER_PIXEL = 0.75; // requested; each pair is a minimum and a maximum
const MIN_PAIRS_PER_PIXEL = 0.6; // with fewer, finer data are requested
const MIN_POINTS = 100, MAX_POINTS = 5000; // of one request
const MIN_COARSE_POINTS = 600;
const REQUEST_DELAY = 20; // [ms], so that one turn of the wheel makes one request

const toNumbers = (values) => Float64Array.from(values, (v) => (v === null ? NaN : v));

function decode(response, points) {
  const fingers = new Map(Object.entries(response.fingers).map(([finger, own]) => [
    finger, Object.fromEntries(["t", ...SERIES].map((key) => [key, toNumbers(own[key] ?? [])])),
  ]));
  return { start: response.start, end: response.end, exact: response.exact, points, fingers };
}

/** Return the index of the first of the sorted times that is not before `time`. */
export function indexAt(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

export class Signals {
  /** @param arrived called with null after new data, or with an error. */
  constructor(arrived) {
    this.arrived = arrived;
    this.generation = 0; // counts recordings; responses for an earlier one are dropped
    this.close();
  }

  close() {
    this.generation += 1;
    this.coarse = this.fine = null;
    this.loading = false;
    this.requested = null;
    this.timer = clearTimeout(this.timer); // undefined
  }

  async open(id, start, end, width) {
    this.close();
    Object.assign(this, { id, start, end });
    const generation = this.generation;
    const data = await this.fetch(start, end, Math.max(MIN_COARSE_POINTS, Math.round(width)));
    if (generation !== this.generation) return;
    this.coarse = data;
    this.arrived(null);
    if (this.requested) this.request(...this.requested);
  }

  async fetch(start, end, points) {
    const query = new URLSearchParams({ start, end, points });
    return decode(await callService("GET", `recordings/${this.id}/signals?${query}`), points);
  }

  /**
   * Request the data of a window, unless they are loaded. One request runs at a time; after it,
   * only the newest window is requested.
   */
  request(start, end, width) {
    this.requested = [start, end, width];
    if (!this.coarse || this.loading || this.timer) return;
    this.timer = setTimeout(() => { this.timer = null; this.load(); }, REQUEST_DELAY);
  }

  async load() {
    const [start, end, width] = this.requested, generation = this.generation;
    if (this.isFineEnough(start, end, width)) return;
    const margin = MARGIN * (end - start);
    const from = Math.max(this.start, start - margin), to = Math.min(this.end, end + margin);
    const points = Math.min(MAX_POINTS, Math.round((PAIRS_PER_PIXEL * width * (to - from)) / (end - start)));
    this.loading = true;
    let problem = null;
    try {
      const data = await this.fetch(from, to, Math.max(MIN_POINTS, points));
      if (generation !== this.generation) return;
      this.fine = data;
    } catch (error) {
      problem = error;
    }
    if (generation !== this.generation) return;
    this.loading = false;
    this.arrived(problem);
    if (!problem && this.requested.some((value, k) => value !== [start, end, width][k])) this.request(...this.requested);
  }

  // Return whether the loaded data are fine enough for a window of this width [px].
  isFineEnough(start, end, width) {
    return [this.fine, this.coarse].some((data) => data && data.start <= start && data.end >= end
      && (data.exact || data.points / (data.end - data.start) >= (MIN_PAIRS_PER_PIXEL * width) / (end - start)));
  }

  /** Return the finest loaded data of a finger over a window, as segments (data, from, to). */
  segments(finger, start, end) {
    const coarseData = this.coarse?.fingers.get(finger), fineData = this.fine?.fingers.get(finger);
    if (!coarseData) return [];
    const { fine } = this;
    if (!fineData || this.coarse.exact || fine.end <= start || fine.start >= end) return [[coarseData, start, end]];
    const segments = [[fineData, Math.max(start, fine.start), Math.min(end, fine.end)]];
    if (fine.start > start) segments.unshift([coarseData, start, fine.start]);
    if (fine.end < end) segments.push([coarseData, fine.end, end]);
    return segments;
  }

  /** Return the values of the loaded sample nearest to a time, by series; null without data. */
  valuesAt(finger, time) {
    const [[data] = []] = this.segments(finger, time, time + 1e-9);
    if (!data?.t.length) return null;
    let index = Math.min(data.t.length - 1, indexAt(data.t, time));
    if (index > 0 && time - data.t[index - 1] < data.t[index] - time) index -= 1;
    return Object.fromEntries(SERIES.map((key) => [key, data[key][index]]));
  }
}
