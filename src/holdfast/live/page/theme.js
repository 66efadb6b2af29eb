// Colours for the canvases, read from the style sheet, so that they are written down once.

const NAMES = [
  "ground", "panel", "text", "muted", "grid", "base", "outline",
  "stable-line", "unstable-line", "no-contact-line", "unknown-line",
  "finger-0", "finger-1", "finger-2", "finger-3", "finger-4", "finger-5",
  "axis-x", "axis-y", "axis-z", "marker",
];
const light = window.matchMedia("(prefers-color-scheme: light)");

export const colours = {};

/** The page's own font, small, for canvases. */
export const FONT = `11px ${getComputedStyle(document.documentElement).fontFamily}`;

function read() {
  const style = getComputedStyle(document.documentElement);
  for (const name of NAMES) colours[name] = style.getPropertyValue(`--${name}`).trim();
}

/** Calls `changed` whenever the system turns from dark to light or back. */
export function onTheme(changed) {
  light.addEventListener("change", () => { read(); changed(); });
}

export const fingerColour = (place) => colours[`finger-${place % 6}`];
export const stateColour = (key) => colours[`${key}-line`];

// From dim to bright, in even steps of lightness: legible to the colour-blind and in print.
const DARK = [[62, 96, 190], [46, 134, 190], [48, 176, 164], [150, 212, 96], [253, 231, 76]];
const LIGHT = [[176, 205, 230], [110, 170, 210], [50, 130, 170], [40, 85, 140], [45, 20, 95]];

/** The colour of a share from 0 to 1 of the full scale. */
export function heat(share) {
  const stops = light.matches ? LIGHT : DARK;
  const at = Math.min(1, Math.max(0, share)) * (stops.length - 1);
  const k = Math.min(stops.length - 2, Math.floor(at));
  const mix = stops[k].map((low, c) => Math.round(low + (at - k) * (stops[k + 1][c] - low)));
  return `rgb(${mix.join(" ")})`;
}

read();
