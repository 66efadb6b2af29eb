// Legend beside the plots of each finger: its name, the lines, and their values at the cursor.

import { make, setText } from "../web/dom.js";
import { colours, fingerColour } from "../web/theme.js";
import { forceLines } from "./draw_signals.js";
import { number, unitWord } from "./format.js";

function swatch(colour) {
  const mark = make("i", "swatch");
  mark.style.background = colour;
  return mark;
}

export class Legend {
  constructor(box) {
    this.box = box;
    this.values = new Map();
  }

  open(recording, force) {
    this.values.clear();
    this.box.replaceChildren(...recording.fingers.map((finger, index) => this.fingerLegend(finger, index, recording.unit[finger], force)));
  }

  fingerLegend(finger, index, unit, force) {
    const name = make("h3", "", swatch(fingerColour(index)), make("span", "", finger));
    name.title = finger;
    const values = new Map();
    const entry = (key, label, colour) => {
      const value = make("span", "value", number(null));
      values.set(key, value);
      return make("div", "entry", swatch(colour), make("span", "label", label), value);
    };
    const entries = [...forceLines(force, index).map((each) => entry(each.key, each.name, each.colour)), entry("sigma", "σ", colours.muted)];
    this.values.set(finger, values);
    return make("section", "finger-legend", name, make("small", "unit", unitWord(unit)), ...entries);
  }

  /** Show the values of a finger; null shows dashes. */
  show(finger, values) {
    for (const [key, element] of this.values.get(finger) ?? []) setText(element, number(values?.[key]));
  }
}
