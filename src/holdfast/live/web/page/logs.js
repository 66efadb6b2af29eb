// Lists of the newest events and notices, newest first, each with the time at which it came.

import { make, shape, setText } from "../web/dom.js";
import { stateKey } from "../web/text.js";
import { distance, stateWord, wallTime } from "./format.js";

const MAX_ITEMS = 50;
const CHANGE_TIME = 0.25; // [s] between the same changes of two fingers that are one change
const HAND = "hand";

class Log {
  constructor(list) { this.list = list; }

  addItem(time, ...parts) {
    const item = make("li", "", make("time", "", wallTime(time)), ...parts);
    this.list.prepend(item);
    while (this.list.children.length > MAX_ITEMS) this.list.lastElementChild.remove();
    return item;
  }
}

export class NoticeLog extends Log {
  add({ time, text }) { this.addItem(time, make("span", "", text)); }
}

export class EventLog extends Log {
  clear() {
    this.list.replaceChildren();
    this.changes = new Map(); // newest change to each state
    this.slips = new Map(); // text of the slip of each finger that slides
  }

  addEvent(name, ...parts) {
    const text = make("span", "change", ...parts);
    const item = this.addItem(Date.now() / 1000, make("b", "finger", name), text);
    return { item, text };
  }

  /** Add the change of a finger or of the hand to the line of the same change, or as a new line. */
  add(event) {
    let change = this.changes.get(event.state);
    if (!change?.includes(event)) {
      change = new Change(event.state, this.addEvent(""));
      this.changes.set(event.state, change);
    }
    change.add(event);
  }

  /** Add a slip that began; write how far and how long the finger slid when it has ended. */
  addSlip({ finger, begin, end, distance: slid }) {
    if (!this.slips.has(finger)) this.slips.set(finger, this.addEvent(finger, shape("slip"), "slips").text);
    if (end === null) return;
    const far = Number.isFinite(slid) ? `${distance(slid)} in ` : "", time = end - begin;
    this.slips.get(finger).replaceChildren(shape("slip"), `slid ${far}${time.toFixed(time < 9.95 ? 2 : 0)} s`);
    this.slips.delete(finger);
  }
}

// One line: the change of the hand with the fingers that made it, or of fingers alone.
class Change {
  constructor(state, line) {
    Object.assign(this, { state, ...line, time: NaN, previous: null, fingers: [], ofHand: false });
  }

  includes({ finger, time, previous }) {
    if (!(Math.abs(time - this.time) <= CHANGE_TIME)) return false;
    if (finger === HAND) return !this.ofHand;
    return !this.fingers.includes(finger) && (this.ofHand || previous === this.previous);
  }

  add({ finger, previous, time }) {
    this.time = time; // of the newest
    if (finger === HAND) this.ofHand = true;
    else this.fingers.push(finger);
    if (finger === HAND || this.previous === null) this.previous = previous;
    const names = this.fingers.join(", ");
    setText(this.item.children[1], this.ofHand ? HAND : names);
    const by = this.ofHand && names ? [make("span", "by", names)] : [];
    this.text.replaceChildren(chip(this.previous), "→", chip(this.state), ...by);
  }
}

function chip(state) {
  const box = make("span", "chip", shape(stateKey(state)), stateWord(state).toLowerCase());
  box.dataset.state = stateKey(state);
  return box;
}
