// Banner with the state of the hand, and status line at the foot of the page.

import { byId, make, setShape, setText } from "../web/dom.js";
import { NO_VALUE, stateKey } from "../web/text.js";
import { isLate, latency, stateWord } from "./format.js";

const ANNOUNCE_INTERVAL = 1500; // [ms]; a screen reader cannot follow 20 announcements a second
const PARTS = {
  rate: "rate", p50: "latency p50", p99: "p99", max: "max", delay: "late by",
  n_packets: "packets", n_lost: "lost", n_refused: "refused", n_dropped: "dropped",
};

export class HandBanner {
  constructor() { this.announced = { word: "", at: -Infinity }; }

  start(hello) {
    const about = `${hello.model} · ${hello.source}`;
    setText(byId("about"), about);
    byId("about").title = about;
    document.title = `holdfast · ${hello.source}`;
  }

  showState(state, word = stateWord(state)) {
    const key = stateKey(state), box = byId("hand"), now = performance.now();
    setText(byId("hand-word"), word);
    if (box.dataset.state !== key) setShape(box.querySelector(".shape"), key);
    box.dataset.state = key;
    if (word === this.announced.word || now - this.announced.at <= ANNOUNCE_INTERVAL) return;
    this.announced = { word, at: now };
    setText(byId("hand-spoken"), `Hand: ${word.toLowerCase()}`);
  }
}

const whole = (n) => (n ?? null) === null ? NO_VALUE : n.toLocaleString("en").replaceAll(",", "\u202f");

/** Status line at the foot of the page. */
export class HealthLine {
  constructor(footer) {
    this.footer = footer;
    this.link = make("b", "", "connecting");
    this.values = Object.fromEntries(Object.keys(PARTS).map((key) => [key, make("b", "", NO_VALUE)]));
    footer.append(make("span", "link", make("i", "dot"), this.link),
      ...Object.entries(PARTS).map(([key, label]) => make("span", key, label, " ", this.values[key])));
    this.values.delay.parentElement.hidden = true;
  }

  showConnection(state, text) {
    this.footer.dataset.link = state;
    setText(this.link, text);
  }

  update(health) {
    const show = (key, text, isBad) => {
      setText(this.values[key], text);
      this.values[key].parentElement.classList.toggle("bad", isBad);
    };
    show("rate", (health.rate ?? null) === null ? NO_VALUE : `${health.rate.toFixed(1)} Hz`, false);
    for (const key of ["p50", "p99", "max"]) show(key, latency(health.latency?.[key]), false);
    show("delay", latency(health.delay), true);
    // Shown while it matters alone: the foot has one line on a tablet.
    this.values.delay.parentElement.hidden = !isLate(health.delay);
    for (const key of ["n_packets", "n_lost", "n_refused", "n_dropped"]) show(key, whole(health[key]), key !== "n_packets" && health[key] > 0);
  }
}
