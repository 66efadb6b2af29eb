// Emergency stop of the hand: a button and the space bar. It needs nothing but one HTTP request,
// which is repeated until the server answers.

import { callService } from "../../web/api.js";
import { byId, setText } from "../../web/dom.js";

const ATTEMPT_TIMEOUT = 1000, RETRY_DELAY = 200; // [ms]
const UNREACHABLE = "THE SERVER CANNOT BE REACHED: use the emergency stop of the hand itself.";

const wait = (time) => new Promise((resolve) => { setTimeout(resolve, time); });
const writesText = (element) => element.closest?.("textarea, [contenteditable], input:not([type=range])");

export class EmergencyStop {
  /** @param onAnswer is called with the state of the loop that the server returns. */
  constructor(onAnswer) {
    this.onAnswer = onAnswer;
    this.enabled = false;
    this.pending = false;
    this.button = byId("stop");
    this.button.addEventListener("click", () => this.press());
    // Before all other listeners: no button, dialog or shortcut takes the space bar.
    for (const kind of ["keydown", "keyup"]) window.addEventListener(kind, (event) => this.onKey(event), true);
    for (const kind of ["focusin", "focusout"]) window.addEventListener(kind, () => setTimeout(() => this.showHint()));
  }

  /** Listen to the space bar if a hand is controlled. */
  enable(enabled) {
    if (this.enabled === enabled) return;
    this.enabled = enabled;
    setText(byId("space-help"), enabled ? "EMERGENCY STOP of the hand" : "pause plots and maps");
  }

  onKey(event) {
    if (!this.enabled || event.key !== " " || writesText(event.target)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.type === "keydown" && !event.repeat) this.press();
  }

  /** Send the stop until the server answers. */
  async press() {
    if (this.pending) return;
    this.pending = true;
    this.show("pending", "Stopping …");
    for (let attempt = 1; this.pending; attempt += 1) {
      try {
        const answer = await callService("POST", "grip/stop", undefined, AbortSignal.timeout(ATTEMPT_TIMEOUT));
        this.finish("", "");
        this.onAnswer(answer);
      } catch (error) {
        if (error.status >= 400 && error.status < 500) this.finish("failed", `NOT CONFIRMED: ${error.message}`);
        else {
          this.show("failed", `${UNREACHABLE} Attempt ${attempt} …`);
          await wait(RETRY_DELAY);
        }
      }
    }
  }

  finish(kind, text) {
    this.pending = false;
    this.show(kind, text);
  }

  show(kind, text) {
    const box = byId("stop-feedback");
    box.className = `stop-feedback ${kind}`;
    setText(box, text);
    box.hidden = !text;
    this.button.classList.toggle("pending", this.pending);
  }

  showHint() {
    const typing = document.activeElement && writesText(document.activeElement);
    setText(byId("stop-hint"), typing ? "Esc, then space bar" : "space bar");
  }
}
