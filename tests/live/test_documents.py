"""An estimate is one type: a field that it gets is in all documents, without another change."""

import json
from typing import get_args

import msgspec
import pytest
from msgspec.structs import fields

from holdfast.cli.detect.output import json_lines
from holdfast.contact import ContactEstimate
from holdfast.live.documents import FingerDocument, document_type, finger_document
from holdfast.live.estimate_chunks import EstimateChunk
from live import estimates


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
