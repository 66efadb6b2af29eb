// Panel of the loop that controls the grip of a hand: state, commands beside their limits, stop.

import { callService } from "../../web/api.js";
import { byId, make, setText } from "../../web/dom.js";
import { toast } from "../../page/controls.js";
import { NO_VALUE, withSpaces } from "../../page/format.js";
import { EmergencyStop } from "./stop.js";

const POLL_INTERVAL = 1000, POLL_TIMEOUT = 1000; // [ms]
const CONFIRM_TIME = 4000; // [ms] in which the second press of Reset counts

const FAULT_HELP = ": the loop of the hand does not control the grip; states of contacts are then outlined, "
  + "not filled. The panel says what happened, what the hand is commanded and what Reset does.";

export const scaleText = (scale) => `${scale.toFixed(2)}×`;

/** Return where a scale is between the limits, from 0 to 1. */
export function share(scale, { min_scale: low, max_scale: high }) {
  return high > low ? Math.min(1, Math.max(0, (scale - low) / (high - low))) : 0;
}

/** Return the limits as one line. */
export function limitsText(limits) {
  const force = limits.max_force === null ? "no highest force" : `force ≤ ${limits.max_force}`;
  return `${scaleText(limits.min_scale)} to ${scaleText(limits.max_scale)} · ${force} · on a fault or stop: ${limits.on_fault}`;
}

/** Return in one word what is sent: whether commands are, and in a fault, which. */
export function commandWord(grip) {
  if (!grip.armed) return "DRY RUN";
  if (grip.failure) return "NOTHING SENT";
  if (grip.released) return "RELEASED";
  return grip.state === "FAULT" ? "HELD" : "ARMED";
}

/** Return the explanation of a fault as a notice; empty without a fault. */
export function faultNotice(grip) {
  if (grip?.state !== "FAULT" || !grip.fault) return "";
  const { reason, happened, commanded, continues, reset } = grip.fault;
  return `grip FAULT (${withSpaces(reason)}): ${[happened, commanded, continues, reset].join(" ")}`;
}

/** Return the entries after the one that was seen last. */
export function newEntries(entries, last) {
  const key = ({ time, text }) => `${time} ${text}`;
  return entries.slice(entries.findLastIndex((entry) => key(entry) === last) + 1);
}

export class Panel {
  /** @param page with `addEvent(time, text)`, for events of the loop [s], and `addNotice(text)`. */
  constructor(page) {
    this.page = page;
    this.badge = make("b", "hand-grip", "GRIP FAULT");
    Object.assign(this.badge, { id: "hand-grip", hidden: true });
    byId("hand-word").after(this.badge);
    byId("slip-help").parentElement.append(make("li", "", make("b", "", "GRIP FAULT"), FAULT_HELP));
    this.noticed = "";
    this.grip = null;
    this.lastEntry = "";
    this.link = "connecting";
    this.fingers = new Map();
    this.stop = new EmergencyStop((grip) => this.update(grip));
    byId("grip-reset").addEventListener("click", () => this.reset());
    setInterval(() => this.poll(), POLL_INTERVAL);
  }

  start() {
    this.lastEntry = "";
  }

  setLink(link) {
    this.link = link;
    if (link === "lost") this.poll();
  }

  // Without its WebSocket, the page reads the state by plain requests.
  async poll() {
    if (this.link === "open" || (this.link !== "lost" && this.grip === null)) return;
    if (this.grip === null && this.known) return;
    try {
      this.update(await callService("GET", "grip", undefined, AbortSignal.timeout(POLL_TIMEOUT)));
    } catch {
      if (this.grip) this.showState("unknown", "NO CONNECTION", "the state of the loop is not known");
    }
  }

  /** Show the state; null if no hand is controlled. */
  update(grip) {
    this.known = true;
    this.grip = grip ?? null;
    byId("grip").hidden = this.grip === null;
    document.body.classList.toggle("has-grip", this.grip !== null);
    this.stop.enable(this.grip !== null);
    if (this.grip === null) return;
    const reason = grip.stopped ? "stopped by a person" : withSpaces(grip.reason);
    this.showState(grip.state.toLowerCase(), grip.state, grip.failure || reason || (grip.waiting ? `waiting: ${grip.waiting}` : ""));
    const word = commandWord(grip);
    setText(byId("grip-armed"), word);
    byId("grip").dataset.command = word.toLowerCase().replace(" ", "-");
    this.showFault(grip);
    setText(byId("grip-hand"), `${grip.hand} · law ${grip.law}`);
    setText(byId("grip-limits"), limitsText(grip.limits));
    this.showFingers(grip);
    this.showButtons(grip);
    for (const { time, text } of newEntries(grip.events, this.lastEntry)) {
      this.page.addEvent(time, text.replace(/^grip /, ""));
      this.lastEntry = `${time} ${text}`;
    }
  }

  showState(key, word, reason) {
    byId("grip").dataset.grip = key;
    setText(byId("grip-word"), word);
    setText(byId("grip-reason"), reason);
  }

  // A contact may be STABLE in a fault: the page must not look as if the loop were in control.
  showFault(grip) {
    const isFault = grip.state === "FAULT", { fault } = grip;
    document.body.classList.toggle("grip-fault", isFault);
    this.badge.hidden = !isFault;
    byId("grip-fault").hidden = !isFault || !fault;
    if (isFault && fault) for (const key of ["happened", "commanded", "continues", "reset"]) setText(byId(`fault-${key}`), fault[key]);
    const notice = faultNotice(grip);
    if (notice === this.noticed) return;
    this.page.addNotice(notice || `grip: the fault has ended, now ${grip.state}`);
    this.noticed = notice;
  }

  showFingers(grip) {
    const names = Object.keys(grip.fingers);
    if (names.join() !== [...this.fingers.keys()].join()) {
      this.fingers = new Map(names.map((name) => [name, new FingerScale(name)]));
      byId("grip-fingers").replaceChildren(...[...this.fingers.values()].map(({ element }) => element));
    }
    for (const [name, row] of this.fingers) row.update(grip.fingers[name], grip);
  }

  showButtons(grip) {
    setText(byId("stop-word"), grip.stopped ? "STOPPED" : "STOP");
    byId("stop").classList.toggle("stopped", grip.stopped);
    const reset = byId("grip-reset");
    reset.disabled = Boolean(grip.failure) || grip.state !== "FAULT";
    if (reset.disabled) this.askReset(false);
  }

  // The first press asks, the second one resets. A dialog would hide the stop.
  askReset(asking) {
    clearTimeout(this.asking);
    this.asking = asking ? setTimeout(() => this.askReset(false), CONFIRM_TIME) : null;
    setText(byId("grip-reset"), asking ? "Press again to reset" : "Reset");
    byId("grip-reset").classList.toggle("asking", asking);
  }

  async reset() {
    if (!this.asking) {
      this.askReset(true);
      return;
    }
    this.askReset(false);
    try {
      this.update(await callService("POST", "grip/reset", undefined, AbortSignal.timeout(POLL_TIMEOUT)));
    } catch (error) {
      toast(error.message, "bad");
    }
  }
}

class FingerScale {
  constructor(name) {
    this.value = make("b", "", "–");
    this.reason = make("small", "reason");
    this.fill = make("i", "fill");
    this.mark = make("i", "threshold");
    this.limit = make("small");
    const label = make("span", "grip-name", name);
    label.title = name;
    this.element = make("li", "", make("div", "line", label, this.value),
      make("div", "meter", make("div", "bar", this.fill, this.mark)), make("div", "below", this.limit, this.reason));
  }

  update({ scale, highest, reason }, { limits, state, released, failure }) {
    const isFault = state === "FAULT";
    this.element.classList.toggle("passive", isFault || released);
    setText(this.value, released || failure ? NO_VALUE : scaleText(scale));
    setText(this.reason, released ? "released" : isFault && !failure ? "held" : withSpaces(reason));
    setText(this.limit, `${scaleText(limits.min_scale)} to ${scaleText(highest)}`);
    this.fill.style.transform = `scaleX(${share(scale, limits).toFixed(3)})`;
    this.mark.style.left = `${100 * share(highest, limits)}%`;
  }
}
