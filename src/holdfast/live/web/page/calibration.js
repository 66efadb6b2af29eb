// Panel of the calibration by own handling: progress, result, model file, and the way back.

import { addressWithToken, callService } from "../web/api.js";
import { byId, setText } from "../web/dom.js";
import { LOCKED, toast } from "./controls.js";

const HINT = "Hold an object firmly and handle it as usual: grasp, carry, turn, put down. Nothing needs a label.";
const SHORT = "30 s or more are better, with the arm in motion.";

const whole = (seconds) => `${Math.floor(seconds)}\u202fs`;

/** Return what the panel says and offers at a document of the service. */
export function panelOf({ state, seconds, least, enough, most, calibrated, refused, text, warnings }) {
  if (state === "recording") {
    const ready = seconds >= least;
    return {
      told: HINT, warning: ready && seconds < enough ? SHORT : "", progress: true,
      held: `Held ${whole(seconds)} of ${whole(most)}`, button: `Held ${whole(seconds)}`,
      buttons: ["finish", "cancel"], ready, finish: ready ? `Use ${whole(seconds)}` : `From ${Math.ceil(least)}\u202fs on`,
    };
  }
  if (state === "fitting") {
    return { told: "Fitting the model to this handling …", warning: "", progress: false, button: "Fitting …", buttons: [] };
  }
  const shown = { told: text, warning: calibrated && !refused ? warnings.map((line) => `${line}.`).join(" ") : "", progress: false, refused };
  if (calibrated) return { ...shown, button: "Calibrated", buttons: ["save", "download", "again", "undo", "close"] };
  return { ...shown, button: "Calibrate", buttons: text ? ["again", "close"] : [] };
}

export class CalibrationPanel {
  /** @param onModel is called when the model of the session has changed. */
  constructor(onModel) {
    this.onModel = onModel;
    this.document = null;
    this.impossible = "";
    this.canSave = true;
    this.connected = false;
    this.locked = false;
    this.open = false;
    this.result = null; // text of the last result that was shown
    this.title = byId("calibrate").title;
    byId("calibrate").addEventListener("click", () => this.press());
    const on = (name, work) => byId(`calibration-${name}`).addEventListener("click", work);
    on("finish", () => this.send("finish", "POST", "calibration/finish"));
    on("cancel", () => { this.open = false; this.send("cancel", "DELETE", "calibration"); });
    on("again", () => this.begin("again"));
    on("undo", () => this.send("undo", "DELETE", "calibration"));
    on("close", () => this.show(this.open = false));
    on("save", () => this.save());
    on("download", () => this.download());
    this.show();
  }

  start(hello) {
    this.impossible = hello.not_calibratable ?? "";
    this.canSave = hello.can_record !== false;
    this.result = null;
    this.show();
  }

  setConnected(connected) {
    this.connected = connected;
    this.show();
  }

  /** Lock the model while the hand is armed; the service refuses changes too. */
  setLocked(locked) { this.locked = locked; }

  /** Show the document of the service; null from a service that does not calibrate. */
  update(document) {
    const before = this.document;
    this.document = document ?? null;
    if (document && before) {
      const begins = before.state === "idle" && document.state !== "idle";
      if (begins || document.text !== before.text) this.open = begins || document.text !== "";
      if (document.calibrated !== before.calibrated || (document.calibrated && document.text !== before.text)) this.onModel();
    } else if (document && document.state !== "idle") {
      this.open = true;
    }
    this.show();
  }

  press() {
    if (byId("calibrate").disabled) return this.locked ? toast(LOCKED, "bad") : undefined; // by the key C
    if (this.document.state === "idle" && !this.document.calibrated && !this.open) return this.begin("");
    this.open = !this.open;
    return this.show();
  }

  begin(name) { return this.send(name, "POST", "calibration"); }

  // One request at a time: a double click counts once.
  async send(name, method, path, body) {
    const button = byId(name ? `calibration-${name}` : "calibrate");
    if (button.disabled || this.busy) return null;
    this.busy = true;
    try {
      return await callService(method, path, body);
    } catch (error) {
      toast(error.message, "bad");
      return null;
    } finally {
      this.busy = false;
    }
  }

  async save() {
    const answer = await this.send("save", "POST", "calibration/model", {});
    if (answer) toast(`Model written to ${answer.path}`, "good");
  }

  download() {
    const link = document.createElement("a");
    link.href = addressWithToken("api/v1/calibration/model");
    link.download = "calibrated.json";
    link.click();
  }

  show() {
    const { document: now, locked, connected } = this;
    const button = byId("calibrate"), panel = byId("calibration-panel");
    button.disabled = !now || !connected || (locked && !now.calibrated) || Boolean(this.impossible);
    button.title = this.impossible || (locked ? LOCKED : this.title);
    if (!now) { panel.hidden = true; return; }
    const shown = panelOf(now);
    setText(byId("calibrate-text"), shown.button);
    button.setAttribute("aria-pressed", String(now.calibrated));
    const open = (this.open || now.state !== "idle") && Boolean(shown.told);
    button.setAttribute("aria-expanded", String(open));
    panel.hidden = !open;
    setText(byId("calibration-told"), shown.told);
    panel.classList.toggle("refused", Boolean(shown.refused));
    setText(byId("calibration-warning"), shown.warning);
    byId("calibration-warning").hidden = !shown.warning;
    byId("calibration-progress").hidden = !shown.progress;
    setText(byId("calibration-held"), shown.held ?? "");
    Object.assign(byId("calibration-bar"), { max: now.most, value: Math.min(now.seconds, now.most) });
    for (const name of ["finish", "cancel", "again", "save", "download", "undo", "close"]) {
      const one = byId(`calibration-${name}`);
      one.hidden = !shown.buttons.includes(name);
      one.disabled = !connected;
    }
    setText(byId("calibration-finish"), shown.finish ?? "");
    byId("calibration-finish").disabled ||= !shown.ready || locked;
    for (const name of ["again", "undo"]) byId(`calibration-${name}`).disabled ||= locked;
    byId("calibration-save").hidden ||= !this.canSave;
  }
}
