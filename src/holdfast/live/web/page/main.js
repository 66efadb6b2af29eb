// Puts the parts together: messages in, pictures out, at the browser's own pace.

import { byId, fillChoice, make, setPressed, setText } from "../web/dom.js";
import { fingerColour, onTheme } from "../web/theme.js";
import { Cards } from "./cards.js";
import { Controls } from "./controls.js";
import { Feed } from "./connection.js";
import { Hand, Health, alert } from "./banner.js";
import { listen } from "./keys.js";
import { Events, Notices } from "./logs.js";
import { Pace } from "./frame_rate.js";
import { Plots } from "./plots.js";
import { Store, capacityFor } from "./store.js";
import { STATES, span } from "./format.js";

const WINDOWS = [5, 10, 30, 60]; // [s]

class Page {
  constructor() {
    this.hand = new Hand();
    this.health = new Health(byId("health"));
    this.events = new Events(byId("events"));
    this.notices = new Notices(byId("notices"));
    this.plots = new Plots(byId("stack"));
    this.cards = new Cards(byId("cards"), (name) => this.choose(this.plots.chosen === name ? null : name));
    this.controls = new Controls((text) => this.mark(text));
    this.state = { link: "connecting", why: "", ended: false, silent: false };
    this.store = null;
    this.frozen = null; // what is looked at while paused
    this.dirty = false;
    this.pace = new Pace();
    this.told = -Infinity; // when ages were last written
    fillChoice(byId("windows"), WINDOWS.map((value) => ({ value, label: `${value} s`, title: `Show ${value} seconds` })),
      this.plots.window, (value) => this.look(value));
    byId("pause").addEventListener("click", () => this.pause());
    listen({
      " ": () => this.pause(), t: () => this.controls.tare(), r: () => this.controls.record(),
      m: () => this.controls.mark(), f: () => this.controls.full(), "?": () => byId("help").click(),
      digit: (n) => this.choose(n ? this.plots.names?.[n - 1] ?? this.plots.chosen : null),
    });
    onTheme(() => this.recolour());
    this.feed = new Feed({
      hello: (message) => this.hello(message),
      live: (message) => this.live(message),
      link: (link, why) => this.link(link, why),
    });
    requestAnimationFrame(() => this.draw());
  }

  hello(message) {
    this.info = message;
    if (this.frozen) this.pause();
    const names = Object.keys(message.fingers);
    this.store = new Store(names, capacityFor(message.rate));
    this.gap = message.rate ? Math.max(0.1, 4 / message.rate) : 0.5;
    this.events.clear();
    for (const part of [this.hand, this.cards, this.controls]) part.start(message);
    this.plots.start(message, this.store);
    this.choices();
    this.tellStream(message);
  }

  live(message) {
    if (!this.store) return;
    this.state.ended = Boolean(message.ended);
    this.state.silent = Boolean(message.health?.silent);
    this.now = message.time;
    this.store.append(message.series, Math.max(0, STATES.indexOf(message.hand)), this.gap);
    const { ended, silent } = this.state;
    // An old STABLE must not be read as one of now.
    if (ended || silent) this.hand.tell("UNKNOWN", ended ? "SOURCE ENDED" : "NO SAMPLES");
    else this.hand.tell(message.hand);
    this.cards.stale(ended || silent);
    this.cards.update(message);
    for (const event of message.events ?? []) this.events.add(event);
    for (const notice of message.notices ?? []) this.notices.add(notice);
    if (message.health) this.health.update(message.health);
    this.controls.update(message.recording);
    this.tellLink();
    this.dirty = true;
  }

  link(link, why) {
    // Why it was refused stays while the attempts go on.
    if (link === "lost" && this.state.link === "refused") return;
    Object.assign(this.state, { link, why });
    this.controls.connection(link === "open");
    this.tellLink();
    if (link === "open") return;
    this.hand.tell("UNKNOWN", "NO CONNECTION");
    this.cards.forget("no connection");
    this.cards.stale(true);
  }

  tellLink() {
    const { link, why, ended, silent } = this.state, open = link === "open";
    alert(
      link === "refused" && `Not connected: ${why}`,
      link === "lost" && "Connection lost, trying again …",
      open && ended && "Source ended: what is shown is the last of it",
      open && silent && "No samples from the source",
    );
    const words = { connecting: "connecting", open: ended ? "source ended" : "connected", lost: "connection lost", refused: "not connected" };
    this.health.connection(open && (ended || silent) ? "quiet" : link, words[link]);
  }

  draw() {
    requestAnimationFrame(() => this.draw());
    if (!this.pace.may() || !this.store || !this.dirty) return;
    this.dirty = false;
    this.pace.drawn();
    if (!this.frozen) {
      this.cards.draw();
      if (this.store.end) this.plots.draw(this.store);
    } else if (Number.isFinite(this.now)) {
      setText(byId("paused"), `PAUSED · ${span(this.now - this.frozen.latest)} ago`);
    }
    if (performance.now() - this.told < 250) return;
    this.told = performance.now();
    this.events.age(this.now);
  }

  pause() {
    if (!this.store?.end) return;
    this.frozen = this.frozen ? null : this.store.frozen();
    const button = byId("pause"), paused = this.frozen !== null;
    button.setAttribute("aria-pressed", String(paused));
    setText(button, paused ? "Resume" : "Pause");
    byId("paused").hidden = !paused;
    document.body.classList.toggle("is-paused", paused);
    this.cards.freeze(paused);
    this.dirty = true;
  }

  look(seconds) {
    this.plots.window = seconds;
    if (this.store) this.plots.build();
    setPressed(byId("windows"), seconds);
    this.redraw();
  }

  choose(name) {
    if (!this.store || name === this.plots.chosen) return;
    this.plots.chosen = name;
    setPressed(byId("fingers"), name ?? "");
    this.cards.select(name);
    this.plots.build();
    this.redraw();
  }

  redraw() {
    const store = this.frozen ?? this.store;
    if (store?.end) this.plots.draw(store);
  }

  choices() {
    const swatch = (k) => {
      const mark = make("i", "swatch");
      mark.style.background = fingerColour(k);
      return mark;
    };
    const fingers = this.plots.names.map((name, k) => ({ value: name, label: name, title: `Plots of ${name} (${k + 1})`, mark: swatch(k) }));
    fillChoice(byId("fingers"), [{ value: "", label: "all", title: "Plots of all fingers (0)" }, ...fingers],
      this.plots.chosen ?? "", (name) => this.choose(name || null));
    this.cards.select(this.plots.chosen);
  }

  mark(text) {
    if (!Number.isFinite(this.now)) return;
    this.plots.mark(this.now);
    this.events.addMarker(this.now, text);
  }

  tellStream(hello) {
    const modules = Object.entries(hello.modules ?? {}).map(([name, n]) => `${name} (${n})`).join(", ");
    const sensors = [...new Set(Object.values(hello.fingers).map(({ sensor }) => sensor))].join(", ");
    const rows = {
      model: hello.model, source: hello.source, sensors, rate: hello.rate ? `${hello.rate} Hz` : "not known",
      "modules (taxels)": modules, since: new Date(1000 * hello.started).toLocaleString("en-GB"),
    };
    byId("stream").replaceChildren(...Object.entries(rows).flatMap(([name, value]) => [make("dt", "", name), make("dd", "", String(value))]));
  }

  recolour() {
    if (!this.store) return;
    document.querySelectorAll(".card .swatch").forEach((mark) => { mark.style.background = fingerColour(Number(mark.dataset.finger)); });
    this.choices();
    this.plots.build();
    this.redraw();
    this.cards.draw();
  }
}

// For those who look at it in the browser's console, and for tests.
window.holdfast = new Page();
