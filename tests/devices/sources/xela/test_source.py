import json

import pytest

from holdfast.devices.sources import open_source
from holdfast.devices.sources.xela.client import XelaSource
from holdfast.sensors import sensor


def test_a_sensor_from_a_file(tmp_path):
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(sensor("uskin-4x4").to_dict()))
    assert isinstance(open_source(f"xela://auto?sensor={path}"), XelaSource)


@pytest.mark.parametrize(
    ("query", "text"),
    [
        ("value=counts", "unknown parameter value"),
        ("values=force", "'force'"),
        ("fingers=thumb", "'thumb'"),
        ("sensor=nothing", "uskin-curved"),
        ("sensor=/none/nothing.json", "nothing.json"),
    ],
)
def test_what_is_refused(query, text):
    with pytest.raises(ValueError, match=text):
        open_source(f"xela://auto?{query}")
