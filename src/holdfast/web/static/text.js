// Format numbers and names for people, on every page. Pure functions.

export const MINUS = "\u2212";
export const NO_VALUE = "\u2013";

/** Return a name with spaces instead of underscores. */
export const withSpaces = (word) => String(word).replaceAll("_", " ");

/** Format a number with three or four digits and a real minus sign; a dash for no value. */
export function number(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NO_VALUE;
  const size = Math.abs(value);
  let text;
  if (size >= 99999.5) text = `${(size / 1000).toFixed(0)}k`;
  else if (size >= 99.95) text = size.toFixed(0);
  else if (size >= 9.995) text = size.toFixed(1);
  else text = size.toFixed(2);
  return (value < 0 && Number(text) !== 0 ? MINUS : "") + text;
}

export const unitWord = (unit) => (unit === "count" ? "counts" : unit ?? "");

export const percent = (fraction) => (Number.isFinite(fraction) ? `${Math.round(100 * fraction)}\u202f%` : NO_VALUE);
