// Beside the plots of each finger: its name, what the lines are, and their values at the cursor.

import { make, setText } from "../web/dom.js";
import { colours, fingerColour } from "../web/theme.js";
import { forceLines } from "./lines.js";
import { number, unitWord } from "./words.js";

function swatch(colour) {
  const mark = make("i", "swatch");
  mark.style.background = colour;
  return mark;
}

export class Gutters {
  constructor(box) {
    this.box = box;
    this.values = new Map();
  }

  open(recording, kind) {
    this.values.clear();
    this.box.replaceChildren(...recording.fingers.map((finger, place) => this.gutter(finger, place, recording.unit[finger], kind)));
  }

  gutter(finger, place, unit, kind) {
    const name = make("h3", "", swatch(fingerColour(place)), make("span", "", finger));
    name.title = finger;
    const values = new Map();
    const entry = (key, label, colour) => {
      const value = make("span", "value", number(null));
      values.set(key, value);
      return make("div", "entry", swatch(colour), make("span", "label", label), value);
    };
    const entries = [...forceLines(kind, place).map((each) => entry(each.key, each.name, each.colour)), entry("sigma", "σ", colours.muted)];
    this.values.set(finger, values);
    return make("section", "gutter", name, make("small", "unit", unitWord(unit)), ...entries);
  }

  show(finger, found) {
    for (const [key, element] of this.values.get(finger) ?? []) setText(element, number(found?.[key]));
  }
}
