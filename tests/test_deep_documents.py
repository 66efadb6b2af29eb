"""Documents that are nested deeper than any reader can follow are refused as documented."""

import pytest

from holdfast.detection import Model
from holdfast.errors import ModelError, RecordingError
from holdfast.io import load_labels
from holdfast.sensors import Sensor
from holdfast.twin.objects import load_objects

DEPTH = 100_000
LISTS = "[" * DEPTH + "]" * DEPTH
TOML_LISTS = "[" * (DEPTH // 4) + "]" * (DEPTH // 4)
"""A TOML file has at most 64 kB."""
LINKS = "<link>" * DEPTH + "</link>" * DEPTH


@pytest.mark.parametrize(
    ("read", "text", "refusal"),
    [
        (Model.load, f'{{"name": {LISTS}}}', ModelError),
        (load_labels, f'{{"name": {LISTS}}}', RecordingError),
        (Sensor.from_json, f'{{"name": {LISTS}}}', ValueError),
        (load_objects, f"mug = {TOML_LISTS}", ValueError),
        (lambda path: Sensor.from_urdf(path, "tip"), f"<robot>{LINKS}</robot>", ValueError),
    ],
    ids=["model", "labels", "sensor", "objects", "URDF"],
)
def test_a_deep_document_is_refused(tmp_path, read, text, refusal):
    path = tmp_path / "deep"
    path.write_text(text)
    with pytest.raises(refusal) as refused:
        read(path)
    assert type(refused.value) is refusal
    assert str(path) in str(refused.value)
