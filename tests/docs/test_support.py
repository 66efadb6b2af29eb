"""The table of support names all sensors, sources and hands."""

from holdfast.devices.uri import SCHEMES
from holdfast.sensors import built_in_hands, built_in_sensors
from holdfast_grip.hands import HAND_SCHEMES

from . import blocks


def test_every_device_is_in_the_table_of_support():
    page = (blocks.ROOT / "docs" / "support.md").read_text("utf-8")
    others = [f"{scheme}:" for scheme in (*SCHEMES, *HAND_SCHEMES)]
    for name in (*built_in_sensors(), *built_in_hands(), *others):
        assert f"`{name}`" in page, name
