// Time that runs: the video's, where there is one, else the page's own.

import { addressWithToken } from "../web/api.js";
import { byId, make, setText } from "../web/dom.js";
import { keep, kept } from "./saver.js";

const SMALL = 0.02; // [s], less the video need not be moved

export class Player {
  /** @param moved is called with the time that is played [s]. */
  constructor(moved) {
    this.moved = moved;
    this.video = byId("video");
    this.playing = false;
    this.time = 0;
    for (const name of ["error", "stalled"]) this.video.addEventListener(name, () => this.broken());
    this.video.addEventListener("loadedmetadata", () => this.seek(this.time));
    this.video.addEventListener("pause", () => { if (this.usable && !this.video.ended) this.stop(); });
    byId("play").addEventListener("click", () => this.toggle());
    byId("rate").addEventListener("change", () => { this.video.playbackRate = this.rate; });
    byId("medium").addEventListener("change", (event) => this.load(this.media[Number(event.target.value)]));
    byId("offset").addEventListener("change", (event) => this.shift(event.target.valueAsNumber));
  }

  get rate() { return Number(byId("rate").value); }
  get usable() { return Boolean(this.medium) && this.video.readyState >= 1 && !this.video.error; }

  open(recording) {
    this.stop();
    Object.assign(this, { id: recording.id, name: recording.name, start: recording.start, end: recording.end, time: recording.start });
    this.media = recording.media ?? [];
    byId("film").hidden = !this.media.length;
    byId("medium").replaceChildren(...this.media.map(({ name }, k) => Object.assign(make("option", "", name), { value: String(k) })));
    byId("medium").hidden = this.media.length < 2;
    this.load(this.media[0] ?? null);
  }

  load(medium) {
    this.stop();
    this.medium = medium;
    byId("film-problem").hidden = true;
    byId("film-offset").hidden = !medium;
    if (!medium) { this.drop(); return; }
    this.video.title = medium.name;
    this.offset = kept(this.offsetKey) ?? medium.offset;
    byId("offset").value = String(this.offset);
    if (medium.missing) {
      this.drop();
      this.tell(`${medium.name} is not there beside the recording`);
      return;
    }
    this.video.hidden = false;
    this.video.src = addressWithToken(`media/${this.id}/${medium.index}`).href;
    this.video.playbackRate = this.rate;
  }

  // Without a source, and without an error because of it.
  drop() {
    this.video.hidden = true;
    this.video.removeAttribute("src");
    this.video.load();
  }

  get offsetKey() { return `holdfast.label ${this.name} offset ${this.medium.name}`; }

  shift(offset) {
    if (!Number.isFinite(offset) || !this.medium) return;
    this.offset = offset;
    keep(this.offsetKey, offset);
    this.seek(this.time);
  }

  broken() {
    if (!this.medium || !this.video.error) return;
    this.video.hidden = true;
    this.tell(`${this.medium.name} cannot be played: this browser does not decode it`);
  }

  tell(text) {
    byId("film-offset").hidden = true;
    setText(byId("film-problem"), text);
    byId("film-problem").hidden = false;
  }

  /** Goes to a time of the recording. */
  seek(time) {
    this.time = Math.max(this.start ?? 0, Math.min(this.end ?? 0, time));
    if (this.usable) {
      const to = Math.max(0, this.time - this.offset);
      if (Math.abs(this.video.currentTime - to) > SMALL) this.video.currentTime = to;
    }
    this.moved(this.time);
  }

  toggle() {
    if (this.playing) { this.stop(); return; }
    if (this.start === undefined) return;
    if (this.time >= this.end - SMALL) this.seek(this.start);
    this.playing = true;
    this.last = performance.now();
    this.show();
    this.begin();
    requestAnimationFrame((now) => this.step(now));
  }

  // The video plays where it has pictures for this time; before and after them time runs alone.
  begin() {
    const at = this.time - (this.offset ?? 0);
    if (!this.usable || !this.video.paused || at < 0 || at >= this.video.duration) return;
    this.video.currentTime = at;
    this.video.play().catch(() => this.stop());
  }

  step(now) {
    if (!this.playing) return;
    const filmed = this.usable && !this.video.paused && !this.video.ended;
    this.time = filmed ? this.video.currentTime + this.offset : this.time + ((now - this.last) / 1000) * this.rate;
    this.last = now;
    if (!filmed) this.begin();
    if (this.time >= this.end) { this.time = this.end; this.stop(); }
    this.moved(this.time);
    requestAnimationFrame((next) => this.step(next));
  }

  stop() {
    this.playing = false;
    if (!this.video.paused) this.video.pause();
    this.show();
  }

  show() {
    byId("play").setAttribute("aria-pressed", String(this.playing));
    byId("play").title = byId("play").ariaLabel = this.playing ? "Stop (space bar)" : "Play (space bar)";
  }
}
