// Create and change elements. Texts are set as text, never as HTML: names and notices come from
// devices.

const SVG = "http://www.w3.org/2000/svg";
const TOAST_TIME = 6000; // [ms]
const MAX_TOASTS = 4;

export const byId = (id) => document.getElementById(id);

/** Create an element with a class name, and children that are elements or texts. */
export function make(tag, className = "", ...children) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.append(...children);
  return element;
}

/** Create a button that calls `act`. */
export function makeButton(className, act, ...children) {
  const button = make("button", className, ...children);
  button.type = "button";
  button.addEventListener("click", act);
  return button;
}

/** Create a mark in the colour of a line; `colour` is the name of a custom property. */
export function swatch(colour) {
  const mark = make("i", "swatch");
  mark.style.background = `var(--${colour})`;
  return mark;
}

/** Create the entry of a line in a legend: its colour, its label, and its value, which is returned too. */
export function legendEntry(colour, label) {
  const value = make("span", "value", "–"), entry = make("div", "entry", swatch(colour), make("span", "label", label), value);
  entry.title = label;
  return [entry, value];
}

/** Set the text of an element if it differs, which avoids needless layout. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Create the shape of a state; `key` as `stateKey` returns it. */
export function shape(key) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("class", "shape");
  svg.setAttribute("aria-hidden", "true");
  svg.append(document.createElementNS(SVG, "use"));
  setShape(svg, key);
  return svg;
}

export const setShape = (svg, key) => svg.firstChild.setAttribute("href", `web/shapes.svg#${key}`);

/** Fill a row with buttons of which one is pressed; a click calls `choose(value)`. */
export function fillChoice(row, entries, chosen, choose) {
  row.replaceChildren(...entries.map(({ value, title, content }) => {
    const button = makeButton("", () => choose(value), ...content);
    button.title = title;
    button.dataset.value = String(value);
    return button;
  }));
  setPressed(row, chosen);
}

/** Mark the button with this value as the pressed one of its row. */
export function setPressed(row, value) {
  for (const button of row.children) button.setAttribute("aria-pressed", String(button.dataset.value === String(value)));
}

/** Show a short message for a few seconds; `kind` is "good" or "bad". */
export function showToast(text, kind) {
  const box = make("p", `toast ${kind}`, text), toasts = byId("toasts");
  toasts.append(box);
  while (toasts.children.length > MAX_TOASTS) toasts.firstElementChild.remove();
  setTimeout(() => box.remove(), TOAST_TIME);
}

/** Do the work of a button, once at a time: a double click counts once. Show why it fails. */
export async function runOnce(button, work) {
  if (button.matches(":disabled, .busy")) return;
  button.classList.add("busy");
  await work().catch((error) => showToast(error.message, "bad"));
  button.classList.remove("busy");
}

/** Show a line above the page until it is replaced; an empty text hides it. */
export function showAlert(text) {
  setText(byId("alert"), text);
  byId("alert").hidden = !text;
}
