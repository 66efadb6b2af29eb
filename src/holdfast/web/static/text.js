// Words and numbers as people read them on every page. Pure functions.

export const MINUS = "\u2212";
export const NO_VALUE = "\u2013";

/** What nobody has named yet is shown as it came, underscores apart. */
export const withSpaces = (word) => String(word).replaceAll("_", " ");

/** A number to three or four digits, with a real minus; a dash for none. */
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

export const percent = (share) => (Number.isFinite(share) ? `${Math.round(100 * share)}\u202f%` : NO_VALUE);
