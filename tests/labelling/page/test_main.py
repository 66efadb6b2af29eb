"""The whole labelling page in a browser, with a fake service."""

import pytest

from labelling.page.actions import (
    click,
    drag,
    labels,
    point,
    position,
    ready,
    rounded,
    saved,
    shows,
    until,
)
from labelling.page.fake_service import FINGERS, FakeService, Recording, label

SIZES = [(1280, 720), (1024, 768), (1920, 1080)]
HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.mark.parametrize(
    ("size", "scheme"), list(zip(SIZES, ("dark", "light", "dark"), strict=True))
)
def test_four_fingers_fit_without_scrolling(visit, service, size, scheme):
    page = visit(service.url, size, scheme)
    ready(page)
    extent = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
    assert page.evaluate(extent) == list(size)
    rows, height = page.evaluate(
        "[holdfast.plot.rows.length, document.querySelector('#rows').clientHeight]"
    )
    assert rows == 4
    assert page.evaluate("holdfast.plot.height") == height
    clipped = page.evaluate(
        """() => [...document.querySelectorAll("button, .finger-legend, .finger-legend *, select")]
          .filter((e) => e.offsetParent && e.scrollWidth > e.clientWidth + 1)
          .filter((e) => getComputedStyle(e).display !== "inline")
          .map((e) => `${e.className} ${e.textContent}`)"""
    )
    assert clipped == []
    small = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select")]
          .filter((e) => e.offsetParent && !e.closest(".status-bar, .list"))
          .map((e) => e.getBoundingClientRect())
          .filter((r) => Math.min(r.width, r.height) < 43.9).length"""
    )
    assert small == 0


def test_label_undo_redo_save_and_reload(visit, service):
    page = visit(service.url)
    ready(page)
    drag(page, "index", 8, 12)
    page.keyboard.press("2")
    page.keyboard.press("s")
    drag(page, "index", 14, 15)
    first, second = labels(page, "index")
    assert rounded([first, second]) == [(8, 12, "stable", None), (14, 15, "unstable", "slip")]
    page.keyboard.press("Control+z")
    assert labels(page, "index") == [first]
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")  # nothing is left to undo
    assert labels(page, "index") == []
    page.keyboard.press("Control+Shift+z")
    page.keyboard.press("Control+y")
    assert labels(page, "index") == [first, second]
    saved(page)
    by_hand = {"evidence": "hand", "confidence": 1, "author": "ada"}
    assert service.saves[-1] == {
        "labels": {
            "thumb": [], "middle": [], "ring": [],
            "index": [label(*first, **by_hand), label(*second, **by_hand)],
        },
        "note": "", "author": "ada", "revision": f"r{len(service.saves) - 1}",
    }  # fmt: skip
    page.reload()
    ready(page)
    assert labels(page, "index") == [first, second]
    shows(page, "#save-text", "saved by ada")


SLIP_COLUMNS = """() => {
  const canvas = holdfast.plot.canvases.labels, [, bottom] = holdfast.plot.rows[0].labels;
  const ratio = canvas.width / holdfast.plot.view.width, context = canvas.getContext("2d");
  const style = getComputedStyle(document.documentElement).getPropertyValue("--slip").trim();
  const wanted = [1, 3, 5].map((k) => parseInt(style.slice(k, k + 2), 16));
  const y = Math.round(ratio * (bottom - 2));
  const row = context.getImageData(0, y, canvas.width, 1).data;
  const columns = [];
  for (let x = 0; x < canvas.width; x += 1) {
    if (wanted.every((value, k) => row[4 * x + k] === value)) columns.push(x / ratio);
  }
  return [columns, [8, 10, 12, 12.02].map((time) => holdfast.plot.view.x(time))];
}"""


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_a_slip_within_a_disturbance_is_drawn_apart_and_kept_apart(
    visit, service, scheme, tmp_path
):
    parts = [
        (6, 8, "disturbance"), (8, 10, "slip"), (10, 12, "disturbance"),
        (12, 12.02, "slip"), (12.02, 14, "disturbance"),
    ]  # fmt: skip
    service.recordings[0].save(
        {"thumb": [label(start, end, "unstable", cause) for start, end, cause in parts]}
    )
    page = visit(service.url, scheme=scheme)
    ready(page)
    page.wait_for_timeout(100)
    page.screenshot(path=tmp_path / "page.png")
    columns, (start, end, short, short_end) = page.evaluate(SLIP_COLUMNS)
    long = [x for x in columns if x < (end + short) / 2]
    assert (min(long), max(long)) == (pytest.approx(start, abs=2), pytest.approx(end, abs=2))
    assert short_end - short < 2  # too narrow for a text, and still drawn
    narrow = [x for x in columns if x not in long]
    assert narrow
    assert narrow == pytest.approx([short] * len(narrow), abs=2)
    drag(page, "thumb", 20, 22)
    page.keyboard.press("2")
    saved(page)
    kept = [(x["start"], x["end"], x["cause"]) for x in service.saves[-1]["labels"]["thumb"][:5]]
    assert kept == parts


def test_keys_change_the_clicked_label_or_the_next_label(visit, service):
    service.recordings[0].save({"thumb": [label(5, 9, "stable")]})
    page = visit(service.url)
    ready(page)
    page.keyboard.press("3")
    shows(page, "#edited-label", "next")
    assert rounded(labels(page)) == [(5, 9, "stable", None)]
    click(page, "thumb", 7)
    shows(page, "#edited-label", "this")
    page.keyboard.press("2")
    page.keyboard.press("d")
    assert labels(page) == [(5, 9, "unstable", "disturbance")]
    page.keyboard.press("d")  # the same cause again removes it
    page.keyboard.press("1")
    page.keyboard.press("l")  # a cause makes a stable label unstable
    assert labels(page) == [(5, 9, "unstable", "lost")]
    page.keyboard.press("Escape")
    drag(page, "thumb", 20, 22)
    assert rounded(labels(page))[1] == (20, 22, "no_contact", None)
    click(page, "thumb", 7)
    page.keyboard.press("Delete")
    assert rounded(labels(page)) == [(20, 22, "no_contact", None)]


def test_a_new_label_overwrites_others(visit, service):
    service.recordings[0].save({"thumb": [label(4, 20, "stable", author="eve", evidence="seen")]})
    page = visit(service.url)
    ready(page)
    page.click("#states button[data-value=unstable]")
    page.click("#causes button[data-value=slip]")
    drag(page, "thumb", 10, 11)
    parts = [(4, 10, "stable", None), (10, 11, "unstable", "slip"), (11, 20, "stable", None)]
    assert rounded(labels(page)) == parts
    saved(page)
    authors = [each["author"] for each in service.saves[-1]["labels"]["thumb"]]
    assert authors == ["eve", "ada", "eve"]
    page.click("#states button[data-value=stable]")
    drag(page, "thumb", 9, 12)
    assert rounded(labels(page)) == [(4, 20, "stable", None)]


def test_one_label_for_all_fingers(visit, service):
    page = visit(service.url)
    ready(page)
    drag(page, "ring", 8, 12)
    page.keyboard.press("a")
    first = labels(page, "ring")
    assert [labels(page, finger) for finger in FINGERS] == [first] * 4
    page.keyboard.press("Control+z")
    assert [len(labels(page, finger)) for finger in FINGERS] == [0, 0, 0, 1]
    page.keyboard.press("2")
    drag(page, "thumb", 14, 16, keys=["Control"])
    assert [len(labels(page, finger)) for finger in FINGERS] == [1, 1, 1, 2]


def test_edges_move_and_snap_to_change_points(visit, service):
    around = [label(6, 9, "stable"), label(9, 12, "unstable", "slip")]
    service.recordings[0].save({"thumb": around})
    (change, *_) = [each for each in service.recordings[0].changes["thumb"] if each > 6.5]
    page = visit(service.url)
    ready(page)
    drag(page, "thumb", 9, change + 0.1, zone="labels")
    assert labels(page) == [(6, change, "stable", None), (change, 12, "unstable", "slip")]
    drag(page, "thumb", change, change + 0.25, zone="labels", keys=["Alt"])
    (moved,) = {labels(page)[0][1], labels(page)[1][0]}
    assert 0.15 < moved - change < 0.35
    drag(page, "thumb", moved, 30, zone="labels")  # beyond the neighbour
    assert rounded(labels(page))[0][:1] == (6,)
    assert len(labels(page)) == 1
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    assert labels(page) == [(6, 9, "stable", None), (9, 12, "unstable", "slip")]


def test_proposals_are_accepted_and_rejected(visit, service):
    recording = service.recordings[0]
    rule = {"confidence": 0.9, "author": "rule:signal", "evidence": "grows"}
    recording.fields["proposals"] = {
        "thumb": [label(5, 7, "unstable", "closing", **rule), label(7, 9, "stable", **rule)],
        "index": [label(10, 11, "unstable", **{**rule, "confidence": 0.3})],
    }
    page = visit(service.url)
    ready(page)
    point(page, "thumb", 8)
    shows(page, "#item", "proposed: stable[\\s\\S]*90[\\s\\S]*rule:signal · grows")
    page.keyboard.press("Enter")
    assert labels(page) == [(7, 9, "stable", None)]
    saved(page)
    accepted = {"confidence": 1, "author": "ada", "evidence": "rule:signal, accepted, grows"}
    assert service.saves[-1]["labels"]["thumb"] == [label(7, 9, "stable", **accepted)]
    shows(page, "#item", "index · 10.000")  # the next proposal
    page.keyboard.press("x")
    shows(page, "#open-proposals", "1 open proposal")
    page.keyboard.press("Enter")
    assert labels(page) == [(5, 7, "unstable", "closing"), (7, 9, "stable", None)]
    shows(page, "#open-proposals", "no open")
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    shows(page, "#open-proposals", "2 open proposals")
    page.keyboard.press("Control+Shift+z")
    page.reload()
    ready(page)
    shows(page, "#open-proposals", "1 open proposal")  # rejected proposals stay rejected


def test_accepting_all_proposals_keeps_existing_labels(visit, service):
    recording = service.recordings[0]
    recording.save({"thumb": [label(5, 6, "no_contact", author="eve")]})
    rule = {"author": "rule:signal"}
    recording.rule_proposals = {
        "thumb": [label(4, 9, "stable", confidence=0.9, **rule),
                  label(9, 10, "unstable", confidence=0.7, **rule)],
        "ring": [label(1, 2, "no_contact", confidence=0.85, **rule)],
    }  # fmt: skip
    page = visit(service.url)
    ready(page)
    page.click("#propose")
    shows(page, "#open-proposals", "3 open proposals")
    assert service.propose_requests == [{"rule": "", "parameters": {}}]
    page.keyboard.press("Shift+Enter")
    assert labels(page) == [
        (4, 5, "stable", None), (5, 6, "no_contact", None), (6, 9, "stable", None),
    ]  # fmt: skip
    assert labels(page, "ring") == [(1, 2, "no_contact", None)]
    saved(page)
    authors = [each["author"] for each in service.saves[-1]["labels"]["thumb"]]
    assert authors == ["rule:signal", "eve", "rule:signal"]
    page.keyboard.press("Control+z")
    assert labels(page) == [(5, 6, "no_contact", None)]


def test_the_error_of_a_rule_is_shown(visit, service):
    page = visit(service.url)
    ready(page)
    page.select_option("#rule", "tracking")
    page.click("#propose")
    shows(page, ".toast.bad", "there are no poses")
    assert service.propose_requests == [{"rule": "tracking", "parameters": {}}]


def test_a_proposal_outside_the_window_is_shown_before_it_is_accepted(visit, service):
    service.recordings[0].fields["proposals"] = {"thumb": [label(20, 21, "stable", confidence=0.9)]}
    page = visit(service.url)
    ready(page)
    page.evaluate("holdfast.view.setWindow(2, 4)")
    page.keyboard.press("Enter")
    assert labels(page) == []
    assert page.evaluate("holdfast.view.contains({ start: 20, end: 21 })")
    page.keyboard.press("Enter")
    assert labels(page) == [(20, 21, "stable", None)]


def test_items_to_review_one_after_the_other(visit, service):
    recording = service.recordings[0]
    recording.save({"thumb": [label(2, 4, "stable", confidence=0.5), label(10, 14, "stable")]})
    recording.fields["proposals"] = {"index": [label(20, 21, "unstable", confidence=0.3)]}
    page = visit(service.url)
    ready(page)
    shows(page, "#n-review-items", "^2$")
    for text in ("proposed: unstable", r"stable[\s\S]*50"):
        page.keyboard.press("g")
        shows(page, "#item", text)
    page.keyboard.press("Enter")  # confirms the label of low confidence
    shows(page, "#n-review-items", "^1$")
    click(page, "thumb", 13)
    page.keyboard.press("2")
    page.keyboard.press("g")
    page.keyboard.press("x")
    shows(page, "#review-items", "^$")
    saved(page)
    thumb = service.saves[-1]["labels"]["thumb"]
    assert [(each["state"], each["confidence"]) for each in thumb] == [
        ("stable", 1), ("unstable", 1),
    ]  # fmt: skip


def test_labels_inside_a_recording_count_as_labelled(visit):
    one, two = Recording("one"), Recording("two")
    held = {"start": 1.0, "end": 2.0, "state": "stable", "cause": None, "evidence": "",
            "confidence": 1.0, "author": "ann"}  # fmt: skip
    one.file = {**one.file, "labels": {**one.file["labels"], "thumb": [held]}}
    with FakeService(one, two) as service:
        page = visit(service.url)
        ready(page)
        shows(page, "#progress", "^1 of 2 labelled, 1 as imported$")


def test_the_next_recording(visit):
    with FakeService(Recording("one"), Recording("two", fingers=("left", "right"))) as service:
        page = visit(service.url)
        ready(page)
        drag(page, "thumb", 8, 12)
        page.keyboard.press("n")  # the drawn label is saved first
        shows(page, "#name", "two")
        until(page, "holdfast.plot.rows.length === 2")
        (sent,) = service.saves[-1]["labels"]["thumb"]
        assert rounded([(sent["start"], sent["end"], sent["state"])]) == [(8, 12, "stable")]
        shows(page, "#progress", "1 of 2 labelled")
        page.keyboard.press("n")
        shows(page, ".toast", "last recording")
        page.reload()
        shows(page, "#name", "two")
        page.click("#recordings button[data-id='0']")
        shows(page, "#name", "one")
        until(page, "holdfast.editor.fingers.length === 4")
        assert rounded(labels(page)) == [(8, 12, "stable", None)]


def test_read_only(visit, service):
    service.recordings[0].save({"thumb": [label(5, 9, "stable")]})
    service.recordings[0].fields["read_only"] = True
    page = visit(service.url)
    ready(page)
    shows(page, "#alert", "Read-only")
    drag(page, "thumb", 12, 14)
    click(page, "thumb", 7)
    for key in ("2", "a", "Delete", "Control+z", "Shift+Enter"):
        page.keyboard.press(key)
    assert labels(page) == [(5, 9, "stable", None)]
    assert page.locator("#note").is_disabled()
    assert page.locator("#states button").first.is_disabled()
    page.wait_for_timeout(600)
    assert service.saves == []


def test_names_are_shown_as_text(visit):
    rule = {"author": HOSTILE, "evidence": HOSTILE, "confidence": 0.3}
    hostile = Recording(
        HOSTILE, fingers=(HOSTILE, "thumb"), proposals={"thumb": [label(2, 3, "stable", **rule)]},
        markers=[(3.0, HOSTILE)],
        media=[{"index": 0, "name": HOSTILE, "offset": 0, "missing": True}],
    )  # fmt: skip
    hostile.save({HOSTILE: [label(4, 5, "unstable", **rule)]}, note=HOSTILE, author=HOSTILE)
    with FakeService(hostile) as service:
        page = visit(service.url)
        ready(page)
        page.keyboard.press("g")
        named = ("#name", ".finger-legend h3", "#recordings")
        for selector in (*named, "#save-text", "#video-problem", "#item"):
            shows(page, selector, "<img src=x onerror=alert")
        assert page.locator("#note").input_value() == HOSTILE
        assert page.locator("img").count() == 0


def test_a_recording_that_cannot_be_read(visit):
    class Broken(Recording):
        def describe(self, index):
            raise ValueError("no")

        def entry(self, index):
            return super().entry(index) | {"error": "broken.parquet: damaged", "duration": None}

    with FakeService(Recording("good"), Broken("broken")) as service:
        page = visit(service.url)
        ready(page)
        shows(page, "#recordings li:nth-child(2)", "not readable")
        page.keyboard.press("n")
        shows(page, "#alert", "500")
        shows(page, "#name", "broken")
        assert page.evaluate("holdfast.editor.fingers.length") == 0
        page.keyboard.press("p")
        until(page, "holdfast.editor.fingers.length === 4")
        assert page.locator("#alert").is_hidden()


def test_the_note_is_saved(visit, service):
    page = visit(service.url)
    ready(page)
    page.keyboard.press("e")
    page.keyboard.type("1 good grasp")  # letters are no shortcuts here
    page.keyboard.press("Escape")
    saved(page)
    assert service.saves[-1]["note"] == "1 good grasp"
    assert service.saves[-1]["labels"] == {finger: [] for finger in FINGERS}
    page.keyboard.press("Control+z")
    assert page.locator("#note").input_value() == ""


def test_shortcuts_are_off_while_the_help_is_open(visit, service):
    page = visit(service.url)
    ready(page)
    page.keyboard.press("?")
    shows(page, "#help-box", "accept the proposal under the pointer")
    page.keyboard.press("3")
    page.keyboard.press("Escape")
    assert page.locator("#help-box").is_hidden()
    assert page.evaluate("holdfast.editor.nextKind.state") == "stable"


def test_draw_and_pinch_on_a_touch_screen(visit, service):
    page = visit(service.url, has_touch=True)
    ready(page)
    page.touchscreen.tap(*position(page, "thumb", 10))
    assert labels(page) == []
    touch = page.context.new_cdp_session(page)

    def send(kind, *times):
        points = [dict(zip("xy", position(page, "index", time), strict=True)) for time in times]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    send("touchStart", 8)
    send("touchMove", 10)
    send("touchMove", 12)
    send("touchEnd")
    assert rounded(labels(page, "index")) == [(8, 12, "stable", None)]
    left, right = (position(page, "thumb", time) for time in (14, 16))
    both = [dict(zip("xy", each, strict=True)) | {"id": k} for k, each in enumerate((left, right))]
    apart = [both[0] | {"x": left[0] - 60}, both[1] | {"x": right[0] + 60}]
    for kind, points in (("touchStart", both[:1]), ("touchStart", both), ("touchMove", apart),
                         ("touchEnd", [])):  # fmt: skip
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    assert page.evaluate("holdfast.view.span") < 20
    assert len(labels(page)) == 0
