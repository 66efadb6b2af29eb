// Beside the plots: the recordings, and what is left to be looked at.

import { byId, make, shape, setText } from "../web/dom.js";
import { labelWord, lengthWord, many, percent, stateKey, stateWord, timeWord } from "./words.js";

const MOST = 60; // rows of doubtful stretches

// Not scrollIntoView: that would scroll the page as well where it is longer than the screen.
function reveal(row, list) {
  const [one, all] = [row, list].map((each) => each.getBoundingClientRect());
  list.scrollTop += Math.min(0, one.top - all.top) + Math.max(0, one.bottom - all.bottom);
}

/** The list of recordings with what is done of each. */
export class Recordings {
  constructor(choose) {
    this.choose = choose;
    this.all = [];
  }

  open(recordings) {
    this.all = recordings;
    byId("recordings").replaceChildren(...recordings.map((entry) => {
      const row = make("button", "recording", make("i", "done"), make("span", "name", entry.name), make("span", "count"));
      row.type = "button";
      row.dataset.id = String(entry.id);
      row.addEventListener("click", () => this.choose(entry.id));
      return make("li", "", row);
    }));
    recordings.forEach((entry) => this.tell(entry));
  }

  tell(entry) {
    const row = byId("recordings").querySelector(`[data-id="${entry.id}"]`);
    if (!row) return;
    row.title = entry.error ?? [entry.name, lengthWord(entry.duration), many(entry.n_labels, "label"), `${many(entry.n_proposals, "proposal")} open`, `${entry.n_doubtful} doubtful`].join(" · ");
    row.dataset.done = entry.error ? "bad" : entry.labelled ? "yes" : entry.n_labels ? "inside" : "no";
    const count = entry.error ? "cannot be read" : entry.n_doubtful ? `${entry.n_doubtful} doubtful` : entry.n_labels ? many(entry.n_labels, "label") : lengthWord(entry.duration);
    row.lastElementChild.replaceChildren(count);
    row.lastElementChild.classList.toggle("warn", Boolean(entry.error || entry.n_doubtful));
    this.progress();
  }

  // After a save the list is right without asking for it.
  update(id, fields) {
    const entry = this.all.find((each) => each.id === id);
    if (entry) this.tell(Object.assign(entry, fields));
  }

  progress() {
    const done = this.all.filter(({ labelled }) => labelled).length;
    setText(byId("progress"), `${done} of ${this.all.length} labelled`);
    byId("progress-bar").style.transform = `scaleX(${this.all.length ? done / this.all.length : 0})`;
  }

  mark(id) {
    for (const row of byId("recordings").querySelectorAll("button")) {
      const here = row.dataset.id === String(id);
      row.setAttribute("aria-current", String(here));
      if (here) reveal(row, byId("recordings"));
    }
  }

  /** The recording before (-1) or after (1) one, or undefined. */
  next(id, by) {
    const place = this.all.findIndex((each) => each.id === id);
    return this.all[place + by];
  }
}

/** What is doubtful, the most doubtful first, and how many proposals are open. */
export class Checks {
  constructor(editor, look) {
    this.editor = editor;
    this.look = look;
    this.shown = null;
  }

  show() {
    const { doubts, proposals, focus } = this.editor;
    setText(byId("open-proposals"), proposals.length ? `${many(proposals.length, "proposal")} open` : "no open proposals");
    byId("accept-all").disabled = this.editor.readOnly || !proposals.length;
    if (this.shown !== doubts) {
      this.shown = doubts;
      setText(byId("n-doubts"), doubts.length ? String(doubts.length) : "");
      byId("doubts").replaceChildren(...doubts.slice(0, MOST).map((each) => this.row(each)));
    }
    [...byId("doubts").children].forEach((row, k) => row.firstElementChild.setAttribute("aria-current", String(doubts[k]?.item === focus?.item && focus !== null)));
  }

  row(each) {
    const { kind, finger, item } = each;
    const state = kind === "suspect" ? item.expected : item.state;
    const mark = shape(stateKey(state));
    const text = kind === "suspect" ? `${stateWord(item.given)} → ${stateWord(item.expected)}?` : labelWord(item);
    const button = make("button", "doubt", mark, make("span", "finger", finger), make("span", "what", text),
      make("time", "", timeWord(item.start, 0.1)), make("b", "", percent(item.confidence)));
    button.type = "button";
    button.dataset.state = stateKey(state);
    button.title = { suspect: "the audit contradicts this label", label: "a label of little confidence", proposal: "a proposal of little confidence" }[kind];
    button.addEventListener("click", () => this.look(each));
    return make("li", "", button);
  }
}
