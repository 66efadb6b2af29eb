// The buttons of states, causes and edits, and which of them are pressed or can be.

import { byId, make, shape } from "../web/dom.js";
import { CAUSES, STATES, stateKey, stateWord } from "./words.js";

export class Palette {
  /** @param act is called with the name of an action and its argument. */
  constructor(editor, act) {
    this.editor = editor;
    this.states = STATES.map((state, k) => this.button(byId("states"), state, act, { state }, String(k + 1),
      [shape(stateKey(state)), make("span", "", stateWord(state)), make("kbd", "", String(k + 1))]));
    // The letter that is underlined is the key.
    this.causes = CAUSES.map((cause) => this.button(byId("causes"), cause, act, { cause }, cause[0].toUpperCase(),
      [make("span", "", make("u", "", cause[0]), cause.slice(1))]));
    for (const name of ["undo", "redo", "copy", "remove"]) byId(name).addEventListener("click", () => act(name));
  }

  button(row, value, act, fields, key, content) {
    const button = make("button", "", ...content);
    Object.assign(button, { type: "button", title: `${stateWord(value)} (${key})` });
    if (fields.state) button.dataset.state = stateKey(value);
    button.dataset.value = value;
    button.addEventListener("click", () => act("name", fields));
    row.append(button);
    return button;
  }

  show() {
    const { editor } = this, now = editor.chosen?.label ?? editor.pen;
    byId("palette-of").textContent = editor.chosen ? "this label" : "next label";
    for (const button of this.states) button.setAttribute("aria-pressed", String(button.dataset.value === now.state));
    for (const button of this.causes) button.setAttribute("aria-pressed", String(button.dataset.value === now.cause));
    for (const button of [...this.states, ...this.causes]) button.disabled = editor.readOnly;
    byId("undo").disabled = editor.readOnly || !editor.history.past.length;
    byId("redo").disabled = editor.readOnly || !editor.history.future.length;
    byId("copy").disabled = editor.readOnly || !editor.selected || editor.fingers.length < 2;
    byId("remove").disabled = editor.readOnly || !editor.selected;
  }
}
