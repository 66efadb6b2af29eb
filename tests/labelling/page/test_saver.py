"""saver.js and conflicts.js: saving, conflicts, refused saves, and labels after a crash."""

from labelling.page.actions import drag, labels, ready, rounded, saved, shows, until
from labelling.page.fake_service import FakeService, Recording, label

OWN = (8, 12, "stable", None)
OTHERS = [label(20, 25, "unstable", "slip", author="eve")]


def test_a_conflict_can_be_resolved_with_the_file(visit, service):
    page = visit(service.url)
    ready(page)
    service.recordings[0].save({"thumb": OTHERS}, note="other note")
    drag(page, "thumb", 8, 12)
    shows(page, "#question", r"another page or program[\s\S]*1 label by eve[\s\S]*1 label\.")
    shows(page, "#save-text", "NOT SAVED")
    page.keyboard.press("Escape")  # does not close the dialog
    page.click("#question button[data-value=file]")
    assert labels(page) == [(20, 25, "unstable", "slip")]
    assert page.locator("#note").input_value() == "other note"
    saved(page)
    shows(page, "#save-text", "saved by eve")
    assert len(service.saves) == 1
    page.keyboard.press("Control+z")  # restores the labels of this page
    assert rounded(labels(page)) == [OWN]
    saved(page)
    assert service.recordings[0].file["author"] == "ada"
    page.reload()
    ready(page)
    assert page.locator("#question").is_hidden()
    assert rounded(labels(page)) == [OWN]


def test_a_conflict_can_be_resolved_with_this_page(visit, service):
    page = visit(service.url)
    ready(page)
    service.recordings[0].save({"thumb": OTHERS})
    drag(page, "thumb", 8, 12)
    shows(page, "#question", "changed by another page or program")
    assert service.recordings[0].file["labels"] == {"thumb": OTHERS}
    page.click("#question button[data-value=page]")
    saved(page)
    until(page, "holdfast.saver.revision === 'r2'")
    (sent,) = service.recordings[0].file["labels"]["thumb"]
    assert sent["state"] == "stable"
    page.keyboard.press("Control+z")
    assert labels(page) == [(20, 25, "unstable", "slip")]


def test_two_pages_that_save_the_same_file(visit, service):
    one = visit(service.url)
    two = visit(service.url)
    ready(one)
    ready(two)
    drag(one, "thumb", 8, 12)
    saved(one)
    drag(two, "index", 8, 12)
    shows(two, "#question", "1 label by ada")
    two.click("#question button[data-value=file]")
    drag(two, "index", 8, 12)
    saved(two)
    assert rounded(labels(two)) == [OWN]
    assert len(service.recordings[0].file["labels"]["index"]) == 1


def test_unsaved_labels_are_offered_after_a_crash(visit, service):
    service.refusal = (500, "the disk is full")
    page = visit(service.url)
    ready(page)
    drag(page, "thumb", 8, 12)
    page.keyboard.press("e")
    page.keyboard.type("half done")
    shows(page, "#alert", "Not saved: the disk is full")
    page.close()
    again = visit(service.url, context=page.context)
    shows(again, "#question", "1 label of grasp")
    service.refusal = None
    assert labels(again) == []
    again.click("#question button[data-value=restore]")
    assert rounded(labels(again)) == [OWN]
    assert again.locator("#note").input_value() == "half done"
    saved(again)
    assert service.saves[-1]["note"] == "half done"
    again.reload()
    ready(again)
    assert again.locator("#question").is_hidden()
    assert rounded(labels(again)) == [OWN]


def test_labels_of_a_page_that_never_saved_can_be_discarded(visit, service):
    page = visit(service.url)
    ready(page)
    # Neither the delayed save nor the save at closing reaches the service.
    page.evaluate("""() => {
      window.setTimeout = () => 0;
      window.fetch = () => new Promise(() => {});
    }""")
    drag(page, "thumb", 8, 12)
    page.close()
    assert service.saves == []
    service.recordings[0].save({"thumb": OTHERS})
    again = visit(service.url, context=page.context)
    shows(again, "#question", "changed since then by another page or program")
    again.click("#question button[data-value=discard]")
    assert labels(again) == [(20, 25, "unstable", "slip")]
    again.reload()
    ready(again)
    assert again.locator("#question").is_hidden()


def test_saving_is_repeated_until_the_service_answers(visit):
    recording = Recording()
    with FakeService(recording) as first:
        page = visit(first.url)
        ready(page)
    drag(page, "thumb", 8, 12)
    shows(page, "#save-text", "NOT SAVED: the service does not answer")
    with FakeService(recording, port=first.port):
        saved(page)
        assert page.locator("#alert").is_hidden()
        assert len(recording.file["labels"]["thumb"]) == 1


def test_a_refused_save_is_shown_and_not_repeated(visit, service):
    service.refusal = (422, "thumb: <b>no</b>")
    page = visit(service.url)
    ready(page)
    drag(page, "thumb", 8, 12)
    shows(page, "#save-text", "^NOT SAVED: thumb: <b>no</b>$")
    page.wait_for_timeout(1500)
    assert len(service.saves) == 1
    service.refusal = None
    drag(page, "thumb", 14, 16)
    saved(page)
    assert page.locator("#alert").is_hidden()


def test_quick_changes_are_saved_together(visit, service):
    page = visit(service.url)
    ready(page)
    page.evaluate("""() => { for (let k = 0; k < 20; k += 1) {
      holdfast.editor.draw(["thumb"], k + 0.1, k + 0.6, true);
    } }""")
    saved(page)
    assert len(service.saves) == 1
    assert len(service.saves[0]["labels"]["thumb"]) == 20
    page.evaluate("holdfast.editor.draw(['thumb'], 25, 26, true)")
    page.keyboard.press("Control+z")  # before it is saved
    shows(page, "#save-text", "^saved")
    page.wait_for_timeout(600)
    assert len(service.saves) == 1


def test_unsaved_labels_are_offered_when_the_recording_is_opened_again(visit):
    with FakeService(Recording("one"), Recording("two")) as service:
        page = visit(service.url)
        ready(page)
        service.refusal = (500, "the disk is full")
        drag(page, "thumb", 8, 12)
        page.keyboard.press("n")
        shows(page, "#name", "two")
        shows(page, ".toast.bad", "one is not saved")
        service.refusal = None
        page.keyboard.press("p")
        shows(page, "#question", "1 label of one")
        page.click("#question button[data-value=restore]")
        saved(page)
        assert rounded(labels(page)) == [OWN]
