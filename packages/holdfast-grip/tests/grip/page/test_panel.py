"""The panel of the grip loop and the emergency stop, in a browser, with a fake service."""

import re

import pytest

from grip.page.fake_hand import HandService, gripping
from holdfast_grip.loop.grip_faults import ENDED, GRIP_FAULTS
from live.web.page.fake_service import Service, Tape, made_up
from live.web.page.test_main import requests, shows, until, wait_for_samples
from web.screens import PHONE, SCREENS, flaws

STOP = ("POST", "grip/stop")
RESET = ("POST", "grip/reset")
FAULT = {"state": "FAULT", "reason": "finger_fault", "released": True}


@pytest.fixture
def noted():
    """Messages of the browser about lost connections, also in the middle of a request."""
    return r"Failed to load resource: .*(\b409\b|ERR_)|WebSocket connection to"


@pytest.fixture
def holding():
    with HandService(Tape(*made_up())) as service:
        service.at = 3.5  # all fingers hold
        service.grip = gripping()
        yield service


def until_called(page, service, *calls):
    for _ in range(600):
        if requests(service)[-len(calls) :] == list(calls):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"{requests(service)}, never {calls}")


def lose_socket(page):
    """Cut the WebSocket of a page, and let no other one open."""
    page.evaluate(
        "() => { holdfast.connection.connect = () => {}; holdfast.connection.socket.close(); }"
    )
    shows(page, "#hand-word", "NO CONNECTION")


def test_without_a_hand_there_is_no_panel(visit):
    with Service(Tape(*made_up())) as service:
        check_without_a_hand(visit(service.url), service)


def check_without_a_hand(page, service):
    wait_for_samples(page)
    assert not page.locator("#grip").is_visible()
    page.keyboard.press("Space")
    shows(page, "#paused", "PAUSED")
    assert requests(service) == []


def test_the_panel_shows_state_commands_and_limits(visit, holding):
    page = visit(holding.url)
    shows(page, "#grip-word", "^REACT$")
    shows(page, "#grip-armed", "^ARMED$")
    shows(page, "#grip-hand", r"ros2:plexus.* · law friction-margin")
    shows(page, "#grip-limits", r"1.00× to 2.00× · force ≤ 12.5 · on a fault or stop: open")
    shows(
        page,
        "#grip-fingers li:nth-child(2)",
        r"index[\s\S]*1.50×[\s\S]*1.00× to 1.75×\s*unstable",
    )
    shows(page, "#events", r"grip[\s\S]*REACT: index rises from 1.000 \(unstable\)[\s\S]*HOLD")
    assert page.locator("#grip-reset").is_disabled()
    holding.grip = gripping(armed=False, **FAULT)
    shows(page, "#grip-word", "^FAULT$")
    shows(page, "#grip-reason", "^finger fault$")
    shows(page, "#grip-armed", "^DRY RUN$")


def test_an_idle_loop_says_what_it_waits_for(visit, holding):
    holding.grip = gripping(state="IDLE", waiting="the ring finger is not stable: 12 s")
    page = visit(holding.url, PHONE)
    shows(page, "#grip-word", "^IDLE$")
    shows(page, "#grip-reason", "^waiting: the ring finger is not stable: 12 s$")
    assert flaws(page, PHONE) == []
    holding.grip = gripping(state="HOLD", waiting="")
    shows(page, "#grip-reason", "^$")


def test_each_event_is_listed_once(visit, holding):
    page = visit(holding.url)
    shows(page, "#events", "REACT: index")
    wait_for_samples(page)
    holding.grip["events"] = [*holding.grip["events"], {"time": 4.4, "text": "grip RELAX"}]
    shows(page, "#events", "RELAX")
    wait_for_samples(page)
    texts = page.locator("#events b:text-is('grip') + .change").all_inner_texts()
    assert texts == ["RELAX", "REACT: index rises from 1.000 (unstable)", "HOLD"]


def test_the_button_stops_and_a_second_press_of_reset_resets(visit, holding):
    page = visit(holding.url)
    shows(page, "#grip-word", "REACT")
    page.click("#stop")
    shows(page, "#grip-word", "^FAULT$")
    shows(page, "#grip-reason", "stopped by a person")
    shows(page, "#stop-word", "STOPPED")
    page.click("#grip-reset")
    shows(page, "#grip-reset", "Press again to reset")
    assert requests(holding) == [STOP]
    page.click("#grip-reset")
    shows(page, "#grip-word", "HOLD")
    assert requests(holding) == [STOP, RESET]
    assert page.locator("#grip-reset").is_disabled()


@pytest.mark.parametrize("focus", ["body", "#tare", "#grip-reset", "#threshold"])
def test_the_space_bar_stops_whatever_has_the_focus(visit, holding, focus):
    holding.grip = gripping(state="FAULT", reason="stale")
    page = visit(holding.url)
    shows(page, "#grip-word", "FAULT")
    page.keyboard.press("p")  # shows the slider of the threshold
    page.focus(focus)
    page.keyboard.press("Space")
    until_called(page, holding, STOP)
    assert requests(holding) == [STOP]
    assert page.locator("#paused").is_hidden()


def test_the_space_bar_stops_in_front_of_a_dialog(visit, holding):
    page = visit(holding.url)
    shows(page, "#grip-word", "REACT")
    page.keyboard.press("?")
    shows(page, "#space-help", "EMERGENCY STOP of the hand")
    page.keyboard.press("Space")
    until_called(page, holding, STOP)


def test_in_a_text_field_the_space_bar_writes_and_the_button_says_so(visit, holding):
    page = visit(holding.url)
    shows(page, "#grip-word", "REACT")
    page.focus("#marker-text")
    shows(page, "#stop-hint", "Esc, then space bar")
    page.keyboard.type("a push")
    assert page.input_value("#marker-text") == "a push"
    page.keyboard.press("Escape")
    shows(page, "#stop-hint", "^space bar$")
    page.keyboard.press("Space")
    until_called(page, holding, STOP)


@pytest.mark.parametrize("how", ["button", "space"])
def test_it_stops_with_the_socket_lost(visit, holding, how):
    page = visit(holding.url)
    shows(page, "#grip-word", "REACT")
    lose_socket(page)
    holding.grip["fingers"]["thumb"]["scale"] = 1.99
    shows(page, "#grip-fingers", "1.99×")  # read by plain requests
    if how == "button":
        page.click("#stop")
    else:
        page.keyboard.press("Space")
    shows(page, "#grip-reason", "stopped by a person")
    assert holding.grip["stopped"]


def test_it_repeats_the_stop_until_the_server_answers(visit, holding):
    page = visit(holding.url)
    shows(page, "#grip-word", "REACT")
    holding.stop_fails = True
    page.keyboard.press("Space")
    shows(page, "#stop-feedback", r"CANNOT BE REACHED.* Attempt 3")
    holding.stop_fails = False
    shows(page, "#grip-reason", "stopped by a person")
    assert page.locator("#stop-feedback").is_hidden()


def test_tare_and_threshold_are_locked_while_armed(visit, holding):
    page = visit(holding.url)
    shows(page, "#grip-armed", "^ARMED$")
    page.click("#threshold-toggle")
    locked = "^The hand is armed: the tare, the thresholds and the model are locked"
    shows(page, "#threshold-expected", locked)
    for name in ("tare", "threshold", "threshold-own"):
        assert page.locator(f"#{name}").is_disabled()
    for name in ("tare", "threshold"):
        assert page.locator(f"#{name}").get_attribute("title").startswith("The hand is armed")
    page.keyboard.press("t")
    shows(page, "#toasts", "The hand is armed: the tare")
    assert requests(holding) == []
    holding.grip = gripping(armed=False)
    shows(page, "#grip-armed", "^DRY RUN$")
    assert page.locator("#threshold").is_enabled()
    page.click("#tare")
    until_called(page, holding, ("POST", "tare"))


def test_a_server_that_is_gone_is_shown(visit):
    with HandService(Tape(*made_up())) as service:
        service.grip = gripping()
        page = visit(service.url)
        shows(page, "#grip-word", "REACT")
    page.keyboard.press("Space")
    shows(page, "#stop-feedback", "CANNOT BE REACHED: use the emergency stop of the hand itself")
    shows(page, "#grip-word", "NO CONNECTION")
    until(page, "document.getElementById('stop').classList.contains('pending')")


def test_a_stop_that_is_not_confirmed_is_shown(visit, holding):
    holding.refusal = "the loop has ended: the hand does not answer"
    page = visit(holding.url)
    shows(page, "#grip-word", "REACT")
    page.click("#stop")
    shows(page, "#stop-feedback", "NOT CONFIRMED: the loop has ended: the hand does not answer")
    assert requests(holding) == [STOP]


def test_a_loop_that_has_ended_cannot_be_reset(visit, holding):
    holding.grip = gripping(state="FAULT", failure="the hand does not answer")
    page = visit(holding.url)
    shows(page, "#grip-reason", "the hand does not answer")
    assert page.locator("#grip-reset").is_disabled()


@pytest.mark.parametrize("size", SCREENS)
def test_nothing_overlaps_or_overflows(visit, holding, size, tmp_path):
    page = visit(holding.url, size)
    shows(page, "#grip-word", "REACT")
    wait_for_samples(page)
    page.screenshot(path=tmp_path / "react.png")
    assert flaws(page, size) == []
    holding.grip = gripping(**FAULT)
    shows(page, "#grip-reason", "finger fault")
    page.click("#grip-reset")
    page.screenshot(path=tmp_path / "fault.png", full_page=True)
    assert flaws(page, size) == []


def test_the_stop_stays_in_view_when_the_page_scrolls(visit, holding):
    for size in (PHONE, (1024, 600)):
        page = visit(holding.url, size)
        shows(page, "#grip-word", "REACT")
        page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
        box = page.locator("#stop").bounding_box()
        assert 0 <= box["y"] <= size[1] - box["height"]


def test_six_fingers_on_a_phone(visit):
    names = [f"finger{k + 1} of a long name" for k in range(6)]
    with HandService(Tape(*made_up(names, "gtac"))) as service:
        service.at, service.grip = 3.5, gripping(names)
        page = visit(service.url, PHONE)
        shows(page, "#grip-word", "REACT")
        wait_for_samples(page)
        assert flaws(page, PHONE) == []


LOST = {"state": "FAULT", "reason": "lost"}


def hold_limits():
    return gripping()["limits"] | {"on_fault": "hold", "recovery": 0.5}


def test_a_fault_is_explained_in_words_and_put_in_the_notices(visit, holding):
    holding.grip = gripping(limits=hold_limits(), **LOST)
    page = visit(holding.url)
    shows(page, "#grip-fault", "All fingers of the grip lost contact")
    shows(page, "#grip-fault", "Held: the last command stays")
    shows(page, "#grip-fault", "in later grasps too, until Reset")
    shows(page, "#grip-fault", "Reset continues with these forces if the grip still touches")
    shows(page, "#hand-grip", "GRIP FAULT")
    shows(page, "#notices", r"grip FAULT \(lost\): All fingers[\s\S]*Held[\s\S]*Reset")
    wait_for_samples(page)
    assert page.locator("#notices li").count() == 1
    holding.grip = gripping(state="HOLD")
    shows(page, "#notices", "grip: the fault has ended, now HOLD")
    assert page.locator("#grip-fault").is_hidden()
    assert page.locator("#hand-grip").is_hidden()


def test_in_a_fault_nothing_looks_as_if_the_loop_were_in_control(visit, holding):
    page = visit(holding.url)
    shows(page, "#grip-armed", "^ARMED$")
    shows(page, "#hand-word", "^STABLE$")
    fill = "e => getComputedStyle(e).backgroundColor"
    boxes = [page.locator(one) for one in ("#hand", '[aria-label="index"] .head', "#grip-armed")]
    in_control = [box.evaluate(fill) for box in boxes]
    holding.grip = gripping(limits=hold_limits(), **LOST)
    shows(page, "#grip-armed", "^HELD$")
    shows(page, "#grip-fingers li:nth-child(2)", r"1.50×[\s\S]*held")
    shows(page, "#hand-word", "^STABLE$")  # the estimate stays what it is
    assert all(box.evaluate(fill) != old for box, old in zip(boxes, in_control, strict=True))
    bar = page.locator("#grip-fingers li:nth-child(2) .fill")
    assert bar.evaluate(fill) != page.locator(".log .fill").first.evaluate(fill)


COMMANDED = [
    ({"released": True, **LOST}, "RELEASED", r"index\s*–[\s\S]*released"),
    ({"released": True, "state": "IDLE"}, "RELEASED", r"index\s*–[\s\S]*released"),
    ({"failure": "no answer", **LOST}, "NOTHING SENT", r"index\s*–"),
    ({"armed": False, **LOST}, "DRY RUN", r"1.50×[\s\S]*held"),
]


def test_what_is_commanded(visit, holding):
    page = visit(holding.url)
    for fields, word, finger in COMMANDED:
        holding.grip = gripping(**fields)
        shows(page, "#grip-armed", f"^{word}$")
        shows(page, "#grip-fingers li:nth-child(2)", finger)


def test_every_fault_is_explained(visit, holding):
    page = visit(holding.url)
    for reason, text in GRIP_FAULTS.items():
        failure = "the hand does not answer" if reason == ENDED else ""
        holding.grip = gripping(state="FAULT", reason=reason, released=True, failure=failure)
        shows(page, "#fault-happened", re.escape(text.happened))
        assert flaws(page, (1280, 720)) == [], reason


@pytest.mark.parametrize(
    ("width", "height"), [(390, 844), (768, 1024), (1280, 720), (1366, 768), (1440, 900)]
)
def test_a_finger_and_the_plots_are_whole_beside_the_panel(visit, holding, width, height):
    """On a phone the hand, the stop and a finger are seen at once; elsewhere all plots."""
    page = visit(holding.url)
    page.set_viewport_size({"width": width, "height": height})
    shows(page, "#grip-word", "REACT")
    bottom = "(e) => e.getBoundingClientRect().bottom"
    first = page.locator(".card").first.evaluate(bottom)
    assert first <= height
    assert page.locator("#hand-word").evaluate(bottom) <= height
    if width > 700:
        assert page.locator(".plot.last").evaluate(bottom) <= height
        low = page.locator(".card .total").first.evaluate(bottom)
        assert low <= first
