// Tare, recording, markers, full screen; and the toasts that tell how it went.

import { callService } from "../web/api.js";
import { byId, make, setText } from "../web/dom.js";
import { bytes, clock } from "./format.js";

const STAYS = 6000; // [ms]

/** A short message; `kind` is "good" or "bad". */
export function toast(text, kind) {
  const box = make("p", `toast ${kind}`, text), toasts = byId("toasts");
  toasts.append(box);
  while (toasts.children.length > 4) toasts.firstElementChild.remove();
  setTimeout(() => box.remove(), STAYS);
}

export class Controls {
  /** @param marked is called with the text of a marker that was put. */
  constructor(marked) {
    this.marked = marked;
    this.recording = null;
    this.canRecord = true;
    this.open = false;
    byId("tare").addEventListener("click", () => this.tare());
    byId("record").addEventListener("click", () => this.record());
    byId("marker").addEventListener("submit", (event) => { event.preventDefault(); this.mark(); });
    byId("full").addEventListener("click", () => this.full());
    byId("help").addEventListener("click", () => byId("help-box").showModal());
    // A click leaves no focus behind: the space bar then means "pause" again, not "tare" again.
    document.addEventListener("click", (event) => {
      if (event.detail > 0) event.target.closest?.("button")?.blur();
    });
    this.show();
  }

  start(hello) {
    this.canRecord = hello.can_record !== false;
    this.show();
  }

  connection(open) {
    this.open = open;
    this.show();
  }

  update(recording) {
    this.recording = recording ?? null;
    this.show();
  }

  show() {
    const button = byId("record"), r = this.recording;
    byId("tare").disabled = !this.open;
    button.disabled = !this.open || !this.canRecord;
    button.title = this.canRecord ? (r ? r.path : "Start or stop a recording (R)") : "This service does not record";
    button.setAttribute("aria-pressed", String(r !== null));
    setText(byId("record-text"), r ? `Stop ${clock(r.seconds)} · ${bytes(r.n_bytes)}${r.n_dropped > 0 ? ` · ${r.n_dropped} dropped` : ""}` : "Record");
    byId("mark").disabled = byId("marker-text").disabled = !this.open || !this.canRecord;
  }

  // One request at a time from each button: a double click is one wish.
  async ask(button, work) {
    if (button.disabled || button.classList.contains("busy")) return;
    button.classList.add("busy");
    try {
      await work();
    } catch (error) {
      toast(error.message, "bad");
    } finally {
      button.classList.remove("busy");
    }
  }

  tare() {
    return this.ask(byId("tare"), async () => {
      await callService("POST", "tare");
      toast("Taking the tare: nothing may touch the fingers", "good");
    });
  }

  record() {
    return this.ask(byId("record"), async () => {
      if (this.recording) {
        const { path, seconds } = await callService("DELETE", "recording");
        this.update(null);
        toast(`${clock(seconds ?? 0)} recorded: ${path}`, "good");
      } else {
        const { path } = await callService("POST", "recording", {});
        toast(`Recording to ${path}`, "good");
      }
    });
  }

  mark() {
    const field = byId("marker-text"), text = field.value.trim();
    return this.ask(byId("mark"), async () => {
      await callService("POST", "markers", { text: text || "marker" });
      this.marked(text);
    });
  }

  full() {
    const done = document.fullscreenElement
      ? document.exitFullscreen() : document.documentElement.requestFullscreen();
    done.catch(() => toast("The browser does not allow full screen here", "bad"));
  }
}
