// Overview of the whole recording, with the time window as a frame, and the time axis of the window.

import { byId, make } from "../web/dom.js";
import { TimePlot } from "../web/plot.js";
import { stateKey, timeText } from "../web/text.js";
import { fingerColour } from "../web/theme.js";
import { placeAll, place } from "./intervals.js";

const MIN_DRAG_DISTANCE = 4; // [px], a shorter movement is a click

export class Overview {
  constructor(view, editor, signals) {
    Object.assign(this, { view, editor, signals, box: byId("overview"), press: null });
    this.axis = new TimePlot(byId("time-axis"), {
      lines: [], window: () => [view.start, view.end], range: () => [0, 1], ticks: [], times: timeText, padding: [0, 0],
    });
    const on = (name, act, options) => this.box.addEventListener(name, act, options);
    on("pointerdown", (event) => this.pressed(event));
    on("pointermove", (event) => this.press && this.moved(event));
    on("pointerup", (event) => this.released(event));
    on("dblclick", () => view.showAll());
    on("wheel", (event) => { event.preventDefault(); view.zoom(Math.exp(event.deltaY * 0.002), this.timeAt(event)); }, { passive: false });
  }

  // The whole recording, as a window for `place`.
  get whole() {
    const { low, high } = this.view;
    return { start: low, end: high, span: high - low };
  }

  timeAt(event) {
    const { left, width } = this.box.getBoundingClientRect();
    return this.whole.start + (this.whole.span * (event.clientX - left)) / width;
  }

  // A drag moves the window if it begins there, and else chooses a new one; a click moves it there.
  pressed(event) {
    const time = this.timeAt(event), { view } = this, zoomed = view.span < 0.99 * this.whole.span;
    this.box.setPointerCapture(event.pointerId);
    this.press = { time, x: event.clientX, moves: zoomed && time > view.start && time < view.end, started: false };
  }

  moved(event) {
    const { press, view } = this, time = this.timeAt(event);
    press.started ||= Math.abs(event.clientX - press.x) > MIN_DRAG_DISTANCE;
    if (!press.started) return;
    if (!press.moves) { view.setWindow(Math.min(time, press.time), Math.max(time, press.time)); return; }
    view.pan(time - press.time);
    press.time = time;
  }

  released(event) {
    const { view } = this, time = this.timeAt(event);
    if (this.press && !this.press.started) view.setWindow(time - view.span / 2, time + view.span / 2);
    this.press = null;
  }

  /** Draw the signals of the recording, each scaled to its own maximum. */
  draw() {
    const { fingers } = this.editor, { coarse } = this.signals;
    if (coarse === this.drawn) { this.plot?.draw(); return; }
    this.drawn = coarse;
    this.plot?.destroy();
    this.plot = new TimePlot(byId("overview-plot"), {
      lines: fingers.map((_, k) => fingerColour(k)), window: () => [this.whole.start, this.whole.end], range: () => [0, 1.05], ticks: [], padding: [0, 0],
    });
    if (!coarse || !fingers.length) return;
    this.plot.draw(window.uPlot.join(fingers.map((finger) => {
      const { t, F_a } = coarse.fingers[finger], largest = F_a.reduce((a, b) => Math.max(a, b ?? 0), 0) || 1;
      return [t, F_a.map((value) => (value === null ? null : value / largest))];
    })));
  }

  /** Show the labels of all fingers, and the items to review. */
  showLabels() {
    const { editor, whole } = this;
    byId("ribbons").replaceChildren(...editor.fingers.map((finger) => {
      const ribbon = make("div", "ribbon");
      placeAll(ribbon, whole, editor.labels(finger), ({ state }) => {
        const part = make("i");
        part.dataset.state = stateKey(state);
        return part;
      });
      return ribbon;
    }));
    placeAll(byId("review-marks"), whole, editor.reviewItems.map(({ item }) => item), () => make("i"));
  }

  showWindow() {
    place(byId("frame"), this.whole, this.view);
    this.axis.draw([[this.view.start, this.view.end]]);
  }
}
