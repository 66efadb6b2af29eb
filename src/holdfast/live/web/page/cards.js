// Cards of the fingers: state, values, faults and taxel map of each.

import { make, makeButton, setShape, setText, shape } from "../web/dom.js";
import { number, percent, stateKey, unitWord } from "../web/text.js";
import { Scale, TaxelMap } from "./taxel_map.js";
import { debounceNote, distance, faultWord, hasSlipRule, reasonWord, shownProbability, slipSpeed, stateWord } from "./format.js";

export class Cards {
  /** @param onChoose is called with the name of a finger whose card is clicked. */
  constructor(section, onChoose) {
    this.section = section;
    this.onChoose = onChoose;
    this.cards = new Map();
    this.scales = new Map();
    this.frozen = false;
    new ResizeObserver(() => this.arrange()).observe(section);
  }

  start(hello) {
    for (const card of this.cards.values()) card.map.observer.disconnect();
    this.scales.clear();
    const entries = Object.entries(hello.fingers);
    this.cards = new Map(entries.map(([name, sensor], k) => {
      if (!this.scales.has(sensor.unit)) this.scales.set(sensor.unit, { disc: new Scale(sensor.unit), arrow: new Scale(sensor.unit) });
      return [name, new Card(name, sensor, this.scales.get(sensor.unit), k, hello, () => this.onChoose(name))];
    }));
    this.section.replaceChildren(...[...this.cards.values()].map((card) => card.element));
    this.arrange();
  }

  // Use as many columns as fit, in rows of equal length: 3 + 3 for six fingers, not 5 + 1.
  arrange() {
    const n = this.cards.size || 1, fit = Math.max(1, Math.floor((this.section.clientWidth + 8) / 208));
    const rows = Math.ceil(n / fit);
    this.section.parentElement.style.setProperty("--columns", Math.ceil(n / rows));
    this.section.parentElement.style.setProperty("--rows", rows);
  }

  update(message) {
    if (!this.frozen) this.decayScales(message.time);
    for (const [name, card] of this.cards) {
      const finger = message.fingers[name];
      card.setThreshold(message.thresholds?.[name]);
      if (finger) card.update(finger, this.frozen);
    }
  }

  decayScales(now) {
    for (const { disc, arrow } of this.scales.values()) for (const scale of [disc, arrow]) scale.decay(now);
  }

  /** Show all fingers as UNKNOWN: an old STABLE must not look like a current one. */
  clearStates(reason) {
    for (const card of this.cards.values()) {
      card.showState("UNKNOWN", reason);
      card.showSlip(null);
    }
  }

  /** Dim the values if they are not current. */
  setOutdated(outdated) { this.section.classList.toggle("outdated", outdated); }

  draw() {
    for (const card of this.cards.values()) card.map.draw();
  }

  choose(name) {
    for (const [own, card] of this.cards) card.element.classList.toggle("chosen", own === name);
  }

  setFrozen(frozen) {
    this.frozen = frozen;
    this.section.classList.toggle("frozen", frozen);
  }
}

class Card {
  constructor(name, sensor, scales, index, hello, onChoose) {
    this.sensor = sensor;
    this.hello = hello;
    this.shape = shape("unknown");
    this.word = make("strong", "word", "UNKNOWN");
    this.reason = make("span", "reason");
    this.slid = make("span", "slid");
    this.speed = make("span", "speed");
    this.slip = make("span", "slips", shape("slip"), make("span", "slips-word", "slips"), this.slid, this.speed);
    const title = make("span", "name", name);
    title.title = name;
    this.head = makeButton("head", onChoose, this.shape, make("span", "head-text", make("span", "top-line", title, this.reason, this.slip), this.word));
    this.head.title = `Plots of ${name} (${index + 1})`;
    const canvas = make("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `Taxel map of ${name}`);
    this.map = new TaxelMap(canvas, sensor, scales);
    this.faults = make("ul", "faults");
    this.faults.hidden = true;
    const body = make("div", "body", make("div", "map", canvas), this.makeValues());
    this.map.observer.observe(canvas.parentElement);
    this.element = make("article", "card", this.head, body, this.faults);
    this.element.setAttribute("aria-label", name);
    this.showState("UNKNOWN", "");
    this.showSlip(null);
  }

  makeValues() {
    const { unit } = this.sensor, line = (className, unit, ...label) => {
      const value = make("b", "", number(null));
      return [make("div", `value-line ${className}`, ...label, value, make("small", "", unit)), value];
    };
    const [probability, sigma, force, ...axes] = [
      line("", "", "stable"), line("", unitWord(unit), "σ"), line("", unitWord(unit), "|F|"),
      ...["x", "y", "z"].map((axis) => line("axis", "", make("span", "", "F", make("sub", "", axis)))),
    ];
    Object.assign(this, { probability: probability[1], sigma: sigma[1], force: force[1], axes: axes.map(([, value]) => value) });
    this.fill = make("i", "fill");
    this.mark = make("i", "threshold");
    this.setThreshold(this.sensor.probability_threshold);
    const rows = [probability, sigma, force, ...axes].map(([row]) => row);
    rows.splice(1, 0, make("div", "meter", this.fill, this.mark));
    return make("div", "values", ...rows);
  }

  /** Move the mark of the threshold from which the finger is stable. */
  setThreshold(threshold) {
    if (!Number.isFinite(threshold) || threshold === this.threshold) return;
    this.threshold = threshold;
    this.mark.style.left = `${100 * threshold}%`;
  }

  update(finger, frozen) {
    this.showState(finger.state, debounceNote(finger, this.threshold, this.hello.debounce) || reasonWord(finger.reason));
    this.showSlip(hasSlipRule(this.sensor) && finger.cause === "slip" ? finger : null);
    const probability = shownProbability(finger.state, finger.stable_probability);
    setText(this.probability, percent(probability));
    this.fill.style.transform = `scaleX(${(probability ?? 0).toFixed(3)})`;
    setText(this.sigma, number(finger.instability));
    const force = finger.force ?? [null, null, null];
    setText(this.force, number(force.includes(null) ? null : Math.hypot(...force)));
    this.axes.forEach((value, k) => setText(value, number(force[k])));
    this.showFaults(finger.faults ?? [], finger.faulty_taxels ?? []);
    if (!frozen) this.map.update(finger.taxels, finger.faulty_taxels ?? []);
  }

  showState(state, reason) {
    const key = stateKey(state);
    setText(this.word, stateWord(state));
    setText(this.reason, reason);
    if (this.element.dataset.state === key) return;
    this.element.dataset.state = key;
    setShape(this.shape, key);
  }

  // Say that the finger slides, whatever its state, and how far and how fast, if the model has a
  // rule for it. A model without a slip rule never says it: the finger is null.
  showSlip(finger) {
    this.slip.hidden = !finger;
    this.element.classList.toggle("sliding", Boolean(finger));
    const measured = Number.isFinite(finger?.slip_distance);
    this.slip.classList.toggle("measured", measured);
    setText(this.slid, measured ? distance(finger.slip_distance) : "");
    setText(this.speed, measured ? slipSpeed(finger.slip_speed) : "");
  }

  showFaults(faults, taxels) {
    const key = JSON.stringify([faults, taxels]);
    if (key === this.faultsKey) return;
    this.faultsKey = key;
    const texts = this.hello.faults ?? {}, words = faults.map((fault) => faultWord(fault, texts));
    if (taxels.length) words.push(`taxel${taxels.length > 1 ? "s" : ""} ${taxels.slice(0, 4).join(", ")}${taxels.length > 4 ? " …" : ""}`);
    // There is room for three; the tooltip has all.
    const shown = words.length > 3 ? [...words.slice(0, 2), `${words.length - 2} more`] : words;
    this.faults.replaceChildren(...shown.map((word) => make("li", "", word)));
    this.faults.title = [words.join("; "), ...faults.map((fault) => texts[fault]?.advice ?? "")].filter(Boolean).join("\n");
    this.faults.hidden = !words.length;
  }
}
