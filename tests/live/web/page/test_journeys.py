"""What a person does on the live page, from opening it to having done it."""

import json
import re

import pytest

from browser import DESKTOP, HOSTILE, on_both, shows, until
from holdfast.contact import ContactState, Reason
from live import build
from live.test_chain import verb
from live.web.page.fake_service import FINGERS, Service
from web.screens import flaws

NOTHING = {"stable_probability": None, "instability": None, "force": [None] * 3, "taxels": None}
INDEX = '[aria-label="index"].card'
LINES = "holdfast.plots.rows[0].kind.lines.map(({ label }) => label)"
KINDS = "holdfast.plots.rows.map(({ kind }) => kind.key)"
SLIPS = """[...document.querySelectorAll(".card")].map((card) => card.querySelector(".slips"))
  .filter((pill) => pill.checkVisibility()).length"""
DRAWN = """[...holdfast.plots.rows.map(({ plot }) => JSON.stringify(plot.plot.data)),
  ...[...document.querySelectorAll(".map canvas")].map((canvas) => canvas.toDataURL())]"""
INKED = """[...document.querySelectorAll(".map canvas")].every((canvas) => canvas.getContext("2d")
  .getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 0))"""


def opened(visit, service, size=DESKTOP, **options):
    page = visit(service.url, size, **options)
    wait_for_samples(page)
    return page


def wait_for_samples(page, n=30):
    count = "(holdfast.store?.end ?? 0) + (holdfast.store?.removed ?? 0)"
    until(page, f"(wanted) => {count} > wanted", page.evaluate(count) + n)


@on_both
def test_see_states_forces_and_the_taxel_map_of_a_finger(visit, service, size):
    values = {"stable_probability": 0.876, "instability": 3.3, "force": [3, 4, 12]}
    service.change(state="STABLE", **values)
    page = opened(visit, service, size)
    shows(page, "#hand-word", "^STABLE$")
    shows(page, f"{INDEX} .word", "^STABLE$")
    in_order = (r"88\s%", "3.30", "13.0", "3.00", "4.00", "12.0")
    shows(page, f"{INDEX} .values", r"[\s\S]*".join(in_order))
    assert page.locator(".card").count() == 4
    assert page.evaluate(INKED)
    assert page.evaluate(LINES) == list(FINGERS)
    page.click(f"{INDEX} .head")
    assert page.evaluate(LINES) == ["Fx", "Fy", "Fz"]
    assert flaws(page, size) == []
    page.click("#fingers button:first-child")
    assert page.evaluate(LINES) == list(FINGERS)
    service.change(state="NO_CONTACT", **values)
    shows(page, f"{INDEX} .values", r"^stable\s*–")  # without contact nothing can be stable
    service.change(state="UNSTABLE", **values)
    shows(page, "#events li", r"hand\s*no contact\s*→\s*unstable\s*thumb, index, middle, ring")
    shows(page, "#hand-spoken", "unstable")  # for screen readers
    shows(page, f"{INDEX} .head", "held")  # why it is not stable: the hold time


@on_both
def test_see_what_is_wrong_with_a_sensor(visit, service, size):
    page = opened(visit, service, size)
    text = "thumb: the tare was taken in contact: open the hand"
    service.patch = {"problems": [{"fault": "tare_loaded", "fingers": ["thumb"], "text": text}]}
    service.notices = [{"time": 1.7e9 + k, "text": f"{k} {text}"} for k in range(9)]
    faults = {"faults": ["tare_loaded", "saturated"], "faulty_taxels": [4, 12]}
    service.change(state="UNKNOWN", reason="fault", **NOTHING, **faults)
    shows(page, "#alert", f"^{text}$")
    shows(page, "#hand-word", "^UNKNOWN$")
    shows(page, f"{INDEX} .faults", r"loaded at tare\s*saturated\s*taxels 4, 12")
    shows(page, f"{INDEX} .values", r"–[\s\S]*–[\s\S]*–")
    shows(page, "#notices", f"8 {text}")
    assert page.evaluate("[...holdfast.cards.cards.get('index').map.faulty].join()") == "3,11"
    assert flaws(page, size) == []
    service.patch = {"problems": []}
    until(page, "document.getElementById('alert').hidden")


def test_every_state_and_reason_has_its_words(module):
    call = "async ([name, value]) => (await import('/page/format.js'))[name](value)"
    states = module.evaluate("import('/page/format.js').then((m) => m.STATES)")
    assert states == [state.value for state in ContactState]  # by their codes
    texts = {module.evaluate(call, ["reasonWord", reason.value]) for reason in Reason}
    assert len(texts) == len(Reason)
    assert not any("_" in text for text in texts)


@on_both
def test_pause_look_back_and_go_on(visit, service, size):
    page = opened(visit, service, size)
    page.click("#pause")
    shows(page, "#paused", "PAUSED")
    still = page.evaluate(DRAWN)
    wait_for_samples(page)
    assert page.evaluate(DRAWN) == still
    service.change(state="UNSTABLE")  # states are still updated
    shows(page, "#hand-word", "UNSTABLE")
    page.click("#windows button:first-child")  # and what is frozen can be looked at
    assert page.evaluate("holdfast.plots.rows[0].plot.plot.scales.x.min") == -5
    assert flaws(page, size) == []
    page.click("#pause")
    assert page.locator("#paused").is_hidden()
    until(page, f"(still) => {DRAWN}.every((now, k) => now !== still[k])", still)


@on_both
def test_take_a_new_tare_record_mark_and_stop(visit, service, size):
    page = opened(visit, service, size)
    service.refusal = "the index is touched: <b>let go</b>"
    page.click("#tare")
    shows(page, ".toast.bad", "^the index is touched: <b>let go</b>$")
    service.refusal = None
    page.click("#tare")
    shows(page, ".toast.good", "tare")
    page.click("#record")
    shows(page, "#record", r"0:0\d · \d+ kB")
    shows(page, "#toasts", "grasps/grasp-0007.mcap")
    page.fill("#marker-text", "m 1 pushed <i>")  # letters and digits are no shortcuts here
    page.press("#marker-text", "Enter")
    shows(page, "#events", "pushed <i>")
    until(page, "holdfast.plots.markers.length === 1")
    assert flaws(page, size) == []
    page.click("#record")
    shows(page, "#record", "^Record$")
    marker = ("POST", "markers", '{"text":"m 1 pushed <i>"}')
    assert service.calls[2:] == [("POST", "recording", "{}"), marker, ("DELETE", "recording", "")]
    service.tape.hello_fields = {"can_record": False}
    page.reload()
    shows(page, "#health", "^connected")
    disabled = [page.locator(f"#{name}").is_disabled() for name in ("record", "mark", "tare")]
    assert disabled == [True, True, False]


@on_both
def test_lose_and_regain_the_connection(visit, size):
    with Service() as first:
        first.tape.slip_threshold = 0.6
        first.change(state="STABLE", cause="slip")
        page = opened(visit, first, size)
        until(page, f"{SLIPS} === 4")
    shows(page, "#hand-word", "NO CONNECTION")  # neither an old STABLE nor an old slip is shown
    assert set(page.locator(".card .word").all_inner_texts()) == {"UNKNOWN"}
    assert page.evaluate(SLIPS) == 0
    assert page.locator("#alert").is_visible()
    assert page.locator("#tare").is_disabled()
    assert flaws(page, size) == []
    with Service(("left", "right"), port=first.port):
        shows(page, "#hand-word", "STABLE")
        shows(page, "#health", "^connected")
        assert page.locator("#alert").is_hidden()
        assert page.locator(".card").count() == 2
        assert page.locator("#tare").is_enabled()


def test_open_the_page_with_and_without_its_token(visit):
    with Service(token="a secret") as service:
        page = visit(service.url)
        shows(page, "#alert", "needs its token")
        page = visit(f"{service.url}?token=a%20secret")
        wait_for_samples(page)
        page.click("#tare")
        shows(page, "#toasts", "tare")
        service.tape.hello_fields = {"schema": "holdfast.live/9"}
        page.reload()
        shows(page, "#alert", "holdfast.live/9, this page holdfast.live/1")


def test_see_that_a_source_is_late_silent_or_over(visit, service):
    service.tape.hello_fields = {"source": "xela://192.168.1.10:5000"}
    page = opened(visit, service)
    health = {"rate": None, "n_packets": 12, "n_lost": 3, "n_refused": 1, "n_dropped": 0,
              "latency": {}, "delay": 0.34, "silent": True}  # fmt: skip
    service.patch = {"health": health}
    shows(page, "#alert", "No samples")
    shows(page, "#health", r"late by 340\sms[\s\S]*lost 3\s*refused 1")
    service.patch = {"ended": True}
    shows(page, "#hand-word", "SOURCE ENDED")
    service.tape.hello_fields, service.patch = {}, {"health": health}
    page.reload()
    shows(page, "#hand-word", "NEXT GRASP")  # the twin pauses between two grasps
    assert page.locator("#alert").is_hidden()


@on_both
def test_change_between_light_and_dark(visit, service, size):
    page = opened(visit, service, size, scheme="light")
    assert flaws(page, size) == []
    colour = "getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(colour)
    page.emulate_media(color_scheme="dark")
    until(page, f"(light) => {colour} !== light", light)
    wait_for_samples(page)
    assert flaws(page, size) == []


def test_do_everything_with_the_keyboard(visit, service):
    page = opened(visit, service)
    page.keyboard.press("?")
    shows(page, "#help-box", r"pause plots and maps[\s\S]*What the page shows")
    page.keyboard.press("r")  # keys do nothing behind the help
    page.keyboard.press("Escape")
    assert page.locator("#help-box").is_hidden()
    page.keyboard.press("2")
    assert page.evaluate("holdfast.plots.chosen") == "index"
    page.keyboard.press("9")  # there is no ninth finger
    page.keyboard.press("0")
    assert page.evaluate("holdfast.plots.chosen") is None
    page.keyboard.press(" ")
    shows(page, "#paused", "PAUSED")
    page.keyboard.press("k")
    assert page.locator("#paused").is_hidden()
    for key in "trm":
        n = len(service.calls)
        page.keyboard.press(key)
        until(page, "!document.querySelector('.busy')")
        assert len(service.calls) == n + 1
    page.keyboard.press("l")  # lights up for a camera, and marks when
    until(page, "document.body.dataset.flash === 'dark'")
    until(page, "document.body.dataset.flash === 'bright'")
    until(page, "!document.body.dataset.flash")
    assert [path for _, path, _ in service.calls] == ["tare", "recording", "markers", "markers"]
    assert json.loads(service.calls[-1][2]) == {"text": "flash"}


@on_both
def test_see_how_far_a_finger_slides(visit, service, size):
    service.tape.slip_threshold = 0.6
    page = opened(visit, service, size)
    assert page.evaluate(KINDS) == ["force", "sigma", "probability", "slip"]
    slip = {"finger": "thumb", "begin": 7.0, "end": None, "distance": 0.1}
    service.tape.change = {"index": {"state": "STABLE", "cause": "slip"},
                           "ring": {"state": "UNSTABLE", "cause": "disturbance"}}  # fmt: skip
    service.tape.slips_now = [slip]
    until(page, f"{SLIPS} === 1")
    shows(page, f"{INDEX} .slips", "^slips$")
    shows(page, f"{INDEX} .word", "^STABLE$")  # whatever its state
    shows(page, "#events", "thumb\\s*slips")
    service.tape.slips_now = [slip | {"end": 7.25, "distance": 2.04}]
    service.change(state="UNSTABLE", cause="slip", slip_speed=12.34, slip_distance=1.26)
    shows(page, f"{INDEX} .slips", r"1\.3\smm")
    shows(page, "#events", r"thumb\s*slid 2\.0\smm in 0\.25 s")
    assert flaws(page, size) == []
    service.tape.slip_threshold = None  # a model without a slip rule shows nothing of slips
    page.reload()
    wait_for_samples(page)
    assert page.evaluate(SLIPS) == 0
    assert page.evaluate(KINDS) == ["force", "sigma", "probability"]


@pytest.mark.parametrize(("n", "layout"), [(1, "uskin-4x6"), (6, "gtac")])
@on_both
def test_open_the_page_of_another_hand(visit, n, layout, size):
    with Service([f"finger{k + 1} of a long name" for k in range(n)], layout) as service:
        page = opened(visit, service, size)
        assert page.locator(".card").count() == n
        assert page.evaluate(INKED)
        assert flaws(page, size) == []


def test_see_what_an_odd_device_sends(visit):
    """Names are shown as text, and values of another shape do no harm."""
    with Service((HOSTILE, "thumb")) as service:
        page = opened(visit, service)
        service.notices = [{"time": 1e9, "text": HOSTILE}]
        service.tape.change = {HOSTILE: {"faults": [HOSTILE], "reason": HOSTILE, "state": HOSTILE}}
        page.keyboard.press("?")
        for selector in (".name", "#fingers", "#notices", ".faults"):
            shows(page, selector, re.escape(HOSTILE))
        assert page.locator("img").count() == 0
        service.tape.change = {"thumb": {"taxels": [[1, 2, 3]], "faulty_taxels": [99]}}
        wait_for_samples(page)
        service.patch = {"series": {"times": [1e6, 1e6 + 0.01], "fingers": {}}}
        until(page, "holdfast.store.latest > 9e5")


def test_leave_the_page_open_for_minutes(visit, service):
    service.speed = 60  # three seconds in each message
    page = opened(visit, service)
    for k in range(2):
        service.notices = [{"time": 1e9 + i, "text": f"notice {k} {i}"} for i in range(30)]
        wait_for_samples(page, 12_000)  # more than a minute each
    assert page.evaluate("holdfast.store.end <= holdfast.store.times.length")
    assert page.evaluate("holdfast.store.times.length") == 24_000
    assert page.locator("#notices li").count() == 50
    assert page.locator("#events li").count() <= 50
    assert page.evaluate("holdfast.plots.rows[0].plot.plot.data[0].length") < 1300


def test_see_what_a_sensor_server_sends(visit, tmp_path):
    """The whole chain: `holdfast play` sends a recording, `holdfast serve` shows it."""
    path, _ = build.grasp_file(tmp_path, fingers=FINGERS)
    with (
        verb("play", path, "--port", 0, "--whole-hand") as player,
        verb("serve", build.TWIN, player["uri"], "--port", 0, "--record-to", tmp_path) as server,
    ):
        page = visit(server["url"])
        # Main states only: on a busy machine late packets make fingers UNKNOWN for a while.
        shows(page, "#hand-word", "STABLE|NO CONTACT")
        assert page.locator(".card").count() == len(FINGERS)
        shows(page, "#health", r"lost 0\b")
