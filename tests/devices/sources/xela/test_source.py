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
        ("value=counts", "unknown parameter value; there are values, fingers, sensor"),
        ("values=force", "values=counts or calibrated expected, 'force' given"),
        ("fingers=thumb", "fingers=1:thumb,2:index expected, 'thumb' given"),
        ("sensor=nothing", "sensor=FILE.json or one of uskin-curved, "),
    ],
)
def test_what_is_refused(query, text):
    with pytest.raises(ValueError) as refusal:
        open_source(f"xela://auto?{query}")
    assert str(refusal.value).startswith(f"xela://auto?{query}: {text}")


def test_a_sensor_that_is_no_file(tmp_path):
    with pytest.raises(ValueError, match=r"nothing\.json"):
        open_source(f"xela://auto?sensor={tmp_path}/nothing.json")
