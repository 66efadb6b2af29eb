// Questions that need an answer, and short messages that do not.

import { byId, make } from "../web/dom.js";

const STAYS = 6000; // [ms]

/** A short message; `kind` is "good" or "bad". */
export function toast(text, kind) {
  const box = make("p", `toast ${kind}`, text), toasts = byId("toasts");
  toasts.append(box);
  while (toasts.children.length > 4) toasts.firstElementChild.remove();
  setTimeout(() => box.remove(), STAYS);
}

let answering = Promise.resolve();

/** Asks a question, one after the other; resolves to the value of the button that was pressed. */
export function ask(title, texts, buttons) {
  answering = answering.then(() => show(title, texts, buttons));
  return answering;
}

function show(title, texts, buttons) {
  const dialog = byId("ask");
  return new Promise((resolve) => {
    const row = make("div", "answers", ...buttons.map(({ value, label }) => {
      const button = make("button", "", label);
      button.type = "button";
      button.dataset.value = value;
      button.addEventListener("click", () => { dialog.close(); resolve(value); });
      return button;
    }));
    const heading = make("h2", "", title);
    heading.id = "ask-title";
    heading.tabIndex = -1;
    dialog.replaceChildren(heading, ...texts.map((text) => make("p", "", text)), row);
    // Escape would leave it open which labels count.
    dialog.oncancel = (event) => event.preventDefault();
    dialog.onkeydown = (event) => { if (event.key === "Escape") event.preventDefault(); };
    dialog.showModal();
    // Not a button: whoever presses Enter for proposals must not answer unseen.
    heading.focus();
  });
}

/** A line across the page that stays until it is no longer so; empty for none. */
export function alert(text) {
  const box = byId("alert");
  if (box.textContent !== text) box.textContent = text;
  box.hidden = !text;
}
