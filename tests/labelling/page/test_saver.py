"""Saving: conflicts, refusals, and what outlives a crash."""

from labelling.page.desk import Desk, Recording, label
from labelling.page.hands import drag, labels, ready, rough, saved, shows, until

MINE = (8, 12, "stable", None)
THEIRS = [label(20, 25, "unstable", "slip", author="eve")]


def test_a_conflict_is_decided_for_theirs(visit, desk):
    page = visit(desk.url)
    ready(page)
    desk.recordings[0].save({"thumb": THEIRS}, note="theirs")
    drag(page, "thumb", 8, 12)
    shows(page, "#ask", r"Somebody else[\s\S]*1 label by eve[\s\S]*1 label\.")
    shows(page, "#save-text", "NOT SAVED")
    page.keyboard.press("Escape")  # is no answer
    page.click("#ask button[data-value=theirs]")
    assert labels(page) == [(20, 25, "unstable", "slip")]
    assert page.locator("#note").input_value() == "theirs"
    saved(page)
    shows(page, "#save-text", "saved by eve")
    assert len(desk.puts) == 1
    page.keyboard.press("Control+z")  # nothing is lost
    assert rough(labels(page)) == [MINE]
    saved(page)
    assert desk.recordings[0].file["author"] == "ada"
    page.reload()
    ready(page)
    assert page.locator("#ask").is_hidden()
    assert rough(labels(page)) == [MINE]


def test_a_conflict_is_decided_for_mine(visit, desk):
    page = visit(desk.url)
    ready(page)
    desk.recordings[0].save({"thumb": THEIRS})
    drag(page, "thumb", 8, 12)
    shows(page, "#ask", "Somebody else")
    assert desk.recordings[0].file["labels"] == {"thumb": THEIRS}
    page.click("#ask button[data-value=mine]")
    saved(page)
    until(page, "holdfast.saver.revision === 'r2'")
    (sent,) = desk.recordings[0].file["labels"]["thumb"]
    assert sent["state"] == "stable"
    page.keyboard.press("Control+z")
    assert labels(page) == [(20, 25, "unstable", "slip")]


def test_two_pages_on_one_file(visit, desk):
    one = visit(desk.url)
    two = visit(desk.url)
    ready(one)
    ready(two)
    drag(one, "thumb", 8, 12)
    saved(one)
    drag(two, "index", 8, 12)
    shows(two, "#ask", "1 label by ada")
    two.click("#ask button[data-value=theirs]")
    drag(two, "index", 8, 12)
    saved(two)
    assert rough(labels(two)) == [MINE]
    assert len(desk.recordings[0].file["labels"]["index"]) == 1


def test_what_a_crash_left_is_offered_again(visit, desk):
    desk.refusal = (500, "the disk is full")
    page = visit(desk.url)
    ready(page)
    drag(page, "thumb", 8, 12)
    page.keyboard.press("e")
    page.keyboard.type("half done")
    shows(page, "#alert", "Not saved: the disk is full")
    page.close()
    again = visit(desk.url, context=page.context)
    shows(again, "#ask", "1 label of grasp")
    desk.refusal = None
    assert labels(again) == []
    again.click("#ask button[data-value=restore]")
    assert rough(labels(again)) == [MINE]
    assert again.locator("#note").input_value() == "half done"
    saved(again)
    assert desk.puts[-1]["note"] == "half done"
    again.reload()
    ready(again)
    assert again.locator("#ask").is_hidden()
    assert rough(labels(again)) == [MINE]


def test_a_page_that_dies_before_it_saves(visit, desk):
    page = visit(desk.url)
    ready(page)
    # The moment until it saves never comes, nor does a last word.
    page.evaluate("""() => {
      window.setTimeout = () => 0;
      window.fetch = () => new Promise(() => {});
    }""")
    drag(page, "thumb", 8, 12)
    page.close()
    assert desk.puts == []
    desk.recordings[0].save({"thumb": THEIRS})
    again = visit(desk.url, context=page.context)
    shows(again, "#ask", "changed since by somebody else")
    again.click("#ask button[data-value=discard]")
    assert labels(again) == [(20, 25, "unstable", "slip")]
    again.reload()
    ready(again)
    assert again.locator("#ask").is_hidden()


def test_it_saves_when_the_service_is_back(visit):
    recording = Recording()
    with Desk(recording) as first:
        page = visit(first.url)
        ready(page)
    drag(page, "thumb", 8, 12)
    shows(page, "#save-text", "NOT SAVED: the service does not answer")
    with Desk(recording, port=first.port):
        saved(page)
        assert page.locator("#alert").is_hidden()
        assert len(recording.file["labels"]["thumb"]) == 1


def test_what_is_refused_is_told_and_not_tried_again(visit, desk):
    desk.refusal = (422, "thumb: <b>no</b>")
    page = visit(desk.url)
    ready(page)
    drag(page, "thumb", 8, 12)
    shows(page, "#save-text", "^NOT SAVED: thumb: <b>no</b>$")
    page.wait_for_timeout(1500)
    assert len(desk.puts) == 1
    desk.refusal = None
    drag(page, "thumb", 14, 16)
    saved(page)
    assert page.locator("#alert").is_hidden()


def test_changes_in_a_row_are_saved_in_one(visit, desk):
    page = visit(desk.url)
    ready(page)
    page.evaluate("""() => { for (let k = 0; k < 20; k += 1) {
      holdfast.editor.draw(["thumb"], k + 0.1, k + 0.6, true);
    } }""")
    saved(page)
    assert len(desk.puts) == 1
    assert len(desk.puts[0]["labels"]["thumb"]) == 20
    page.evaluate("holdfast.editor.draw(['thumb'], 25, 26, true)")
    page.keyboard.press("Control+z")  # before it is saved
    shows(page, "#save-text", "^saved")
    page.wait_for_timeout(600)
    assert len(desk.puts) == 1


def test_what_was_not_saved_is_offered_when_its_recording_is_opened_again(visit):
    with Desk(Recording("one"), Recording("two")) as desk:
        page = visit(desk.url)
        ready(page)
        desk.refusal = (500, "the disk is full")
        drag(page, "thumb", 8, 12)
        page.keyboard.press("n")
        shows(page, "#name", "two")
        shows(page, ".toast.bad", "one is not saved")
        desk.refusal = None
        page.keyboard.press("p")
        shows(page, "#ask", "1 label of one")
        page.click("#ask button[data-value=restore]")
        saved(page)
        assert rough(labels(page)) == [MINE]
