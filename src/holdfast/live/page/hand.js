// The banner with the state of the hand, the alert below it, and the line of health.

import { byId, make, write } from "../web/dom.js";
import { NOTHING, delay, stateKey, stateWord } from "./words.js";

const SPEAK = 1500; // [ms] between two announcements: a screen reader cannot follow 20 a second

export class Hand {
  constructor() {
    this.box = byId("hand");
    this.spoken = { text: "", at: -Infinity };
  }

  start(hello) {
    const about = [hello.model, hello.source].map(String).join(" · ");
    write(byId("about"), about);
    byId("about").title = about;
    document.title = `holdfast · ${hello.source}`;
  }

  tell(state, word = stateWord(state)) {
    const key = stateKey(state);
    write(byId("hand-word"), word);
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
  write(box, text);
  box.hidden = !text;
}

/** The line of health at the foot of the page. */
export class Health {
  constructor(footer) {
    const part = (key, label) => {
      const value = make("b", "", NOTHING);
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
    write(this.link, text);
  }

  update(health) {
    const whole = (n) => (n === null || n === undefined ? NOTHING : n.toLocaleString("en").replaceAll(",", "\u202f"));
    write(this.rate, health.rate === null || health.rate === undefined ? NOTHING : `${health.rate.toFixed(1)} Hz`);
    const latency = health.latency ?? {};
    write(this.latency, delay(latency.p50));
    write(this.late, delay(latency.p99));
    write(this.worst, delay(latency.max));
    write(this.packets, whole(health.n_packets));
    [health.n_lost, health.n_refused, health.n_dropped].forEach((n, k) => {
      write(this.counts[k], whole(n));
      this.counts[k].parentElement.classList.toggle("bad", n > 0);
    });
  }
}
