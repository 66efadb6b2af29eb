// Mouse, pen and fingers on the plots: labels are drawn, edges moved, and the window too.

import { at, snap } from "./model.js";
import { rowAt, zoneAt } from "./rows.js";
import { LEFT, RIGHT } from "./view.js";

const MOVED = 4; // [px] from which on a press is a drag
const NEAR = { mouse: 6, pen: 8, touch: 16 }; // [px] to an edge
const SNAP = 9; // [px]

export class Pointer {
  /** @param seek is called with the time of a click, @param hovered with what is pointed at. */
  constructor(canvas, plot, seek, hovered) {
    Object.assign(this, { canvas, plot, seek, hovered, editor: plot.editor, view: plot.view });
    this.down = new Map(); // pointers that touch, by id
    this.drag = null;
    const on = (name, act, options) => canvas.addEventListener(name, act.bind(this), options);
    on("pointerdown", this.press);
    on("pointermove", this.move);
    on("pointerup", this.release);
    on("pointercancel", this.cancel);
    on("pointerleave", this.leave);
    on("wheel", this.wheel, { passive: false });
    on("dblclick", () => this.view.fit());
    on("contextmenu", (event) => event.preventDefault());
  }

  /** What is under an event. */
  find(event) {
    const box = this.canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    const row = rowAt(this.plot.rows, y), finger = this.editor.fingers[row];
    if (finger === undefined) return null;
    const time = this.view.time(Math.max(LEFT, Math.min(this.view.width - RIGHT, x)));
    const zone = zoneAt(this.plot.rows[row], y), labels = this.editor.state.labels[finger];
    const label = at(labels, time);
    const proposal = this.editor.proposals.find((each) => each.finger === finger && each.item.start <= time && time < each.item.end);
    const reach = (NEAR[event.pointerType] ?? 6) * (zone === "labels" ? 1.3 : 0.7);
    const edge = zone === "proposals" ? null : this.edge(labels, label, x, reach);
    return { x, y, row, finger, time, zone, label, proposal, edge };
  }

  // The edge next to a place; of two labels that share it, that of the one which is pointed at.
  edge(labels, under, x, reach) {
    let best = null;
    for (const label of labels) {
      for (const side of ["start", "end"]) {
        const away = Math.abs(this.view.x(label[side]) - x) - (label === under ? 0.5 : 0);
        if (away <= reach && away < (best?.away ?? Infinity)) best = { label, side, away };
      }
    }
    return best;
  }

  /** A time, moved to a change point or an edge nearby; not where Alt is held. */
  snapped(event, finger, time, without = null) {
    if (event.altKey) return time;
    const { low, high } = this.editor.bounds;
    const edges = Object.values(this.editor.state.labels).flat()
      .filter((label) => label !== without).flatMap((label) => [label.start, label.end]);
    const own = without ? edges.filter((edge) => edge !== without.start && edge !== without.end) : edges;
    return snap(time, [low, high, ...own, ...(this.plot.changes[finger] ?? [])], SNAP * this.view.perPixel);
  }

  press(event) {
    this.canvas.focus({ preventScroll: true });
    this.down.set(event.pointerId, event.clientX);
    this.canvas.setPointerCapture(event.pointerId);
    if (this.down.size === 2) { this.pinch(); return; }
    const found = this.find(event);
    if (!found || this.down.size > 2) return;
    const panning = event.shiftKey || event.button > 0 || this.editor.readOnly;
    this.drag = { ...found, from: found.time, fromX: event.clientX, began: false, mode: panning ? "pan" : found.edge ? "edge" : "label", button: event.button };
    if (this.drag.mode === "label") this.drag.from = this.snapped(event, found.finger, found.time);
  }

  // Two fingers: what is under them stays under them.
  pinch() {
    this.editor.show(null);
    const left = this.canvas.getBoundingClientRect().left;
    const held = [...this.down].map(([id, x]) => [id, this.view.time(x - left)]);
    this.drag = { mode: "pinch", began: true, held };
  }

  /** The window has moved under the pointer, which itself did not. */
  again() {
    if (this.last && this.plot.hover && !this.drag) this.plot.hover = this.find(this.last);
  }

  move(event) {
    const found = this.find(event), { drag } = this;
    this.last = event;
    if (!found) return;
    this.plot.aimed = drag ? null : found.proposal ?? null;
    const before = this.down.get(event.pointerId);
    if (this.down.has(event.pointerId)) this.down.set(event.pointerId, event.clientX);
    if (!drag) { this.hover(found); return; }
    drag.began ||= Math.abs(event.clientX - drag.fromX) > MOVED;
    if (!drag.began) return;
    if (drag.mode === "pinch") this.pinched();
    else if (drag.mode === "pan") this.view.pan((before - event.clientX) * this.view.perPixel);
    else {
      this.reach(found.x);
      this.apply(event, false);
    }
    this.hover({ ...found, time: this.plot.snapped ?? found.time, x: this.plot.snapped === null ? found.x : this.view.x(this.plot.snapped) });
  }

  pinched() {
    const left = this.canvas.getBoundingClientRect().left;
    const [[a, timeA], [b, timeB]] = this.drag.held;
    const [xa, xb] = [a, b].map((id) => this.down.get(id) - left);
    if (Math.abs(xa - xb) < 8 || timeA === timeB) return;
    const perPixel = Math.abs((timeB - timeA) / (xb - xa));
    const start = timeA - (xa - LEFT) * perPixel;
    this.view.look(start, start + perPixel * this.view.inner);
  }

  // A drag beyond the side of the plot takes the window along.
  reach(x) {
    const over = Math.min(0, x - LEFT) + Math.max(0, x - (this.view.width - RIGHT));
    if (over) this.view.pan(0.3 * over * this.view.perPixel);
  }

  apply(event, commit) {
    const { drag } = this, { time } = this.find(event);
    if (drag.mode === "edge") {
      const to = this.snapped(event, drag.finger, time, drag.edge.label);
      this.plot.snapped = to === time ? null : to;
      this.editor.move(drag.finger, drag.edge.label, drag.edge.side, to, commit);
    } else if (drag.mode === "label") {
      const to = this.snapped(event, drag.finger, time);
      this.plot.snapped = to === time ? null : to;
      const fingers = event.ctrlKey || event.metaKey ? [drag.finger, ...this.editor.fingers.filter((name) => name !== drag.finger)] : [drag.finger];
      this.editor.draw(fingers, drag.from, to, commit);
    }
    if (commit) this.plot.snapped = null;
  }

  release(event) {
    const { drag } = this;
    this.down.delete(event.pointerId);
    if (drag?.mode === "pinch" && this.down.size) return;
    if (!drag) return;
    if (drag.began) this.apply(event, true);
    else if (!drag.button) this.click(drag);
    this.drag = null;
    this.hover(event.pointerType === "touch" ? null : this.find(event));
  }

  leave() {
    if (this.drag) return;
    this.last = this.plot.aimed = null;
    this.hover(null);
  }

  cancel(event) {
    this.down.delete(event.pointerId);
    this.stop();
  }

  /** Gives up what is being dragged. */
  stop() {
    const had = this.drag !== null;
    this.drag = null;
    this.plot.snapped = null;
    if (had) this.editor.show(null);
    return had;
  }

  click({ finger, label, proposal, zone, time }) {
    if (zone === "proposals" && proposal) {
      this.editor.select(null, null);
      this.editor.point({ kind: "proposal", ...proposal });
    } else {
      this.editor.select(finger, label);
      this.editor.point(null);
    }
    this.seek(time);
  }

  hover(found) {
    this.plot.hover = found;
    const edge = this.drag ? this.drag.mode === "edge" : found?.edge && !this.editor.readOnly;
    this.canvas.style.cursor = this.drag?.mode === "pan" ? "grabbing" : edge ? "col-resize" : "crosshair";
    this.plot.redraw("over");
    this.hovered(found);
  }

  wheel(event) {
    // Over the rows the wheel zooms; sideways, or with Shift, it moves.
    event.preventDefault();
    const unit = event.deltaMode === 1 ? 16 : event.deltaMode === 2 ? 400 : 1;
    const sideways = event.shiftKey && !event.deltaX ? event.deltaY : event.deltaX;
    if (Math.abs(sideways) > Math.abs(event.shiftKey ? 0 : event.deltaY)) {
      this.view.pan(sideways * unit * this.view.perPixel);
      return;
    }
    const found = this.find(event);
    if (found) this.view.zoom(Math.exp(event.deltaY * unit * (event.ctrlKey ? 0.01 : 0.002)), found.time);
  }
}
