// Lists of the newest events and notices, newest first.

import { make, shape, setText } from "../web/dom.js";
import { duration, stateKey, stateWord, wallTime } from "./format.js";

const MAX_ITEMS = 50;

function prepend(list, item) {
  list.prepend(item);
  while (list.children.length > MAX_ITEMS) list.lastElementChild.remove();
}

export class EventLog {
  constructor(list) {
    this.list = list;
    this.times = new WeakMap(); // of each item: [s] on the source's clock
  }

  clear() { this.list.replaceChildren(); }

  add(event) {
    const chip = (state) => {
      const box = make("span", "chip", shape(stateKey(state)), stateWord(state).toLowerCase());
      box.dataset.state = stateKey(state);
      return box;
    };
    const name = make("b", "finger", event.finger);
    name.title = event.finger;
    this.addItem(event.time, name, make("span", "change", chip(event.previous), "→", chip(event.state)));
  }

  addMarker(time, text, kind = "marker") {
    const label = make("span", "change", text);
    label.title = text;
    this.addItem(time, make("b", "finger marked", kind), label);
  }

  addItem(time, ...parts) {
    const item = make("li", "", make("time", "", duration(0)), ...parts);
    this.times.set(item, time);
    prepend(this.list, item);
  }

  /** Update the ages of the items; `now` on the source's clock [s]. */
  updateAges(now) {
    for (const item of this.list.children) {
      setText(item.firstElementChild, duration(now - this.times.get(item)));
    }
  }
}

export class NoticeLog {
  constructor(list) { this.list = list; }

  add(notice) {
    prepend(this.list, make("li", "", make("time", "", wallTime(notice.time)), make("span", "", notice.text)));
  }
}
