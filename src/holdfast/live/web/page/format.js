// Format numbers, states and times for people. Pure functions.

import { NO_VALUE, withSpaces } from "../web/text.js";

export * from "../web/text.js";

// The code of a state in a series is its index in this list.
export const STATES = ["UNKNOWN", "NO_CONTACT", "UNSTABLE", "STABLE"];
export const UNKNOWN = 0, NO_CONTACT = 1, UNSTABLE = 2, STABLE = 3;

const REASONS = {
  tare: "taking tare",
  warm_up: "warming up",
  gap: "gap in samples",
  fault: "faulty",
};

const FAULTS = {
  not_finite: "not a number",
  stuck: "stuck",
  saturated: "saturated",
  tare_loaded: "loaded at tare",
  dead: "dead",
  noisy: "noisy",
  out_of_range: "out of range",
  tare_drift: "tare drifts",
  taxel_count: "wrong number of taxels",
  packet_gap: "packets missing",
  late: "late",
  clock_jump: "clock jumped",
  rate: "rate changed",
};

/** Return the key of a state in class names, shapes and colours: "no-contact". */
export const stateKey = (state) =>
  STATES.includes(state) ? state.toLowerCase().replace("_", "-") : "unknown";

export const stateWord = (state) => withSpaces(state ?? "UNKNOWN");
export const reasonWord = (reason) => (reason ? REASONS[reason] ?? withSpaces(reason) : "");
export const faultWord = (fault) => FAULTS[fault] ?? withSpaces(fault);

/** Format a duration in few characters: "0.8 s", "12 s", "3 min", "2 h". */
export function duration(seconds) {
  if (seconds < 9.95) return `${Math.max(0, seconds).toFixed(1)} s`;
  if (seconds < 99.5) return `${seconds.toFixed(0)} s`;
  if (seconds < 5970) return `${Math.round(seconds / 60)} min`;
  return `${Math.round(seconds / 3600)} h`;
}

/** Format a latency: "0.21 ms", "12 ms", "1.3 s". */
export function latency(seconds) {
  if (seconds === null || seconds === undefined) return NO_VALUE;
  if (seconds >= 1) return `${seconds.toFixed(1)} s`;
  const ms = 1000 * seconds;
  return `${ms < 0.995 ? ms.toFixed(2) : ms < 9.95 ? ms.toFixed(1) : ms.toFixed(0)} ms`;
}

/** Format an elapsed time as a clock: "0:07", "1:02:03". */
export function clock(seconds) {
  const whole = Math.floor(seconds), two = (n) => String(n).padStart(2, "0");
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  return h ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)}`;
}

/** Format a file size: "784 kB", "2.1 GB". */
export function fileSize(n) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let k = 0;
  while (n >= 999.5 && k < units.length - 1) { n /= 1000; k += 1; }
  return `${k && n < 9.95 ? n.toFixed(1) : n.toFixed(0)} ${units[k]}`;
}

/** Format the wall-clock time of a notice; `epoch` in seconds since 1970. */
export const wallTime = (epoch) => new Date(1000 * epoch).toLocaleTimeString("en-GB");
