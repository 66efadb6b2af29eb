// Save the labels: in the browser at once, and with the service a moment later.

import { callService } from "../web/connection.js";

const SAVE_DELAY = 300; // [ms] after the last change
const RETRY_DELAYS = [1000, 2000, 5000, 10000]; // [ms]

// The key contains what identifies a recording; its position in the list may change.
const storageKey = (recording) => `holdfast.label ${recording.name} ${recording.start} ${recording.end}`;

/** Read a JSON value from the browser's storage; null if it is missing or the storage is off. */
export function readStored(key) {
  try {
    return JSON.parse(window.localStorage.getItem(key));
  } catch {
    return null;
  }
}

/** Write a JSON value to the browser's storage; null removes it. */
export function writeStored(key, value) {
  try {
    if (value === null) window.localStorage.removeItem(key);
    else window.localStorage.setItem(key, JSON.stringify(value));
  } catch { /* private window, or storage full */ }
}

export class Saver {
  /**
   * @param report called with the state ("saved", "saving", "waiting", "conflict" or "failed"),
   *   the reason of a failure, and author and time of a save.
   * @param conflict called once if another page or program has changed the file.
   */
  constructor(report, conflict) {
    this.report = report;
    this.conflict = conflict;
    this.close();
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.flush(); });
  }

  close() {
    clearTimeout(this.timer);
    this.recording = null;
    this.state = this.savedState = null; // of the editor: now, and in the file
    this.n_failures = 0;
    this.stopped = false; // until a conflict is resolved
    this.running = null; // promise of the request that is sent
  }

  open(recording, state, author) {
    this.close();
    Object.assign(this, { recording, author, revision: recording.revision, state, savedState: state });
    this.key = storageKey(recording);
  }

  get rejectedKey() { return `${this.key} rejected`; }
  get dirty() {
    return this.recording !== null && (this.state.labels !== this.savedState.labels || this.state.note !== this.savedState.note);
  }

  /** Return the labels that an earlier page could not save; null if there are none that differ. */
  unsavedCopy(recording) {
    const copy = readStored(storageKey(recording));
    if (!copy?.labels) return null;
    const toText = (labels) => JSON.stringify(recording.fingers.map((finger) => labels[finger] ?? []));
    const differs = toText(copy.labels) !== toText(recording.labels) || copy.note !== recording.note;
    if (!differs) this.discardCopy(recording);
    return differs ? copy : null;
  }

  discardCopy(recording) { writeStored(storageKey(recording), null); }

  /** Store a new state of the editor in the browser, and schedule a save. */
  update(state) {
    if (!this.recording) return;
    if (state.rejected !== this.state.rejected) writeStored(this.rejectedKey, [...state.rejected]);
    this.state = state;
    if (!this.dirty) { this.unchanged(); return; }
    const { labels, note } = state;
    writeStored(this.key, { labels, note, revision: this.revision, time: new Date().toISOString() });
    if (this.stopped) return;
    this.report("waiting");
    this.schedule(SAVE_DELAY);
  }

  // Undo has restored what is in the file.
  unchanged() {
    if (this.running || this.stopped) return;
    clearTimeout(this.timer);
    writeStored(this.key, null);
    this.report("saved");
  }

  schedule(delay) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.save(), delay);
  }

  /** Save unsaved changes now; resolve when they are saved or have failed. */
  async flush() {
    clearTimeout(this.timer);
    await this.running;
    if (this.dirty && !this.stopped) await this.save();
  }

  save() {
    if (this.running || this.stopped || !this.dirty) return this.running;
    const recording = this.recording;
    this.running = this.send(recording).finally(() => {
      if (this.recording === recording) this.running = null;
    });
    return this.running;
  }

  async send(recording) {
    const state = this.state, { labels, note } = state;
    this.report("saving");
    const body = { labels, note, author: this.author, revision: this.revision };
    const reply = await callService("PUT", `recordings/${recording.id}/labels`, body).catch((problem) => ({ problem }));
    if (this.recording !== recording) return; // another recording was opened
    if (reply.problem) this.failed(reply.problem);
    else this.succeeded(state, reply);
  }

  succeeded(state, { revision, time }) {
    Object.assign(this, { revision, savedState: state, n_failures: 0 });
    if (this.dirty) this.schedule(SAVE_DELAY);
    else writeStored(this.key, null);
    this.report(this.dirty ? "waiting" : "saved", "", { author: this.author, time });
  }

  failed(problem) {
    if (problem.status === 409) {
      this.stopped = true;
      this.report("conflict", problem.message);
      this.conflict();
      return;
    }
    this.report("failed", problem.message);
    // A refused save is not repeated. A save that did not reach the service, or met an error of it, is.
    if (problem.status && problem.status < 500) return;
    this.schedule(RETRY_DELAYS[Math.min(this.n_failures, RETRY_DELAYS.length - 1)]);
    this.n_failures += 1;
  }

  /** Continue after a conflict; `revision` and `state` are those of the file. */
  resume(revision, state) {
    Object.assign(this, { revision, savedState: state, stopped: false });
  }
}
