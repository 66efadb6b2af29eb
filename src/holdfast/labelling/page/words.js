// Words and numbers as people read them. Pure functions.

import { MINUS, NO_VALUE, withSpaces } from "../web/text.js";

export * from "../web/text.js";

export const STATES = ["stable", "unstable", "no_contact"]; // by their keys 1, 2, 3
export const CAUSES = ["closing", "disturbance", "slip", "lost", "released"]; // by their first letters

/** The key of a state in class names, shapes and colours: "no-contact". */
export const stateKey = (state) => (STATES.includes(state) ? state.replace("_", "-") : "unknown");

export const stateWord = (state) => withSpaces(state ?? "unknown");

/** "unstable, slip" */
export const labelWord = ({ state, cause }) => stateWord(state) + (cause ? `, ${withSpaces(cause)}` : "");

/** A time with the digits that a step of the axis needs. */
export const timeWord = (time, step) =>
  time.toFixed(Math.max(0, Math.min(6, Math.ceil(-Math.log10(step) - 1e-9)))).replace("-", MINUS);

/** "1.320 – 2.010 s (0.690 s)" */
export const spanWord = ({ start, end }) =>
  `${timeWord(start, 0.001)} \u2013 ${timeWord(end, 0.001)} s (${timeWord(end - start, 0.001)} s)`;

/** A length of time: "31 s", "4:05 min". */
export function lengthWord(seconds) {
  if (!Number.isFinite(seconds)) return NO_VALUE;
  const whole = Math.round(seconds);
  return whole < 100 ? `${whole} s` : `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} min`;
}

/** Many of a thing: "1 label", "3 labels". */
export const many = (n, thing) => `${n} ${thing}${n === 1 ? "" : "s"}`;

/** Date and time of an ISO 8601 text; the text itself where it is none. */
export function whenWord(text) {
  const date = new Date(text);
  if (!text || Number.isNaN(date.getTime())) return text ?? "";
  const today = date.toDateString() === new Date().toDateString();
  const time = date.toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" });
  return today ? time : `${date.toLocaleDateString("en-GB", { day: "numeric", month: "short", year: "numeric" })}, ${time}`;
}

/** Steps of an axis that people count in: 1, 2, 5 times a power of ten, at least `least`. */
export function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * ([1, 2, 5].find((step) => step * power >= least * (1 - 1e-9)) ?? 10);
}
