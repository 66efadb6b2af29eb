// Dialogs that decide which labels are kept: those of this page, of an earlier page that could not
// save them, or of another program that saved first. The labels that are not chosen stay in the
// undo history.

import { callService } from "../web/connection.js";
import { byId, make, makeButton, showToast } from "../web/dom.js";
import { countOf, dateText } from "./format.js";

const countLabels = (labels) => countOf(Object.values(labels).flat().length, "label");

let lastAnswer = Promise.resolve();

/** Ask a question; resolve to the value of the pressed button. Questions wait for each other. */
function ask(title, texts, buttons) {
  lastAnswer = lastAnswer.then(() => showQuestion(title, texts, buttons));
  return lastAnswer;
}

function showQuestion(title, texts, buttons) {
  const dialog = byId("question");
  return new Promise((resolve) => {
    const row = make("div", "answers", ...buttons.map(({ value, label }) => {
      const button = makeButton("", () => { dialog.close(); resolve(value); }, label);
      button.dataset.value = value;
      return button;
    }));
    const heading = make("h2", "", title);
    heading.tabIndex = -1;
    dialog.replaceChildren(heading, ...texts.map((text) => make("p", "", text)), row);
    // Escape must not close the dialog without a decision.
    dialog.onkeydown = (event) => event.key === "Escape" && event.preventDefault();
    dialog.showModal();
    // The heading gets the focus: Enter, pressed for a proposal, must not answer the question.
    heading.focus();
  });
}

/** Offer labels that an earlier page could not save. */
export async function offerUnsavedLabels({ editor, saver }, recording, unsaved) {
  const texts = [`This browser keeps ${countLabels(unsaved.labels)} of ${recording.name} from ${dateText(unsaved.time)} that were not saved.`];
  if (unsaved.revision !== recording.revision) {
    texts.push("The label file was changed since then by another page or program. "
      + "Restored labels replace the labels of the file; Undo brings the labels of the file back.");
  }
  const buttons = [{ value: "restore", label: "Restore labels" }, { value: "discard", label: "Discard labels" }];
  const answer = await ask("Unsaved labels", texts, buttons);
  if (answer === "restore") editor.replaceAll(unsaved.labels, unsaved.note ?? "");
  else saver.discardCopy(recording);
}

/** Ask which labels to keep after another page or program has saved the file; then go on saving. */
export async function resolveConflict(page) {
  const { id, generation, editor, saver } = page;
  const file = await callService("GET", `recordings/${id}`).catch((error) => showToast(error.message, "bad"));
  if (!file || generation !== page.generation) return;
  const by = [file.author && ` by ${file.author}`, file.time && `, ${dateText(file.time)}`].filter(Boolean).join("");
  const answer = await ask("The label file was changed by another page or program", [
    `In the file: ${countLabels(file.labels)}${by}.`,
    `On this page: ${countLabels(editor.state.labels)}. Undo brings back the version that you do not choose.`,
  ], [{ value: "file", label: "Use the file" }, { value: "page", label: "Keep this page" }]);
  const own = editor.state;
  // The version of the file enters the undo history in both cases.
  editor.replaceAll(file.labels, file.note);
  saver.resume(file.revision, editor.state);
  page.saveStatus.lastSave = { author: file.author, time: file.time };
  if (answer === "page") editor.replaceAll(own.labels, own.note);
  else saver.update(editor.state);
}
