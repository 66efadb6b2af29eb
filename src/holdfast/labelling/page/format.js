// Format states, numbers and times for people. Pure functions.

import { MINUS, NO_VALUE, withSpaces } from "../web/text.js";

export * from "../web/text.js";

export const STATES = ["stable", "unstable", "no_contact"]; // in the order of their keys 1, 2, 3
export const CAUSES = ["closing", "disturbance", "slip", "lost", "released", "glitch"];

/** Return the key of a cause: its first letter; k for a glitch, because g goes to the next item. */
export const causeKey = (cause) => (cause === "glitch" ? "k" : cause[0]);

/** Return the key of a state in class names, shapes and colours: "no-contact". */
export const stateKey = (state) => (STATES.includes(state) ? state.replace("_", "-") : "unknown");

export const stateText = (state) => withSpaces(state ?? "unknown");

/** Format state and cause of a label: "unstable, slip". */
export const labelText = ({ state, cause }) => stateText(state) + (cause ? `, ${withSpaces(cause)}` : "");

/** Format a time [s] with the digits that an axis of this step needs. */
export const timeText = (time, step) =>
  time.toFixed(Math.max(0, Math.min(6, Math.ceil(-Math.log10(step) - 1e-9)))).replace("-", MINUS);

/** Format an interval: "1.320 – 2.010 s (0.690 s)". */
export const spanText = ({ start, end }) =>
  `${timeText(start, 0.001)} \u2013 ${timeText(end, 0.001)} s (${timeText(end - start, 0.001)} s)`;

/** Format a duration: "31 s", "4:05 min". */
export function durationText(seconds) {
  if (!Number.isFinite(seconds)) return NO_VALUE;
  const whole = Math.round(seconds);
  return whole < 100 ? `${whole} s` : `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} min`;
}

/** Format a number of things: "1 label", "3 labels". */
export const countOf = (n, noun) => `${n} ${noun}${n === 1 ? "" : "s"}`;

/** Format an ISO 8601 time, without the date if it is today; return other texts unchanged. */
export function dateText(text) {
  const date = new Date(text);
  if (!text || Number.isNaN(date.getTime())) return text ?? "";
  const today = date.toDateString() === new Date().toDateString();
  const time = date.toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" });
  return today ? time : `${date.toLocaleDateString("en-GB", { day: "numeric", month: "short", year: "numeric" })}, ${time}`;
}

/** Return the smallest of 1, 2 and 5 times a power of ten that is at least `minimum`. */
export function niceStep(minimum) {
  const power = 10 ** Math.floor(Math.log10(minimum));
  return power * ([1, 2, 5].find((step) => step * power >= minimum * (1 - 1e-9)) ?? 10);
}
