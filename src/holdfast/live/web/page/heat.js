// The colour scale of the taxel maps.

import { lightTheme } from "../web/theme.js";

// From dim to bright, in even steps of lightness: legible to the colour-blind and in print.
const DARK = [[62, 96, 190], [46, 134, 190], [48, 176, 164], [150, 212, 96], [253, 231, 76]];
const LIGHT = [[176, 205, 230], [110, 170, 210], [50, 130, 170], [40, 85, 140], [45, 20, 95]];

/** The colour of a share from 0 to 1 of the full scale. */
export function heat(share) {
  const stops = lightTheme.matches ? LIGHT : DARK;
  const at = Math.min(1, Math.max(0, share)) * (stops.length - 1);
  const k = Math.min(stops.length - 2, Math.floor(at));
  const mix = stops[k].map((low, c) => Math.round(low + (at - k) * (stops[k + 1][c] - low)));
  return `rgb(${mix.join(" ")})`;
}
