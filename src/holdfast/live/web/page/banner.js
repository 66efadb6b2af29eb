// The banner with the state of the hand, the alert below it, and the line of health.

import { byId, make, setText } from "../web/dom.js";
import { NO_VALUE, delay, stateKey, stateWord } from "./format.js";

const SPEAK = 1500; // [ms] between two announcements: a screen reader cannot follow 20 a second

export class Hand {
  constructor() {
    this.box = byId("hand");
    this.spoken = { text: "", at: -Infinity };
  }

  start(hello) {
    const about = [hello.model, hello.source].map(String).join(" · ");
    setText(byId("about"), about);
    byId("about").title = about;
    document.title = `holdfast · ${hello.source}`;
  }

  tell(state, word = stateWord(state)) {
    const key = stateKey(state);
    setText(byId("hand-word"), word);
    if (this.box.dataset.state !== key) {
      this.box.dataset.state = key;
      byId("hand-shape").setAttribute("href", `#shape-${key}`);
    }
    const now = performance.now();
    if (word !== this.spoken.text && now - this.spoken.at > SPEAK) {
      this.spoken = { text: word, at: now };
      byId("hand-spoken").textContent = `Hand: ${word.toLowerCase()}`;
    }
  }
}

/** What must be seen at once, or nothing: the first of these texts that is not empty. */
export function alert(...texts) {
  const text = texts.find(Boolean) ?? "", box = byId("alert");
  setText(box, text);
  box.hidden = !text;
}

/** The line of health at the foot of the page. */
export class Health {
  constructor(footer) {
    const part = (key, label) => {
      const value = make("b", "", NO_VALUE);
      footer.append(make("span", key, label, " ", value));
      return value;
    };
    this.dot = make("i", "dot");
    this.link = make("b", "", "connecting");
    footer.append(make("span", "link", this.dot, this.link));
    this.rate = part("rate", "rate");
    this.latency = part("latency", "latency p50");
    this.late = part("late", "p99");
    this.worst = part("worst", "max");
    this.packets = part("packets", "packets");
    this.counts = ["lost", "refused", "dropped"].map((key) => part(key, key));
    this.footer = footer;
  }

  connection(state, text) {
    this.footer.dataset.link = state;
    setText(this.link, text);
  }

  update(health) {
    const whole = (n) => (n === null || n === undefined ? NO_VALUE : n.toLocaleString("en").replaceAll(",", "\u202f"));
    setText(this.rate, health.rate === null || health.rate === undefined ? NO_VALUE : `${health.rate.toFixed(1)} Hz`);
    const latency = health.latency ?? {};
    setText(this.latency, delay(latency.p50));
    setText(this.late, delay(latency.p99));
    setText(this.worst, delay(latency.max));
    setText(this.packets, whole(health.n_packets));
    [health.n_lost, health.n_refused, health.n_dropped].forEach((n, k) => {
      setText(this.counts[k], whole(n));
      this.counts[k].parentElement.classList.toggle("bad", n > 0);
    });
  }
}
