// How often to draw: as often as news come, but never for more than half of the browser's time.

const LONGEST = 1000; // [ms] a tab that was hidden has not been slow

/** Measures from a drawing to the browser's next frame: scripts, layout and painting. */
export class Pace {
  constructor() {
    this.begun = null;
    this.next = 0;
  }

  /** Whether it is time to draw; asked once in every frame. */
  may() {
    const now = performance.now();
    if (this.begun !== null) {
      this.next = now + Math.min(LONGEST, now - this.begun);
      this.begun = null;
    }
    // Half a frame early rather than a whole one late.
    return now >= this.next - 8;
  }

  drawn() {
    this.begun = performance.now();
  }
}
