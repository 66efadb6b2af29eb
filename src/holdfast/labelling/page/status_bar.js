// Status bar: whether the labels are saved, the item that keys act on, and the time window.

import { byId, make, setText, shape } from "../web/dom.js";
import { percent, stateKey, timeText } from "../web/text.js";
import { dateText, labelText, spanText } from "./format.js";
import { LOW_CONFIDENCE } from "./labels.js";

const SAVE_TEXTS = {
  saving: "saving …", waiting: "not saved yet …", none: "no labels yet",
  conflict: "NOT SAVED: the label file was changed by another page or program",
};

/** Save status: whether the labels are saved, and who saved them last. */
export class SaveStatus {
  open({ author, time, origin, read_only }) {
    this.lastSave = { author, time };
    if (origin === "file") this.show("saved");
    else this.show("none", origin === "inside" ? "labels from the recording file" : "");
    if (read_only) setText(byId("save-text"), `read-only${author ? ` · by ${author}, ${dateText(time)}` : ""}`);
  }

  /** @param lastSave author and time of the last save, if they are new. */
  show(state, reason = "", lastSave = null) {
    if (lastSave) this.lastSave = lastSave;
    const { author, time } = this.lastSave ?? {};
    const saved = author || time ? `saved${author ? ` by ${author}` : ""}${time ? `, ${dateText(time)}` : ""}` : "no changes";
    const texts = { ...SAVE_TEXTS, saved, failed: `NOT SAVED: ${reason}` };
    byId("save").dataset.save = state;
    setText(byId("save-text"), state === "none" && reason ? reason : texts[state]);
    byId("save").title = state === "saved" && time ? new Date(time).toLocaleString("en-GB") : reason;
  }
}

const HINTS = { proposal: "Enter accepts, X rejects", label: "Enter confirms the label", fresh: "A copies the label to all fingers" };

/** Show the selected label, or else the target of Enter and X, in the status bar. */
export function showItem(editor, target) {
  const box = byId("item"), { selected, readOnly } = editor;
  const showsTarget = !selected || (target && (selected.fresh || target.kind !== "proposal"));
  const { kind, finger, item } = (showsTarget ? target : { kind: "selected", finger: selected.finger, item: selected.label }) ?? {};
  const doubt = kind === "selected" && item.confidence < LOW_CONFIDENCE ? "label" : kind;
  const hint = item ? HINTS[kind === "selected" && selected.fresh ? "fresh" : doubt] : "Drag over a finger to label it · ? shows all keys";
  box.replaceChildren();
  if (item) {
    const facts = [finger, spanText(item), item.confidence < 1 ? percent(item.confidence) : "", item.author, item.evidence].filter(Boolean).join(" · ");
    box.dataset.state = stateKey(item.state);
    box.title = facts;
    box.append(shape(stateKey(item.state)), make("b", "", `${kind === "proposal" ? "proposed: " : ""}${labelText(item)}`), make("span", "facts", facts));
  }
  if (!readOnly) box.append(make("span", "hint", hint ?? ""));
}

/** Show the time window, and whether every sample is drawn. */
export function showWindow(view, signals) {
  const { fine, coarse } = signals, data = fine && fine.start <= view.start && fine.end >= view.end ? fine : coarse;
  const step = view.span > 20 ? 0.1 : view.span > 2 ? 0.01 : 0.001;
  const text = `${timeText(view.start, step)} – ${timeText(view.end, step)} s`;
  setText(byId("window"), data?.exact ? `${text} · every sample` : text);
}
