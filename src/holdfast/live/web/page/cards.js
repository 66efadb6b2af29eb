// One card for each finger: its state, three figures, its faults and its map.

import { make, shape, setText } from "../web/dom.js";
import { fingerColour } from "../web/theme.js";
import { Scale, TaxelMap } from "./taxelmap.js";
import { faultWord, number, percent, reasonWord, stateKey, stateWord, unitWord } from "./format.js";

// Decades that the bar of sigma spans, by unit: from noise to a violent slip.
const SIGMA = { count: [1, 1000], N: [1e-3, 1] };

/** Share of a logarithmic bar, from 0 to 1. */
export function logShare(value, [low, high]) {
  if (!(value > 0)) return 0;
  return Math.min(1, Math.max(0, Math.log(value / low) / Math.log(high / low)));
}

export class Cards {
  constructor(section, choose) {
    this.section = section;
    this.choose = choose;
    this.cards = new Map();
    this.scales = new Map();
    this.frozen = false;
    this.observer = new ResizeObserver((entries) => {
      for (const entry of entries) {
        const card = [...this.cards.values()].find((own) => own.map.canvas.parentElement === entry.target);
        card?.map.resize(entry.contentRect.width, entry.contentRect.height);
      }
    });
    new ResizeObserver(() => this.arrange()).observe(section);
  }

  start(hello) {
    this.observer.disconnect();
    this.scales.clear();
    const entries = Object.entries(hello.fingers);
    this.cards = new Map(entries.map(([name, sensor], k) => {
      if (!this.scales.has(sensor.unit)) this.scales.set(sensor.unit, { disc: new Scale(sensor.unit), arrow: new Scale(sensor.unit) });
      return [name, new Card(name, sensor, this.scales.get(sensor.unit), k, () => this.choose(name))];
    }));
    this.section.replaceChildren(...[...this.cards.values()].map((card) => card.element));
    for (const card of this.cards.values()) this.observer.observe(card.map.canvas.parentElement);
    this.arrange();
  }

  // As many columns as fit, and lines of equal length: six fingers are 3 + 3, not 5 + 1.
  arrange() {
    const n = this.cards.size || 1, fit = Math.max(1, Math.floor((this.section.clientWidth + 8) / 208));
    const lines = Math.ceil(n / fit);
    this.section.parentElement.style.setProperty("--columns", Math.ceil(n / lines));
    this.section.parentElement.style.setProperty("--lines", lines);
  }

  update(message) {
    if (!this.frozen) this.decay(message.time);
    for (const [name, card] of this.cards) {
      const finger = message.fingers[name];
      if (finger) card.update(finger, this.frozen);
    }
  }

  decay(now) {
    for (const { disc, arrow } of this.scales.values()) for (const scale of [disc, arrow]) scale.decay(now);
  }

  /** Nothing is known while nobody tells: an old STABLE must not stand there. */
  forget(reason) {
    for (const card of this.cards.values()) card.tell("UNKNOWN", reason);
  }

  /** Whether what is shown is no longer so. */
  stale(stale) { this.section.classList.toggle("stale", stale); }

  draw() {
    for (const card of this.cards.values()) card.map.draw();
  }

  select(name) {
    for (const [own, card] of this.cards) card.element.classList.toggle("chosen", own === name);
  }

  freeze(frozen) {
    this.frozen = frozen;
    this.section.classList.toggle("frozen", frozen);
  }
}

class Card {
  constructor(name, sensor, scales, place, choose) {
    this.sensor = sensor;
    const swatch = make("i", "swatch");
    swatch.style.background = fingerColour(place);
    swatch.dataset.finger = place;
    this.shape = shape("unknown");
    this.word = make("strong", "word", "UNKNOWN");
    this.reason = make("span", "reason");
    const title = make("span", "name", swatch, make("span", "", name));
    title.title = name;
    this.head = make("button", "head", this.shape, make("span", "says", make("span", "top-line", title, this.reason), this.word));
    this.head.type = "button";
    this.head.title = `Plots of ${name} (${place + 1})`;
    this.head.addEventListener("click", choose);
    const canvas = make("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `Taxel map of ${name}`);
    this.map = new TaxelMap(canvas, sensor, scales);
    this.faults = make("ul", "faults");
    this.faults.hidden = true;
    const body = make("div", "body", make("div", "map", canvas), this.figures());
    this.element = make("article", "card", this.head, body, this.faults);
    this.element.setAttribute("aria-label", name);
    this.tell("UNKNOWN", "");
  }

  figures() {
    this.probability = meter("stable", "");
    const threshold = this.sensor.probability_threshold;
    if (Number.isFinite(threshold)) {
      const mark = make("i", "threshold");
      mark.style.left = `${100 * threshold}%`;
      this.probability.bar.append(mark);
    }
    this.sigma = meter("σ", unitWord(this.sensor.unit));
    this.sigma.bar.classList.add("log");
    this.force = make("b", "", number(null));
    this.axes = ["x", "y", "z"].map((axis) => {
      const shown = make("span", "", number(null));
      return { shown, row: make("div", "axis", make("span", "", "F", make("sub", "", axis)), shown) };
    });
    const total = make("div", "total", make("span", "", "|F|"), this.force, make("small", "", unitWord(this.sensor.unit)));
    return make("div", "figures", this.probability.box, this.sigma.box, make("div", "force", total, ...this.axes.map(({ row }) => row)));
  }

  update(finger, frozen) {
    this.tell(finger.state, reasonWord(finger.reason));
    setText(this.probability.value, percent(finger.stable_probability));
    setBar(this.probability, finger.stable_probability ?? 0);
    setText(this.sigma.value, number(finger.instability));
    setBar(this.sigma, logShare(finger.instability, SIGMA[this.sensor.unit] ?? SIGMA.count));
    const force = finger.force ?? [null, null, null], known = force.every((x) => x !== null);
    setText(this.force, number(known ? Math.hypot(...force) : null));
    this.axes.forEach(({ shown }, k) => setText(shown, number(force[k])));
    this.tellFaults(finger.faults ?? [], finger.faulty_taxels ?? []);
    if (!frozen) this.map.update(finger.taxels, finger.faulty_taxels ?? []);
  }

  tell(state, reason) {
    const key = stateKey(state);
    setText(this.word, stateWord(state));
    setText(this.reason, reason);
    if (this.element.dataset.state === key) return;
    this.element.dataset.state = key;
    this.shape.firstChild.setAttribute("href", `#shape-${key}`);
  }

  tellFaults(faults, taxels) {
    const told = JSON.stringify([faults, taxels]);
    if (told === this.told) return;
    this.told = told;
    const words = faults.map(faultWord);
    if (taxels.length) {
      const few = taxels.slice(0, 4).map((k) => k + 1).join(", ");
      words.push(`${taxels.length > 1 ? "taxels" : "taxel"} ${few}${taxels.length > 4 ? " …" : ""}`);
    }
    // Three have room; the tooltip has them all.
    const shown = words.length > 3 ? [...words.slice(0, 2), `${words.length - 2} more`] : words;
    this.faults.replaceChildren(...shown.map((word) => make("li", "", word)));
    this.faults.title = words.join("; ");
    this.faults.hidden = !words.length;
  }
}

function meter(label, unit) {
  const value = make("b", "", "–"), fill = make("i", "fill"), bar = make("div", "bar", fill);
  const box = make("div", "meter", make("div", "line", make("span", "", label), value, make("small", "", unit)), bar);
  return { box, value, bar, fill };
}

function setBar({ fill }, share) {
  fill.style.transform = `scaleX(${share.toFixed(3)})`;
}
