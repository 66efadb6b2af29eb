// Buttons for tare, recording, markers and full screen, and the messages about their results.

import { callService } from "../web/connection.js";
import { byId, setText, showToast } from "../web/dom.js";
import { clock, fileSize } from "./format.js";

const FLASH_TIME = 400; // [ms], dark and then bright
// The first callback comes before the page is painted, the second one after it.
const painted = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));

export class Controls {
  /** @param onMarker is called with the text of each marker that the service accepted. */
  constructor(onMarker) {
    this.onMarker = onMarker;
    this.recording = null;
    this.canRecord = true;
    this.connected = false;
    byId("tare").addEventListener("click", () => this.tare());
    byId("record").addEventListener("click", () => this.record());
    byId("marker").addEventListener("submit", (event) => { event.preventDefault(); this.mark(); });
    byId("full").addEventListener("click", () => this.toggleFullScreen());
    this.show();
  }

  start(hello) {
    this.canRecord = hello.can_record !== false;
    this.show();
  }

  setConnected(connected) {
    this.connected = connected;
    this.show();
  }

  update(recording) {
    this.recording = recording ?? null;
    this.show();
  }

  show() {
    const button = byId("record"), r = this.recording;
    byId("tare").disabled = !this.connected;
    button.disabled = !this.connected || !this.canRecord;
    button.title = this.canRecord ? (r ? r.path : "Start or stop a recording (R)") : "This service does not record";
    button.setAttribute("aria-pressed", String(r !== null));
    setText(byId("record-text"), r ? `Stop ${clock(r.seconds)} · ${fileSize(r.n_bytes)}${r.n_dropped > 0 ? ` · ${r.n_dropped} dropped` : ""}` : "Record");
    byId("mark").disabled = byId("marker-text").disabled = !this.connected || !this.canRecord;
  }

  // One request of a button at a time: a double click counts once.
  async request(button, work) {
    if (button.disabled || button.classList.contains("busy")) return;
    button.classList.add("busy");
    try {
      await work();
    } catch (error) {
      showToast(error.message, "bad");
    } finally {
      button.classList.remove("busy");
    }
  }

  tare() {
    return this.request(byId("tare"), async () => {
      await callService("POST", "tare");
      showToast("Taking the tare: nothing may touch the fingers", "good");
    });
  }

  record() {
    return this.request(byId("record"), async () => {
      if (this.recording) {
        const { path, seconds } = await callService("DELETE", "recording");
        this.update(null);
        showToast(`${clock(seconds ?? 0)} recorded: ${path}`, "good");
      } else {
        const { path } = await callService("POST", "recording", {});
        showToast(`Recording to ${path}`, "good");
      }
    });
  }

  mark() {
    const field = byId("marker-text"), text = field.value.trim();
    return this.request(byId("mark"), async () => {
      await callService("POST", "markers", { text: text || "marker" });
      this.onMarker(text);
    });
  }

  /** Light up the page for a camera, and mark when: `label auto` then has the offset of its clock. */
  flash() {
    return this.request(byId("mark"), async () => {
      const shown = (name) => { document.body.dataset.flash = name; return painted(); };
      try {
        await shown("dark");
        await new Promise((done) => setTimeout(done, FLASH_TIME));
        await shown("bright");
        await callService("POST", "markers", { text: "flash" });
        this.onMarker("flash");
        await new Promise((done) => setTimeout(done, FLASH_TIME));
      } finally {
        delete document.body.dataset.flash;
      }
    });
  }

  toggleFullScreen() {
    const done = document.fullscreenElement
      ? document.exitFullscreen() : document.documentElement.requestFullscreen();
    done.catch(() => showToast("The browser does not allow full screen here", "bad"));
  }
}
