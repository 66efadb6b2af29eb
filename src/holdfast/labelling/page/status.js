// The line below: how the saving stands, what is pointed at, and when.

import { byId, make, shape, setText } from "../web/dom.js";
import { labelWord, percent, spanWord, stateKey, stateWord, timeWord, whenWord } from "./words.js";

const SAVING = { saving: "saving …", waiting: "not saved yet …", conflict: "NOT SAVED: the file was changed by somebody else", none: "no labels yet" };

/** How the saving stands; `by` is who saved last and when. */
export class SaveState {
  open({ author, time, origin, read_only }) {
    this.by = { author, time };
    if (origin === "file") this.tell("saved");
    else this.tell("none", origin === "inside" ? "labels of the recording itself" : "");
    if (read_only) setText(byId("save-text"), `read-only${author ? ` · by ${author}, ${whenWord(time)}` : ""}`);
  }

  tell(state, why = "", by = null) {
    if (by) this.by = by;
    const { author, time } = this.by ?? {};
    const saved = author || time ? `saved${author ? ` by ${author}` : ""}${time ? `, ${whenWord(time)}` : ""}` : "no changes";
    const words = { ...SAVING, saved, failed: `NOT SAVED: ${why}` };
    byId("save").dataset.save = state;
    setText(byId("save-text"), state === "none" && why ? why : words[state]);
    byId("save").title = state === "saved" && time ? new Date(time).toLocaleString("en-GB") : why;
  }
}

const hints = {
  proposal: "Enter accepts, X rejects", suspect: "Enter corrects it, X if the label is right",
  label: "Enter confirms it", fresh: "A copies it to all fingers",
};

/** What is selected, or else what is meant by Enter and X. */
export function tellAbout(editor, target) {
  const box = byId("about"), { selected } = editor;
  const shown = selected && !(target && (selected.fresh || target.kind !== "proposal")) ? { kind: "own", finger: selected.finger, item: selected.label } : target;
  if (!shown) {
    box.replaceChildren(make("span", "hint", editor.readOnly ? "" : "Drag over a finger to label it · ? for all keys"));
    return;
  }
  const { kind, finger, item } = shown, audit = kind === "suspect";
  const what = audit ? `${stateWord(item.given)}; the audit expects ${stateWord(item.expected)}` : labelWord(item);
  const sure = audit || item.confidence < 1 ? percent(item.confidence) : "";
  const mark = shape(stateKey(audit ? item.expected : item.state));
  const facts = [finger, spanWord(item), sure, item.author, item.evidence].filter(Boolean).join(" · ");
  const hint = kind === "own" ? (selected.fresh ? hints.fresh : item.confidence < 0.8 ? hints.label : "") : hints[kind];
  box.replaceChildren(mark, make("b", "", `${kind === "proposal" ? "proposed: " : ""}${what}`), make("span", "facts", facts), make("span", "hint", editor.readOnly ? "" : hint));
  box.dataset.state = stateKey(audit ? item.expected : item.state);
  box.title = facts;
}

/** The window, and whether each sample is drawn. */
export function tellWindow(view, signals) {
  const { part, whole } = signals, data = part && part.start <= view.start && part.end >= view.end ? part : whole;
  const digits = view.span > 20 ? 0.1 : view.span > 2 ? 0.01 : 0.001;
  const text = `${timeWord(view.start, digits)} – ${timeWord(view.end, digits)} s`;
  setText(byId("window"), data?.exact ? `${text} · every sample` : text);
}
