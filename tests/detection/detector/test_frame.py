"""Estimates as a DataFrame: the words and numbers of the JSON lines."""

import json
import sys

import pytest

from holdfast.cli.detect.output import json_lines
from holdfast.contact import ContactState
from holdfast.detection import detect
from holdfast.errors import MissingExtra
from holdfast.live.estimate_chunks import chunk_from_detection

from .build import broken, cause_head, model, recording, tactile

TEXTS = ("faults", "faulty_taxels")


def detected(slips=(), speeds=()):
    made = model(slips=slips, speeds=speeds, threshold=20.0)
    part = made.fingers["thumb"]
    parts = {**made.fingers, "thumb": part.with_heads(cause_head(part.features))}
    hand = {"thumb": broken(tactile(seed=1)), "index": tactile(seed=2, start=0.004)}
    return detect(type(made)(**{**vars_of(made), "fingers": parts}), recording(**hand))


def vars_of(struct):
    return {name: getattr(struct, name) for name in struct.__struct_fields__}


@pytest.mark.parametrize("slips", [(), ("thumb", "index")], ids=["no slip rule", "slips"])
def test_rows_are_the_json_lines(slips):
    detection = detected(slips, slips)
    frame = detection.to_frame()
    lines = [
        json.loads(line)
        for block in json_lines(chunk_from_detection(detection))
        for line in block.splitlines()
    ]
    assert len(frame) == len(lines) > 300
    assert frame["cause"].notna().any()
    assert (frame["faults"] != "").any()
    for row, line in zip(frame.to_dict("records"), lines, strict=True):
        for axis, force in zip("xyz", line.pop("force"), strict=True):
            line[f"force_{axis}"] = force
        line |= {name: ", ".join(map(str, line[name])) for name in TEXTS}
        assert row.pop("hand") in list(ContactState)
        assert row.keys() == line.keys()
        for name, value in line.items():
            got = row[name]
            assert (got != got) if value is None else got == value, name


def test_the_state_of_the_hand_is_that_of_the_same_instant():
    detection = detected()
    frame = detection.to_frame()
    hand = dict(zip(detection.times.tolist(), detection.hand.tolist(), strict=True))
    assert [hand[time] for time in frame["time"]] == [
        ContactState(word).code for word in frame["hand"]
    ]
    assert {ContactState(code) for code in detection.fingers["thumb"].state} == {
        ContactState(word) for word in frame["state"][frame["finger"] == "thumb"]
    }


def test_without_pandas_the_extra_is_named(monkeypatch):
    detection = detected()
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtra, match="pandas"):
        detection.to_frame()
