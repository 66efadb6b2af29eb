"""labels.js and editor.js: operations on labels, and undo, compared with slow, simple versions."""

import random

import pytest

CALL = "async ([name, given]) => (await import('/page/labels.js'))[name](...given)"
# Run operations on a new editor; check the labels after each, and undo and redo them all.
SESSION = """async ([operations]) => {
  const { Editor } = await import("/page/editor.js");
  const { areValid } = await import("/page/labels.js");
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
    if (what === "draw") {
      editor.select(null, null);
      editor.draw([finger], 33 * x - 1, 33 * y - 1, true);
    }
    if (what === "all") editor.draw(fingers, 30 * x, 30 * y, true);
    const side = x < 0.5 ? "start" : "end", states = ["stable", "unstable", "no_contact"];
    if (what === "edge" && label) editor.moveEdge(finger, label, side, 34 * y - 2, true);
    if (what === "state") editor.setKind({ state: states[Math.floor(3 * x)] });
    if (what === "cause") editor.setKind({ cause: ["slip", "closing"][Math.floor(2 * x)] });
    if (what === "delete") editor.remove();
    if (what === "copy") editor.copy();
    if (what === "accept" && editor.proposals.length) {
      const { proposals } = editor;
      editor.accept({ kind: "proposal", ...proposals[Math.floor(x * proposals.length)] });
    }
    if (what === "reject" && editor.proposals.length) editor.reject(editor.proposals[0]);
    if (what === "fill") editor.acceptAll(x);
    for (const own of Object.values(editor.state.labels)) {
      const outside = own.some((each) => each.start < 0 || each.end > 30.01);
      if (!areValid(own) || outside) bad.push([what, own]);
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


def call(page, name, *given):
    return page.evaluate(CALL, [name, list(given)])


def span(start, end, state="stable", cause=None, **fields):
    return {"start": start, "end": end, "state": state, "cause": cause, **fields}


def states_on_grid(labels, n=40):
    """Return the labelled state of each tenth of a second, and check that none overlap."""
    found = [None] * n
    for each in labels:
        for k in range(round(10 * each["start"]), round(10 * each["end"])):
            assert found[k] is None
            found[k] = each["state"]
    return found


def random_label(rng, n=40):
    start, end = sorted(rng.sample(range(n + 1), 2))
    return span(start / 10, end / 10, rng.choice(["stable", "unstable", "no_contact"]))


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


@pytest.mark.parametrize("seed", range(5))
def test_overwrite_replaces_the_states_of_its_interval(module, seed):
    rng, labels, painted = random.Random(seed), [], [None] * 40
    for _ in range(25):
        new = random_label(rng)
        labels, merged = call(module, "overwrite", labels, new)
        for k in range(round(10 * new["start"]), round(10 * new["end"])):
            painted[k] = new["state"]
        assert states_on_grid(labels) == painted
        assert merged in labels
        # The new label is merged with adjacent labels of the same state.
        assert merged["start"] <= new["start"]
        assert new["end"] <= merged["end"]


@pytest.mark.parametrize("seed", range(5))
def test_fill_gaps_changes_only_unlabelled_times(module, seed):
    rng, labels, painted = random.Random(seed), [], [None] * 40
    for _ in range(12):
        new = random_label(rng)
        labels = call(module, "fillGaps", labels, new)
        for k in range(round(10 * new["start"]), round(10 * new["end"])):
            painted[k] = painted[k] or new["state"]
        assert states_on_grid(labels) == painted


def test_a_label_within_another_splits_it(module):
    labels, _ = call(module, "overwrite", [span(0, 9, author="eve")], span(3, 4, "unstable"))
    assert labels == [span(0, 3, author="eve"), span(3, 4, "unstable"), span(4, 9, author="eve")]


def test_the_same_state_of_another_cause_stays_apart(module):
    given = [span(0, 3, "unstable", "slip")]
    labels, _ = call(module, "overwrite", given, span(2, 5, "unstable", "closing"))
    assert labels == [span(0, 2, "unstable", "slip"), span(2, 5, "unstable", "closing")]


def test_remainders_shorter_than_the_minimum_are_dropped(module):
    labels = call(module, "cut", [span(0, 3)], 0.005, 2.995, 0.01)
    assert labels == []


@pytest.mark.parametrize(
    ("index", "side", "time", "expected"),
    [
        (0, "end", 2, [(0, 2), (4, 6), (6, 9)]),
        (0, "end", 5, [(0, 5), (5, 6), (6, 9)]),
        (0, "end", 7, [(0, 7), (7, 9)]),
        (0, "end", 99, [(0, 10)]),
        (0, "end", -1, [(0, 0.1), (4, 6), (6, 9)]),
        (1, "end", 5, [(0, 3), (4, 5), (5, 9)]),
        (1, "end", 8, [(0, 3), (4, 8), (8, 9)]),
        (2, "start", 5, [(0, 3), (4, 5), (5, 9)]),
        (2, "start", 2, [(0, 2), (2, 9)]),
        (1, "end", 2, [(0, 2), (2, 9)]),  # the same edge, dragged across its own label
        (2, "start", 9.5, [(0, 3), (4, 9.5)]),
        (1, "start", 6, [(0, 3), (5.9, 6), (6, 9)]),
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


@pytest.mark.parametrize(
    ("time", "within", "expected"), [(2.2, 0.3, 2), (2.2, 0.1, 2.2), (2.9, 1, 3), (2.5, 0, 2.5)]
)
def test_snap(module, time, within, expected):
    assert call(module, "snap", time, [1, 2, 3], within) == expected


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
