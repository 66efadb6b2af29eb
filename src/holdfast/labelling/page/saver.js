// Keeps the labels: in the browser at once, on the disk a moment later, and says how it stands.

import { callService } from "../web/api.js";

const PAUSE = 300; // [ms] after the last change
const RETRIES = [1000, 2000, 5000, 10000]; // [ms]

// One recording, whatever its place in the list.
const keyOf = (recording) => `holdfast.label ${recording.name} ${recording.start} ${recording.end}`;

/** A JSON value that the browser keeps; null where there is none or the browser keeps nothing. */
export function kept(key) {
  try {
    return JSON.parse(window.localStorage.getItem(key));
  } catch {
    return null;
  }
}

export function keep(key, value) {
  try {
    if (value === null) window.localStorage.removeItem(key);
    else window.localStorage.setItem(key, JSON.stringify(value));
    return true;
  } catch {
    return false; // private windows, or no room
  }
}

export class Saver {
  /**
   * @param tell is given the state (saved, saving, waiting, conflict, failed) and why.
   * @param conflict is called once when somebody else has saved.
   */
  constructor(tell, conflict) {
    this.tell = tell;
    this.conflict = conflict;
    this.close();
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.flush(); });
  }

  close() {
    clearTimeout(this.timer);
    this.recording = null;
    this.state = this.stored = null; // what is to be saved, and what is on the disk
    this.fails = 0;
    this.stopped = false; // until somebody decides on a conflict
    this.running = null;
  }

  open(recording, state, author) {
    this.close();
    Object.assign(this, { recording, author, revision: recording.revision, state, stored: state });
    this.key = keyOf(recording);
  }

  get rejectedKey() { return `${this.key} rejected`; }
  get dirty() {
    return this.recording !== null && (this.state.labels !== this.stored.labels || this.state.note !== this.stored.note);
  }

  /** What an earlier page could not save of a recording, if it differs from what is there. */
  rescue(recording) {
    const found = kept(keyOf(recording));
    if (!found?.labels) return null;
    const plain = (labels) => JSON.stringify(recording.fingers.map((finger) => labels[finger] ?? []));
    const different = plain(found.labels) !== plain(recording.labels) || found.note !== recording.note;
    if (!different) this.forget(recording);
    return different ? found : null;
  }

  forget(recording) { keep(keyOf(recording), null); }

  /** Something has changed. */
  touch(state) {
    if (!this.recording) return;
    if (state.rejected !== this.state.rejected) keep(this.rejectedKey, [...state.rejected]);
    this.state = state;
    if (!this.dirty) { this.same(); return; }
    const { labels, note } = state;
    keep(this.key, { labels, note, revision: this.revision, time: new Date().toISOString() });
    if (this.stopped) return;
    this.tell("waiting");
    this.later(PAUSE);
  }

  // It has been undone to what is on the disk.
  same() {
    if (this.running || this.stopped) return;
    clearTimeout(this.timer);
    keep(this.key, null);
    this.tell("saved");
  }

  later(pause) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.save(), pause);
  }

  /** Saves now what is not saved; resolves when that is done or has failed. */
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
    this.tell("saving");
    let answer, problem = null;
    try {
      answer = await callService("PUT", `recordings/${recording.id}/labels`, { labels, note, author: this.author, revision: this.revision });
    } catch (error) {
      problem = error;
    }
    if (this.recording !== recording) return; // another recording is open by now
    if (problem) this.failed(problem);
    else this.succeeded(state, answer);
  }

  succeeded(state, { revision, time }) {
    Object.assign(this, { revision, stored: state, fails: 0 });
    if (this.dirty) this.later(PAUSE);
    else keep(this.key, null);
    this.tell(this.dirty ? "waiting" : "saved", "", { author: this.author, time });
  }

  failed(problem) {
    if (problem.status === 409) {
      this.stopped = true;
      this.tell("conflict", problem.message);
      this.conflict();
      return;
    }
    this.tell("failed", problem.message);
    // What the service refuses it refuses again; what did not reach it may.
    if (problem.status && problem.status < 500) return;
    this.later(RETRIES[Math.min(this.fails, RETRIES.length - 1)]);
    this.fails += 1;
  }

  /** Goes on after a conflict, from what is on the disk: with these labels, or over them. */
  decide(revision, stored) {
    Object.assign(this, { revision, stored, stopped: false });
  }
}
