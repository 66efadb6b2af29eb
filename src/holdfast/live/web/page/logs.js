// The latest events and notices, newest first, fifty of each.

import { make, shape, setText } from "../web/dom.js";
import { span, stateKey, stateWord, wall } from "./format.js";

const MOST = 50;

function putFirst(list, item) {
  list.prepend(item);
  while (list.children.length > MOST) list.lastElementChild.remove();
}

export class Events {
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
    this.put(event.time, name, make("span", "change", chip(event.previous), "→", chip(event.state)));
  }

  addMarker(time, text) {
    const words = make("span", "change", text);
    words.title = text;
    this.put(time, make("b", "finger marked", "marker"), words);
  }

  put(time, ...parts) {
    const item = make("li", "", make("time", "", span(0)), ...parts);
    this.times.set(item, time);
    putFirst(this.list, item);
  }

  /** Says how long ago each was, at `now` on the source's clock [s]. */
  age(now) {
    for (const item of this.list.children) {
      setText(item.firstElementChild, span(now - this.times.get(item)));
    }
  }
}

export class Notices {
  constructor(list) { this.list = list; }

  add(notice) {
    putFirst(this.list, make("li", "", make("time", "", wall(notice.time)), make("span", "", notice.text)));
  }
}
