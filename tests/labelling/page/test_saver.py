"""saver.js and conflicts.js: saving, conflicts, refused saves, and labels after a crash."""

import pytest

from browser import shows, until
from labelling.page.actions import drag, labels, opened, ready, saved
from labelling.page.fake_service import FakeService, Recording, label

OWN = (8, 12, "stable", None)
OTHERS = (20, 25, "unstable", "slip")


@pytest.mark.parametrize("choice", ["file", "page"])
def test_another_program_saves_meanwhile(visit, service, choice):
    page = opened(visit, service)
    (recording,) = service.recordings
    recording.save({"thumb": [label(*OTHERS, author="eve")]}, note="other note")
    drag(page, "thumb", 8, 12)
    shows(page, "#question", r"1 label by eve")
    shows(page, "#save-text", "NOT SAVED")
    page.keyboard.press("Escape")  # does not close the dialog
    assert labels(page) == [OWN]
    page.click(f"#question button[data-value={choice}]")
    saved(page)
    kept, other = (OTHERS, OWN) if choice == "file" else (OWN, OTHERS)
    assert labels(page) == [kept]
    assert page.locator("#note").input_value() == ("other note" if choice == "file" else "")
    page.keyboard.press("Control+z")  # brings back the other version
    assert labels(page) == [other]
    saved(page)
    until(page, "holdfast.saver.revision === 'r2' || holdfast.saver.revision === 'r3'")
    (sent,) = recording.file["labels"]["thumb"]
    assert sent["state"] == other[2]
    page.reload()
    ready(page)
    assert page.locator("#question").is_hidden()
    assert labels(page) == [other]


@pytest.mark.parametrize("answer", ["restore", "discard"])
def test_unsaved_labels_are_offered_after_a_crash(visit, service, answer):
    service.refusal = (500, "the disk is full")
    page = opened(visit, service)
    drag(page, "thumb", 8, 12)
    page.keyboard.press("e")
    page.keyboard.type("half done")
    shows(page, "#alert", "the disk is full")
    page.close()
    service.recordings[0].save({"thumb": [label(*OTHERS)]})
    again = visit(service.url, context=page.context)
    shows(again, "#question", r"1 label of grasp[\s\S]*changed since then")
    service.refusal = None
    again.click(f"#question button[data-value={answer}]")
    saved(again)
    expected = (OWN, "half done") if answer == "restore" else (OTHERS, "")
    for _ in range(2):
        found = labels(again), again.locator("#note").input_value()
        assert found == ([expected[0]], expected[1])
        again.reload()
        ready(again)
        assert again.locator("#question").is_hidden()


def test_saving_is_repeated_until_the_service_answers(visit):
    recording = Recording()
    with FakeService(recording) as first:
        page = opened(visit, first)
    drag(page, "thumb", 8, 12)
    shows(page, "#save-text", "NOT SAVED")
    with FakeService(recording, port=first.port) as again:
        saved(page)
        assert page.locator("#alert").is_hidden()
        assert len(recording.file["labels"]["thumb"]) == 1
        page.evaluate("for (const k of [1, 3, 5]) holdfast.editor.draw(['thumb'], k, k + 1, true)")
        saved(page)  # quick changes together
        page.keyboard.press("Control+z")
        page.keyboard.press("Control+Shift+z")  # before it is saved
        page.wait_for_timeout(600)
        assert [len(save["labels"]["thumb"]) for save in again.saves] == [1, 4]


def test_a_refused_save_is_shown_and_not_repeated(visit):
    with FakeService(Recording("one"), Recording("two")) as service:
        service.refusal = (422, "thumb: <b>no</b>")
        page = opened(visit, service)
        drag(page, "thumb", 8, 12)
        shows(page, "#save-text", "thumb: <b>no</b>$")
        page.wait_for_timeout(1500)
        assert len(service.saves) == 1
        page.keyboard.press("n")
        shows(page, "#name", "two")
        service.refusal = None
        page.keyboard.press("p")  # it is offered when the recording is opened again
        page.click("#question button[data-value=restore]")
        saved(page)
        assert labels(page) == [OWN]
