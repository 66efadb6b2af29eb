// Labels of the open recording, and every change of them, with undo.

import { change, fillGaps, findReviewItems, itemKey, moveEdge, openProposals, overwrite, remove, replaceInterval, roundTime } from "./labels.js";

/**
 * Undo history without a limit. States are never changed in place, so that each is kept as it is;
 * unchanged parts are shared between states.
 */
export class History {
  constructor(state) {
    this.state = state;
    this.past = [];
    this.future = [];
    this.tag = null;
  }

  /** Set a new state. Consecutive changes of the same tag are undone together. */
  change(state, tag = null) {
    if (tag === null || tag !== this.tag) this.past.push(this.state);
    this.tag = tag;
    this.future = [];
    this.state = state;
  }

  /** Return to the state before. Return false if there is none. */
  undo() { return this.step(this.past, this.future); }
  redo() { return this.step(this.future, this.past); }

  step(from, to) {
    if (!from.length) return false;
    to.push(this.state);
    this.state = from.pop();
    this.tag = null;
    return true;
  }
}

export const EMPTY_RECORDING = {
  fingers: [], labels: {}, proposals: {}, start: 0, end: 1, rate: 1, note: "", read_only: true,
};

export class Editor {
  /** @param changed called with true if labels or note changed, else with false. */
  constructor(changed) {
    this.changed = changed;
    this.nextKind = { state: "stable", cause: null }; // of the next label that is drawn
    this.open(EMPTY_RECORDING, "", []);
  }

  open(recording, author, rejected) {
    this.recording = recording;
    this.author = author;
    this.readOnly = Boolean(recording.read_only);
    const period = recording.rate > 0 ? 1 / recording.rate : 1e-3;
    // A label may end one sample period after the last sample, and then contains it.
    this.bounds = { low: recording.start, high: recording.end + period, minDuration: period };
    const labels = Object.fromEntries(recording.fingers.map((finger) => [finger, recording.labels[finger] ?? []]));
    this.history = new History({ labels, note: recording.note ?? "", rejected: new Set(rejected) });
    this.selected = null; // { finger, label, fresh }; fresh: just drawn, not yet clicked
    this.focus = null; // { kind, finger, item } that Enter and X act on
    this.preview = null; // { finger: labels } during a drag
  }

  get state() { return this.history.state; }
  get fingers() { return this.recording.fingers; }
  get proposals() { return this.openItems.proposals; }
  get reviewItems() { return this.openItems.reviewItems; }

  // Every redraw needs these lists, so they are computed once for each state.
  get openItems() {
    const { state, recording: { proposals } } = this;
    if (this.cache?.state === state && this.cache.source === proposals) return this.cache;
    const open = { proposals: openProposals(state, proposals), reviewItems: findReviewItems(state, proposals) };
    return (this.cache = { state, source: proposals, ...open });
  }

  /** The selected label, unless it was just drawn. */
  get chosen() { return this.selected && !this.selected.fresh ? this.selected : null; }

  isRejected(finger, item) { return this.state.rejected.has(itemKey(finger, item)); }

  /** Return the labels of a finger as they are drawn: during a drag, its preview. */
  labels(finger) { return this.preview?.[finger] ?? this.state.labels[finger]; }

  /** Change fields of the state, as one step of the undo history. */
  apply(fields, tag = null) {
    if (this.readOnly) return;
    this.history.change({ ...this.state, ...fields }, tag);
    this.preview = null;
    this.changed(true);
  }

  setLabels(labels) { this.apply({ labels: { ...this.state.labels, ...labels } }); }

  setNote(note) {
    if (note !== this.state.note) this.apply({ note }, "note");
  }

  setPreview(labels) {
    this.preview = labels;
    this.changed(false);
  }

  select(finger, label, fresh = false) {
    this.selected = label ? { finger, label, fresh } : null;
    this.changed(false);
  }

  setFocus(focus) {
    this.focus = focus;
    this.changed(false);
  }

  // Return the fields of a label that a person sets: full confidence, and the author.
  byHand(fields) { return { evidence: "hand", confidence: 1, author: this.author, ...fields }; }

  /** Return a new label between two times, in any order; null if it is too short. */
  newLabel(from, to) {
    const { low, high, minDuration } = this.bounds;
    const [start, end] = [Math.min(from, to), Math.max(from, to)].map((time) => roundTime(Math.max(low, Math.min(high, time))));
    return end - start >= minDuration ? this.byHand({ start, end, ...this.nextKind }) : null;
  }

  /** Draw a label on fingers, or only preview it unless `commit`. */
  draw(fingers, from, to, commit) {
    const label = this.newLabel(from, to);
    if (!label || this.readOnly) { this.setPreview(null); return; }
    const results = fingers.map((finger) => [finger, overwrite(this.state.labels[finger], label, this.bounds.minDuration)]);
    const labels = Object.fromEntries(results.map(([finger, [own]]) => [finger, own]));
    if (!commit) { this.setPreview(labels); return; }
    this.selected = { finger: fingers[0], label: results[0][1][1], fresh: true };
    this.setLabels(labels);
  }

  /** Move an edge of a label, or only preview it unless `commit`. */
  moveEdge(finger, label, side, time, commit) {
    if (this.readOnly) return;
    const [labels, moved] = moveEdge(this.state.labels[finger], label, side, roundTime(time), this.bounds);
    if (!commit) { this.setPreview({ [finger]: labels }); return; }
    if (!differInTime(labels, this.state.labels[finger])) { this.setPreview(null); return; }
    const signed = { ...moved, ...this.byHand() };
    this.selected = { finger, label: signed, fresh: false };
    this.setLabels({ [finger]: labels.map((each) => (each === moved ? signed : each)) });
  }

  /** Set the state or the cause of the chosen label, or else of the next label. */
  setKind(fields) {
    const now = this.chosen?.label ?? this.nextKind, cause = now.cause === fields.cause ? null : fields.cause ?? null;
    const next = { state: fields.state ?? (cause && now.state === "stable" ? "unstable" : now.state), cause };
    if (!this.chosen) { this.nextKind = next; this.changed(false); return; }
    if (this.readOnly) return;
    const { finger, label } = this.chosen;
    const [labels, changed] = change(this.state.labels[finger], label, this.byHand(next));
    this.selected = { finger, label: changed, fresh: false };
    this.setLabels({ [finger]: labels });
  }

  /** Delete the selected label. */
  remove() {
    if (!this.selected || this.readOnly) return;
    const { finger, label } = this.selected;
    this.selected = null;
    this.setLabels({ [finger]: remove(this.state.labels[finger], label) });
  }

  /** Copy the selected label to all other fingers. Return false if no label is selected. */
  copy() {
    if (!this.selected || this.readOnly) return false;
    const { finger, label } = this.selected, others = this.fingers.filter((name) => name !== finger);
    const signed = { ...label, ...this.byHand() };
    this.setLabels(Object.fromEntries(others.map((name) => [name, overwrite(this.state.labels[name], signed, this.bounds.minDuration)[0]])));
    return true;
  }

  /** Accept a proposal, or confirm a label. */
  accept({ kind, finger, item }) {
    const labels = this.state.labels[finger], evidence = [item.author, "accepted", item.evidence].filter(Boolean).join(", ");
    const label = { ...item, ...this.byHand({ evidence }) };
    this.selected = kind === "label" ? { finger, label, fresh: true } : null;
    this.setLabels({ [finger]: replaceInterval(labels, label, this.bounds.minDuration) });
  }

  /**
   * Accept all open proposals of at least a confidence, where no label is; the rule stays their
   * author. Return their number.
   */
  acceptAll(minConfidence) {
    const accepted = this.proposals.filter(({ item }) => item.confidence >= minConfidence);
    if (!accepted.length || this.readOnly) return 0;
    const labels = { ...this.state.labels };
    for (const { finger, item } of accepted) labels[finger] = fillGaps(labels[finger], item, this.bounds.minDuration);
    this.setLabels(labels);
    return accepted.length;
  }

  /** Reject a proposal. */
  reject({ finger, item }) {
    this.apply({ rejected: new Set([...this.state.rejected, itemKey(finger, item)]) });
  }

  /** Replace all labels and the note, by restored ones or by those of the label file. */
  replaceAll(labels, note) {
    const all = Object.fromEntries(this.fingers.map((finger) => [finger, labels[finger] ?? []]));
    this.selected = null;
    this.apply({ labels: all, note });
  }

  undo() { this.stepHistory(() => this.history.undo()); }
  redo() { this.stepHistory(() => this.history.redo()); }

  stepHistory(step) {
    this.preview = null;
    if (this.readOnly || !step()) return;
    const { finger, label } = this.selected ?? {};
    if (label && !this.state.labels[finger].includes(label)) this.selected = null;
    this.changed(true);
  }

  /** Return the review item after the last reviewed one, or the first; null if there is none. */
  nextReviewItem() {
    const items = this.reviewItems, last = this.lastReviewed;
    const isAfter = ({ finger, item }) => (item.confidence - last.item.confidence || item.start - last.item.start || finger.localeCompare(last.finger)) > 0;
    return (this.lastReviewed = (last && items.find(isAfter)) ?? items[0] ?? null);
  }
}

const differInTime = (one, two) => one.length !== two.length
  || one.some((label, k) => label.start !== two[k].start || label.end !== two[k].end);
