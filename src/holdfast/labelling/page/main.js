// Puts the parts together.

import { callService } from "../web/api.js";
import { byId, setText } from "../web/dom.js";
import { onTheme } from "../web/theme.js";
import { Deeds } from "./deeds.js";
import { alert, toast } from "./dialogs.js";
import { rescue, settle } from "./disputes.js";
import { Editor } from "./editor.js";
import { Palette } from "./palette.js";
import { Checks, Recordings } from "./panels.js";
import { Player } from "./player.js";
import { Plot } from "./plot.js";
import { Pointer } from "./pointer.js";
import { Saver, kept } from "./saver.js";
import { Signals } from "./signals.js";
import { SaveState, tellAbout, tellWindow } from "./status.js";
import { Strip } from "./strip.js";
import { View } from "./view.js";
import { timeWord } from "./words.js";

const ALL = ["head", "under", "lines", "over"];
const SCHEMA = "holdfast.label/1";
const LEAST_SAMPLES = 10; // in a window

class Page {
  constructor() {
    this.turn = 0; // counts openings: answers for an earlier one are dropped
    this.id = null;
    this.view = new View(() => this.looked());
    this.signals = new Signals((problem) => this.arrived(problem));
    this.editor = new Editor((real) => this.changed(real));
    this.plot = new Plot(this.editor, this.view, this.signals);
    this.state = new SaveState();
    this.saver = new Saver((...told) => this.told(...told), () => settle(this));
    this.recordings = new Recordings((id) => this.open(id));
    this.checks = new Checks(this.editor, (doubt) => this.deeds.lookAt(doubt));
    this.player = new Player((time) => this.played(time));
    this.deeds = new Deeds(this);
    this.palette = new Palette(this.editor, (name, ...given) => this.deeds[name](...given));
    this.pointer = new Pointer(byId("over"), this.plot, (time) => this.player.seek(time), () => this.about());
    this.strip = new Strip(byId("head"), this.view);
    this.deeds.listen();
    byId("save").addEventListener("click", () => (this.saver.stopped ? settle(this) : this.saver.flush()));
    onTheme(() => { this.plot.open(); this.plot.redraw(...ALL); });
    window.addEventListener("hashchange", () => this.open(this.asked()));
    this.start();
  }

  asked() {
    const id = Number(window.location.hash.slice(1) || NaN);
    return this.recordings.all.some((entry) => entry.id === id) ? id : this.recordings.all.find(({ error }) => !error)?.id ?? this.recordings.all[0]?.id;
  }

  async start() {
    try {
      const { schema, author, recordings } = await callService("GET", "recordings");
      if (schema !== SCHEMA) throw new Error(`the service speaks ${schema}, this page ${SCHEMA}: load the page anew`);
      this.author = author;
      setText(byId("author"), author);
      this.recordings.open(recordings);
      if (!recordings.length) throw new Error("there are no recordings");
    } catch (error) {
      alert(`Nothing to label: ${error.message}`);
      return;
    }
    this.open(this.asked());
  }

  async open(id) {
    if (id === undefined || id === this.id) return;
    const turn = (this.turn += 1);
    this.pointer.stop();
    await this.saver.flush();
    if (turn !== this.turn) return;
    if (this.saver.dirty) toast(`${this.saver.recording.name} is not saved: this browser keeps its labels, and offers them when you open it again`, "bad");
    this.id = id;
    window.history.replaceState(null, "", `#${id}`);
    this.recordings.mark(id);
    let recording;
    try {
      recording = await callService("GET", `recordings/${id}`);
    } catch (error) {
      if (turn === this.turn) this.broken(id, error);
      return;
    }
    if (turn === this.turn) this.opened(recording, turn);
  }

  // A recording that cannot be read does not leave the labels of the one before on the page.
  broken(id, error) {
    this.saver.close();
    this.show({ id, name: this.recordings.all.find((entry) => entry.id === id)?.name ?? "", start: 0, end: 1, rate: 100, fingers: [], unit: {}, labels: {}, proposals: {}, suspects: [], note: "", read_only: true, origin: "none" });
    alert(error.message);
  }

  opened(recording, turn) {
    this.show(recording);
    const { id, start, end } = recording;
    alert(recording.read_only ? "Read-only: the labels of this recording cannot be saved, so nothing can be changed" : "");
    // One after the other: what is drawn does not wait for what edges snap to.
    this.signals.open(id, start, end, this.view.inner)
      .then(() => this.change(id, turn), (error) => turn === this.turn && alert(error.message));
    const found = recording.read_only ? null : this.saver.rescue(recording);
    if (found) rescue(this, recording, found);
  }

  async change(id, turn) {
    const { fingers } = await callService("GET", `recordings/${id}/changes`).catch(() => ({ fingers: {} })); // nothing snaps, that is all
    if (turn !== this.turn) return;
    this.plot.changes = fingers;
    this.plot.redraw("under");
  }

  show(recording) {
    this.signals.close();
    this.saver.open(recording, null, this.author);
    this.editor.open(recording, this.author, kept(this.saver.rejectedKey) ?? []);
    this.saver.open(recording, this.editor.state, this.author);
    this.state.open(recording);
    this.player.open(recording);
    this.plot.playhead = null;
    setText(byId("played"), "");
    this.plot.open();
    this.view.limit(recording.start, recording.end, LEAST_SAMPLES / (recording.rate || 100));
    setText(byId("name"), recording.name);
    byId("name").title = recording.name;
    document.title = `${recording.name} · holdfast label`;
    byId("note").disabled = this.editor.readOnly;
    byId("propose").disabled = !recording.fingers.length;
    document.body.classList.toggle("is-read-only", this.editor.readOnly);
    this.changed(false);
  }

  told(state, why, by) {
    this.state.tell(state, why, by);
    // It stays while it is tried again.
    if (state === "failed") alert(`Not saved: ${why}. The labels are kept in this browser.`);
    if (state === "saved" || state === "conflict") alert("");
    if (state === "saved" && by) this.recordings.update(this.id, { labelled: true });
    this.count();
  }

  count() {
    const { labels } = this.editor.state;
    this.recordings.update(this.id, {
      n_labels: Object.values(labels).flat().length, n_proposals: this.editor.proposals.length, n_doubtful: this.editor.doubts.length,
    });
  }

  /** Labels, selection, or what is pointed at are others; `real` where it is to be saved. */
  changed(real) {
    if (!this.deeds) return;
    if (real) this.saver.touch(this.editor.state);
    if (real) this.count();
    this.palette.show();
    this.checks.show();
    this.about();
    if (byId("note").value !== this.editor.state.note) byId("note").value = this.editor.state.note;
    this.plot.redraw("head", "under", "over");
  }

  about() { tellAbout(this.editor, this.deeds.target()); }

  /** Another part is looked at: what is there is drawn at once, finer data are asked for. */
  looked() {
    this.pointer?.again();
    this.plot?.redraw(...ALL);
    if (this.editor?.fingers.length) this.signals.want(this.view.start, this.view.end, this.view.inner);
    if (this.signals) tellWindow(this.view, this.signals);
  }

  arrived(problem) {
    if (problem) toast(`The signals did not come: ${problem.message}`, "bad");
    else this.plot.data();
    tellWindow(this.view, this.signals);
  }

  played(time) {
    this.plot.playhead = time;
    setText(byId("played"), `${timeWord(time, 0.01)} s`);
    if (this.player.playing) this.view.follow(time);
    this.plot.redraw("over");
  }
}

// For those who look at it in the browser's console, and for tests.
window.holdfast = new Page();
