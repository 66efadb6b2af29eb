// What a person does to the labels of the open recording. Every change goes through here.

import { History } from "./history.js";
import { change, doubts, fill, moveEdge, nameOf, openProposals, overwrite, put, remove, tidy } from "./model.js";

const same = (a, b) => a && b && a.finger === b.finger && a.item.start === b.item.start && a.item.end === b.item.end;

export class Editor {
  /** @param changed is called with true where labels or note are others, else false. */
  constructor(changed) {
    this.changed = changed;
    this.pen = { state: "stable", cause: null };
    this.open({ fingers: [], labels: {}, proposals: {}, suspects: [], start: 0, end: 1, rate: 1, note: "", read_only: true }, "", []);
  }

  open(recording, author, rejected) {
    this.recording = recording;
    this.author = author;
    this.readOnly = Boolean(recording.read_only);
    const least = recording.rate > 0 ? 1 / recording.rate : 1e-3;
    // The last sample is labelled too.
    this.bounds = { low: recording.start, high: recording.end + least, least };
    const labels = Object.fromEntries(recording.fingers.map((finger) => [finger, recording.labels[finger] ?? []]));
    this.history = new History({ labels, note: recording.note ?? "", rejected: new Set(rejected) });
    this.selected = null; // { finger, label, fresh }: fresh is drawn a moment ago, not chosen
    this.focus = null; // { kind, finger, item } that Enter and X mean
    this.preview = null; // { finger: labels } while something is dragged
  }

  get state() { return this.history.state; }
  get fingers() { return this.recording.fingers; }
  get proposals() { return this.found.proposals; }
  get doubts() { return this.found.doubts; }

  // Asked for at every drawing, so found once for each state.
  get found() {
    const { state, recording: { proposals, suspects } } = this;
    if (this.memo?.state !== state || this.memo.of !== proposals) {
      this.memo = { state, of: proposals, proposals: openProposals(state, proposals), doubts: doubts(state, proposals, suspects ?? []) };
    }
    return this.memo;
  }

  get chosen() { return this.selected && !this.selected.fresh ? this.selected : null; }

  isRejected(finger, item) { return this.state.rejected.has(nameOf(finger, item)); }

  /** Labels as they are to be drawn. */
  labels(finger) { return this.preview?.[finger] ?? this.state.labels[finger]; }

  edit(fields, tag = null) {
    if (this.readOnly) return;
    this.history.change({ ...this.state, ...fields }, tag);
    this.preview = null;
    this.changed(true);
  }

  put(labels) { this.edit({ labels: { ...this.state.labels, ...labels } }); }

  select(finger, label, fresh = false) {
    this.selected = label ? { finger, label, fresh } : null;
    this.changed(false);
  }

  point(focus) {
    this.focus = focus;
    this.changed(false);
  }

  mine(fields) { return { evidence: "hand", confidence: 1, author: this.author, ...fields }; }

  /** A label of the pen between two times, as it would be; null where that is too short. */
  drawn(from, to) {
    const { low, high, least } = this.bounds;
    const [start, end] = [Math.min(from, to), Math.max(from, to)].map((time) => tidy(Math.max(low, Math.min(high, time))));
    return end - start >= least ? this.mine({ start, end, ...this.pen }) : null;
  }

  /** Shows what a drag would do, or does it. */
  draw(fingers, from, to, commit) {
    const label = this.drawn(from, to);
    if (!label || this.readOnly) { this.show(null); return; }
    const found = fingers.map((finger) => [finger, overwrite(this.state.labels[finger], label, this.bounds.least)]);
    const labels = Object.fromEntries(found.map(([finger, [own]]) => [finger, own]));
    if (!commit) { this.show(labels); return; }
    this.selected = { finger: fingers[0], label: found[0][1][1], fresh: true };
    this.put(labels);
  }

  move(finger, label, side, time, commit) {
    if (this.readOnly) return;
    const [labels, moved] = moveEdge(this.state.labels[finger], label, side, tidy(time), this.bounds);
    if (!commit) { this.show({ [finger]: labels }); return; }
    if (!differ(labels, this.state.labels[finger])) { this.show(null); return; }
    const signed = { ...moved, ...this.mine() };
    this.selected = { finger, label: signed, fresh: false };
    this.put({ [finger]: labels.map((each) => (each === moved ? signed : each)) });
  }

  show(labels) {
    this.preview = labels;
    this.changed(false);
  }

  /** A state or cause for the chosen label, else for the pen. */
  name(fields) {
    const now = this.chosen?.label ?? this.pen;
    let next;
    if ("state" in fields) next = { state: fields.state, cause: null };
    else {
      const cause = now.cause === fields.cause ? null : fields.cause;
      next = { state: cause && now.state === "stable" ? "unstable" : now.state, cause };
    }
    if (!this.chosen) { this.pen = next; this.changed(false); return; }
    if (this.readOnly) return;
    const { finger, label } = this.chosen;
    const [labels, changed] = change(this.state.labels[finger], label, this.mine(next));
    this.selected = { finger, label: changed, fresh: false };
    this.put({ [finger]: labels });
  }

  remove() {
    if (!this.selected || this.readOnly) return;
    const { finger, label } = this.selected;
    this.selected = null;
    this.put({ [finger]: remove(this.state.labels[finger], label) });
  }

  /** The selected label for every other finger too. */
  copy() {
    if (!this.selected || this.readOnly) return false;
    const { finger, label } = this.selected, others = this.fingers.filter((name) => name !== finger);
    this.put(Object.fromEntries(others.map((name) => [name, overwrite(this.state.labels[name], this.signed(label), this.bounds.least)[0]])));
    return true;
  }

  signed(label) { return { ...label, ...this.mine() }; }

  /** Takes a proposal or what an audit expects, or confirms a label; what a person saw is certain. */
  accept({ kind, finger, item }) {
    const own = this.state.labels[finger], evidence = [item.author, "accepted", item.evidence].filter(Boolean).join(", ");
    const sure = this.mine({ evidence });
    if (kind === "suspect") {
      const { start, end, expected: state } = item;
      // At an edge the neighbour is what should have gone on.
      const beside = own.find((each) => each.state === state && each.start <= end && each.end >= start);
      const label = this.mine({ start, end, state, cause: beside?.cause ?? null, evidence: "audit, accepted" });
      this.selected = null;
      this.put({ [finger]: overwrite(own, label, this.bounds.least)[0] });
    } else if (kind === "label") {
      const [labels, label] = change(own, item, sure);
      this.selected = { finger, label, fresh: true };
      this.put({ [finger]: labels });
    } else {
      this.selected = null;
      this.put({ [finger]: put(own, { ...item, ...sure }, this.bounds.least) });
    }
  }

  /** Takes all confident proposals where nothing is labelled, as their rule signed them. */
  acceptAll(above) {
    const taken = this.proposals.filter(({ item }) => item.confidence >= above);
    if (!taken.length || this.readOnly) return 0;
    const labels = { ...this.state.labels };
    for (const { finger, item } of taken) labels[finger] = fill(labels[finger], item, this.bounds.least);
    this.put(labels);
    return taken.length;
  }

  reject({ finger, item }) {
    this.edit({ rejected: new Set([...this.state.rejected, nameOf(finger, item)]) });
  }

  write(note) {
    if (note !== this.state.note) this.edit({ note }, "note");
  }

  /** Everything of another state at once: what was rescued, or what somebody else saved. */
  replace(labels, note) {
    const whole = Object.fromEntries(this.fingers.map((finger) => [finger, labels[finger] ?? []]));
    this.selected = null;
    this.edit({ labels: whole, note });
  }

  undo() { this.travel(() => this.history.undo()); }
  redo() { this.travel(() => this.history.redo()); }

  travel(step) {
    this.preview = null;
    if (this.readOnly || !step()) return;
    const { finger, label } = this.selected ?? {};
    if (label && !this.state.labels[finger].includes(label)) this.selected = null;
    this.changed(true);
  }

  /** The doubtful stretch after the one that was looked at last. */
  nextDoubt() {
    const all = this.doubts, key = (each) => [each.doubt, each.item.start, each.finger];
    const after = this.lastDoubt && all.find((each) => !same(each, this.lastDoubt) && compare(key(each), key(this.lastDoubt)) > 0);
    return (this.lastDoubt = after ?? all[0] ?? null);
  }
}

const differ = (one, two) => one.length !== two.length
  || one.some((label, k) => label.start !== two[k].start || label.end !== two[k].end);

function compare(a, b) {
  const k = a.findIndex((value, place) => value !== b[place]);
  return k < 0 ? 0 : a[k] < b[k] ? -1 : 1;
}
