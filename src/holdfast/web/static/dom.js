// Building elements. Texts go in as text, never as HTML: names and notices come from devices.

const SVG = "http://www.w3.org/2000/svg";

export const byId = (id) => document.getElementById(id);

/** An element with a class, and children that are elements or texts. */
export function make(tag, name = "", ...children) {
  const element = document.createElement(tag);
  if (name) element.className = name;
  element.append(...children);
  return element;
}

/** Sets a text where it differs, so that nothing is laid out anew for nothing. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** The shape of a state; `key` as `stateKey` gives it. */
export function shape(key) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("class", "shape");
  svg.setAttribute("aria-hidden", "true");
  const use = document.createElementNS(SVG, "use");
  use.setAttribute("href", `#shape-${key}`);
  svg.append(use);
  return svg;
}

/** One button of a row of which exactly one is pressed. */
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

export function setPressed(row, value) {
  for (const button of row.children) {
    button.setAttribute("aria-pressed", String(button.dataset.value === String(value)));
  }
}
