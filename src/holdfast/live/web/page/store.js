// Samples of the last minute, in memory of constant size.

import { indexAt } from "../web/store.js";
import { STATES, UNKNOWN, shownProbability } from "./format.js";

const SECONDS = 60;
const COLUMNS = ["fx", "fy", "fz", "force", "sigma", "probability", "slip"];

/** Return the number of samples in a minute at a rate [Hz]; sensors reach up to 1000 Hz. */
export const capacityFor = (rate) => Math.ceil(SECONDS * Math.min(1000, Math.max(200, 1.05 * (rate ?? 0))));

/**
 * Store of the newest `capacity` samples, as columns.
 *
 * The arrays have twice that length, so that the newest samples are always contiguous. They are
 * moved to the beginning once in `capacity` samples only.
 */
export class SampleStore {
  constructor(fingers, capacity) {
    this.capacity = capacity;
    this.end = 0; // index after the newest sample
    this.removed = 0; // number of samples removed at the beginning; keeps bins aligned
    this.lastTimes = new Map(); // time of each finger's last sample [s]
    this.times = new Float64Array(2 * capacity);
    this.hand = new Uint8Array(2 * capacity);
    this.fingers = new Map(fingers.map((name) => [name, {
      ...Object.fromEntries(COLUMNS.map((column) => [column, new Float32Array(2 * capacity)])),
      state: new Uint8Array(2 * capacity),
    }]));
  }

  get start() { return Math.max(0, this.end - this.capacity); }
  get latest() { return this.end ? this.times[this.end - 1] : null; }

  arrays() { return [this.times, this.hand, ...[...this.fingers.values()].flatMap((columns) => Object.values(columns))]; }

  /** Append the samples of a message; `hand` is the code of the hand's state. */
  append({ times, fingers }, hand, maxGap) {
    const last = this.latest;
    if (!times.length) return;
    // Times that go back mean a restarted source: a replay in a loop, or another clock. A source
    // that falls silent gives an estimate at the time of its last sample: the samples stay.
    if (last !== null && times[0] < last) this.clear();
    // A sample without values breaks the lines of the plots.
    else if (last !== null && times[0] - last > maxGap) this.appendSample(0.5 * (last + times[0]), UNKNOWN, {}, 0, 0);
    const skipped = Math.max(0, times.length - this.capacity);
    this.removed += skipped;
    for (let k = skipped; k < times.length; k += 1) this.appendSample(times[k], hand, fingers, k, maxGap);
  }

  clear() {
    this.end = 0;
    this.lastTimes.clear();
  }

  appendSample(time, hand, fingers, k, maxGap) {
    if (this.end === this.times.length) {
      const from = this.end - this.capacity;
      for (const array of this.arrays()) array.copyWithin(0, from);
      this.end = this.capacity;
      this.removed += from;
    }
    const index = this.end++;
    this.times[index] = time;
    this.hand[index] = hand;
    for (const [name, columns] of this.fingers) {
      const series = fingers[name], state = series?.state?.[k];
      // Fingers may be sampled at different times: between its samples a finger keeps its values.
      const isBetween = state === null && index > 0 && time - (this.lastTimes.get(name) ?? -Infinity) < maxGap;
      const sample = isBetween ? null : sampleOf(series, k);
      for (const key of Object.keys(columns)) columns[key][index] = sample ? sample[key] : columns[key][index - 1];
      if (typeof state === "number") this.lastTimes.set(name, time);
    }
  }

  /** Return a copy, for plots that are paused. */
  copy() { return Object.assign(new SampleStore([], 0), structuredClone({ ...this })); }
}

function sampleOf(series, k) {
  const value = (values) => values?.[k] ?? NaN;
  const [fx, fy, fz] = [0, 1, 2].map((axis) => value(series?.force?.[axis])), state = series?.state?.[k] ?? UNKNOWN;
  const shown = (values) => shownProbability(STATES[state], values?.[k]) ?? NaN;
  return {
    fx, fy, fz, force: Math.hypot(fx, fy, fz), sigma: value(series?.instability), state,
    probability: shown(series?.stable_probability), slip: shown(series?.slip_probability),
  };
}

/**
 * Reduce the last `window` seconds to about `bins` bins, with the smallest and the largest value
 * of each bin, so that short peaks remain visible.
 *
 * The number of samples in a bin is a power of two, and bins keep their samples while the plot
 * moves: lines shift and do not flicker.
 *
 * @param arrays columns of the store.
 * @returns {{x: number[], columns: (number|null)[][], indices: number[]}} times relative to the
 *   newest sample [s], values, and the indices of the samples in the store.
 */
export function downsample(store, window, bins, arrays) {
  const now = store.latest ?? 0;
  const first = Math.max(store.start, indexAt(store.times, now - window, store.start, store.end) - 1);
  const stride = 2 ** Math.max(0, Math.ceil(Math.log2((store.end - first) / bins)));
  const indices = [], columns = arrays.map(() => []);
  let start = stride === 1 ? first : Math.ceil((first + store.removed) / stride) * stride - store.removed;
  for (; start < store.end; start += stride) {
    const stop = Math.min(start + stride, store.end), middle = start + (stride >> 1);
    const isPair = stride > 1 && middle < stop;
    indices.push(start, ...(isPair ? [middle] : []));
    arrays.forEach((array, c) => columns[c].push(...(isPair ? extremes(array, start, stop) : [Number.isNaN(array[start]) ? null : array[start]])));
  }
  return { x: indices.map((index) => store.times[index] - now), columns, indices };
}

// Return the smallest and the largest value in their order; a missing value breaks the line.
function extremes(array, start, stop) {
  let low = -1, high = -1, missing = -1;
  for (let k = start; k < stop; k += 1) {
    if (Number.isNaN(array[k])) { missing = k; continue; }
    if (low < 0 || array[k] < array[low]) low = k;
    if (high < 0 || array[k] > array[high]) high = k;
  }
  if (low < 0) return [null, null];
  const pair = low <= high ? [array[low], array[high]] : [array[high], array[low]];
  if (missing < 0) return pair;
  return missing < high ? [null, array[high]] : [array[high], null];
}
