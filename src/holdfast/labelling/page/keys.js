// The keyboard: one hand labels with it while the other is at the mouse.

const typing = (element) => element.closest?.("input, textarea, select, [contenteditable]");
const asking = () => document.querySelector("dialog[open]") !== null;

// A key as it is written in the table of actions: "Control-z", "Shift-Enter", "a".
function nameOf(event) {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const held = event.ctrlKey || event.metaKey ? "Control-" : "";
  // Where Shift is needed for the sign itself it is no part of the name.
  const shift = event.shiftKey && (held || key.length > 1) ? "Shift-" : "";
  return held + shift + key;
}

/** @param actions by the names of their keys. */
export function listen(actions) {
  document.addEventListener("keydown", (event) => {
    if (event.altKey || asking()) return;
    const name = nameOf(event), saves = name === "Control-s";
    if (typing(event.target) && !saves) {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    // A button that was reached with the keyboard is pressed with the space bar and Enter.
    if ([" ", "Enter"].includes(name) && event.target.closest?.("button")) return;
    const act = actions[name];
    if (!act) return;
    event.preventDefault();
    if (!event.repeat || /Control-|Arrow|^[+\-=]$/.test(name)) act();
  });
  // A click leaves no focus behind: Enter then means the proposal again, not the button.
  document.addEventListener("click", (event) => {
    if (event.detail > 0) event.target.closest?.("button")?.blur();
  });
}
