// Time series of the pages: sorted times with columns of values.

/** Return the index of the first of the sorted times in [low, high) that is not before `time`. */
export function indexAt(times, time, low = 0, high = times.length) {
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}
