// Panels beside the plots: the list of recordings, and the items to review.

import { byId, make, makeButton, setText, shape } from "../web/dom.js";
import { duration, percent, stateKey, timeText } from "../web/text.js";
import { countOf, labelText } from "./format.js";

const MAX_REVIEW_ROWS = 60;

// Scroll a list to a row. `scrollIntoView` would also scroll the page on small screens.
function scrollToRow(row, list) {
  const [inner, outer] = [row, list].map((each) => each.getBoundingClientRect());
  list.scrollTop += Math.min(0, inner.top - outer.top) + Math.max(0, inner.bottom - outer.bottom);
}

// Return how far a recording is labelled: "error", "saved", "inside" its file, or "none".
const progressOf = (entry) => (entry.error ? "error" : entry.labelled ? "saved" : entry.n_labels ? "inside" : "none");

// Return the most important fact of a recording.
function summaryOf(entry) {
  if (entry.error) return "not readable";
  if (entry.n_doubtful) return `${entry.n_doubtful} to review`;
  return entry.n_labels ? countOf(entry.n_labels, "label") : duration(entry.duration);
}

/** List of recordings, each with its progress. */
export class RecordingList {
  constructor(choose) {
    this.choose = choose;
    this.all = [];
  }

  open(recordings) {
    this.all = recordings;
    byId("recordings").replaceChildren(...recordings.map((entry) => {
      const row = makeButton("recording", () => this.choose(entry.id), make("i", "progress-mark"), make("span", "name", entry.name), make("span", "summary"));
      row.dataset.id = String(entry.id);
      return make("li", "", row);
    }));
    recordings.forEach((entry) => this.show(entry));
  }

  show(entry) {
    const row = byId("recordings").querySelector(`[data-id="${entry.id}"]`);
    if (!row) return;
    row.title = entry.error ?? [entry.name, duration(entry.duration), countOf(entry.n_labels, "label")].join(" · ");
    row.dataset.progress = progressOf(entry);
    row.lastElementChild.replaceChildren(summaryOf(entry));
    row.lastElementChild.classList.toggle("warn", Boolean(entry.error || entry.n_doubtful));
    this.showProgress();
  }

  /** Update the entry of a recording without a request to the service. */
  update(id, fields) {
    const entry = this.all.find((each) => each.id === id);
    if (entry) this.show(Object.assign(entry, fields));
  }

  showProgress() {
    const n = this.all.filter((entry) => ["saved", "inside"].includes(progressOf(entry))).length;
    setText(byId("progress"), `${n} of ${this.all.length} labelled`);
  }

  markCurrent(id) {
    for (const row of byId("recordings").querySelectorAll("button")) {
      const current = row.dataset.id === String(id);
      row.setAttribute("aria-current", String(current));
      if (current) scrollToRow(row, byId("recordings"));
    }
  }

  /** Return the recording before (-1) or after (1) another; undefined at the ends of the list. */
  neighbour(id, step) { return this.all[this.all.findIndex((each) => each.id === id) + step]; }
}

/** List of the items to review, those of the lowest confidence first, and the number of open proposals. */
export class ReviewList {
  constructor(editor, choose) {
    this.editor = editor;
    this.choose = choose;
    this.shown = null;
  }

  show() {
    const { reviewItems, proposals, focus } = this.editor;
    setText(byId("open-proposals"), proposals.length ? countOf(proposals.length, "open proposal") : "no open proposals");
    byId("accept-all").disabled = this.editor.readOnly || !proposals.length;
    if (this.shown !== reviewItems) {
      this.shown = reviewItems;
      setText(byId("n-review-items"), reviewItems.length ? String(reviewItems.length) : "");
      byId("review-items").replaceChildren(...reviewItems.slice(0, MAX_REVIEW_ROWS).map((each) => this.row(each)));
    }
    [...byId("review-items").children].forEach((row, k) => {
      const current = focus !== null && reviewItems[k]?.item === focus.item;
      row.firstElementChild.setAttribute("aria-current", String(current));
    });
  }

  row(each) {
    const { kind, finger, item } = each;
    const button = makeButton("review-item", () => this.choose(each), shape(stateKey(item.state)), make("span", "finger", finger),
      make("span", "name", labelText(item)), make("time", "", timeText(item.start, 0.1)), make("b", "", percent(item.confidence)));
    button.dataset.state = stateKey(item.state);
    button.title = `This ${kind} has a low confidence`;
    return make("li", "", button);
  }
}
