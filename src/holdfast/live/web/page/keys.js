// Keyboard shortcuts: one key each, because the other hand is at the robot.

import { byId } from "../web/dom.js";

const isTyping = (element) => element.closest?.("input, textarea, select, [contenteditable]");

/** @param actions by key; `digit` is called with the number. */
export function listenToKeys(actions) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
    if (byId("help-box").open) return;
    if (isTyping(event.target)) {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    // The space bar presses a button that has the keyboard focus.
    if (event.key === " " && event.target.closest?.("button")) return;
    const act = /^\d$/.test(event.key) ? () => actions.digit(Number(event.key)) : actions[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act();
  });
}
