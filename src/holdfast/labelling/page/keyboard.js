// Keyboard shortcuts: which key runs which command. The help in index.html lists the same keys.

import { CAUSES, causeKey, STATES } from "./format.js";

/** Return the actions of the shortcuts, by key name: "Control-z", "Shift-Enter", "a". */
export function keyBindings(commands) {
  const states = STATES.map((state, k) => [String(k + 1), () => commands.setKind({ state })]);
  const causes = CAUSES.map((cause) => [causeKey(cause), () => commands.setKind({ cause })]);
  return {
    ...Object.fromEntries([...states, ...causes]),
    "Control-z": () => commands.undo(), "Control-Shift-z": () => commands.redo(), "Control-y": () => commands.redo(),
    "Control-s": () => commands.saver.flush(),
    Delete: () => commands.remove(), Backspace: () => commands.remove(),
    a: () => commands.copy(),
    Enter: () => commands.accept(), x: () => commands.reject(), "Shift-Enter": () => commands.acceptAll(),
    g: () => commands.nextReviewItem(), n: () => commands.openNeighbour(1), p: () => commands.openNeighbour(-1),
    e: () => commands.editNote(),
    " ": () => commands.player.toggle(), Escape: () => commands.cancel(),
    f: () => commands.nextForce(), y: () => commands.toggleScaling(), b: () => commands.toggleSidePanel(),
    0: () => commands.view.showAll(), Home: () => commands.view.showAll(),
    "+": () => commands.zoom(0.6), "=": () => commands.zoom(0.6), "-": () => commands.zoom(1 / 0.6),
    ArrowLeft: () => commands.pan(-0.2), ArrowRight: () => commands.pan(0.2),
    "?": () => commands.showHelp(),
  };
}

const isTyping = (element) => element.closest?.("input, textarea, select, [contenteditable]");
const isDialogOpen = () => document.querySelector("dialog[open]") !== null;

// Return the name of a pressed key as `keyBindings` spells it.
function keyName(event) {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const control = event.ctrlKey || event.metaKey ? "Control-" : "";
  // Signs as "?" need Shift on some keyboards; their name does not contain it.
  const shift = event.shiftKey && (control || key.length > 1) ? "Shift-" : "";
  return control + shift + key;
}

/** Run the action of each pressed key. @param actions by key name. */
export function listenToKeys(actions) {
  document.addEventListener("keydown", (event) => {
    if (event.altKey || isDialogOpen()) return;
    const name = keyName(event);
    if (isTyping(event.target) && name !== "Control-s") {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    // The space bar and Enter press a button that has the keyboard focus.
    if ([" ", "Enter"].includes(name) && event.target.closest?.("button")) return;
    const act = actions[name];
    if (!act) return;
    event.preventDefault();
    if (!event.repeat || /Control-|Arrow|^[+\-=]$/.test(name)) act();
  });
  // A clicked button loses the focus, so that Enter accepts a proposal and does not press it.
  document.addEventListener("click", (event) => {
    if (event.detail > 0) event.target.closest?.("button")?.blur();
  });
}
