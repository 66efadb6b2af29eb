// Commands that keys and buttons run.

import { callService } from "../web/connection.js";
import { byId, runOnce, showToast } from "../web/dom.js";
import { listenToKeys } from "../web/help.js";
import { percent } from "../web/text.js";
import { CAUSES, causeKey, countOf, STATES } from "./format.js";

const FORCES = ["F_a", "F_x", "F_y", "F_z", "xyz"];
const READ_ONLY = "This recording is read-only";

export class Commands {
  constructor(page) {
    this.page = page;
    page.rows.target = () => this.target();
    for (const part of ["editor", "view", "rows", "player", "saver", "recordings"]) this[part] = page[part];
  }

  listen() {
    listenToKeys(this.keys());
    const on = (id, name, act) => byId(id).addEventListener(name, act);
    on("previous-recording", "click", () => this.openNeighbour(-1));
    on("next-recording", "click", () => this.openNeighbour(1));
    on("force", "change", (event) => this.rows.showForce(event.target.value));
    on("note", "input", (event) => this.editor.setNote(event.target.value));
    on("propose", "click", (event) => runOnce(event.target, () => this.propose()));
    on("accept-all", "click", () => this.acceptAll());
    on("next-item", "click", () => this.nextReviewItem());
    on("toggle-side", "click", () => this.toggleSidePanel());
  }

  /** Return the keys of the page, for `listenToKeys`. */
  keys() {
    const states = Object.fromEntries(STATES.map((state, k) => [k + 1, () => this.setKind({ state })]));
    const causes = Object.fromEntries(CAUSES.map((cause) => [causeKey(cause), () => this.setKind({ cause })]));
    const closer = () => this.zoom(0.6), all = () => this.view.showAll();
    return {
      Label: [
        ["1 2 3", "set the state: stable, unstable, no contact (of the selected label, or else of the next label)", states],
        ["C D S L R K", "set the cause: closing, disturbance, slip, lost, released, glitch", causes],
        ["drag", "draw a label on a finger; with Ctrl on all fingers"],
        ["drag an edge", "move the edge; it snaps to change points, except with Alt"],
        ["click", "select a label, and move the playback time"],
        ["A", "copy the label to all fingers", { a: () => this.copy() }],
        ["Delete", "delete the label", { Delete: () => this.remove(), Backspace: () => this.remove() }],
        ["Esc", "cancel a drag, or clear the selection", { Escape: () => this.cancel() }],
        ["Ctrl Z", "undo; with Shift redo", { "Control-z": () => this.undo(), "Control-Shift-z": () => this.redo(), "Control-y": () => this.redo() }],
        ["E", "edit the note about the recording", { e: () => this.editNote(), "Control-s": () => this.saver.flush() }],
        ["Enter", "accept the proposal under the pointer, or the next one; confirm a label of low confidence", { Enter: () => this.accept() }],
        ["X", "reject the proposal", { x: () => this.reject() }],
        ["Shift Enter", "accept all proposals of high confidence", { "Shift-Enter": () => this.acceptAll() }],
        ["G", "go to the next item to review", { g: () => this.nextReviewItem() }],
      ],
      View: [
        ["wheel", "zoom about the pointer"],
        ["Shift or right drag", "move the time window"],
        ["double click, 0", "show the whole recording", { 0: all, Home: all }],
        ["+ − ← →", "zoom and move", { "+": closer, "=": closer, "-": () => this.zoom(1 / 0.6), ArrowLeft: () => this.pan(-0.2), ArrowRight: () => this.pan(0.2) }],
        ["Space", "play or pause", { " ": () => this.player.toggle() }],
        ["N P", "open the next or the previous recording", { n: () => this.openNeighbour(1), p: () => this.openNeighbour(-1) }],
        ["F", "show |F|, Fx, Fy, Fz, or all three components", { f: () => this.nextForce() }],
        ["Y", "fit the vertical axes to the whole recording or to the visible window", { y: () => this.toggleScaling() }],
        ["B", "hide or show the side panel", { b: () => this.toggleSidePanel() }],
      ],
    };
  }

  setKind(fields) { this.editor.setKind(fields); }
  undo() { this.page.pointer.cancelDrag(); this.editor.undo(); }
  redo() { this.page.pointer.cancelDrag(); this.editor.redo(); }
  remove() { this.editor.remove(); }

  copy() {
    if (!this.editor.copy()) showToast(this.editor.readOnly ? READ_ONLY : "Draw or select a label first: A copies it to all fingers", "bad");
  }

  /**
   * Return the item that Enter and X act on: the proposal under the pointer, else the selected
   * label of low confidence, else the item in focus, else the next proposal; null if none is left.
   */
  target() {
    const { proposals, reviewItems, chosen, focus } = this.editor;
    const proposalOf = (item) => proposals.find((each) => each.item === item), review = (item) => reviewItems.find((each) => each.item === item);
    const proposal = proposalOf(this.rows.hoveredProposal?.item);
    if (proposal) return { kind: "proposal", ...proposal };
    const doubtful = review(chosen?.label) ?? (focus && (review(focus.item) || proposalOf(focus.item)) && focus);
    return doubtful || (proposals.length ? { kind: "proposal", ...proposals[0] } : null);
  }

  accept() { this.decide((target) => this.editor.accept(target)); }
  reject() { this.decide((target) => target.kind !== "label" && this.editor.reject(target)); }

  // Run `act` on the target. A target outside the window is only shown first.
  decide(act) {
    const target = this.target();
    if (!target) return showToast("No proposal is open", "good");
    if (this.editor.readOnly) return showToast(READ_ONLY, "bad");
    const hovered = this.rows.hoveredProposal?.item === target.item;
    if (!this.view.contains(target.item) && !hovered) {
      this.view.reveal(target.item);
      return this.editor.setFocus(target);
    }
    const next = this.itemAfter(target);
    act(target);
    this.rows.hoveredProposal = null;
    this.editor.setFocus(next);
    if (next && !hovered && !this.view.contains(next.item)) this.view.reveal(next.item);
    return undefined;
  }

  // Return the next review item if the target comes from the review list, else the next proposal in time.
  itemAfter(target) {
    const { editor } = this;
    if (target.kind !== "proposal" || editor.lastReviewed?.item === target.item) {
      return editor.reviewItems.find(({ item }) => item !== target.item) ?? null;
    }
    const { proposals } = editor, index = proposals.findIndex(({ item }) => item === target.item);
    const next = proposals[index + 1] ?? proposals[index && 0];
    return next ? { kind: "proposal", ...next } : null;
  }

  acceptAll() {
    const minConfidence = Math.max(0, Math.min(1, byId("min-confidence").valueAsNumber / 100 || 0));
    const n = this.editor.acceptAll(minConfidence);
    showToast(`${countOf(n, "proposal")} with a confidence of at least ${percent(minConfidence)} accepted`, n ? "good" : "bad");
  }

  nextReviewItem() {
    const item = this.editor.nextReviewItem();
    if (item) this.showReviewItem(item);
    else showToast("No items are left to review", "good");
  }

  showReviewItem(reviewItem) {
    const { editor } = this, { kind, finger, item } = reviewItem;
    editor.lastReviewed = reviewItem;
    this.rows.hoveredProposal = null;
    this.view.reveal(item);
    editor.select(finger, kind === "label" ? item : null);
    editor.setFocus(reviewItem);
    this.player.seek(item.start);
  }

  async propose() {
    const { id, generation, editor } = this.page;
    const { proposals } = await callService("POST", `recordings/${id}/propose`, { rule: byId("rule").value, parameters: {} });
    if (generation !== this.page.generation) return;
    editor.recording.proposals = proposals;
    // A new request shows all proposals again, also those that were rejected.
    if (editor.state.rejected.size) editor.apply({ rejected: new Set() });
    editor.setFocus(null);
    this.page.updateCounts();
    showToast(`${countOf(Object.values(proposals).flat().length, "proposal")}: Enter accepts one, Shift-Enter accepts all of high confidence`, "good");
  }

  /** Open the previous (-1) or the next (1) recording. */
  openNeighbour(step) {
    const entry = this.recordings.neighbour(this.page.id, step);
    if (entry) this.page.open(entry.id);
    else showToast(step > 0 ? "This is the last recording" : "This is the first recording", "good");
  }

  /** Cancel a drag; without a drag, clear the selection. */
  cancel() {
    if (this.page.pointer.cancelDrag()) return;
    this.editor.selected = null;
    this.editor.setFocus(null);
  }

  nextForce() {
    const force = FORCES[(FORCES.indexOf(this.rows.force) + 1) % FORCES.length];
    byId("force").value = force;
    this.rows.showForce(force);
  }

  toggleScaling() {
    this.rows.scaleToWindow = !this.rows.scaleToWindow;
    this.rows.redraw("signals");
    showToast(this.rows.scaleToWindow ? "Vertical axes fit the visible window" : "Vertical axes fit the whole recording", "good");
  }

  /** Zoom about the cursor, or about the middle of the window if there is no cursor. */
  zoom(factor) {
    const { start, end } = this.view;
    this.view.zoom(factor, this.rows.hover?.time ?? (start + end) / 2);
  }

  pan(fraction) { this.view.pan(fraction * this.view.span); }
  toggleSidePanel() { byId("toggle-side").setAttribute("aria-pressed", String(document.body.classList.toggle("is-side-hidden"))); }

  editNote() {
    document.body.classList.remove("is-side-hidden");
    byId("note").focus();
  }
}
