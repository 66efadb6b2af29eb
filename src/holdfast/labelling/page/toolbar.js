// Toolbar above the plots: buttons for states, causes and edits.

import { byId, make, shape } from "../web/dom.js";
import { CAUSES, causeKey, STATES, stateKey, stateText } from "./format.js";

const EDITS = ["undo", "redo", "copy", "remove"]; // names of commands, and ids of their buttons

/** Return a cause with its key underlined, if the key is its first letter. */
const causeText = (cause) => cause.startsWith(causeKey(cause))
  ? make("span", "", make("u", "", cause[0]), cause.slice(1))
  : make("span", "", cause);

export class Toolbar {
  /** @param run called with the name of a command and its argument. */
  constructor(editor, run) {
    this.editor = editor;
    this.states = STATES.map((state, k) => this.button(byId("states"), state, run, { state }, String(k + 1),
      [shape(stateKey(state)), make("span", "", stateText(state)), make("kbd", "", String(k + 1))]));
    this.causes = CAUSES.map((cause) => this.button(byId("causes"), cause, run, { cause },
      causeKey(cause).toUpperCase(), [causeText(cause)]));
    for (const name of EDITS) byId(name).addEventListener("click", () => run(name));
  }

  button(row, value, run, fields, key, content) {
    const button = make("button", "", ...content);
    Object.assign(button, { type: "button", title: `${stateText(value)} (${key})` });
    if (fields.state) button.dataset.state = stateKey(value);
    button.dataset.value = value;
    button.addEventListener("click", () => run("setKind", fields));
    row.append(button);
    return button;
  }

  /** Show which buttons are pressed and which are enabled. */
  show() {
    const { editor } = this, { readOnly, history } = editor, now = editor.chosen?.label ?? editor.nextKind;
    byId("edited-label").textContent = editor.chosen ? "this label" : "next label";
    for (const button of this.states) button.setAttribute("aria-pressed", String(button.dataset.value === now.state));
    for (const button of this.causes) button.setAttribute("aria-pressed", String(button.dataset.value === now.cause));
    for (const button of [...this.states, ...this.causes]) button.disabled = readOnly;
    byId("undo").disabled = readOnly || !history.past.length;
    byId("redo").disabled = readOnly || !history.future.length;
    byId("copy").disabled = readOnly || !editor.selected || editor.fingers.length < 2;
    byId("remove").disabled = readOnly || !editor.selected;
  }
}
