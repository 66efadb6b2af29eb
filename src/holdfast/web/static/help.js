// Keyboard shortcuts. One table runs them and is listed in the help, which opens at its head.

import { byId, make } from "./dom.js";

const isTyping = (element) => element.closest?.("input, textarea, select, [contenteditable]");
const isDialogOpen = () => document.querySelector("dialog[open]") !== null;

// Return the name of a pressed key: "Control-z", "Shift-Enter", "a".
function keyName(event) {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const control = event.ctrlKey || event.metaKey ? "Control-" : "";
  // Signs as "?" need Shift on some keyboards; their name does not contain it.
  const shift = event.shiftKey && (control || key.length > 1) ? "Shift-" : "";
  return control + shift + key;
}

// Keys begin with a capital letter, a digit or a sign, words such as "drag" with a small letter.
const withKeys = (text) => text.split(" ").flatMap((word) => [/^[a-z–]/.test(word) ? word : make("kbd", "", word), " "]);

/**
 * Run the action of each pressed key, and list the keys in the help.
 *
 * @param groups rows [keys as shown, text, actions by key name] by the title of their group.
 */
export function listenToKeys(groups) {
  const box = byId("help-box"), show = () => { box.showModal(); box.scrollTop = 0; };
  const tables = Object.entries(groups).flatMap(([title, rows]) => [
    make("h2", "", title), make("dl", "keys", ...rows.flatMap(([keys, text]) => [make("dt", "", ...withKeys(keys)), make("dd", "", text)])),
  ]);
  tables[1].append(make("dt", "", make("kbd", "", "?")), make("dd", "", "show this help"));
  box.prepend(...tables);
  tables[0].tabIndex = -1;
  tables[0].autofocus = true; // the focus shows what has it: the head
  byId("help").addEventListener("click", show);
  const actions = Object.assign({ "?": show }, ...Object.values(groups).flat().map(([, , own]) => own));
  document.addEventListener("keydown", (event) => {
    if (event.altKey || isDialogOpen()) return;
    const name = keyName(event);
    if (isTyping(event.target) && name !== "Control-s") {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    // The space bar and Enter press a button that has the keyboard focus.
    if ([" ", "Enter"].includes(name) && event.target.closest?.("button")) return;
    if (!actions[name]) return;
    event.preventDefault();
    if (!event.repeat || /Control-|Arrow|^[+\-=]$/.test(name)) actions[name]();
  });
  // A clicked button loses the focus, so that the next key is a shortcut again.
  document.addEventListener("click", (event) => {
    if (event.detail > 0) event.target.closest?.("button")?.blur();
  });
}
