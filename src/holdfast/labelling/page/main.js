// Labelling page: connects its parts, and opens recordings.

import { callService } from "../web/connection.js";
import { byId, setText, showAlert, showToast } from "../web/dom.js";
import { timeText } from "../web/text.js";
import { onTheme } from "../web/theme.js";
import { Commands } from "./commands.js";
import { offerUnsavedLabels, resolveConflict } from "./conflicts.js";
import { EMPTY_RECORDING, Editor } from "./editor.js";
import { Overview } from "./overview.js";
import { RecordingList, ReviewList } from "./panels.js";
import { Player } from "./player.js";
import { Pointer } from "./pointer.js";
import { Rows } from "./rows.js";
import { Saver, readStored } from "./saver.js";
import { Signals } from "./signals.js";
import { SaveStatus, showItem, showWindow } from "./status_bar.js";
import { Toolbar } from "./toolbar.js";
import { View } from "./view.js";

const SCHEMA = "holdfast.label/1";
const MIN_WINDOW_SAMPLES = 10;

class LabellingPage {
  constructor() {
    this.generation = 0; // counts opened recordings; replies for an earlier one are dropped
    this.id = null; // of the open recording
    this.view = new View(() => this.windowChanged());
    this.signals = new Signals((problem) => this.signalsArrived(problem));
    this.editor = new Editor((unsaved) => this.editorChanged(unsaved));
    this.rows = new Rows(this.editor, this.view, this.signals);
    this.overview = new Overview(this.view, this.editor, this.signals);
    this.saveStatus = new SaveStatus();
    this.saver = new Saver((...report) => this.saveReported(...report), () => resolveConflict(this));
    this.recordings = new RecordingList((id) => this.open(id));
    this.reviewList = new ReviewList(this.editor, (item) => this.commands.showReviewItem(item));
    this.player = new Player((time) => this.playTimeChanged(time));
    this.commands = new Commands(this);
    this.toolbar = new Toolbar(this.editor, (command, ...args) => this.commands[command](...args));
    this.pointer = new Pointer(byId("surface"), this.rows, (time) => this.player.seek(time), () => this.showStatus());
    this.commands.listen();
    byId("save").addEventListener("click", () => (this.saver.stopped ? resolveConflict(this) : this.saver.flush()));
    onTheme(() => { this.rows.redraw("signals", "labels"); this.overview.draw(); });
    window.addEventListener("hashchange", () => this.open(this.idFromAddress()));
    this.start();
  }

  // Return the recording that the address names, or else the first readable one.
  idFromAddress() {
    const id = Number(window.location.hash.slice(1) || NaN), { all } = this.recordings;
    if (all.some((entry) => entry.id === id)) return id;
    return all.find(({ error }) => !error)?.id ?? all[0]?.id;
  }

  async start() {
    try {
      const { schema, author, recordings } = await callService("GET", "recordings");
      if (schema !== SCHEMA) throw new Error(`the service uses ${schema}, this page expects ${SCHEMA}; reload the page`);
      this.author = author;
      setText(byId("author"), author);
      this.recordings.open(recordings);
      if (!recordings.length) throw new Error("the service has no recordings");
    } catch (error) {
      showAlert(`No recordings to label: ${error.message}`);
      return;
    }
    this.open(this.idFromAddress());
  }

  async open(id) {
    if (id === undefined || id === this.id) return;
    const generation = (this.generation += 1);
    this.pointer.cancelDrag();
    await this.saver.flush();
    if (generation !== this.generation) return;
    if (this.saver.dirty) showToast(`${this.saver.recording.name} is not saved. This browser keeps its labels and offers them again.`, "bad");
    this.id = id;
    window.history.replaceState(null, "", `#${id}`);
    this.recordings.markCurrent(id);
    const recording = await callService("GET", `recordings/${id}`).catch((error) => ({ error }));
    if (generation !== this.generation) return;
    if (recording.error) this.openFailed(id, recording.error);
    else this.opened(recording, generation);
  }

  // Show an empty recording, so that the labels of the previous one disappear.
  openFailed(id, error) {
    this.saver.close();
    const name = this.recordings.all.find((entry) => entry.id === id)?.name ?? "";
    this.show({ ...EMPTY_RECORDING, id, name, rate: 100, unit: {}, origin: "none" });
    showAlert(error.message);
  }

  opened(recording, generation) {
    this.show(recording);
    const { id, start, end } = recording;
    showAlert(recording.read_only ? "Read-only: labels of this recording cannot be changed, because they cannot be saved" : "");
    // The signals come first; the change points, which only snapping needs, after them.
    this.signals.open(id, start, end, this.view.width)
      .then(() => this.loadChangePoints(id, generation), (error) => generation === this.generation && showAlert(error.message));
    const unsaved = recording.read_only ? null : this.saver.unsavedCopy(recording);
    if (unsaved) offerUnsavedLabels(this, recording, unsaved);
  }

  async loadChangePoints(id, generation) {
    // Without change points, edges snap only to other edges.
    const { fingers } = await callService("GET", `recordings/${id}/changes`).catch(() => ({ fingers: {} }));
    if (generation !== this.generation) return;
    this.rows.changePoints = fingers;
    this.rows.redraw("labels");
  }

  show(recording) {
    this.signals.close();
    this.saver.open(recording, null, this.author);
    this.editor.open(recording, this.author, readStored(this.saver.rejectedKey) ?? []);
    this.saver.open(recording, this.editor.state, this.author);
    this.saveStatus.open(recording);
    this.player.open(recording);
    this.rows.playTime = null;
    setText(byId("play-time"), "");
    this.rows.open();
    this.view.open(recording.start, recording.end, MIN_WINDOW_SAMPLES / (recording.rate || 100));
    setText(byId("name"), recording.name);
    byId("name").title = recording.name;
    document.title = `${recording.name} · holdfast label`;
    byId("note").disabled = this.editor.readOnly;
    byId("propose").disabled = !recording.fingers.length;
    this.editorChanged(false);
  }

  saveReported(state, reason, lastSave) {
    this.saveStatus.show(state, reason, lastSave);
    // The alert stays while the save is repeated.
    if (state === "failed") showAlert(`Not saved: ${reason}. This browser keeps the labels.`);
    if (state === "saved" || state === "conflict") showAlert("");
    if (state === "saved" && lastSave) this.recordings.update(this.id, { labelled: true });
    this.updateCounts();
  }

  updateCounts() {
    const { state, reviewItems } = this.editor;
    this.recordings.update(this.id, { n_labels: Object.values(state.labels).flat().length, n_doubtful: reviewItems.length });
  }

  /** Show a change of labels, selection, focus or preview; `unsaved` if it must be saved. */
  editorChanged(unsaved) {
    if (!this.commands) return;
    if (unsaved) {
      this.saver.update(this.editor.state);
      this.updateCounts();
    }
    this.toolbar.show();
    this.reviewList.show();
    this.showStatus();
    if (byId("note").value !== this.editor.state.note) byId("note").value = this.editor.state.note;
    this.rows.redraw("labels");
    this.overview.showLabels();
  }

  showStatus() { showItem(this.editor, this.commands.target()); }

  // Draw the loaded signals at once, and request finer ones.
  windowChanged() {
    this.pointer?.windowMoved();
    this.rows?.redraw("signals", "labels");
    this.overview?.showWindow();
    if (this.editor?.fingers.length) this.signals.request(this.view.start, this.view.end, this.view.width);
    if (this.signals) showWindow(this.view, this.signals);
  }

  signalsArrived(problem) {
    if (problem) showToast(`The signals could not be loaded: ${problem.message}`, "bad");
    else {
      this.rows.redraw("signals");
      this.overview.draw();
    }
    showWindow(this.view, this.signals);
  }

  playTimeChanged(time) {
    this.rows.playTime = time;
    setText(byId("play-time"), `${timeText(time, 0.01)} s`);
    if (this.player.playing) this.view.follow(time);
    this.rows.redraw();
  }
}

// For the browser's console, and for tests.
window.holdfast = new LabellingPage();
