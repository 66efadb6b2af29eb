"""An estimate is one type: a field that it gets is in all documents, without another change."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import get_args

import msgspec
import pytest
from msgspec.structs import fields

import holdfast
from holdfast.cli.detect.output import json_lines
from holdfast.contact import ContactEstimate
from holdfast.live.documents import FingerDocument, document_type, finger_document
from holdfast.live.estimate_chunks import EstimateChunk
from live import estimates

PACKAGE = Path(holdfast.__file__).parent
NEW_FIELD = "    slip_distance: float | None = None\n"
"""Line of the package after which the test adds a field to the estimate."""
PROGRAM = """
import json, sys
import holdfast
from holdfast.live.estimate_chunks import EstimateChunk
from holdfast.cli.detect.output import json_lines
from holdfast.contact import ContactState, HandEstimate
from holdfast.live.documents import finger_document
from holdfast.live.web.schema import EstimateDocument
from live import estimates
import msgspec

finger = estimates.finger(humidity=0.25)
hand = HandEstimate(7.0, ContactState.STABLE, {"thumb": finger})
socket = EstimateDocument(
    time=7.0, hand=hand.state, fingers={"thumb": finger_document(finger, [(1.0, 2.0, 3.0)])}
)
(line,) = json_lines(EstimateChunk("made", {"thumb": [finger]}, []))
json.dump(
    {
        "package": holdfast.__file__,
        "line": json.loads(line),
        "socket": msgspec.to_builtins(socket)["fingers"]["thumb"],
        "schema": msgspec.json.schema(EstimateDocument)["$defs"]["FingerDocument"],
    },
    sys.stdout,
)
"""


@pytest.fixture(scope="module")
def wider(tmp_path_factory):
    """Return what a copy of the package prints whose estimate has one more field."""
    folder = tmp_path_factory.mktemp("wider")
    package = folder / "holdfast"
    package.mkdir()
    for path in PACKAGE.iterdir():
        if path.name not in ("contact.py", "__pycache__"):
            (package / path.name).symlink_to(path)
    text = (PACKAGE / "contact.py").read_text("utf-8")
    assert text.count(NEW_FIELD) == 1
    wide = text.replace(NEW_FIELD, NEW_FIELD + "    humidity: float = 0.0\n")
    (package / "contact.py").write_text(wide, "utf-8")
    paths = os.pathsep.join([str(folder), str(Path(__file__).parents[1])])
    answer = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=os.environ | {"PYTHONPATH": paths},
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert not answer.returncode, answer.stderr
    found = json.loads(answer.stdout)
    assert Path(found["package"]).parent == package
    return found


def test_a_new_field_of_the_estimate_is_in_every_document(wider):
    assert list(wider["line"])[-2:] == ["slip_distance", "humidity"]
    assert list(wider["socket"])[-3:] == ["slip_distance", "humidity", "taxels"]
    assert wider["line"]["humidity"] == wider["socket"]["humidity"] == 0.25
    assert wider["socket"]["taxels"] == [[1.0, 2.0, 3.0]]
    assert {"type": "null"} in wider["schema"]["properties"]["humidity"]["anyOf"]
    assert "humidity" in wider["schema"]["required"]


def test_all_documents_have_the_fields_of_the_estimate():
    estimate = estimates.estimate()
    (lines,) = json_lines(EstimateChunk("made", {"thumb": [estimate.fingers["thumb"]]}, []))
    socket = msgspec.to_builtins(finger_document(estimate.fingers["thumb"]))
    names = list(ContactEstimate.__struct_fields__)
    assert list(json.loads(lines)) == [names[0], "finger", *names[1:]]
    assert list(socket) == [*names, "taxels"]


def test_numbers_may_be_null_where_a_value_may_have_none():
    def nullable(kind):
        found = {field.name: field.type for field in fields(kind)}
        return {name for name, part in found.items() if float in get_args(part)}

    assert nullable(FingerDocument) == {
        "stable_probability", "instability", "slip_probability", "slip_speed", "slip_distance",
    }  # fmt: skip
    force = next(field.type for field in fields(FingerDocument) if field.name == "force")
    assert get_args(force) == (float | None,) * 3


class Wish(msgspec.Struct):
    scale: float
    reason: str = ""


def test_an_optional_field_of_a_value_is_required_in_its_document():
    kind = document_type("Wish", Wish, "A wish.")
    with pytest.raises(TypeError, match=r"Missing required argument 'reason'"):
        kind(1.0)
    assert kind.__doc__ == "A wish."
