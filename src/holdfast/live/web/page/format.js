// Format numbers, states and times for people. Pure functions.

import { NO_VALUE, withSpaces } from "../web/text.js";

// The code of a state in a series is its index in this list.
export const STATES = ["UNKNOWN", "NO_CONTACT", "UNSTABLE", "STABLE"];
export const UNKNOWN = 0;

const REASONS = {
  tare: "taking tare",
  warm_up: "warming up",
  gap: "gap in samples",
  fault: "faulty",
  load: "load changes",
  hold: "hold time",
};

/** Return whether samples arrive late enough to be worth a colour; as MIN_LATE_DELAY [s]. */
export const isLate = (seconds) => seconds > 0.1;

export const stateWord = (state) => withSpaces(state ?? "UNKNOWN");
export const reasonWord = (reason) => (reason ? REASONS[reason] ?? withSpaces(reason) : "");
/** Return the probability to show; null without contact, where nothing can be stable or slide. */
export const shownProbability = (state, probability) => (state === "NO_CONTACT" ? null : probability ?? null);
/** Return whether the model has a slip rule for a finger of the hello message. */
export const hasSlipRule = (sensor) => Number.isFinite(sensor?.slip_threshold);
/** Return the name of a fault; `texts` are those of the service, by fault. */
export const faultWord = (fault, texts) => texts?.[fault]?.words ?? withSpaces(fault);

/** Format a fraction as percent, with decimals where they matter: "50 %", "68.5 %", "99.95 %". */
export function share(fraction) {
  if (!Number.isFinite(fraction)) return NO_VALUE;
  const digits = Math.abs(fraction - 0.5) > 0.485 ? 2 : 1;
  return `${Number((100 * fraction).toFixed(digits))}\u202f%`;
}

/** Return why the state of a finger differs from what its probability says; "" if it does not. */
export function debounceNote({ state, reason, stable_probability: probability }, threshold, debounce) {
  if (!debounce || !Number.isFinite(probability) || reason === "load") return "";
  const { hold, hysteresis, min_duration: duration } = debounce, above = probability >= threshold;
  const waits = duration > 0 ? `waits ${seconds(duration)}` : "";
  if (state === "UNSTABLE" && above) {
    if (probability < threshold + hysteresis) return `from ${share(threshold + hysteresis)}`;
    return hold > 0 ? `held ${seconds(hold)}` : waits;
  }
  if (state !== "STABLE" || above) return "";
  return probability >= threshold - hysteresis ? `below ${share(threshold - hysteresis)}` : waits;
}

/** Format a distance that a finger slid [mm]: "0.8 mm", "12 mm". */
export const distance = (mm) => `${mm.toFixed(mm < 9.95 ? 1 : 0)}\u202fmm`;
/** Format the speed of a slip [mm/s]: "3.2 mm/s", "85 mm/s". */
export const slipSpeed = (speed) => `${distance(speed)}/s`;

const seconds = (value) => `${Number(value.toPrecision(2))} s`;

/** Format a latency: "0.21 ms", "12 ms", "1.3 s". */
export function latency(seconds) {
  if (!Number.isFinite(seconds)) return NO_VALUE;
  const ms = 1000 * seconds;
  return ms >= 1000 ? `${seconds.toFixed(1)} s` : `${ms.toFixed(ms < 0.995 ? 2 : ms < 9.95 ? 1 : 0)} ms`;
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
