"""labels.js and editor.js: operations on labels, and undo, compared with slow, simple versions."""

import random

import pytest

CALL = "async ([name, given]) => (await import('/page/labels.js'))[name](...given)"
# Run operations on a new editor; check the labels after each, and undo and redo them all.
SESSION = """async ([operations]) => {
  const { Editor } = await import("/page/editor.js");
  const editor = new Editor(() => {});
  const fingers = ["a", "b"], labels = { a: [], b: [] };
  const proposals = { a: [], b: [] };
  for (let k = 0; k < 8; k += 1) {
    proposals[fingers[k % 2]].push({ start: 3 * k + 0.5, end: 3 * k + 3.5, state: "stable",
                                     cause: null, evidence: "", confidence: k / 8, author: "r" });
  }
  editor.open({ fingers, labels, proposals, start: 0, end: 30, rate: 100,
                read_only: false }, "ada", []);
  const text = () => JSON.stringify([editor.state.labels, [...editor.state.rejected]]);
  const seen = [text()], bad = [];
  const pick = (finger, fraction) => {
    const own = editor.state.labels[finger];
    return own[Math.floor(fraction * own.length)];
  };
  for (const [what, finger, x, y, z] of operations) {
    const label = pick(finger, z), before = editor.state;
    if (label) editor.select(finger, label);
    if (what === "draw") editor.draw([finger], 33 * x - 1, 33 * y - 1, true);
    if (what === "all") editor.draw(fingers, 30 * x, 30 * y, true);
    const side = x < 0.5 ? "start" : "end", states = ["stable", "unstable", "no_contact"];
    if (what === "edge" && label) editor.moveEdge(finger, label, side, 34 * y - 2, true);
    if (what === "state") editor.setKind({ state: states[Math.floor(3 * x)] });
    if (what === "cause") editor.setKind({ cause: ["slip", "closing"][Math.floor(2 * x)] });
    if (what === "delete") editor.remove();
    if (what === "copy") editor.copy();
    const [proposal] = editor.proposals;
    if (what === "accept" && proposal) editor.accept({ kind: "proposal", ...proposal });
    if (what === "reject" && proposal) editor.reject(proposal);
    if (what === "fill") editor.acceptAll(x);
    for (const own of Object.values(editor.state.labels)) {
      const valid = own.every(({ start, end }, k) => start >= (own[k - 1]?.end ?? 0)
        && start < end && end <= 30.01);
      if (!valid) bad.push([what, own]);
    }
    if (editor.state !== before) seen.push(text());
  }
  const back = [text()], forth = [];
  while (editor.history.past.length) { editor.undo(); back.push(text()); }
  while (editor.history.future.length) { editor.redo(); forth.push(text()); }
  const n = Object.values(editor.state.labels).flat().length;
  return { bad, n, n_states: seen.length, undone: back.reverse().join() === seen.join(),
           redone: forth.join() === seen.slice(1).join() };
}"""
OPERATIONS = (
    "draw", "draw", "draw", "all", "edge", "edge", "edge", "state", "cause", "delete", "copy",
    "accept", "reject", "fill",
)  # fmt: skip


def span(start, end, state="stable", cause=None, **fields):
    return {"start": start, "end": end, "state": state, "cause": cause, **fields}


@pytest.mark.parametrize("seed", range(5))
def test_random_operations_keep_labels_valid_and_can_be_undone(module, seed):
    rng = random.Random(seed)
    operations = [
        (rng.choice(OPERATIONS), rng.choice("ab"), *(rng.random() for _ in range(3)))
        for _ in range(200)
    ]
    found = module.evaluate(SESSION, [operations])
    assert found["bad"] == []
    assert found["n_states"] > 80
    assert found["n"] > 0
    assert found["undone"]
    assert found["redone"]


@pytest.mark.parametrize("operation", ["overwrite", "fillGaps"])
@pytest.mark.parametrize("seed", range(3))
def test_an_added_label_replaces_states_or_fills_gaps(module, operation, seed):
    """Compared with a list of the state of each second."""
    rng, labels, painted = random.Random(seed), [], [None] * 40
    for _ in range(20):
        start, end = sorted(rng.sample(range(41), 2))
        new = span(start, end, rng.choice(["stable", "unstable", "no_contact"]))
        found = module.evaluate(CALL, [operation, [labels, new]])
        labels = found[0] if operation == "overwrite" else found
        for k in range(start, end):
            painted[k] = new["state"] if operation == "overwrite" else painted[k] or new["state"]
        states = [[x["state"] for x in labels if x["start"] <= k < x["end"]] for k in range(40)]
        assert states == [[state] if state else [] for state in painted]


@pytest.mark.parametrize(
    ("index", "side", "time", "expected"),
    [
        (0, "end", 5, [(0, 5), (5, 6), (6, 9)]),
        (0, "end", 99, [(0, 10)]),
        (0, "end", -1, [(0, 0.1), (4, 6), (6, 9)]),
        (1, "end", 5, [(0, 3), (4, 5), (5, 9)]),
        (1, "end", 8, [(0, 3), (4, 8), (8, 9)]),
        (2, "start", 5, [(0, 3), (4, 5), (5, 9)]),
        (1, "end", 2, [(0, 2), (2, 9)]),  # the same edge, dragged across its own label
        (2, "start", 9.5, [(0, 3), (4, 9.5)]),
        (1, "start", -5, [(0, 6), (6, 9)]),
    ],
)
def test_move_edge(module, index, side, time, expected):
    found = module.evaluate(
        """async ([labels, index, side, time]) => {
          const { moveEdge } = await import("/page/labels.js");
          const bounds = { low: 0, high: 10, minDuration: 0.1 };
          return moveEdge(labels, labels[index], side, time, bounds)[0];
        }""",
        [[span(0, 3), span(4, 6, "unstable"), span(6, 9, "no_contact")], index, side, time],
    )
    edges = [edge for each in found for edge in (each["start"], each["end"])]
    assert edges == pytest.approx([edge for each in expected for edge in each])


def test_consecutive_changes_of_one_tag_are_undone_together(module):
    found = module.evaluate("""async () => {
      const { History } = await import("/page/editor.js"), history = new History("");
      for (const text of ["a", "ab", "abc"]) history.change(text, "note");
      history.change("label");
      history.undo();
      const one = history.state;
      history.undo();
      return [one, history.state, history.undo()];
    }""")
    assert found == ["abc", "", False]
