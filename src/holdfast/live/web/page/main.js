// Connects the parts of the page: messages arrive at the service's pace, drawing follows the
// browser's.

import { Connection } from "../web/connection.js";
import { byId, fillChoice, make, setPressed, setText, showAlert, swatch } from "../web/dom.js";
import { listenToKeys } from "../web/help.js";
import { fingerColour, onTheme } from "../web/theme.js";
import { HandBanner, HealthLine } from "./banner.js";
import { Cards } from "./cards.js";
import { Controls } from "./controls.js";
import { STATES, hasSlipRule } from "./format.js";
import { EventLog, NoticeLog } from "./logs.js";
import { Plots } from "./plots.js";
import { SampleStore, capacityFor } from "./store.js";

const WINDOWS = [5, 10, 30, 60]; // [s]
const MAX_DRAW_TIME = 1000; // [ms]; a longer time means that the tab was hidden

class Page {
  constructor() {
    this.banner = new HandBanner();
    this.health = new HealthLine(byId("health"));
    this.events = new EventLog(byId("events"));
    this.notices = new NoticeLog(byId("notices"));
    this.plots = new Plots(byId("stack"));
    this.cards = new Cards(byId("cards"), (name) => this.chooseFinger(this.plots.chosen === name ? null : name));
    this.controls = new Controls((text) => this.addMarker(text));
    this.advised = new Set(); // advice that the list of notices has
    this.status = { link: "connecting", reason: "", ended: false, silent: false, problem: "" };
    this.store = null;
    this.frozen = null; // a copy of the store while the plots are paused
    this.dirty = false;
    this.drawnAt = this.nextDrawing = null; // [ms]
    fillChoice(byId("windows"), WINDOWS.map((value) => ({ value, title: `Show ${value} seconds`, content: [`${value} s`] })),
      this.plots.window, (value) => this.setWindow(value));
    byId("pause").addEventListener("click", () => this.togglePause());
    listenToKeys({ "Keyboard shortcuts": this.keys() });
    onTheme(() => { this.redrawPlots(); this.cards.draw(); });
    this.connection = new Connection("api/v1/live", "holdfast.live/1", {
      hello: (message) => this.start(message),
      live: (message) => this.update(message),
      state: (link, reason) => this.setLink(link, reason),
    });
    requestAnimationFrame((now) => this.draw(now));
  }

  keys() {
    const fingers = Array.from({ length: 9 }, (_, k) => [k + 1, () => this.chooseFinger(this.plots.names?.[k] ?? this.plots.chosen)]);
    const pause = () => this.togglePause(), { controls } = this;
    return [
      ["Space K", "pause plots and maps", { " ": pause, k: pause }],
      ["1 – 9", "show the plots of this finger", Object.fromEntries(fingers)],
      ["0", "show the plots of all fingers", { 0: () => this.chooseFinger(null) }],
      ["T", "take a new tare", { t: () => controls.tare() }],
      ["R", "start or stop a recording", { r: () => controls.record() }],
      ["M", "add a marker with the text of the field", { m: () => controls.mark() }],
      ["L", "light up the page for a camera, and mark when", { l: () => controls.flash() }],
    ];
  }

  start(hello) {
    if (this.frozen) this.togglePause();
    const names = Object.keys(hello.fingers);
    this.store = new SampleStore(names, capacityFor(hello.rate));
    this.restarts = hello.source.startsWith("twin:"); // it pauses between two grasps
    this.maxGap = hello.rate ? Math.max(0.1, 4 / hello.rate) : 0.5;
    this.events.clear();
    for (const part of [this.banner, this.cards, this.controls]) part.start(hello);
    this.plots.start(hello, this.store);
    document.body.classList.toggle("has-slips", Object.values(hello.fingers).some(hasSlipRule));
    this.fillFingers();
    for (const text of (hello.advice ?? []).filter((advice) => !this.advised.has(advice))) {
      this.advised.add(text);
      this.notices.add({ time: Date.now() / 1000, text });
    }
  }

  update(message) {
    if (!this.store) return;
    const problem = (message.problems ?? []).map(({ text }) => text).join(" · ");
    Object.assign(this.status, { ended: Boolean(message.ended), silent: Boolean(message.health?.silent), problem });
    this.plots.thresholds = message.thresholds ?? {};
    this.now = message.time;
    this.store.append(message.series, Math.max(0, STATES.indexOf(message.hand)), this.maxGap);
    // An old STABLE must not look like a current one.
    const { ended, silent } = this.status, word = ended ? "SOURCE ENDED" : this.restarts ? "NEXT GRASP" : "NO SAMPLES";
    this.banner.showState(ended || silent ? "UNKNOWN" : message.hand, ended || silent ? word : undefined);
    this.cards.setOutdated(ended || silent);
    this.cards.update(message);
    for (const event of message.events ?? []) this.events.add(event);
    for (const slip of message.slips ?? []) this.events.addSlip(slip);
    for (const notice of message.notices ?? []) this.notices.add(notice);
    if (message.health) this.health.update(message.health);
    this.controls.update(message.recording);
    this.showLink();
    this.dirty = true;
  }

  setLink(link, reason) {
    // The reason of a refusal stays visible during further attempts.
    if (link === "lost" && this.status.link === "refused") return;
    Object.assign(this.status, { link, reason });
    byId("actions").disabled = link !== "open";
    this.showLink();
    if (link === "open") return;
    this.banner.showState("UNKNOWN", "NO CONNECTION");
    this.cards.clearStates("no connection");
    this.cards.setOutdated(true);
  }

  showLink() {
    const { link, reason, ended, silent, problem } = this.status, open = link === "open";
    showAlert([
      link === "refused" && `Not connected: ${reason}`,
      link === "lost" && "Connection lost, trying again …",
      open && ended && "Source ended: these are its last values",
      open && silent && !this.restarts && "No samples from the source",
      open && problem,
    ].find(Boolean) || "");
    const words = { connecting: "connecting", open: ended ? "source ended" : "connected", lost: "connection lost", refused: "not connected" };
    this.health.showConnection(open && (ended || silent) ? "quiet" : link, words[link]);
  }

  // Drawing takes at most half of the browser's time: scripts, layout and painting up to the next frame.
  draw(now) {
    requestAnimationFrame((next) => this.draw(next));
    if (this.drawnAt !== null) this.nextDrawing = now + Math.min(MAX_DRAW_TIME, now - this.drawnAt);
    this.drawnAt = null;
    // Half a frame too early is better than a whole frame too late.
    if (!this.store || !this.dirty || now < this.nextDrawing - 8) return;
    this.dirty = false;
    this.drawnAt = now;
    if (this.frozen) return;
    this.cards.draw();
    this.redrawPlots();
  }

  togglePause() {
    if (!this.store?.end) return;
    this.frozen = this.frozen ? null : this.store.copy();
    const button = byId("pause"), paused = this.frozen !== null;
    button.setAttribute("aria-pressed", String(paused));
    setText(button, paused ? "Resume" : "Pause");
    byId("paused").hidden = !paused;
    this.cards.setFrozen(paused);
    this.dirty = true;
  }

  setWindow(seconds) {
    if (!this.store) return;
    setPressed(byId("windows"), seconds);
    this.plots.show(this.plots.chosen, seconds);
    this.redrawPlots();
  }

  chooseFinger(name) {
    if (!this.store || name === this.plots.chosen) return;
    setPressed(byId("fingers"), name ?? "");
    this.cards.choose(name);
    this.plots.show(name, this.plots.window);
    this.redrawPlots();
  }

  redrawPlots() {
    const store = this.frozen ?? this.store;
    if (store?.end) this.plots.draw(store);
  }

  fillFingers() {
    const fingers = this.plots.names.map((name, k) => ({
      value: name, title: `Plots of ${name} (${k + 1})`, content: [swatch(fingerColour(k)), make("span", "", name)],
    }));
    fillChoice(byId("fingers"), [{ value: "", title: "Plots of all fingers (0)", content: ["all"] }, ...fingers],
      this.plots.chosen ?? "", (name) => this.chooseFinger(name || null));
    this.cards.choose(this.plots.chosen);
  }

  addMarker(text) {
    if (!Number.isFinite(this.now)) return;
    this.plots.addMarker(this.now);
    this.events.addEvent("marker", text);
  }
}

// For the browser's console, and for tests.
window.holdfast = new Page();
