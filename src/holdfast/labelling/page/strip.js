// The overview under the pointer: its window is moved, stretched, or put elsewhere.

import { STRIP, wholeTime, wholeX } from "./overview.js";

const GRIP = 9; // [px]

export class Strip {
  constructor(canvas, view) {
    Object.assign(this, { canvas, view, drag: null });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.drag = null; });
    canvas.addEventListener("dblclick", () => view.fit());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  // What a press takes hold of: an edge of the window, the window, or the axis below.
  grip(x, y) {
    if (y > STRIP[1]) return "axis";
    const [left, right] = [this.view.start, this.view.end].map((time) => wholeX(this.view, time));
    const reach = Math.min(GRIP, Math.max(3, (right - left) / 4));
    if (Math.abs(x - left) <= reach) return "start";
    if (Math.abs(x - right) <= reach) return "end";
    return x > left && x < right ? "window" : "outside";
  }

  press(event) {
    const [x, y] = this.place(event), { view } = this;
    this.canvas.setPointerCapture(event.pointerId);
    let mode = this.grip(x, y);
    if (mode === "outside") {
      const time = wholeTime(view, x);
      view.look(time - view.span / 2, time + view.span / 2);
      mode = "window";
    }
    this.drag = { mode, x };
  }

  move(event) {
    const [x, y] = this.place(event), { view, drag } = this;
    if (!drag) {
      const grip = this.grip(x, y);
      this.canvas.style.cursor = grip === "start" || grip === "end" ? "ew-resize" : grip === "outside" ? "pointer" : "grab";
      return;
    }
    const time = wholeTime(view, x);
    if (drag.mode === "axis") view.pan((drag.x - x) * view.perPixel);
    else if (drag.mode === "window") view.pan(time - wholeTime(view, drag.x));
    else if (drag.mode === "start") view.look(Math.min(time, view.end - view.least), view.end);
    else view.look(view.start, Math.max(time, view.start + view.least));
    drag.x = x;
  }

  wheel(event) {
    event.preventDefault();
    const [x, y] = this.place(event), time = y > STRIP[1] ? this.view.time(x) : wholeTime(this.view, x);
    const held = Math.max(this.view.start, Math.min(this.view.end, time));
    this.view.zoom(Math.exp(event.deltaY * (event.deltaMode === 1 ? 16 : 1) * 0.002), held);
  }
}
