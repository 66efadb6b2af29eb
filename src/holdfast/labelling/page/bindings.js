// Which key does what; the help in index.html lists the same.

import { CAUSES, STATES } from "./words.js";

/** Actions by the names that keys.js gives to keys. */
export function keys(deeds) {
  const states = STATES.map((state, k) => [String(k + 1), () => deeds.name({ state })]);
  const causes = CAUSES.map((cause) => [cause[0], () => deeds.name({ cause })]);
  return {
    ...Object.fromEntries([...states, ...causes]),
    "Control-z": () => deeds.undo(), "Control-Shift-z": () => deeds.redo(), "Control-y": () => deeds.redo(),
    "Control-s": () => deeds.saver.flush(),
    Delete: () => deeds.remove(), Backspace: () => deeds.remove(),
    a: () => deeds.copy(),
    Enter: () => deeds.accept(), x: () => deeds.reject(), "Shift-Enter": () => deeds.acceptAll(),
    g: () => deeds.nextDoubt(), n: () => deeds.go(1), p: () => deeds.go(-1), e: () => deeds.note(),
    " ": () => deeds.player.toggle(), Escape: () => deeds.escape(),
    f: () => deeds.force(), y: () => deeds.heights(), b: () => deeds.panel(),
    0: () => deeds.view.fit(), Home: () => deeds.view.fit(),
    "+": () => deeds.zoom(0.6), "=": () => deeds.zoom(0.6), "-": () => deeds.zoom(1 / 0.6),
    ArrowLeft: () => deeds.pan(-0.2), ArrowRight: () => deeds.pan(0.2),
    "?": () => deeds.help(),
  };
}
