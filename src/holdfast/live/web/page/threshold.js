// Panel with the threshold of the probability: the expected errors, and the live detector's value.

import { callService } from "../web/connection.js";
import { byId, setText, showToast } from "../web/dom.js";
import { number } from "../web/text.js";
import { share } from "./format.js";

/** Return the probability of log odds; five digits, as `holdfast tune` has them. */
const probabilityOf = (logOdds) => Number((1 / (1 + Math.exp(-logOdds))).toPrecision(5));

/** Return the log odds of a probability; at most 8, the end of the slider. */
const logOddsOf = (probability) => Math.max(-8, Math.min(8, Math.log(probability / (1 - probability))));

/** Return what the validation of the model expects at a threshold, as a sentence. */
function expectation(points, threshold) {
  const distance = (point) => Math.abs(point.threshold - threshold);
  const point = points.reduce((best, other) => (best && distance(best) <= distance(other) ? best : other), null);
  if (point === null) return "The errors to expect are not known: holdfast tune adds them to the model.";
  const missed = point.missed === null ? "" : `, ${number(point.missed).replace(/\.?0+$/, "")}\u202f% of events missed`;
  return `Expected at ${share(point.threshold)}: ${number(point.false_alarms_per_minute)} false alarms a minute${missed} (measured by holdfast tune)`;
}

/** Return thresholds as text: one value, or the range of those of the fingers. */
function thresholdWord(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  return low === high ? share(low) : `${share(low)} to ${share(high)}`;
}

export class ThresholdPanel {
  constructor() {
    this.slider = byId("threshold");
    this.moving = false; // the user moves the slider, or the service has not answered yet
    byId("threshold-toggle").addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => { this.moving = true; this.showValue([this.chosen]); });
    this.slider.addEventListener("change", () => this.send("POST", { value: this.chosen }));
    // Remove the focus after a drag, so that keys are shortcuts again.
    this.slider.addEventListener("pointerup", () => this.slider.blur());
    byId("threshold-own").addEventListener("click", () => this.send("DELETE"));
  }

  /** Probability at which the slider is; its scale is that of log odds. */
  get chosen() { return probabilityOf(Number(this.slider.value)); }

  start(hello) {
    this.own = Object.values(hello.fingers).map((finger) => finger.probability_threshold); // of the model
    this.points = hello.operating_points ?? [];
    setText(byId("threshold-own"), `Model: ${thresholdWord(this.own)}`);
    this.update();
  }

  /** Show the thresholds of the fingers of the live detector. */
  update(thresholds = {}) {
    if (this.moving) return;
    const own = Object.values(thresholds), values = own.length ? own : this.own;
    const middle = values.reduce((sum, value) => sum + value, 0) / values.length;
    if (middle !== this.middle) this.slider.value = String(logOddsOf(middle));
    this.middle = middle;
    this.showValue(values);
    byId("threshold-own").disabled = values.every((value, k) => value === this.own[k]);
  }

  showValue(values) {
    const word = thresholdWord(values), differ = new Set(values).size > 1;
    for (const id of ["threshold-value", "threshold-now"]) setText(byId(id), word);
    this.slider.setAttribute("aria-valuetext", word);
    setText(byId("threshold-expected"), differ ? "The fingers have different thresholds." : expectation(this.points, values[0]));
  }

  async send(method, body) {
    this.moving = true;
    await callService(method, "threshold", body).catch((error) => showToast(error.message, "bad"));
    this.moving = false;
    this.middle = null; // show the service's value, whatever it is
  }

  toggle() {
    const panel = byId("threshold-panel");
    panel.hidden = !panel.hidden;
    byId("threshold-toggle").setAttribute("aria-pressed", String(!panel.hidden));
  }
}
