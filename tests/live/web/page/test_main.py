"""The whole page, in a browser, with a fake service."""

import json
import re

import numpy as np
import pytest

from live.web.page.fake_service import Service, Tape, made_up

SIZES = [(1280, 720), (1024, 768), (768, 1024), (1920, 1080)]
HOSTILE = "<img src=x onerror=alert(1)>"


def until(page, script, arg=None):
    """Wait until a script is true. (Playwright's own function uses eval, which is forbidden.)"""
    for _ in range(600):
        if page.evaluate(script, arg):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"never true: {script} {arg}")


def shows(page, selector, text):
    """Wait until the text of the first matching element matches a pattern."""
    for _ in range(600):
        found = page.evaluate("(at) => document.querySelector(at)?.innerText ?? ''", selector)
        if re.search(text, found):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"{selector} shows {found!r}, never {text!r}")


def change(service, **fields):
    service.tape.change = dict.fromkeys(service.tape.tracks, fields)


def requests(service):
    return [(method, path) for method, path, _ in service.calls]


def drawn(page):
    """Return what the plots and maps show."""
    return page.evaluate(
        """() => [...holdfast.plots.rows.map((row) => JSON.stringify(row.plot.data)),
                  ...[...document.querySelectorAll(".map canvas")].map((c) => c.toDataURL())]"""
    )


def arrived(page):
    return page.evaluate("(holdfast.store?.end ?? 0) + (holdfast.store?.removed ?? 0)")


def wait_for_samples(page, n=30):
    wanted = arrived(page) + n
    until(page, "(n) => holdfast.store && holdfast.store.end + holdfast.store.removed > n", wanted)


@pytest.mark.parametrize(
    ("size", "scheme", "state", "reason"),
    [(size, *(("dark", "NO_CONTACT", ""), ("light", "UNKNOWN", "gap"))[k % 2])
     for k, size in enumerate(SIZES)],
)  # fmt: skip
def test_everything_fits_without_scrolling(visit, service, size, scheme, state, reason, tmp_path):
    # The longest that cards have to show.
    longest = {
        "stable_probability": 1.0,
        "instability": 12345.6,
        "force": [-23456.7, -9876.5, -8e4],
    }
    faults = {"faults": ["saturated"], "faulty_taxels": [1, 2, 3, 4, 5]}
    change(service, state=state, reason=reason, **longest, **faults)
    page = visit(service.url, size, scheme)
    shows(page, "#hand-word", state.replace("_", " "))
    wait_for_samples(page)
    page.screenshot(path=tmp_path / "page.png")
    extent = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
    assert page.evaluate(extent) == list(size)
    clipped = page.evaluate(
        """() => [...document.querySelectorAll(
            ".values, .values *, .word, .name span, #hand-word, .entry, button")]
          .filter((e) => e.scrollWidth > e.clientWidth + 1)
          .filter((e) => getComputedStyle(e).display !== "inline")
          .map((e) => `${e.className} ${e.textContent}`)"""
    )
    assert clipped == []
    hidden = page.evaluate(
        """() => [...document.querySelectorAll(".card")].filter((card) => {
          const inside = card.querySelector(".values .force").getBoundingClientRect();
          return inside.bottom > card.getBoundingClientRect().bottom;
        }).length"""
    )
    assert hidden == 0
    small = page.evaluate(
        """() => [...document.querySelectorAll("button, input")].filter((e) => e.offsetParent)
          .map((e) => e.getBoundingClientRect())
          .filter((r) => Math.min(r.width, r.height) < 43.9).length"""
    )
    assert small == 0


EVENTS = """(events) => {
  holdfast.events.clear();
  for (const [finger, previous, state, time] of events) {
    holdfast.events.add({ finger, previous, state, time });
  }
}"""


def test_cards_show_the_current_state(visit, service):
    change(service, state="STABLE", stable_probability=0.876, instability=3.3, force=[3, 4, 12])
    page = visit(service.url)
    shows(page, "#hand-word", "^STABLE$")
    shows(page, '[aria-label="index"] .word', "^STABLE$")
    shows(
        page,
        '[aria-label="index"] .values',
        r"88\s%[\s\S]*3.30[\s\S]*13.0[\s\S]*3.00[\s\S]*4.00[\s\S]*12.0",
    )
    assert page.locator(".card").count() == 4
    faults = {"faults": ["stuck", "saturated"], "faulty_taxels": [4, 12]}
    nothing = {"stable_probability": None, "instability": None, "force": [None] * 3, "taxels": None}
    change(service, state="UNKNOWN", reason="tare", **nothing, **faults)
    shows(page, "#hand-word", "^UNKNOWN$")
    shows(page, '[aria-label="ring"] .head', "taking tare")
    shows(page, '[aria-label="ring"] .faults', r"stuck\s*saturated\s*taxels 4, 12")
    shows(page, '[aria-label="ring"] .values', r"–[\s\S]*–[\s\S]*–")
    crossed = "[...holdfast.cards.cards.get('ring').map.faulty].join()"  # indices
    assert page.evaluate(crossed) == "3,11"
    shape = page.locator('[aria-label="ring"] .head > .shape use').get_attribute("href")
    assert shape == "#shape-unknown"


def plot_keys(page):
    return page.evaluate("holdfast.plots.rows.map(({ kind }) => kind.key)")


def visible_slips(page):
    """Return the fingers whose card says that they slip."""
    return page.evaluate(
        """() => [...document.querySelectorAll(".card")]
          .filter((card) => card.querySelector(".slips").checkVisibility())
          .map((card) => card.getAttribute("aria-label"))"""
    )


def test_a_card_says_that_its_finger_slips_whatever_its_state(visit, service):
    service.tape.slip_threshold = 0.6
    change(service, state="STABLE", stable_probability=0.9, cause=None)
    service.tape.change["index"] = {"state": "STABLE", "stable_probability": 0.9, "cause": "slip"}
    service.tape.change["ring"] = {"state": "UNSTABLE", "cause": "disturbance"}
    page = visit(service.url)
    shows(page, '[aria-label="index"] .head', "slips")
    assert visible_slips(page) == ["index"]
    shows(page, '[aria-label="index"] .word', "^STABLE$")
    pill = page.locator('[aria-label="index"] .slips')
    assert pill.locator("use").get_attribute("href") == "#shape-slip"
    colours = page.evaluate(
        """() => ["index", "thumb"].map((name) =>
          getComputedStyle(document.querySelector(`[aria-label="${name}"].card`)).borderColor)"""
    )
    assert colours[0] != colours[1]
    change(service, state="UNSTABLE", cause="disturbance")
    until(page, "() => !document.querySelector('.sliding')")
    assert visible_slips(page) == []


def test_a_card_shows_how_far_and_how_fast_its_finger_slides(visit, service):
    service.tape.slip_threshold = 0.6
    change(service, cause="slip", slip_speed=12.34, slip_distance=1.26)
    page = visit(service.url)
    pill = '[aria-label="index"] .slips'
    shows(page, pill, r"1\.3\smm")
    title = page.locator(pill).get_attribute("title")
    assert title.endswith("slides: 1.3\u202fmm since the slip began, now at 12\u202fmm/s")
    change(service, cause="slip", slip_speed=None, slip_distance=None)  # without a speed rule
    shows(page, pill, "^slips$")


def test_the_list_of_events_has_how_far_a_finger_slid(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    service.muted = True
    page.evaluate(
        """() => {
          const slip = { finger: "thumb", begin: 7, end: null, distance: 0.1 };
          const other = { finger: "ring", begin: 7.1, end: null, distance: null };
          for (const item of [slip, other]) holdfast.events.addSlip(item);
          holdfast.events.addSlip({ ...slip, end: 7.25, distance: 2.04 });
        }"""
    )
    rows = page.locator("#events li").all_inner_texts()[:2]
    assert [" ".join(row.split()).split(" s ", 1)[1] for row in rows] == [
        "ring slips", "thumb slid 2.0 mm in 0.25 s",
    ]  # fmt: skip
    page.evaluate(
        "(slip) => holdfast.events.addSlip(slip)",
        {"finger": "ring", "begin": 7.1, "end": 7.2, "distance": None},
    )
    assert "slid 0.10 s" in page.locator("#events li").first.inner_text()


def test_a_slip_is_not_shown_without_a_connection(visit):
    with Service(Tape(*made_up())) as service:
        service.tape.slip_threshold = 0.6
        change(service, state="UNSTABLE", cause="slip")
        page = visit(service.url)
        until(page, "() => document.querySelectorAll('.sliding').length === 4")
    shows(page, "#hand-word", "NO CONNECTION")
    assert visible_slips(page) == []


def test_a_model_without_a_slip_rule_shows_nothing_of_slips(visit, service):
    change(service, state="UNSTABLE", cause="slip")  # the likely cause, by the causes of the model
    page = visit(service.url)
    wait_for_samples(page)
    assert visible_slips(page) == []
    assert plot_keys(page) == ["force", "sigma", "probability"]
    page.keyboard.press("?")
    assert "slip" not in page.locator("#help-box").inner_text()


def test_the_probability_of_a_slip_has_a_curve_and_its_threshold(visit, service):
    service.tape.slip_threshold = 0.6
    page = visit(service.url)
    wait_for_samples(page)
    assert plot_keys(page) == ["force", "sigma", "probability", "slip"]
    until(page, "() => holdfast.plots.rows[3].plot.data[1].some((x) => x !== null)")
    probabilities = page.evaluate(
        """() => {
          const { fingers, start, end } = holdfast.store;
          const { probability, slip } = fingers.get("thumb");
          return [probability, slip].map((column) => [...column.subarray(start, end)]);
        }"""
    )
    stable, slips = (np.array(column, dtype=float) for column in probabilities)
    known = np.isfinite(stable)
    assert known.any()
    np.testing.assert_allclose(slips[known], 1 - stable[known], atol=1e-6)
    # The threshold is a dashed line at its height: other colours there than without it.
    row = """async () => {
      const { plot } = holdfast.plots.rows[3], y = Math.round(plot.valToPos(0.6, "y", true));
      plot.redraw();
      await new Promise(requestAnimationFrame);
      return [...plot.ctx.getImageData(plot.bbox.left, y, plot.bbox.width, 1).data].join();
    }"""
    page.keyboard.press("k")
    with_line = page.evaluate(row)
    change_all = "(x) => Object.values(holdfast.plots.fingers).forEach((f) => "
    change_all += "{ f.slip_threshold = x; })"
    page.evaluate(change_all, 1)  # of a model that reports no slip until it is taught
    at_1 = row.replace("0.6", "1")
    without_line = page.evaluate(at_1)
    page.evaluate(change_all, None)
    assert page.evaluate(row) != with_line
    assert page.evaluate(at_1) == without_line
    page.keyboard.press("2")
    assert plot_keys(page) == ["force", "sigma", "probability"]  # of a finger without a rule


def test_without_contact_no_probability_of_stability_is_shown(visit, service):
    change(service, state="NO_CONTACT", stable_probability=0.94)
    page = visit(service.url)
    shows(page, "#hand-word", "^NO CONTACT$")
    shows(page, '[aria-label="index"] .meter', r"^stable\s*–$")
    bar = page.locator('[aria-label="index"] .meter .fill').first
    assert bar.get_attribute("style") == "transform: scaleX(0);"
    change(service, state="STABLE", stable_probability=0.94)
    shows(page, '[aria-label="index"] .meter', r"94\s%")


def test_one_line_of_events_for_one_change(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    service.muted = True
    page.evaluate(EVENTS, [
        ["thumb", "UNSTABLE", "STABLE", 7.0], ["index", "UNSTABLE", "STABLE", 7.2],
        ["hand", "UNSTABLE", "STABLE", 7.2],
        ["index", "STABLE", "UNSTABLE", 8.0], ["hand", "STABLE", "UNSTABLE", 8.0],
        ["thumb", "STABLE", "UNSTABLE", 8.1],
        ["ring", "STABLE", "NO_CONTACT", 9.0], ["middle", "STABLE", "NO_CONTACT", 9.1],
        ["index", "UNSTABLE", "STABLE", 9.2],
        ["index", "STABLE", "UNSTABLE", 9.3],  # another one than at 8.0
    ])  # fmt: skip
    lines = [" ".join(one.split()[2:]) for one in page.locator("#events li").all_inner_texts()]
    assert lines == [
        "index stable → unstable",
        "index unstable → stable",
        "ring, middle stable → no contact",
        "hand stable → unstable index, thumb",
        "hand unstable → stable thumb, index",
    ]


def test_changes_are_announced_to_screen_readers(visit, service):
    change(service, state="UNSTABLE")
    page = visit(service.url)
    shows(page, "#hand-word", "UNSTABLE")
    until(page, "document.getElementById('hand-spoken').textContent === 'Hand: unstable'")
    assert page.locator("#hand-spoken").get_attribute("aria-live") == "polite"


def test_pause_freezes_plots_and_maps_only(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    page.keyboard.press("Space")
    shows(page, "#paused", "PAUSED")
    still = drawn(page)
    wait_for_samples(page)
    assert drawn(page) == still
    change(service, state="UNSTABLE")  # states are still updated
    shows(page, "#hand-word", "UNSTABLE")
    page.click("#windows button:first-child")  # and what is frozen can be looked at
    assert page.evaluate("holdfast.plots.rows[0].plot.scales.x.min") == -5
    assert page.locator("#paused").is_visible()
    page.click("#pause")
    assert page.locator("#paused").is_hidden()
    until(page, "(still) => JSON.stringify(holdfast.plots.rows[0].plot.data) !== still", still[0])


def test_the_window_is_chosen(visit, service):
    service.speed = 20
    page = visit(service.url)
    wait_for_samples(page, 9000)
    for seconds in (60, 5, 30, 10):
        page.get_by_role("button", name=f"{seconds} s", exact=True).click()
        low, high, first = page.evaluate(
            """() => { const { plot } = holdfast.plots.rows[1];
                       return [plot.scales.x.min, plot.scales.x.max, plot.data[0][0]]; }"""
        )
        assert (low, high) == (-seconds, 0)
        assert first == pytest.approx(-seconds, abs=0.2)
        pressed = page.locator('#windows [aria-pressed="true"]')
        assert pressed.all_inner_texts() == [f"{seconds} s"]


def test_a_finger_is_chosen(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    labels = "[...document.querySelectorAll('.plot.force .label')].map((e) => e.textContent)"
    assert page.evaluate(labels) == ["thumb", "index", "middle", "ring"]
    page.keyboard.press("2")
    assert page.evaluate(labels) == ["Fx", "Fy", "Fz"]
    assert page.locator(".card.chosen").get_attribute("aria-label") == "index"
    page.click("#fingers button:last-child")
    assert page.locator(".card.chosen").get_attribute("aria-label") == "ring"
    page.click('[aria-label="ring"] .head')  # once more: all again
    assert page.evaluate(labels) == ["thumb", "index", "middle", "ring"]
    page.keyboard.press("9")
    page.keyboard.press("0")
    assert page.evaluate(labels) == ["thumb", "index", "middle", "ring"]


def test_the_tare(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    page.click("#tare")
    shows(page, "#toasts", "Taking the tare")
    service.refusal = "the index is touched: <b>let go</b>"
    page.keyboard.press("t")
    shows(page, ".toast.bad", "^the index is touched: <b>let go</b>$")
    assert requests(service) == [("POST", "tare"), ("POST", "tare")]


def test_a_fault_that_lasts_is_explained(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    text = "thumb: the tare was taken in contact: open the hand"
    problem = {"fault": "tare_loaded", "fingers": ["thumb"], "text": text}
    service.patch = {"problems": [problem]}
    service.tape.change = {"thumb": {"state": "UNKNOWN", "reason": "fault",
                                     "faults": ["tare_loaded"]}}  # fmt: skip
    shows(page, "#alert", f"^{text}$")
    shows(page, '[aria-label="thumb"] .faults', "^loaded at tare$")
    title = page.locator('[aria-label="thumb"] .faults').get_attribute("title")
    assert "the tare was taken in contact" in title
    service.patch = {"problems": []}
    until(page, "document.getElementById('alert').hidden")


def test_a_state_that_is_held_is_explained(visit, service):
    change(service, state="UNSTABLE", stable_probability=0.98)
    page = visit(service.url)
    shows(page, '[aria-label="thumb"] .head', "held 0.1 s")
    change(service, state="UNSTABLE", stable_probability=0.2)
    until(page, "!document.querySelector('.card .reason').textContent")
    page.set_viewport_size({"width": 390, "height": 844})
    change(service, state="UNSTABLE", stable_probability=0.98)
    shows(page, '[aria-label="thumb"] .head', "held for 0.1 s after the last alarm")


def test_the_threshold_is_moved_and_restored(visit, service):
    service.tape.points = [
        {"threshold": 0.5, "false_alarms_per_minute": 4.0, "missed": 2.0},
        {"threshold": 0.7, "false_alarms_per_minute": 1.25, "missed": 3.5},
    ]
    page = visit(service.url)
    wait_for_samples(page)
    shows(page, "#threshold-toggle", r"Threshold\s*50\s%")
    assert page.locator("#threshold-panel").is_hidden()
    page.keyboard.press("p")
    shows(page, "#threshold-expected", r"Expected at 50\s%: 4.00 false alarms a minute, 2\s% of")
    assert page.locator("#threshold-own").is_disabled()
    page.locator("#threshold").fill("0.8")
    shows(page, "#threshold-expected", r"Expected at 70\s%: 1.25 false alarms a minute, 3.5\s% of")
    until(page, "holdfast.plots.thresholds.index === 0.68997")
    shows(page, "#threshold-now", r"69\s%")
    mark = page.locator('[aria-label="index"] .threshold')
    assert mark.evaluate("(e) => e.style.left") == "68.997%"
    page.click("#threshold-own")
    until(page, "holdfast.plots.thresholds.index === 0.5")
    shows(page, "#threshold-now", r"50\s%")
    assert [(method, path, body) for method, path, body in service.calls] == [
        ("POST", "threshold", '{"value":0.68997}'), ("DELETE", "threshold", ""),
    ]  # fmt: skip
    service.refusal = "the source has ended"
    page.locator("#threshold").fill("5")
    shows(page, ".toast.bad", "^the source has ended$")
    shows(page, "#threshold-now", r"50\s%")
    until(page, "document.getElementById('threshold').value === '0'")


def test_a_model_without_a_table_of_thresholds(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    page.click("#threshold-toggle")
    shows(page, "#threshold-expected", "holdfast tune adds them")


def test_a_recording_starts_and_stops(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    page.keyboard.press("r")
    shows(page, "#record", r"Stop 0:0\d · \d+ kB")
    shows(page, "#toasts", "Recording to grasps/")
    assert page.locator("#record").get_attribute("aria-pressed") == "true"
    page.click("#record")
    shows(page, "#record", "^Record$")
    shows(page, "#toasts", "recorded: grasps/")
    assert requests(service) == [("POST", "recording"), ("DELETE", "recording")]


def test_a_service_that_cannot_record_offers_no_recording(visit, service):
    hello = service.tape.hello
    service.tape.hello = lambda: hello() | {"can_record": False}
    page = visit(service.url)
    wait_for_samples(page)
    assert page.locator("#record").is_disabled()
    assert page.locator("#mark").is_disabled()
    assert page.locator("#tare").is_enabled()


def test_markers(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    page.fill("#marker-text", "m 1 pushed <i>")  # letters and digits are typed, not shortcuts
    page.press("#marker-text", "Enter")
    shows(page, "#events", "pushed <i>")
    page.keyboard.press("Escape")
    page.keyboard.press("m")
    until(page, "holdfast.plots.markers.length === 2")
    assert [json.loads(body) for _, _, body in service.calls] == [{"text": "m 1 pushed <i>"}] * 2
    assert page.evaluate("holdfast.plots.chosen") is None
    service.refusal = "no recording runs"
    page.keyboard.press("m")
    shows(page, ".toast.bad", "no recording runs")
    assert page.evaluate("holdfast.plots.markers.length") == 2


def test_a_flash_lights_up_the_page_and_is_marked_then(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    page.evaluate("""() => {
      window.seen = [];
      const look = () => seen.push(getComputedStyle(document.body, "::after").backgroundColor);
      new MutationObserver(look).observe(document.body, { attributeFilter: ["data-flash"] });
    }""")
    page.keyboard.press("l")
    until(page, "seen.length === 3")
    black, white, gone = page.evaluate("seen")
    assert (black, white) == ("rgb(0, 0, 0)", "rgb(255, 255, 255)")
    assert gone not in (black, white)
    assert [json.loads(body) for _, _, body in service.calls] == [{"text": "flash"}]
    assert page.evaluate("holdfast.plots.markers.length") == 1


def test_help(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    page.keyboard.press("?")
    shows(page, "#help-box", r"builtin:twin[\s\S]*twin:\?object=can[\s\S]*thumb \(30\)")
    page.keyboard.press("r")  # keys do nothing behind it
    page.keyboard.press("Escape")
    assert page.locator("#help-box").is_hidden()
    assert service.calls == []


def test_the_page_reconnects(visit):
    with Service(Tape(*made_up())) as first:
        page = visit(first.url)
        wait_for_samples(page)
    shows(page, "#alert", "Connection lost, trying again")
    shows(page, "#hand-word", "NO CONNECTION")  # no old STABLE is shown
    assert set(page.locator(".card .word").all_inner_texts()) == {"UNKNOWN"}
    assert page.locator("#tare").is_disabled()
    with Service(Tape(*made_up(("left", "right"))), port=first.port) as second:
        second.at = 4.0
        shows(page, "#health", "^connected")
        shows(page, "#hand-word", "STABLE")
        assert page.locator("#alert").is_hidden()
        assert page.locator(".card").count() == 2
        assert page.locator("#tare").is_enabled()


def test_the_end_of_the_source_is_shown(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    service.patch = {"ended": True}
    shows(page, "#alert", "Source ended")
    shows(page, "#hand-word", "SOURCE ENDED")
    shows(page, "#health", "^source ended")


def test_the_twin_between_two_grasps_is_no_silent_source(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    service.patch = {"health": {"rate": None, "n_packets": 12, "n_lost": 0, "n_refused": 0,
                                "n_dropped": 0, "silent": True, "delay": 0.0,
                                "latency": {"p50": None, "p99": None, "max": None}}}  # fmt: skip
    shows(page, "#hand-word", "NEXT GRASP")
    assert page.locator("#alert").is_hidden()


def test_a_load_that_changes_is_no_hold_time(visit, service):
    change(service, state="UNSTABLE", reason="load", stable_probability=0.98)
    page = visit(service.url)
    shows(page, '[aria-label="thumb"] .head', "load changes")


@pytest.mark.parametrize("width", [1180, 1440])
def test_a_long_reason_leaves_the_name_of_its_finger(visit, service, width):
    change(service, state="UNSTABLE", stable_probability=0.98)
    page = visit(service.url)
    page.set_viewport_size({"width": width, "height": 900})
    shows(page, '[aria-label="thumb"] .head', "held")
    cut = "(e) => e.scrollWidth > e.clientWidth"
    assert not any(page.locator(".name span").nth(k).evaluate(cut) for k in range(2))


def test_a_silent_source_is_shown(visit, service):
    service.tape.source = "xela://192.168.1.10:5000"
    page = visit(service.url)
    wait_for_samples(page)
    health = {"rate": None, "n_packets": 12, "n_lost": 3, "n_refused": 1, "n_dropped": 0,
              "silent": True, "latency": {"p50": None, "p99": None, "max": None},
              "delay": 0.34}  # fmt: skip
    service.patch = {"health": health}
    shows(page, "#alert", "No samples")
    shows(
        page,
        "#health",
        r"rate –\s*latency p50 –[\s\S]*late by 340\u202fms\s*packets 12\s*lost 3\s*refused 1",
    )
    assert page.locator("#health .bad").all_inner_texts() == [
        "late by 340\u202fms",
        "lost 3",
        "refused 1",
    ]


def test_a_token_is_passed_on(visit):
    with Service(Tape(*made_up()), token="a secret") as service:
        page = visit(service.url)
        shows(page, "#alert", "needs its token")
        page = visit(f"{service.url}?token=a%20secret")
        wait_for_samples(page)
        page.click("#tare")
        shows(page, "#toasts", "Taking the tare")


def test_another_schema_is_refused(visit, service):
    hello = service.tape.hello
    service.tape.hello = lambda: hello() | {"schema": "holdfast.live/9"}
    page = visit(service.url)
    shows(page, "#alert", r"uses holdfast.live/9, this page holdfast.live/1")


def test_names_are_shown_as_text(visit):
    with Service(Tape(*made_up((HOSTILE, "thumb")))) as service:
        service.at = 3.5
        page = visit(service.url)
        wait_for_samples(page)
        service.notices = [{"time": 1e9, "text": HOSTILE}]
        service.tape.change = {HOSTILE: {"faults": [HOSTILE], "reason": HOSTILE, "state": HOSTILE}}
        shows(page, ".name", re.escape(HOSTILE))
        shows(page, "#fingers", re.escape(HOSTILE))
        shows(page, "#notices", re.escape(HOSTILE))
        shows(page, ".faults", re.escape(HOSTILE))
        page.keyboard.press("1")
        page.keyboard.press("?")
        shows(page, "#stream", re.escape(HOSTILE))
        assert page.locator("img").count() == 0


@pytest.mark.parametrize(
    ("n", "layout"), [(1, "uskin-4x6"), (2, "papillarray"), (6, "anyskin"), (6, "gtac")]
)
def test_other_hands(visit, n, layout):
    names = [f"finger{k + 1} of a long name" for k in range(n)]
    with Service(Tape(*made_up(names, layout))) as service:
        service.at = 3.5
        page = visit(service.url)
        wait_for_samples(page)
        assert page.locator(".card").count() == n
        assert page.evaluate("document.documentElement.scrollWidth") == 1280
        # The maps are drawn: some of their pixels are not empty.
        inked = page.evaluate(
            """() => [...document.querySelectorAll(".map canvas")].map((c) =>
              c.getContext("2d").getImageData(0, 0, c.width, c.height).data.some((v) => v > 0))"""
        )
        assert inked == [True] * n


def test_messages_of_wrong_shape_do_no_harm(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    service.tape.change = {"index": {"taxels": [[1, 2, 3]], "faulty_taxels": [99]},
                           "thumb": {"faults": [], "force": [None, 1.0, 2.0]}}  # fmt: skip
    wait_for_samples(page)
    service.patch = {"notices": [], "events": [], "recording": None,
                     "series": {"times": [1e6, 1e6 + 0.01], "fingers": {}}}  # fmt: skip
    until(page, "holdfast.store.latest > 9e5")


def test_memory_is_bounded(visit, service):
    service.speed = 60  # three seconds in each message
    page = visit(service.url)
    wait_for_samples(page, 10)
    before = page.evaluate("holdfast.store.bytes")
    for k in range(4):
        service.notices = [{"time": 1e9 + i, "text": f"notice {k} {i}"} for i in range(30)]
        wait_for_samples(page, 9000)  # a minute each
    end, capacity, after = page.evaluate(
        "[holdfast.store.end, holdfast.store.capacity, holdfast.store.bytes]"
    )
    assert after == before
    assert capacity == 12000
    assert end <= 2 * capacity
    assert page.locator("#notices li").count() == 50
    assert page.locator("#events li").count() <= 50
    assert page.evaluate("holdfast.plots.rows[0].plot.data[0].length") < 1300
