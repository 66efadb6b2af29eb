// Playback: the time of the video, or of the page's own clock where there is no video.

import { addressWithToken } from "../web/connection.js";
import { byId, make, setText } from "../web/dom.js";
import { readStored, writeStored } from "./saver.js";

const TOLERANCE = 0.02; // [s], the video is not moved for a smaller difference

export class Player {
  /** @param timeChanged called with the new time [s]. */
  constructor(timeChanged) {
    this.timeChanged = timeChanged;
    Object.assign(this, { video: byId("video"), playing: false, time: 0 });
    for (const name of ["error", "stalled"]) this.video.addEventListener(name, () => this.videoFailed());
    this.video.addEventListener("loadedmetadata", () => this.seek(this.time));
    this.video.addEventListener("pause", () => { if (this.videoReady && !this.video.ended) this.stop(); });
    byId("play").addEventListener("click", () => this.toggle());
    byId("rate").addEventListener("change", () => { this.video.playbackRate = this.rate; });
    byId("video-choice").addEventListener("change", (event) => this.load(this.media[Number(event.target.value)]));
    byId("offset").addEventListener("change", (event) => this.setOffset(event.target.valueAsNumber));
  }

  get rate() { return Number(byId("rate").value); }
  get videoReady() { return Boolean(this.medium) && this.video.readyState >= 1 && !this.video.error; }

  open(recording) {
    this.stop();
    Object.assign(this, { id: recording.id, name: recording.name, start: recording.start, end: recording.end, time: recording.start });
    this.media = recording.media ?? [];
    byId("video-box").hidden = !this.media.length;
    byId("video-choice").replaceChildren(...this.media.map(({ name }, k) => Object.assign(make("option", "", name), { value: String(k) })));
    byId("video-choice").hidden = this.media.length < 2;
    this.load(this.media[0] ?? null);
  }

  /** Load a video; null unloads it. */
  load(medium) {
    this.stop();
    this.medium = medium;
    byId("video-problem").hidden = true;
    byId("video-offset").hidden = !medium;
    if (!medium) return this.unload();
    this.video.title = medium.name;
    this.offset = readStored(this.offsetKey) ?? medium.offset;
    byId("offset").value = String(this.offset);
    if (medium.missing) return this.showProblem(`The video ${medium.name} was not found beside the recording`);
    this.video.hidden = false;
    this.video.src = addressWithToken(`media/${this.id}/${medium.index}`).href;
    this.video.playbackRate = this.rate;
    return undefined;
  }

  // Remove the source without an error event.
  unload() {
    this.video.hidden = true;
    this.video.removeAttribute("src");
    this.video.load();
  }

  get offsetKey() { return `holdfast.label ${this.name} offset ${this.medium.name}`; }

  /** Set the time of the recording at which the video begins [s]. */
  setOffset(offset) {
    if (!Number.isFinite(offset) || !this.medium) return;
    this.offset = offset;
    writeStored(this.offsetKey, offset);
    this.seek(this.time);
  }

  videoFailed() {
    if (this.medium && this.video.error) this.showProblem(`The video ${this.medium.name} cannot be played: this browser cannot decode it`);
  }

  showProblem(text) {
    this.unload();
    byId("video-offset").hidden = true;
    setText(byId("video-problem"), text);
    byId("video-problem").hidden = false;
  }

  /** Go to a time of the recording [s]. */
  seek(time) {
    this.time = Math.max(this.start ?? 0, Math.min(this.end ?? 0, time));
    if (this.videoReady) {
      const videoTime = Math.max(0, this.time - this.offset);
      if (Math.abs(this.video.currentTime - videoTime) > TOLERANCE) this.video.currentTime = videoTime;
    }
    this.timeChanged(this.time);
  }

  toggle() {
    if (this.playing || this.start === undefined) return this.stop();
    if (this.time >= this.end - TOLERANCE) this.seek(this.start);
    this.playing = true;
    this.lastFrame = performance.now();
    this.showButton();
    this.startVideo();
    return requestAnimationFrame((now) => this.step(now));
  }

  // Play the video if it covers this time. Before and after it, the clock of the page runs alone.
  startVideo() {
    const videoTime = this.time - (this.offset ?? 0);
    if (!this.videoReady || !this.video.paused || videoTime < 0 || videoTime >= this.video.duration) return;
    this.video.currentTime = videoTime;
    this.video.play().catch(() => this.stop());
  }

  step(now) {
    if (!this.playing) return;
    const byVideo = this.videoReady && !this.video.paused && !this.video.ended;
    this.time = byVideo ? this.video.currentTime + this.offset : this.time + ((now - this.lastFrame) / 1000) * this.rate;
    this.lastFrame = now;
    if (!byVideo) this.startVideo();
    if (this.time >= this.end) { this.time = this.end; this.stop(); }
    this.timeChanged(this.time);
    requestAnimationFrame((next) => this.step(next));
  }

  stop() {
    this.playing = false;
    if (!this.video.paused) this.video.pause();
    this.showButton();
  }

  showButton() {
    byId("play").setAttribute("aria-pressed", String(this.playing));
    byId("play").title = byId("play").ariaLabel = this.playing ? "Pause (space bar)" : "Play (space bar)";
  }
}
