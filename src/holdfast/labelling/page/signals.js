// Signals of the recording from the service: the whole recording at low resolution, and the time
// window with a margin at the resolution of the screen.

import { callService } from "../web/connection.js";
import { nearestIndex } from "../web/plot.js";
import { indexAt } from "../web/store.js";

const SERIES = ["t", "F_a", "F_x", "F_y", "F_z", "sigma"];
const MARGIN = 0.4; // on either side, as a fraction of the window
const PAIRS_PER_PIXEL = 0.75; // requested; each pair is a minimum and a maximum
const MIN_PAIRS_PER_PIXEL = 0.6; // with fewer, finer data are requested
const MIN_POINTS = 100, MAX_POINTS = 5000; // of one request
const MIN_COARSE_POINTS = 600;
const REQUEST_DELAY = 20; // [ms], so that one turn of the wheel makes one request

export class Signals {
  /** @param arrived called with null after new data, or with an error. */
  constructor(arrived) {
    this.arrived = arrived;
    this.generation = 0; // counts recordings; responses for an earlier one are dropped
    this.close();
  }

  close() {
    this.generation += 1;
    this.coarse = this.fine = this.requested = null;
    this.joined = new Map(); // coarse and fine data of each finger
    this.loading = false;
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
    return { ...await callService("GET", `recordings/${this.id}/signals?${query}`), points };
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
    const data = await this.fetch(from, to, Math.max(MIN_POINTS, points)).catch((error) => { problem = error; });
    if (generation !== this.generation) return;
    this.loading = false;
    this.fine = data ?? this.fine;
    this.joined.clear();
    this.arrived(problem);
    if (!problem && this.requested.some((value, k) => value !== [start, end, width][k])) this.request(...this.requested);
  }

  // Return whether the loaded data are fine enough for a window of this width [px].
  isFineEnough(start, end, width) {
    return [this.fine, this.coarse].some((data) => data && data.start <= start && data.end >= end
      && (data.exact || data.points / (data.end - data.start) >= (MIN_PAIRS_PER_PIXEL * width) / (end - start)));
  }

  /** Return the columns of a finger: the fine data, and the coarse data around them; null without data. */
  columns(finger) {
    const around = this.coarse?.fingers[finger], inside = this.fine?.fingers[finger];
    if (!around || !inside || this.coarse.exact) return around ?? null;
    if (!this.joined.has(finger)) {
      const [from, to] = [this.fine.start, this.fine.end].map((time) => indexAt(around.t, time));
      this.joined.set(finger, Object.fromEntries(SERIES.map(
        (key) => [key, [...around[key].slice(0, from), ...inside[key], ...around[key].slice(to)]])));
    }
    return this.joined.get(finger);
  }

  /** Return the values of the loaded sample nearest to a time, by series; null without data. */
  valuesAt(finger, time) {
    const columns = this.columns(finger);
    if (!columns?.t.length) return null;
    const index = nearestIndex(columns.t, time);
    return Object.fromEntries(SERIES.map((key) => [key, columns[key][index]]));
  }
}
