// The last minute of every series, in memory that never grows.

import { UNKNOWN } from "./format.js";

export const SECONDS = 60;
const COLUMNS = ["fx", "fy", "fz", "force", "sigma", "probability"];

/** How many samples a minute has at a rate [Hz]; sensors at up to 1000 Hz are known. */
export const capacityFor = (rate) => Math.ceil(SECONDS * Math.min(1000, Math.max(200, 1.05 * (rate ?? 0))));

/**
 * Columns of samples, twice as long as what is kept: the newest samples are always one piece of
 * an array, and only once in `capacity` samples they are moved to its beginning.
 */
export class Store {
  constructor(fingers, capacity) {
    this.capacity = capacity;
    this.end = 0; // one past the newest sample
    this.moved = 0; // by how much places have been moved, so that bins stay where they are
    this.seen = new Map(); // when each finger had its last sample [s]
    this.times = new Float64Array(2 * capacity);
    this.hand = new Uint8Array(2 * capacity);
    this.fingers = new Map(fingers.map((name) => [name, {
      ...Object.fromEntries(COLUMNS.map((column) => [column, new Float32Array(2 * capacity)])),
      state: new Uint8Array(2 * capacity),
    }]));
  }

  get start() { return Math.max(0, this.end - this.capacity); }
  get latest() { return this.end ? this.times[this.end - 1] : null; }

  /** Memory that the series take [bytes]. */
  get bytes() {
    return this.arrays().reduce((sum, array) => sum + array.byteLength, 0);
  }

  arrays() {
    return [this.times, this.hand, ...[...this.fingers.values()].flatMap((own) => Object.values(own))];
  }

  /** Takes the samples of a message; `hand` is the code of the hand's state then. */
  append(series, hand, gap) {
    const times = series.times, last = this.latest;
    if (!times.length) return;
    // A source that begins anew (a replay in a loop, another clock) has no common past.
    if (last !== null && times[0] <= last) this.forget();
    else if (last !== null && times[0] - last > gap) this.lift(0.5 * (last + times[0]), hand);
    const skipped = Math.max(0, times.length - this.capacity);
    this.moved += skipped;
    for (let k = skipped; k < times.length; k += 1) {
      const place = this.next(times[k], hand);
      for (const [name, own] of this.fingers) {
        const from = series.fingers[name];
        if (from?.state?.[k] === null && this.holds(name, times[k], place, gap)) hold(own, place);
        else fill(own, place, from, k);
        if (typeof from?.state?.[k] === "number") this.seen.set(name, times[k]);
      }
    }
  }

  // Fingers may come one by one: between its samples a finger is as it was.
  holds(name, time, place, gap) {
    return place > 0 && time - (this.seen.get(name) ?? -Infinity) < gap;
  }

  forget() {
    this.end = 0;
    this.seen.clear();
  }

  // A sample without values: the lines break where samples are missing.
  lift(time, hand) {
    const place = this.next(time, hand);
    for (const own of this.fingers.values()) fill(own, place, undefined, 0);
  }

  next(time, hand) {
    if (this.end === this.times.length) {
      const from = this.end - this.capacity;
      for (const array of this.arrays()) array.copyWithin(0, from);
      this.end = this.capacity;
      this.moved += from;
    }
    this.times[this.end] = time;
    this.hand[this.end] = hand;
    this.end += 1;
    return this.end - 1;
  }

  /** A copy of what is kept now, for a view that stands still. */
  frozen() {
    const copy = new Store([], 0);
    Object.assign(copy, { capacity: this.capacity, end: this.end, moved: this.moved });
    copy.times = this.times.slice();
    copy.hand = this.hand.slice();
    copy.fingers = new Map([...this.fingers].map(([name, own]) => [
      name, Object.fromEntries(Object.entries(own).map(([key, array]) => [key, array.slice()])),
    ]));
    return copy;
  }

  /** Place of the first sample that is kept and not before `time`. */
  find(time) {
    let low = this.start, high = this.end;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle] < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

function hold(own, place) {
  for (const array of Object.values(own)) array[place] = array[place - 1];
}

const value = (values, k) => values?.[k] ?? NaN;

function fill(own, place, from, k) {
  const [x, y, z] = [0, 1, 2].map((axis) => value(from?.force?.[axis], k));
  own.fx[place] = x;
  own.fy[place] = y;
  own.fz[place] = z;
  own.force[place] = Math.sqrt(x * x + y * y + z * z);
  own.sigma[place] = value(from?.instability, k);
  own.probability[place] = value(from?.stable_probability, k);
  own.state[place] = from?.state?.[k] ?? UNKNOWN;
}

/**
 * What a plot of `window` seconds shows in at most about `bins` bins, with the least and the
 * largest value of each, so that no short peak is lost.
 *
 * Bins hold a power of two of samples and stay on the same samples while the plot moves: lines
 * slide and do not flicker.
 *
 * @param arrays columns of the store.
 * @returns {{x: number[], columns: (number|null)[][], picks: number[]}} times before the
 *   newest sample [s], values, and the places of the samples in the store.
 */
export function reduce(store, window, bins, arrays) {
  const now = store.latest ?? 0;
  const first = Math.max(store.start, store.find(now - window) - 1);
  const stride = 2 ** Math.max(0, Math.ceil(Math.log2((store.end - first) / bins)));
  const x = [], picks = [], columns = arrays.map(() => []);
  let place = stride === 1 ? first : Math.ceil((first + store.moved) / stride) * stride - store.moved;
  for (; place < store.end; place += stride) {
    const stop = Math.min(place + stride, store.end), middle = place + (stride >> 1);
    x.push(store.times[place] - now);
    picks.push(place);
    const two = stride > 1 && middle < stop;
    if (two) { x.push(store.times[middle] - now); picks.push(middle); }
    arrays.forEach((array, c) => {
      if (two) columns[c].push(...extremes(array, place, stop));
      else columns[c].push(Number.isNaN(array[place]) ? null : array[place]);
    });
  }
  return { x, columns, picks };
}

// The least and the largest value in the order in which they came; a missing value breaks the line.
function extremes(array, start, stop) {
  let low = -1, high = -1, broken = false;
  for (let k = start; k < stop; k += 1) {
    if (Number.isNaN(array[k])) { broken = true; continue; }
    if (low < 0 || array[k] < array[low]) low = k;
    if (high < 0 || array[k] > array[high]) high = k;
  }
  if (low < 0) return [null, null];
  const pair = low <= high ? [array[low], array[high]] : [array[high], array[low]];
  return broken ? [array[high], null] : pair;
}
