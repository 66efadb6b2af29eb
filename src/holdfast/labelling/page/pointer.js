// Mouse, pen and touch on the plots: draw labels, move edges, and move the time window.

import { labelAt, snap } from "./labels.js";

const MIN_DRAG_DISTANCE = 4; // [px], a shorter movement is a click
const EDGE_REACH = { mouse: 6, pen: 8, touch: 16 }; // [px]
const SNAP_DISTANCE = 9; // [px]
const WHEEL_UNITS = [1, 16, 400]; // [px], of wheels that count in pixels, lines or pages

export class Pointer {
  /**
   * @param seek called with the time of a click [s].
   * @param hovered called when the pointer is over something else.
   */
  constructor(surface, rows, seek, hovered) {
    Object.assign(this, { surface, rows, seek, hovered, editor: rows.editor, view: rows.view });
    this.drag = null; // of one pointer; others that are pressed meanwhile do nothing
    const on = (name, act, options) => surface.addEventListener(name, act.bind(this), options);
    on("pointerdown", this.press);
    on("pointermove", this.move);
    on("pointerup", this.release);
    on("pointercancel", this.cancelDrag);
    on("pointerleave", this.leave);
    on("wheel", this.wheel, { passive: false });
    on("dblclick", () => this.view.showAll());
    on("contextmenu", (event) => event.preventDefault());
  }

  // Return the horizontal position of an event in the plots [px].
  x(event) { return event.clientX - this.surface.getBoundingClientRect().left; }

  /** Return finger, time, label, proposal and edge at the position of an event; null without fingers. */
  find(event) {
    const x = this.x(event), row = this.rows.rowAt(event.clientY);
    if (!row) return null;
    const { finger } = row, time = this.view.time(x), zone = row.zoneAt(event.clientY);
    const labels = this.editor.state.labels[finger], label = labelAt(labels, time);
    const proposal = this.editor.proposals.find((each) => each.finger === finger && each.item.start <= time && time < each.item.end);
    const reach = (EDGE_REACH[event.pointerType] ?? EDGE_REACH.mouse) * (zone === "labels" ? 1.3 : 0.7);
    const edge = zone === "proposals" ? null : this.nearestEdge(labels, label, x, reach);
    return { x, finger, time, zone, label, proposal, edge };
  }

  // Return the nearest edge; of two labels that share it, the edge of the label under the pointer.
  nearestEdge(labels, labelUnder, x, reach) {
    let nearest = null;
    for (const label of labels) {
      for (const side of ["start", "end"]) {
        const distance = Math.abs(this.view.x(label[side]) - x) - (label === labelUnder ? 0.5 : 0);
        if (distance <= reach && distance < (nearest?.distance ?? Infinity)) nearest = { label, side, distance };
      }
    }
    return nearest;
  }

  /**
   * Return the nearest change point or edge near a time, or else the time. Alt switches it off.
   *
   * @param moved label whose own edges are ignored.
   */
  snapped(event, finger, time, moved = null) {
    if (event.altKey) return time;
    const { low, high } = this.editor.bounds;
    const edges = Object.values(this.editor.state.labels).flat().flatMap((label) => [label.start, label.end])
      .filter((edge) => edge !== moved?.start && edge !== moved?.end);
    return snap(time, [low, high, ...edges, ...(this.rows.changePoints[finger] ?? [])], SNAP_DISTANCE * this.view.secondsPerPixel);
  }

  press(event) {
    this.surface.focus({ preventScroll: true });
    this.surface.setPointerCapture(event.pointerId);
    const found = this.find(event);
    if (!found || this.drag) return;
    const pans = event.shiftKey || event.button > 0 || this.editor.readOnly;
    const mode = pans ? "pan" : found.edge ? "edge" : "label";
    this.drag = { ...found, mode, from: found.time, fromX: event.clientX, lastX: event.clientX, pointer: event.pointerId, started: false, button: event.button };
    if (mode === "label") this.drag.from = this.snapped(event, found.finger, found.time);
  }

  /** Update what is under the pointer after the window has moved. */
  windowMoved() {
    if (this.lastEvent && this.rows.hover && !this.drag) this.rows.hover = this.find(this.lastEvent);
  }

  move(event) {
    const found = this.find(event), { drag } = this;
    this.lastEvent = event;
    if (!found) return;
    this.rows.hoveredProposal = drag ? null : found.proposal ?? null;
    if (!drag) { this.hover(found); return; }
    if (event.pointerId !== drag.pointer) return;
    drag.started ||= Math.abs(event.clientX - drag.fromX) > MIN_DRAG_DISTANCE;
    if (!drag.started) return;
    if (drag.mode === "pan") this.view.pan((drag.lastX - event.clientX) * this.view.secondsPerPixel);
    else this.applyDrag(event, false);
    drag.lastX = event.clientX;
    this.hover({ ...found, time: this.rows.snapTime ?? found.time });
  }

  // Change labels as the drag demands, or only preview it unless `commit`.
  applyDrag(event, commit) {
    const { mode, finger, edge, from } = this.drag, { time } = this.find(event);
    if (mode === "pan") return;
    const to = this.snapped(event, finger, time, edge?.label), isForAll = event.ctrlKey || event.metaKey;
    this.rows.snapTime = commit || to === time ? null : to;
    if (mode === "edge") this.editor.moveEdge(finger, edge.label, edge.side, to, commit);
    else this.editor.draw(isForAll ? [finger, ...this.editor.fingers.filter((name) => name !== finger)] : [finger], from, to, commit);
  }

  release(event) {
    const { drag } = this;
    if (event.pointerId !== drag?.pointer) return;
    if (drag.started) this.applyDrag(event, true);
    else if (!drag.button) this.click(drag);
    this.drag = null;
    this.hover(event.pointerType === "touch" ? null : this.find(event));
  }

  leave() {
    if (this.drag) return;
    this.lastEvent = this.rows.hoveredProposal = null;
    this.hover(null);
  }

  /** Cancel a drag without changes. Return false if there is none. */
  cancelDrag() {
    const hadDrag = this.drag !== null;
    this.drag = null;
    this.rows.snapTime = null;
    if (hadDrag) this.editor.setPreview(null);
    return hadDrag;
  }

  click({ finger, label, proposal, zone, time }) {
    if (zone === "proposals" && proposal) {
      this.editor.select(null, null);
      this.editor.setFocus({ kind: "proposal", ...proposal });
    } else {
      this.editor.select(finger, label);
      this.editor.setFocus(null);
    }
    this.seek(time);
  }

  hover(found) {
    this.rows.hover = found;
    const edge = this.drag ? this.drag.mode === "edge" : found?.edge && !this.editor.readOnly;
    this.surface.style.cursor = this.drag?.mode === "pan" ? "grabbing" : edge ? "col-resize" : "crosshair";
    this.rows.redraw();
    this.hovered(found);
  }

  // The wheel zooms; a sideways movement, or Shift, moves the window.
  wheel(event) {
    event.preventDefault();
    const unit = WHEEL_UNITS[event.deltaMode];
    const sideways = event.shiftKey && !event.deltaX ? event.deltaY : event.deltaX;
    if (Math.abs(sideways) > Math.abs(event.shiftKey ? 0 : event.deltaY)) {
      this.view.pan(sideways * unit * this.view.secondsPerPixel);
      return;
    }
    const found = this.find(event);
    if (found) this.view.zoom(Math.exp(event.deltaY * unit * (event.ctrlKey ? 0.01 : 0.002)), found.time);
  }
}
