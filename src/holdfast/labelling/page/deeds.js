// What keys and buttons do.

import { callService } from "../web/api.js";
import { byId } from "../web/dom.js";
import { toast } from "./dialogs.js";
import { keys } from "./bindings.js";
import { listen } from "./keys.js";
import { many } from "./words.js";

const FORCES = ["F_a", "F_x", "F_y", "F_z", "xyz"];

export class Deeds {
  constructor(page) {
    this.page = page;
    page.plot.target = () => this.target();
    for (const part of ["editor", "view", "plot", "player", "saver", "recordings"]) this[part] = page[part];
  }

  listen() {
    listen(keys(this));
    const on = (id, name, act) => byId(id).addEventListener(name, act);
    on("before", "click", () => this.go(-1));
    on("after", "click", () => this.go(1));
    on("force", "change", (event) => this.plot.show(event.target.value));
    on("note", "input", (event) => this.editor.write(event.target.value));
    on("help", "click", () => this.help());
    on("propose", "click", () => this.propose());
    on("accept-all", "click", () => this.acceptAll());
    on("next-doubt", "click", () => this.nextDoubt());
    on("panel", "click", () => this.panel());
  }

  name(fields) { this.editor.name(fields); }
  undo() { this.page.pointer.stop(); this.editor.undo(); }
  redo() { this.page.pointer.stop(); this.editor.redo(); }
  remove() { this.editor.remove(); }

  copy() {
    if (!this.editor.copy()) toast(this.editor.readOnly ? "Read-only" : "Draw or click a label first: A copies it to all fingers", "bad");
  }

  /** What Enter and X mean: what the pointer went to, else what was gone to, else the next proposal. */
  target() {
    const { editor } = this, { aimed } = this.plot;
    if (aimed && editor.proposals.some(({ item }) => item === aimed.item)) return { kind: "proposal", ...aimed };
    const { chosen, focus } = editor;
    if (chosen && chosen.label.confidence < 1 && editor.doubts.some(({ item }) => item === chosen.label)) return { kind: "label", finger: chosen.finger, item: chosen.label };
    const open = (each) => each.item === focus?.item;
    if (focus && (editor.doubts.some(open) || editor.proposals.some(open))) return focus;
    return editor.proposals.length ? { kind: "proposal", ...editor.proposals[0] } : null;
  }

  accept() { this.decide((target) => this.editor.accept(target)); }
  reject() { this.decide((target) => target.kind !== "label" && this.editor.reject(target)); }

  // Nothing is decided unseen: what is out of sight is shown first.
  decide(act) {
    const target = this.target();
    if (!target) { toast("No proposals are open", "good"); return; }
    if (this.editor.readOnly) { toast("Read-only", "bad"); return; }
    const aimed = this.plot.aimed?.item === target.item;
    if (!this.view.sees(target.item) && !aimed) {
      this.view.show(target.item);
      this.editor.point(target);
      return;
    }
    const after = this.after(target);
    act(target);
    this.plot.aimed = null;
    this.editor.point(after);
    if (after && !aimed && !this.view.sees(after.item)) this.view.show(after.item);
  }

  // What comes next: a doubtful stretch after a doubtful one, else the next proposal in time.
  after(target) {
    const { editor } = this;
    if (target.kind !== "proposal" || editor.lastDoubt?.item === target.item) {
      return editor.doubts.find(({ item }) => item !== target.item) ?? null;
    }
    const place = editor.proposals.findIndex(({ item }) => item === target.item);
    const next = editor.proposals[place + 1] ?? editor.proposals.find(({ item }) => item !== target.item);
    return next ? { kind: "proposal", ...next } : null;
  }

  acceptAll() {
    const above = Math.max(0, Math.min(1, byId("above").valueAsNumber / 100 || 0));
    const n = this.editor.acceptAll(above);
    toast(n ? `${many(n, "proposal")} accepted; the others are less sure than ${Math.round(100 * above)} %` : `No open proposal is as sure as ${Math.round(100 * above)} %`, n ? "good" : "bad");
  }

  nextDoubt() {
    const doubt = this.editor.nextDoubt();
    if (doubt) this.lookAt(doubt);
    else toast("Nothing doubtful is left", "good");
  }

  lookAt(doubt) {
    const { editor } = this;
    editor.lastDoubt = doubt;
    this.plot.aimed = null;
    this.view.show(doubt.item);
    editor.select(doubt.finger, doubt.kind === "label" ? doubt.item : null);
    editor.point(doubt);
    this.player.seek(doubt.item.start);
  }

  async propose() {
    const { id, turn, editor } = this.page, button = byId("propose");
    if (button.classList.contains("busy")) return;
    button.classList.add("busy");
    try {
      const { proposals } = await callService("POST", `recordings/${id}/propose`, { rule: byId("rule").value, parameters: {} });
      if (turn !== this.page.turn) return;
      editor.recording.proposals = proposals;
      // Who asks again wants to see all of them.
      if (editor.state.rejected.size) editor.edit({ rejected: new Set() });
      editor.focus = null;
      this.page.changed(false);
      this.page.count();
      toast(`${many(Object.values(proposals).flat().length, "proposal")}: Enter accepts one, Shift-Enter all confident ones`, "good");
    } catch (error) {
      toast(error.message, "bad");
    } finally {
      button.classList.remove("busy");
    }
  }

  go(by) {
    const entry = this.recordings.next(this.page.id, by);
    if (entry) this.page.open(entry.id);
    else toast(by > 0 ? "This is the last recording" : "This is the first recording", "good");
  }

  escape() {
    if (this.page.pointer.stop()) return;
    this.editor.selected = null;
    this.editor.point(null);
  }

  force() {
    const kind = FORCES[(FORCES.indexOf(this.plot.kind) + 1) % FORCES.length];
    byId("force").value = kind;
    this.plot.show(kind);
  }

  heights() {
    this.plot.close = !this.plot.close;
    this.plot.scales = null;
    this.plot.redraw("lines");
    toast(this.plot.close ? "Heights fit what is in view" : "Heights fit the whole recording", "good");
  }

  /** Zooms about the cursor, else about the middle. */
  zoom(factor) {
    const { start, end } = this.view;
    this.view.zoom(factor, this.plot.hover?.time ?? (start + end) / 2);
  }

  pan(share) { this.view.pan(share * this.view.span); }
  panel() { byId("panel").setAttribute("aria-pressed", String(document.body.classList.toggle("is-wide"))); }
  help() { byId("help-box").showModal(); }

  note() {
    document.body.classList.remove("is-wide");
    byId("note").focus();
  }
}
