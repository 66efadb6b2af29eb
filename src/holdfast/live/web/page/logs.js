// Lists of the newest events and notices, newest first.

import { make, shape, setText } from "../web/dom.js";
import { duration, stateKey } from "../web/text.js";
import { distance, stateWord, wallTime } from "./format.js";

const MAX_ITEMS = 50;
const CHANGE_TIME = 0.25; // [s] between the same changes of two fingers that are one change
const HAND = "hand";

function prepend(list, item) {
  list.prepend(item);
  while (list.children.length > MAX_ITEMS) list.lastElementChild.remove();
}

export class EventLog {
  constructor(list) {
    this.list = list;
    this.times = new WeakMap(); // of each item: [s] on the source's clock
    this.changes = new Map(); // newest change to each state
    this.slips = new Map(); // text of the slip of each finger that slides
  }

  clear() {
    this.list.replaceChildren();
    this.changes.clear();
    this.slips.clear();
  }

  /** Add the change of a finger or of the hand to the line of the same change, or as a new line. */
  add(event) {
    let change = this.changes.get(event.state);
    if (!change?.includes(event)) {
      change = new Change(event.state);
      this.changes.set(event.state, change);
      change.item = this.addItem(event.time, change.name, change.text);
    }
    change.add(event);
    this.times.set(change.item, event.time);
    this.list.prepend(change.item);
  }

  /** Add a slip that began; write how far and how long the finger slid when it has ended. */
  addSlip({ finger, begin, end, distance: slid }) {
    if (!this.slips.has(finger)) {
      this.slips.set(finger, make("span", "change slid-far", shape("slip"), "slips"));
      this.addItem(begin, make("b", "finger marked", finger), this.slips.get(finger));
    }
    if (end === null) return;
    const far = Number.isFinite(slid) ? `${distance(slid)} in ` : "";
    this.slips.get(finger).replaceChildren(shape("slip"), `slid ${far}${lasted(end - begin)}`);
    this.slips.delete(finger);
  }

  addMarker(time, text) {
    const label = make("span", "change", text);
    label.title = text;
    this.addItem(time, make("b", "finger marked", "marker"), label);
  }

  addItem(time, ...parts) {
    const item = make("li", "", make("time", "", duration(0)), ...parts);
    this.times.set(item, time);
    prepend(this.list, item);
    return item;
  }

  /** Update the ages of the items; `now` on the source's clock [s]. */
  updateAges(now) {
    for (const item of this.list.children) {
      setText(item.firstElementChild, duration(now - this.times.get(item)));
    }
  }
}

const lasted = (seconds) => `${seconds.toFixed(seconds < 9.95 ? 2 : 0)} s`;

// One line: the change of the hand with the fingers that made it, or of fingers alone.
class Change {
  constructor(state) {
    Object.assign(this, { state, time: NaN, previous: null, fingers: [], ofHand: false });
    this.name = make("b", "finger");
    this.text = make("span", "change");
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
    this.show();
  }

  show() {
    const names = this.fingers.join(", "), first = this.ofHand ? HAND : names;
    setText(this.name, first);
    this.name.title = first;
    this.name.classList.toggle("marked", !this.ofHand && this.fingers.length > 1);
    const by = this.ofHand && names ? [make("span", "by", names)] : [];
    this.text.replaceChildren(chip(this.previous), "→", chip(this.state), ...by);
  }
}

function chip(state) {
  const box = make("span", "chip", shape(stateKey(state)), stateWord(state).toLowerCase());
  box.dataset.state = stateKey(state);
  return box;
}

export class NoticeLog {
  constructor(list) { this.list = list; }

  add(notice) {
    prepend(this.list, make("li", "", make("time", "", wallTime(notice.time)), make("span", "", notice.text)));
  }
}
