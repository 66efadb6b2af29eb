// Buttons for tare, recording and markers. The page disables them without a connection.

import { callService } from "../web/connection.js";
import { byId, runOnce, setText, showToast } from "../web/dom.js";
import { clock, fileSize } from "./format.js";

const FLASH_TIME = 400; // [ms], dark and then bright
// The first callback comes before the page is painted, the second one after it.
const painted = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
const pause = (time) => new Promise((done) => setTimeout(done, time));

export class Controls {
  /** @param onMarker is called with the text of each marker that the service accepted. */
  constructor(onMarker) {
    this.onMarker = onMarker;
    this.recording = null;
    byId("tare").addEventListener("click", () => this.tare());
    byId("record").addEventListener("click", () => this.record());
    byId("marker").addEventListener("submit", (event) => { event.preventDefault(); this.mark(); });
  }

  start({ can_record: canRecord }) {
    for (const id of ["record", "mark", "marker-text"]) byId(id).disabled = canRecord === false;
    byId("record").title = canRecord === false ? "This service does not record" : "Start or stop a recording (R)";
  }

  /** Show the progress of a recording, null if there is none. */
  update(recording) {
    this.recording = recording ?? null;
    const { seconds, n_bytes: n, n_dropped: dropped } = recording ?? {};
    byId("record").setAttribute("aria-pressed", String(Boolean(recording)));
    setText(byId("record-text"), recording ? `Stop ${clock(seconds)} · ${fileSize(n)}${dropped > 0 ? ` · ${dropped} dropped` : ""}` : "Record");
  }

  tare() {
    return runOnce(byId("tare"), async () => {
      await callService("POST", "tare");
      showToast("Taking the tare: nothing may touch the fingers", "good");
    });
  }

  record() {
    return runOnce(byId("record"), async () => {
      const { path, seconds } = await callService(this.recording ? "DELETE" : "POST", "recording", this.recording ? undefined : {});
      showToast(this.recording ? `${clock(seconds ?? 0)} recorded: ${path}` : `Recording to ${path}`, "good");
      if (this.recording) this.update(null);
    });
  }

  async addMarker(text, shown = text) {
    await callService("POST", "markers", { text });
    this.onMarker(shown);
  }

  mark() {
    const text = byId("marker-text").value.trim();
    return runOnce(byId("mark"), () => this.addMarker(text || "marker", text));
  }

  /** Light up the page for a camera, and mark when: `label auto` then has the offset of its clock. */
  flash() {
    return runOnce(byId("mark"), async () => {
      try {
        document.body.dataset.flash = "dark";
        await pause(FLASH_TIME);
        document.body.dataset.flash = "bright";
        await painted();
        await this.addMarker("flash");
        await pause(FLASH_TIME);
      } finally {
        delete document.body.dataset.flash;
      }
    });
  }
}
