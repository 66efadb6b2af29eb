// Whose labels count: those of an earlier page that died, or of somebody else. Nothing is lost:
// what is not taken is one step of undo away.

import { callService } from "../web/api.js";
import { ask, toast } from "./dialogs.js";
import { many, whenWord } from "./words.js";

const count = (labels) => many(Object.values(labels).flat().length, "label");

/** Offers what an earlier page could not save. */
export async function rescue({ editor, saver }, recording, found) {
  const texts = [`This browser has ${count(found.labels)} of ${recording.name} from ${whenWord(found.time)} that were never saved.`];
  if (found.revision !== recording.revision) texts.push("The label file has been changed since by somebody else; what is restored is written over it, and Undo brings it back.");
  const answer = await ask("Unsaved labels", texts, [{ value: "restore", label: "Restore them" }, { value: "discard", label: "Discard them" }]);
  if (answer === "restore") editor.replace(found.labels, found.note ?? "");
  else saver.forget(recording);
}

/** Asks whose labels count when somebody else has saved, and goes on from there. */
export async function settle(page) {
  const { id, turn, editor, saver } = page;
  let theirs;
  try {
    theirs = await callService("GET", `recordings/${id}`);
  } catch (error) {
    toast(error.message, "bad");
    return;
  }
  if (turn !== page.turn) return;
  const by = [theirs.author && ` by ${theirs.author}`, theirs.time && `, ${whenWord(theirs.time)}`].filter(Boolean).join("");
  const answer = await ask("Somebody else has saved labels for this recording", [
    `On the disk: ${count(theirs.labels)}${by}.`,
    `On this page: ${count(editor.state.labels)}. Whatever you take, Undo brings the other back.`,
  ], [{ value: "theirs", label: "Take theirs" }, { value: "mine", label: "Keep mine" }]);
  const mine = editor.state;
  // Theirs comes first in any case, so that it can be undone to.
  editor.replace(theirs.labels, theirs.note);
  saver.decide(theirs.revision, editor.state);
  page.state.by = { author: theirs.author, time: theirs.time };
  if (answer === "mine") editor.replace(mine.labels, mine.note);
  else saver.touch(editor.state);
}
