// Toolbar above the plots: buttons for states, causes and edits.

import { byId, fillChoice, make, setPressed, setText, shape } from "../web/dom.js";
import { stateKey, withSpaces } from "../web/text.js";
import { CAUSES, causeKey, STATES } from "./format.js";

const EDITS = ["undo", "redo", "copy", "remove"]; // names of commands, and ids of their buttons

/** Return a cause with its key underlined, if the key is its first letter. */
const causeText = (cause) => cause.startsWith(causeKey(cause))
  ? make("span", "", make("u", "", cause[0]), cause.slice(1))
  : make("span", "", cause);

export class Toolbar {
  /** @param run called with the name of a command and its argument. */
  constructor(editor, run) {
    this.editor = editor;
    fillChoice(byId("states"), STATES.map((state, k) => ({
      value: state, title: `${withSpaces(state)} (${k + 1})`, content: [shape(stateKey(state)), make("span", "", withSpaces(state)), make("kbd", "", String(k + 1))],
    })), null, (state) => run("setKind", { state }));
    fillChoice(byId("causes"), CAUSES.map((cause) => ({
      value: cause, title: `${cause} (${causeKey(cause).toUpperCase()})`, content: [causeText(cause)],
    })), null, (cause) => run("setKind", { cause }));
    for (const button of byId("states").children) button.dataset.state = stateKey(button.dataset.value);
    for (const name of EDITS) byId(name).addEventListener("click", () => run(name));
  }

  /** Show which buttons are pressed and which are enabled. */
  show() {
    const { editor } = this, { readOnly, history } = editor, now = editor.chosen?.label ?? editor.nextKind;
    setText(byId("edited-label"), editor.chosen ? "this label" : "next label");
    setPressed(byId("states"), now.state);
    setPressed(byId("causes"), now.cause);
    for (const button of document.querySelectorAll(".choice button")) button.disabled = readOnly;
    byId("undo").disabled = readOnly || !history.past.length;
    byId("redo").disabled = readOnly || !history.future.length;
    byId("copy").disabled = readOnly || !editor.selected || editor.fingers.length < 2;
    byId("remove").disabled = readOnly || !editor.selected;
  }
}
