// Format labels and dates for people. Pure functions.

import { timeText, withSpaces } from "../web/text.js";

export const STATES = ["stable", "unstable", "no_contact"]; // in the order of their keys 1, 2, 3
export const CAUSES = ["closing", "disturbance", "slip", "lost", "released", "glitch"];

/** Return the key of a cause: its first letter; k for a glitch, because g goes to the next item. */
export const causeKey = (cause) => (cause === "glitch" ? "k" : cause[0]);

/** Format state and cause of a label: "unstable, slip". */
export const labelText = ({ state, cause }) => withSpaces(state ?? "unknown") + (cause ? `, ${withSpaces(cause)}` : "");

/** Format an interval: "1.320 – 2.010 s (0.690 s)". */
export const spanText = ({ start, end }) =>
  `${timeText(start, 0.001)} \u2013 ${timeText(end, 0.001)} s (${timeText(end - start, 0.001)} s)`;

/** Format a number of things: "1 label", "3 labels". */
export const countOf = (n, noun) => `${n} ${noun}${n === 1 ? "" : "s"}`;

/** Format an ISO 8601 time, without the date if it is today; return other texts unchanged. */
export function dateText(text) {
  const date = new Date(text);
  if (!text || Number.isNaN(date.getTime())) return text ?? "";
  const time = date.toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" });
  if (date.toDateString() === new Date().toDateString()) return time;
  return `${date.toLocaleDateString("en-GB", { day: "numeric", month: "short", year: "numeric" })}, ${time}`;
}
