"""The table of support names all sensors, sources and hands; the registry's page is right."""

import pytest

from holdfast.devices.uri import SCHEMES
from holdfast.sensors import built_in_hands, built_in_sensors
from holdfast_grip.hands import HAND_SCHEMES

from . import blocks

DOCS = blocks.ROOT / "docs"
MAX_WORDS = {"support": 500, "datasets": 650, "plugins": 850}


def text(page):
    return (DOCS / f"{page}.md").read_text("utf-8")


@pytest.mark.parametrize("page", MAX_WORDS)
def test_the_page_is_short(page):
    assert len(text(page).split()) < MAX_WORDS[page]


def test_every_device_is_in_the_table_of_support():
    page = text("support")
    others = [f"{scheme}:" for scheme in (*SCHEMES, *HAND_SCHEMES)]
    for name in (*built_in_sensors(), *built_in_hands(), *others):
        assert f"`{name}`" in page, name


def test_no_hardware_is_claimed():
    rows = [line for line in text("support").splitlines() if line.startswith("| ")]
    last = {row.rstrip("|").rpartition("|")[2].strip() for row in rows}
    assert last == {"hardware", "none yet", "not needed"}
