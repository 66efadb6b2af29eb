// The page of the guided protocol: what a person does now, and the keys.

import { callService } from "../web/api.js";
import { byId, setText } from "../web/dom.js";

const INTERVAL = 250; // between two looks at the protocol [ms]

function show(view) {
  setText(byId("title"), view.title);
  setText(byId("place"), view.place);
  setText(byId("words"), view.words);
  setText(byId("hint"), view.hint);
  setText(byId("message"), view.message);
  setText(byId("left"), view.left === null ? "" : `${Math.ceil(view.left)} s`);
  byId("bar").hidden = view.left === null;
  byId("bar").value = view.share;
  if (view.decides) document.body.dataset.passed = String(view.words === "GOOD");
  else delete document.body.dataset.passed;
}

async function refresh() {
  try {
    show(await callService("GET", "teach"));
  } catch (error) {
    setText(byId("message"), error.status ? error.message : "The protocol is over, or cannot be reached.");
    setText(byId("left"), "");
  }
  setTimeout(refresh, INTERVAL);
}

for (const button of document.querySelectorAll("nav button")) {
  button.addEventListener("click", () => {
    if (button.id === "quit" && !window.confirm("Stop here? What was recorded is kept.")) return;
    callService("POST", "markers", { text: button.id }).catch(() => {});
  });
}
refresh();
