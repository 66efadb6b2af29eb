"""The labelling page on a phone, a tablet and a desktop."""

import pytest

from labelling.page.actions import drag, labels, ready
from labelling.page.fake_service import label
from web.screens import PHONE, SCREENS, flaws


@pytest.mark.parametrize("size", SCREENS)
def test_nothing_overlaps_or_overflows(visit, service, size, tmp_path):
    service.recordings[0].save({"thumb": [label(5, 9, "stable")]})
    page = visit(service.url, size)
    ready(page)
    page.screenshot(path=tmp_path / "page.png", full_page=True)
    assert flaws(page, size) == []
    page.locator("#cursor-canvas").click(position={"x": 60, "y": 30})  # more in the status bar
    assert flaws(page, size) == []


def test_a_label_is_drawn_on_a_phone(visit, service):
    page = visit(service.url, PHONE)
    ready(page)
    page.click("#states button[data-value=unstable]")
    drag(page, "index", 8, 16)
    ((start, end, state, _),) = labels(page, "index")
    assert (start, end) == pytest.approx((8, 16), abs=1.5)  # edges snap to change points
    assert state == "unstable"
    assert flaws(page, PHONE) == []
