// Limit drawing to half of the browser's time.

const MAX_DRAW_TIME = 1000; // [ms]; a longer time means that the tab was hidden

/** Measure the time from a drawing to the browser's next frame: scripts, layout and painting. */
export class FrameLimiter {
  constructor() {
    this.drawnAt = null;
    this.nextAt = 0;
  }

  /** Return whether it is time to draw; call it once in every frame. */
  mayDraw() {
    const now = performance.now();
    if (this.drawnAt !== null) {
      this.nextAt = now + Math.min(MAX_DRAW_TIME, now - this.drawnAt);
      this.drawnAt = null;
    }
    // Half a frame too early is better than a whole frame too late.
    return now >= this.nextAt - 8;
  }

  startDrawing() {
    this.drawnAt = performance.now();
  }
}
