// Create and change elements. Texts are set as text, never as HTML: names and notices come from
// devices.

const SVG = "http://www.w3.org/2000/svg";

export const byId = (id) => document.getElementById(id);

/** Create an element with a class name, and children that are elements or texts. */
export function make(tag, className = "", ...children) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.append(...children);
  return element;
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
  const use = document.createElementNS(SVG, "use");
  use.setAttribute("href", `#shape-${key}`);
  svg.append(use);
  return svg;
}

/** Fill a row with buttons of which exactly one is pressed; a click calls `choose(value)`. */
export function fillChoice(row, entries, chosen, choose) {
  row.replaceChildren(...entries.map(({ value, label, title, mark }) => {
    const button = make("button", "", ...(mark ? [mark] : []), make("span", "", label));
    button.type = "button";
    button.title = title ?? label;
    button.dataset.value = String(value);
    button.setAttribute("aria-pressed", String(value === chosen));
    button.addEventListener("click", () => choose(value));
    return button;
  }));
}

/** Mark the button with this value as the pressed one of its row. */
export function setPressed(row, value) {
  for (const button of row.children) {
    button.setAttribute("aria-pressed", String(button.dataset.value === String(value)));
  }
}
