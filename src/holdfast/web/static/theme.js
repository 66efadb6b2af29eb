// Colours for canvases, read from the style sheet, which defines them.

export const lightTheme = window.matchMedia("(prefers-color-scheme: light)");

/** Colours by the names of their custom properties. */
export const colours = new Proxy({}, { get: (_, name) => read(name) });

const cache = new Map();

function read(name) {
  if (!cache.has(name)) cache.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return cache.get(name);
}

/** Return the font of the page at a size [px], for canvases. */
export const font = (size, weight = 400) =>
  `${weight} ${size}px ${getComputedStyle(document.documentElement).fontFamily}`;

/** Call `changed` when the system switches between dark and light. */
export function onTheme(changed) {
  lightTheme.addEventListener("change", () => { cache.clear(); changed(); });
}

/** Return the name of the colour of a finger, by its index. */
export const fingerColour = (index) => `finger-${index % 6}`;
