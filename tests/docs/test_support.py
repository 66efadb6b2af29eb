"""The table of support names all sensors, sources and hands; the registry's page is right."""

import pytest

from holdfast.datasets import public_sets
from holdfast.devices.uri import SCHEMES
from holdfast.sensors import built_in_hands, built_in_sensors
from holdfast_grip.hands import HAND_SCHEMES

from . import blocks

DOCS = blocks.ROOT / "docs"
MAX_WORDS = 500


def text(page):
    return (DOCS / f"{page}.md").read_text("utf-8")


@pytest.mark.parametrize("page", ["support", "plugins", "datasets"])
def test_the_page_is_short(page):
    assert len(text(page).split()) < MAX_WORDS


def test_every_device_is_in_the_table_of_support():
    page = text("support")
    others = [f"{scheme}:" for scheme in (*SCHEMES, *HAND_SCHEMES)]
    for name in (*built_in_sensors(), *built_in_hands(), *others):
        assert f"`{name}`" in page, name


def test_no_hardware_is_claimed():
    rows = [line for line in text("support").splitlines() if line.startswith("| ")]
    last = {row.rstrip("|").rpartition("|")[2].strip() for row in rows}
    assert last == {"hardware", "none yet", "not needed"}


def test_the_page_of_data_sets_has_those_that_can_be_downloaded():
    page = text("datasets")
    for name, public in public_sets().items():
        if public.files:
            assert f"| `{name}` |" in page
            assert f"| {public.licence} | {'yes' if public.tried else 'untried'} |" in page
    files = [file for public in public_sets().values() for file in public.files]
    copies = sum(file.sha256 is not None for file in files) - 3
    assert f"Checksums** of {copies} files" in page
    assert f"The other {len(files) - copies - 3} files" in page
