"""The button Calibrate and its panel, in a browser, with a fake service."""

import json

import pytest

from live.web.page.fake_service import SEEN
from live.web.page.test_main import arrived, requests, shows, until, wait_for_samples
from web.screens import SCREENS, flaws

HARDLY = "uskin-curved: the arm hardly moved; add handling in which it carries and turns, or its "
HARDLY += "motion will look like slip"


def progress(service, seconds):
    service.calibration = service.calibration | {"seconds": seconds}


def visible(page):
    return page.evaluate(
        """() => [...document.querySelectorAll(".calibration-buttons button")]
          .filter((e) => e.checkVisibility()).map((e) => e.id.replace("calibration-", ""))"""
    )


def test_from_the_press_to_the_undo(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    assert not page.locator("#calibration-panel").is_visible()
    page.locator("#calibrate").click()
    shows(page, "#calibration-held", r"Held 0\ss of 60\ss")
    shows(page, "#calibration-told", "^Hold an object firmly and handle it as usual")
    assert page.locator("#calibration-finish").is_disabled()
    progress(service, 12.3)
    shows(page, "#calibration-finish", r"^Use 12\ss$")
    shows(page, "#calibration-warning", "30 s or more are better")
    shows(page, "#calibrate", r"Held 12\ss")
    assert page.evaluate("document.querySelector('#calibration-bar').value") == 12.3
    progress(service, 42.0)
    until(page, "document.querySelector('#calibration-warning').hidden")
    before = arrived(page)
    page.locator("#calibration-finish").click()
    shows(page, "#calibration-told", "96 % of this handling is STABLE, 41 % before")
    shows(page, "#calibrate", "^Calibrated$")
    until(page, "document.querySelector('#about').textContent.startsWith('builtin:any, calibr')")
    wait_for_samples(page)
    assert arrived(page) > before  # the plots go on
    assert visible(page) == ["again", "save", "download", "undo", "close"]
    page.locator("#calibration-undo").click()
    shows(page, "#calibration-told", "^calibration undone$")
    shows(page, "#calibrate", "^Calibrate$")
    shows(page, "#about", "^builtin:any ")
    assert requests(service) == [
        ("POST", "calibration"),
        ("POST", "calibration/finish"),
        ("DELETE", "calibration"),
    ]


def test_the_model_is_saved_or_downloaded(visit, service):
    service.calibration |= {"calibrated": True, "text": SEEN}
    page = visit(service.url)
    wait_for_samples(page)
    shows(page, "#calibrate", "^Calibrated$")
    assert not page.locator("#calibration-panel").is_visible()  # of an earlier visitor
    page.keyboard.press("c")
    page.locator("#calibration-save").click()
    shows(page, ".toast", r"^Model written to recordings/model-20261123-081500\.json$")
    with page.expect_download() as download:
        page.locator("#calibration-download").click()
    assert download.value.suggested_filename == "calibrated.json"
    assert json.loads(download.value.path().read_text()) == {"model": "calibrated"}
    page.locator("#calibration-close").click()
    until(page, "document.querySelector('#calibration-panel').hidden")


def test_a_refusal_stays_until_it_is_closed(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    page.keyboard.press("c")
    shows(page, "#calibration-told", "^Hold an object")
    text = "not calibrated: 0.0 s held in 300 s, at least 5 s expected; nothing has changed"
    service.calibration = service.calibration | {"state": "idle", "refused": True, "text": text}
    shows(page, "#calibration-told", "nothing has changed")
    assert page.evaluate("document.querySelector('.calibration-panel.refused') !== null")
    assert visible(page) == ["again", "close"]
    page.locator("#calibration-again").click()
    shows(page, "#calibration-told", "^Hold an object")
    page.locator("#calibration-cancel").click()
    until(page, "document.querySelector('#calibration-panel').hidden")
    assert requests(service)[-1] == ("DELETE", "calibration")


def test_the_refusal_of_the_service_is_shown(visit, service):
    page = visit(service.url)
    wait_for_samples(page)
    service.refusal = "a calibration is running already"
    page.locator("#calibrate").click()
    shows(page, ".toast.bad", "^a calibration is running already$")


def test_an_armed_hand_locks_it(visit, service):
    service.calibration |= {"calibrated": True, "text": SEEN}
    service.patch = {}
    page = visit(service.url)
    wait_for_samples(page)
    page.keyboard.press("c")
    service.patch = {"locked": True}
    until(page, "document.querySelector('#calibration-undo').disabled")
    assert page.locator("#calibration-again").is_disabled()
    assert "model are locked" in page.locator("#calibrate").get_attribute("title")


def test_a_model_that_cannot_be_calibrated_says_so(visit, service):
    hello, text = service.tape.hello, "builtin:twin ... cannot be calibrated; builtin:any can"
    service.tape.hello = lambda: hello() | {"not_calibratable": text}
    page = visit(service.url)
    wait_for_samples(page)
    until(page, "document.querySelector('#calibrate').disabled")
    assert page.locator("#calibrate").get_attribute("title") == text


def test_a_service_without_calibration(visit, service):
    service.calibration = None
    page = visit(service.url)
    wait_for_samples(page)
    assert page.locator("#calibrate").is_disabled()
    page.keyboard.press("c")
    assert requests(service) == []


def test_own_handling_of_another_sensor_is_a_notice(visit, service):
    text = "mine was calibrated on pad, not on uskin-curved: default handling is used"
    service.tape.advice = [text]
    page = visit(service.url)
    shows(page, "#notices", "default handling is used")
    page.evaluate("(text) => holdfast.showAdvice([text])", text)  # the next connection
    assert page.locator("#notices li").count() == 1


@pytest.mark.parametrize("size", [*SCREENS, (1280, 720)])
def test_nothing_overlaps_or_overflows(visit, service, size, tmp_path):
    page = visit(service.url, size)
    wait_for_samples(page)
    page.locator("#calibrate").click()
    shows(page, "#calibration-held", r"Held 0\ss of 60\ss")  # has begun
    progress(service, 23.4)
    shows(page, "#calibration-finish", "^Use 23")
    page.screenshot(path=tmp_path / "handling.png", full_page=True)
    assert flaws(page, size) == []
    warnings = ["uskin-curved: 23 s of holding; 30 s or more are better", HARDLY]
    service.calibration = service.calibration | {"warnings": warnings}
    page.locator("#calibration-finish").click()
    shows(page, "#calibration-warning", "hardly moved")
    page.screenshot(path=tmp_path / "calibrated.png", full_page=True)
    assert flaws(page, size) == []
