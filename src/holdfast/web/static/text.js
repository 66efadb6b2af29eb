// Format numbers, times, names and states for people, on every page. Pure functions.

export const MINUS = "\u2212";
export const NO_VALUE = "\u2013";
const STATE_KEYS = ["stable", "unstable", "no-contact", "unknown"];

/** Return a name with spaces instead of underscores. */
export const withSpaces = (word) => String(word).replaceAll("_", " ");

/** Return the key of a state in class names, shapes and colours: "no-contact". */
export function stateKey(state) {
  const key = String(state).toLowerCase().replace("_", "-");
  return STATE_KEYS.includes(key) ? key : "unknown";
}

/** Format a number with three or four digits and a real minus sign; a dash for no value. */
export function number(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NO_VALUE;
  const size = Math.abs(value);
  const text = size >= 99999.5 ? `${(size / 1000).toFixed(0)}k` : size.toFixed(size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2);
  return (value < 0 && Number(text) !== 0 ? MINUS : "") + text;
}

export const unitWord = (unit) => (unit === "count" ? "counts" : unit ?? "");

export const percent = (fraction) => (Number.isFinite(fraction) ? `${Math.round(100 * fraction)}\u202f%` : NO_VALUE);

/** Format a duration in few characters: "0.8 s", "12 s", "3 min", "2 h". */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return NO_VALUE;
  if (seconds < 99.5) return `${Math.max(0, seconds).toFixed(seconds < 9.95 ? 1 : 0)} s`;
  return seconds < 5970 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

/** Format a time [s] with the digits that an axis of this step needs. */
export const timeText = (time, step) =>
  time.toFixed(Math.max(0, Math.min(6, Math.ceil(-Math.log10(step) - 1e-9)))).replace("-", MINUS);
