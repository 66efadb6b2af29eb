// The keyboard: one letter for what an experimenter does with the other hand on the robot.

import { byId } from "../web/dom.js";

const typing = (element) => element.closest?.("input, textarea, select, [contenteditable]");

/** @param actions by key; `digit` gets the number. */
export function listen(actions) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
    if (byId("help-box").open) return;
    if (typing(event.target)) {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    // A button that was reached with the keyboard is pressed with the space bar.
    if (event.key === " " && event.target.closest?.("button")) return;
    const act = /^\d$/.test(event.key) ? () => actions.digit(Number(event.key)) : actions[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    act();
  });
}
