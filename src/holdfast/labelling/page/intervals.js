// Elements of labels and proposals, placed in the time window. Their look is in style.css.

import { make, shape } from "../web/dom.js";
import { percent, stateKey } from "../web/text.js";
import { labelText } from "./format.js";

const MIN_WIDTH_FOR_TEXT = 18; // [px]

/** Place an element at an interval [s] of the window, as far as it is visible; null if it is not. */
export function place(element, view, { start, end }) {
  if (end <= view.start || start >= view.end) return null;
  const from = Math.max(start, view.start), to = Math.min(end, view.end);
  element.style.left = `${(100 * (from - view.start)) / view.span}%`;
  element.style.width = `${(100 * (to - from)) / view.span}%`;
  return element;
}

/** Fill a box with the visible elements of items; `create` makes one from an item. */
export function placeAll(box, view, items, create) {
  box.replaceChildren(...items.map((item) => place(create(item), view, item)).filter(Boolean));
}

function interval(item, kind, ...marks) {
  const box = make("div", [kind, item.cause === "slip" && "slip", ...marks].filter(Boolean).join(" "));
  box.dataset.state = stateKey(item.state);
  return box;
}

/** Create the element of a label, with its shape and text where there is room. */
export function labelElement(view, item, selected) {
  const marks = selected?.label === item ? [selected.fresh ? "fresh" : "selected"] : [];
  const box = interval(item, "label", ...marks);
  if ((item.end - item.start) / view.secondsPerPixel >= MIN_WIDTH_FOR_TEXT) box.append(shape(stateKey(item.state)), make("span", "", labelText(item)));
  return box;
}

/** Create the element of a proposal: stronger with more confidence, and weak if it is not open. */
export function proposalElement(item, isOpen, isTarget, isDoubtful) {
  const box = interval(item, "proposal", isTarget && "target", isDoubtful && "doubtful");
  box.style.setProperty("--strength", (0.25 + 0.75 * item.confidence) * (isOpen ? 1 : 0.3));
  return box;
}

/** Create the frame of a label of low confidence. */
export const doubtElement = (item, inFocus) =>
  make("div", `doubt${inFocus ? " focus" : ""}`, make("span", "", `unsure ${percent(item.confidence)}`));
