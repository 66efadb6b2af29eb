"""What a person does on the labelling page, from opening it to having done it."""

import numpy as np
import pytest

from browser import DESKTOP, HOSTILE, on_both, shows, until
from holdfast.labelling.server.store import CAUSE_NAMES, STATE_NAMES
from labelling.page.actions import click, drag, labels, opened, point, position, ready, saved
from labelling.page.fake_service import FINGERS, FakeService, Recording, label
from web.screens import flaws

SPAN = "[holdfast.view.start, holdfast.view.end]"


def proposal(start, end, state, confidence=0.9):
    rule = {"author": "rule:signal", "evidence": "grows"}
    return label(start, end, state, confidence=confidence, **rule)


@on_both
def test_draw_a_label_change_it_undo_and_save(visit, service, size):
    page = opened(visit, service, size)
    drag(page, "index", 8, 16)
    click(page, "index", 12, "labels")
    page.click("#states button[data-value=unstable]")
    page.click("#causes button[data-value=slip]")
    ((start, end, *kind),) = labels(page, "index")
    assert (start, end) == pytest.approx((8, 16), abs=1.5)  # edges snap to change points
    assert kind == ["unstable", "slip"]
    for n_labels, state in ((1, "unstable"), (1, "stable"), (0, None)):
        page.click("#undo")
        assert [each[2] for each in labels(page, "index")] == [state] * n_labels
    assert page.locator("#undo").is_disabled()
    for _ in range(3):
        page.click("#redo")
    saved(page)
    (sent,) = service.saves[-1]["labels"]["index"]
    assert (sent["evidence"], sent["confidence"], sent["author"]) == ("hand", 1, "ada")
    assert flaws(page, size) == []
    page.reload()
    ready(page)
    assert labels(page, "index") == [(start, end, "unstable", "slip")]
    click(page, "index", 12, "labels")
    page.click("#remove")
    assert labels(page, "index") == []


def test_draw_and_zoom_with_the_fingers_on_a_phone(visit, service):
    page = opened(visit, service, (390, 844), has_touch=True)
    touch = page.context.new_cdp_session(page)

    def send(kind, *points):
        touches = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})

    page.locator("#surface").scroll_into_view_if_needed()
    page.touchscreen.tap(*position(page, "thumb", 10))
    assert labels(page) == []
    for kind, time in (("touchStart", 8), ("touchMove", 12), ("touchMove", 16)):
        send(kind, position(page, "index", time))
    send("touchEnd")
    assert len(labels(page, "index")) == 1
    box = page.locator("#overview").bounding_box()
    for kind, share in (("touchStart", 0.3), ("touchMove", 0.5), ("touchMove", 0.7)):
        send(kind, (box["x"] + share * box["width"], box["y"] + box["height"] / 2))
    send("touchEnd")
    assert page.evaluate("holdfast.view.span") < 20
    assert labels(page) == []


def test_label_all_fingers_and_move_edges(visit, service):
    service.recordings[0].save({"thumb": [label(4, 20, "stable", author="eve", evidence="seen")]})
    (change, *_) = [each for each in service.recordings[0].changes["thumb"] if each > 11.5]
    page = opened(visit, service)
    page.keyboard.press("2")
    drag(page, "thumb", 10, 11)  # a new label overwrites others
    parts = [(4, 10, "stable", None), (10, 11, "unstable", None), (11, 20, "stable", None)]
    assert labels(page) == parts
    drag(page, "thumb", 11, change + 0.1, zone="labels")  # an edge snaps to a change point
    assert labels(page)[1][1] == labels(page)[2][0] == round(change, 1)
    drag(page, "thumb", change, change + 0.2, zone="labels", key="Alt")
    assert labels(page)[1][1] == labels(page)[2][0] == round(change + 0.2, 1)
    saved(page)
    authors = [each["author"] for each in service.saves[-1]["labels"]["thumb"]]
    assert authors == ["eve", "ada", "eve"]
    drag(page, "ring", 22, 24)
    page.keyboard.press("a")
    assert [len(labels(page, finger)) for finger in FINGERS] == [4, 1, 1, 1]
    page.keyboard.press("Control+z")
    assert [len(labels(page, finger)) for finger in FINGERS] == [3, 0, 0, 1]
    drag(page, "index", 26, 28, key="Control")
    assert [len(labels(page, finger)) for finger in FINGERS] == [4, 1, 1, 2]


def test_label_with_the_keyboard(visit, service):
    service.recordings[0].save({"thumb": [label(5, 9, "stable")]})
    page = opened(visit, service)
    page.keyboard.press("?")
    page.keyboard.press("3")  # keys do nothing behind the help
    page.keyboard.press("Escape")
    assert page.evaluate("holdfast.editor.nextKind.state") == "stable"
    page.keyboard.press("3")  # of the next label
    assert labels(page) == [(5, 9, "stable", None)]
    click(page, "thumb", 7)
    for key, cause in zip("cdklrs", sorted(CAUSE_NAMES), strict=True):
        page.keyboard.press(key)  # a cause makes a stable label unstable
        assert labels(page) == [(5, 9, "unstable", cause)]
    page.keyboard.press("s")  # the same cause again removes it
    assert labels(page) == [(5, 9, "unstable", None)]
    for key, state in zip("123", STATE_NAMES, strict=True):
        page.keyboard.press(key)
        assert labels(page) == [(5, 9, state, None)]
    page.keyboard.press("Escape")
    drag(page, "thumb", 20, 22)
    click(page, "thumb", 7)
    page.keyboard.press("Delete")
    assert labels(page) == [(20, 22, "no_contact", None)]
    page.keyboard.press("e")
    page.keyboard.type("1 good grasp")  # letters are no shortcuts here
    page.keyboard.press("Escape")
    saved(page)
    assert service.saves[-1]["note"] == "1 good grasp"
    page.keyboard.press("Control+z")
    assert page.locator("#note").input_value() == ""


def test_accept_and_reject_proposals(visit, service):
    service.recordings[0].fields["proposals"] = {
        "thumb": [proposal(5, 7, "unstable"), proposal(7, 9, "stable")],
        "index": [proposal(10, 11, "unstable", 0.3)],
    }
    page = opened(visit, service)
    point(page, "thumb", 8)
    shows(page, "#item", "proposed: stable[\\s\\S]*90[\\s\\S]*rule:signal · grows")
    page.keyboard.press("Enter")
    assert labels(page) == [(7, 9, "stable", None)]
    saved(page)
    accepted = {"confidence": 1, "author": "ada", "evidence": "rule:signal, accepted, grows"}
    assert service.saves[-1]["labels"]["thumb"] == [label(7, 9, "stable", **accepted)]
    page.keyboard.press("x")  # the next one
    shows(page, "#open-proposals", "1 open proposal")
    page.evaluate("holdfast.view.setWindow(12, 14)")
    page.keyboard.press("Enter")  # it is outside the window, and shown first
    assert labels(page) == [(7, 9, "stable", None)]
    page.keyboard.press("Enter")
    assert labels(page) == [(5, 7, "unstable", None), (7, 9, "stable", None)]
    for _ in range(2):
        page.keyboard.press("Control+z")
    shows(page, "#open-proposals", "2 open proposals")
    page.keyboard.press("Control+Shift+z")
    page.reload()
    ready(page)
    shows(page, "#open-proposals", "1 open proposal")  # rejected proposals stay rejected


@on_both
def test_accept_what_a_rule_proposes(visit, service, size):
    recording = service.recordings[0]
    recording.save({"thumb": [label(5, 6, "no_contact", author="eve")]})
    page = opened(visit, service, size, scheme="light")
    page.select_option("#rule", "tracking")
    page.click("#propose")
    shows(page, ".toast.bad", "there are no poses")
    recording.rule_proposals = {
        "thumb": [proposal(4, 9, "stable"), proposal(9, 10, "unstable", 0.7)],
        "ring": [proposal(1, 2, "no_contact", 0.85)],
    }
    page.select_option("#rule", "")
    page.click("#propose")
    shows(page, "#open-proposals", "3 open proposals")
    rules = [request["rule"] for request in service.propose_requests]
    assert rules == ["tracking", ""]
    assert flaws(page, size) == []
    page.emulate_media(color_scheme="dark")
    assert flaws(page, size) == []
    page.click("#accept-all")
    kept = [(4, 5, "stable", None), (5, 6, "no_contact", None), (6, 9, "stable", None)]
    assert labels(page) == kept  # labels that exist stay
    assert labels(page, "ring") == [(1, 2, "no_contact", None)]
    saved(page)
    authors = [each["author"] for each in service.saves[-1]["labels"]["thumb"]]
    assert authors == ["rule:signal", "eve", "rule:signal"]
    page.click("#undo")
    assert labels(page) == [(5, 6, "no_contact", None)]


def test_review_what_has_a_low_confidence(visit, service):
    recording = service.recordings[0]
    recording.save({"thumb": [label(2, 4, "stable", confidence=0.5), label(10, 14, "stable")]})
    recording.fields["proposals"] = {"index": [proposal(20, 21, "unstable", 0.3)]}
    page = opened(visit, service)
    for text in ("proposed: unstable", r"stable[\s\S]*50"):
        page.keyboard.press("g")
        shows(page, "#item", text)
    page.keyboard.press("Enter")  # confirms the label
    shows(page, "#n-review-items", "^1$")
    page.keyboard.press("g")
    page.keyboard.press("x")
    shows(page, "#review-items", "^$")
    saved(page)
    assert [each["confidence"] for each in service.saves[-1]["labels"]["thumb"]] == [1, 1]


def test_play_a_video_beside(visit, tmp_path):
    cv2 = pytest.importorskip("cv2")
    video = tmp_path / "wrist.webm"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"VP80"), 20.0, (64, 48))
    for k in range(30):
        writer.write(np.full((48, 64, 3), 8 * k, np.uint8))
    writer.release()
    media = [{"index": 0, "name": "wrist.webm", "offset": 4.0, "missing": False}]
    at = "Math.abs(document.querySelector('#video').currentTime - {}) < 0.1"
    with FakeService(Recording(media=media), media=video) as service:
        page = opened(visit, service)
        until(page, "document.querySelector('#video').readyState >= 2")
        click(page, "thumb", 4.5)
        until(page, at.format(0.5))
        page.fill("#offset", "4.2")
        page.keyboard.press("Enter")
        until(page, at.format(0.3))
        page.keyboard.press("Escape")
        click(page, "thumb", 3.5)  # before the video begins
        page.keyboard.press(" ")
        until(page, "!document.querySelector('#video').paused")
        assert page.evaluate("holdfast.player.time") > 4.1
        until(page, "holdfast.player.time > 6.5")  # time continues after the end of the video
        page.keyboard.press(" ")
        assert not page.evaluate("holdfast.player.playing")
        assert flaws(page, DESKTOP) == []
        page.reload()
        ready(page)
        assert page.locator("#offset").input_value() == "4.2"


@pytest.mark.parametrize("missing", [True, False])
def test_play_although_the_video_cannot_be_shown(visit, missing):
    media = [{"index": 0, "name": "wrist.webm", "offset": 4.0, "missing": missing}]
    with FakeService(Recording(media=media)) as service:
        page = opened(visit, service)
        shows(page, "#video-problem", "wrist.webm")
        assert page.locator("#video").is_hidden()
        page.evaluate("holdfast.view.setWindow(10, 11)")
        click(page, "thumb", 10.8)
        page.select_option("#rate", "2")
        page.click("#play")
        until(page, "holdfast.view.start > 10.5")  # the window follows
        page.evaluate("holdfast.player.seek(29.9)")
        until(page, "!holdfast.player.playing")
        assert page.evaluate("holdfast.player.time") == service.recordings[0].end


def test_look_at_a_long_recording(visit):
    """Zoom in to single samples; finer signals are loaded, of the newest window only."""
    loaded = " && ".join(f"!holdfast.{each}" for each in ("signals.loading", "signals.timer"))
    with FakeService(Recording(seconds=20_000 / 150), Recording("two", 300)) as service:
        page = opened(visit, service)
        x, y = position(page, "index", 40)
        page.mouse.move(x, y)
        page.mouse.wheel(0, -300)
        until(page, "holdfast.view.span < 80")
        assert position(page, "index", 40)[0] == pytest.approx(x, abs=1.1)  # whole pixels
        for _ in range(8):
            page.mouse.wheel(0, -300)
        shows(page, "#window", "every sample")
        start, end = page.evaluate(SPAN)
        times = page.evaluate("holdfast.signals.columns('index').t")
        signals = service.recordings[0].signals.fingers["index"]
        own = signals.times
        shown = own[(own >= start) & (own <= end)].tolist()
        assert [t for t in times if start <= t <= end] == shown
        k = int(np.searchsorted(own, start)) + 2
        point(page, "index", float(own[k]))  # the values at the cursor
        value = f"^{signals.values[k, 0]:.0f}$"
        shows(page, ".finger-row:nth-child(3) .value", value)
        page.select_option("#force", "xyz")
        shows(page, ".finger-legend", r"Fx[\s\S]*Fy[\s\S]*Fz[\s\S]*σ")
        page.keyboard.press("0")
        assert page.evaluate(SPAN) == [0, service.recordings[0].end]
        until(page, loaded)
        service.requests.clear()
        service.delays = [0.6]
        for start in (40, 60, 70, 80):
            page.evaluate(f"holdfast.view.setWindow({start}, {start + 10})")
            page.wait_for_timeout(100)
        until(page, "holdfast.signals.fine.start > 70")
        assert [round(start) for start, _, _ in service.requests] == [36, 76]
        page.keyboard.press("ArrowRight")  # a small step loads nothing
        until(page, loaded)
        assert len(service.requests) == 2
        page.keyboard.press("-")
        page.keyboard.press("+")
        page.evaluate("holdfast.view.pan(1000)")
        assert page.evaluate("holdfast.view.end") == service.recordings[0].end
        box = page.locator("#overview").bounding_box()
        page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 25)  # the overview moves it
        assert page.evaluate(SPAN) == pytest.approx([61, 71], abs=3)
        until(page, loaded)
        service.delays = [0.3]
        page.evaluate("holdfast.view.setWindow(100, 110)")
        page.wait_for_timeout(60)
        page.keyboard.press("n")  # the reply of the first recording is dropped
        shows(page, "#name", "two")
        page.wait_for_timeout(400)
        assert page.evaluate("[holdfast.signals.fine, holdfast.signals.id]") == [None, 1]


def test_go_through_the_recordings_of_a_folder(visit):
    class Broken(Recording):
        def describe(self, index):
            raise ValueError("no")

        def entry(self, index):
            return super().entry(index) | {"error": "broken.parquet: damaged", "duration": None}

    others = Broken("broken"), Recording("three", fingers=("left", "right"), read_only=True)
    others[1].save({"left": [label(5, 9, "stable")]})
    with FakeService(Recording("one"), *others) as service:
        page = opened(visit, service)
        drag(page, "thumb", 8, 12)
        page.keyboard.press("n")  # the drawn label is saved first
        shows(page, "#name", "broken")
        shows(page, "#alert", "500")
        assert len(service.recordings[0].file["labels"]["thumb"]) == 1
        page.click("#next-recording")
        shows(page, "#name", "three")
        shows(page, "#alert", "Read-only")
        drag(page, "left", 12, 14)
        click(page, "left", 7)
        for key in ("2", "a", "Delete", "Control+z", "Shift+Enter"):
            page.keyboard.press(key)
        assert labels(page, "left") == [(5, 9, "stable", None)]
        assert page.locator("#note").is_disabled()
        page.keyboard.press("n")
        shows(page, "#toasts", "last recording")
        page.reload()
        shows(page, "#name", "three")
        page.click("#recordings button[data-id='0']")
        until(page, "holdfast.editor.fingers.length === 4")
        assert labels(page) == [(8, 12, "stable", None)]
        assert len(service.saves) == 1


def test_names_are_shown_as_text(visit):
    rule = {"author": HOSTILE, "evidence": HOSTILE, "confidence": 0.3}
    media = [{"index": 0, "name": HOSTILE, "offset": 0, "missing": True}]
    hostile = Recording(
        HOSTILE, fingers=(HOSTILE, "thumb"), markers=[(3.0, HOSTILE)], media=media,
        proposals={"thumb": [label(2, 3, "stable", **rule)]},
    )  # fmt: skip
    hostile.save({HOSTILE: [label(4, 5, "unstable", **rule)]}, note=HOSTILE, author=HOSTILE)
    with FakeService(hostile) as service:
        page = opened(visit, service)
        page.keyboard.press("g")
        named = ("#name", ".finger-legend h3", "#recordings")
        for selector in (*named, "#save-text", "#video-problem", "#item"):
            shows(page, selector, "<img src=x onerror=alert")
        assert page.locator("img").count() == 0
