// Colours for canvases, read from the style sheet, which defines them.

const NAMES = [
  "ground", "panel", "text", "muted", "grid", "base", "outline", "ink", "focus",
  "stable", "unstable", "no-contact", "unknown",
  "stable-line", "unstable-line", "no-contact-line", "unknown-line",
  "finger-0", "finger-1", "finger-2", "finger-3", "finger-4", "finger-5",
  "axis-x", "axis-y", "axis-z", "marker", "slip",
];
export const lightTheme = window.matchMedia("(prefers-color-scheme: light)");

export const colours = {};

/** Return the font of the page at a size [px], for canvases. */
export const font = (size, weight = 400) =>
  `${weight} ${size}px ${getComputedStyle(document.documentElement).fontFamily}`;

function read() {
  const style = getComputedStyle(document.documentElement);
  for (const name of NAMES) colours[name] = style.getPropertyValue(`--${name}`).trim();
}

/** Call `changed` when the system switches between dark and light. */
export function onTheme(changed) {
  lightTheme.addEventListener("change", () => { read(); changed(); });
}

export const fingerColour = (index) => colours[`finger-${index % 6}`];
export const stateColour = (key) => colours[key];
export const stateLineColour = (key) => colours[`${key}-line`];

read();
