"""The page on a phone, a tablet and a desktop."""

import pytest

from live.web.page.fake_service import Service, Tape, made_up
from live.web.page.test_main import change, shows, wait_for_samples
from web.screens import PHONE, SCREENS, flaws

TARE = "thumb, index, middle, ring: the tare was taken in contact: open the hand, then press Tare"


def fill(service):
    """Show everything that the page can show at once, with long texts."""
    service.patch = {"problems": [{"fault": "tare_loaded", "fingers": ["thumb"], "text": TARE}]}
    service.notices = [{"time": 1.7e9 + k, "text": f"{k} {TARE}"} for k in range(9)]
    values = {"stable_probability": 1.0, "instability": 12345.6, "force": [-23456.7, -9876.5, -8e4]}
    change(service, state="UNKNOWN", reason="gap", faults=["tare_loaded"], **values)


@pytest.mark.parametrize("size", SCREENS)
def test_nothing_overlaps_or_overflows(visit, service, size, tmp_path):
    page = visit(service.url, size)
    wait_for_samples(page)
    page.screenshot(path=tmp_path / "page.png", full_page=True)
    assert flaws(page, size) == []
    fill(service)
    page.keyboard.press("p")
    page.keyboard.press("r")
    shows(page, "#record", "Stop")
    shows(page, "#alert", "tare was taken in contact")
    shows(page, "#notices", "8 thumb")
    page.screenshot(path=tmp_path / "full.png", full_page=True)
    assert flaws(page, size) == []
    page.keyboard.press("2")  # the plots of one finger
    assert flaws(page, size) == []


@pytest.mark.parametrize(
    ("size", "n", "measured"),
    [(size, (4, 6)[k % 2], k % 4 < 2)
     for k, size in enumerate([*SCREENS, (820, 1180), (1400, 900)])],
)  # fmt: skip
def test_slips_overlap_nothing(visit, size, n, measured, tmp_path):
    sliding = {"slip_speed": 234.5, "slip_distance": 123.6} if measured else {}
    names = ("thumb", "index", "middle", "ring", "left palm", "right palm")[:n]
    with Service(Tape(*made_up(names))) as service:
        service.at = 3.5
        service.tape.slip_threshold = 0.6
        change(service, state="UNSTABLE", cause="slip", **sliding)
        page = visit(service.url, size)
        text = r"124\smm" if measured else "slips"
        shows(page, '[aria-label="index"] .head', text)
        wait_for_samples(page)
        page.screenshot(path=tmp_path / "page.png", full_page=True)
        assert flaws(page, size) == []
        heights = page.evaluate("holdfast.plots.rows.map(({ plot }) => plot.height)")
        assert min(heights) >= 40
        page.keyboard.press("2")
        assert flaws(page, size) == []


@pytest.mark.parametrize("n", [1, 6])
def test_other_hands_on_a_phone(visit, n):
    names = [f"finger{k + 1} of a long name" for k in range(n)]
    with Service(Tape(*made_up(names, "gtac"))) as service:
        service.at = 3.5
        page = visit(service.url, PHONE)
        wait_for_samples(page)
        assert flaws(page, PHONE) == []


def test_a_lost_connection_on_a_phone(visit):
    with Service(Tape(*made_up())) as service:
        page = visit(service.url, PHONE)
        wait_for_samples(page)
    shows(page, "#hand-word", "NO CONNECTION")
    assert flaws(page, PHONE) == []


def test_the_plots_have_room_on_a_phone(visit, service):
    page = visit(service.url, PHONE)
    wait_for_samples(page)
    sizes = page.evaluate("holdfast.plots.rows.map(({ plot }) => [plot.width, plot.height])")
    assert all(width > 330 and height >= 120 for width, height in sizes)
