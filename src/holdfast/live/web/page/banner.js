// Banner with the state of the hand, and status line at the foot of the page.

import { byId, make, setShape, setText } from "../web/dom.js";
import { NO_VALUE, stateKey } from "../web/text.js";
import { delay, isLate, latency, stateWord } from "./format.js";

const ANNOUNCE_INTERVAL = 1500; // [ms]; a screen reader cannot follow 20 announcements a second

export class HandBanner {
  constructor() {
    this.box = byId("hand");
    this.announced = { text: "", at: -Infinity };
  }

  start(hello) {
    const about = [hello.model, hello.source].map(String).join(" · ");
    setText(byId("about"), about);
    byId("about").title = about;
    document.title = `holdfast · ${hello.source}`;
  }

  showState(state, word = stateWord(state)) {
    const key = stateKey(state);
    setText(byId("hand-word"), word);
    if (this.box.dataset.state !== key) {
      this.box.dataset.state = key;
      setShape(this.box.querySelector(".shape"), key);
    }
    const now = performance.now();
    if (word !== this.announced.text && now - this.announced.at > ANNOUNCE_INTERVAL) {
      this.announced = { text: word, at: now };
      byId("hand-spoken").textContent = `Hand: ${word.toLowerCase()}`;
    }
  }
}

/** Status line at the foot of the page. */
export class HealthLine {
  constructor(footer) {
    const part = (key, label) => {
      const value = make("b", "", NO_VALUE);
      footer.append(make("span", key, label, " ", value));
      return value;
    };
    this.link = make("b", "", "connecting");
    footer.append(make("span", "link", make("i", "dot"), this.link));
    this.rate = part("rate", "rate");
    this.latencies = { p50: part("latency", "latency p50"), p99: part("late", "p99"), max: part("worst", "max") };
    this.delay = part("delay", "late by");
    this.delay.parentElement.hidden = true;
    this.packets = part("packets", "packets");
    this.counts = ["lost", "refused", "dropped"].map((key) => part(key, key));
    this.footer = footer;
  }

  showConnection(state, text) {
    this.footer.dataset.link = state;
    setText(this.link, text);
  }

  update(health) {
    const whole = (n) => (n === null || n === undefined ? NO_VALUE : n.toLocaleString("en").replaceAll(",", "\u202f"));
    setText(this.rate, health.rate === null || health.rate === undefined ? NO_VALUE : `${health.rate.toFixed(1)} Hz`);
    for (const [key, element] of Object.entries(this.latencies)) setText(element, latency(health.latency?.[key]));
    setText(this.delay, delay(health.delay));
    // Shown while it matters alone: the foot has one line on a tablet.
    this.delay.parentElement.hidden = !isLate(health.delay);
    this.delay.parentElement.classList.toggle("bad", isLate(health.delay));
    setText(this.packets, whole(health.n_packets));
    [health.n_lost, health.n_refused, health.n_dropped].forEach((n, k) => {
      setText(this.counts[k], whole(n));
      this.counts[k].parentElement.classList.toggle("bad", n > 0);
    });
  }
}
