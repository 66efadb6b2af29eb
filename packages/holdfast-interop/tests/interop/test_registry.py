import json
from importlib import resources
from pathlib import Path

import msgspec
import pytest

from holdfast.io.importers import FORMATS, IMPORTER_PLUGINS
from holdfast.sensors import built_in_hands, built_in_sensors
from holdfast_interop.datasets import find_set, public_sets
from holdfast_interop.datasets.registry import Registry, other_sets

DOCUMENT = json.loads(
    resources.files("holdfast_interop.datasets").joinpath("registry.json").read_text()
)
FOREIGN_SENSORS = {"uskin-3x6"}
"""Sensors that an importer makes."""
SET = {
    "name": "a", "title": "t", "sensors": [], "labels": "none", "licence": "MIT", "tried": False,
}  # fmt: skip


@pytest.mark.parametrize("public", public_sets().values(), ids=lambda public: public.name)
def test_a_set_names_what_holdfast_has(public):
    known = {*built_in_sensors(), *built_in_hands(), *FOREIGN_SENSORS}
    assert set(public.sensors) <= known
    assert public.importer in (*FORMATS, *IMPORTER_PLUGINS.names(), None)
    if public.files:
        assert public.address.startswith("https://")
        assert (public.page, bool(public.size)) == (public.page or "missing", True)
        known_size = sum(file.size or 0 for file in public.files)
        assert known_size <= public.size + 10_000


def test_what_the_facts_say():
    counts = {name: len(public.files) for name, public in public_sets().items() if public.files}
    assert counts == {
        "uskin-pick-move": 42, "eflesh-tugs": 138, "gtac-grasps": 39, "gtac-manipulation": 10,
        "arq-slip-2021": 3, "anyskin-slip": 17,
    }  # fmt: skip
    first_digits = [file.sha256[:8] for file in find_set("arq-slip-2021").files]
    assert first_digits == ["a2aef56b", "c8124b29", "a8c4f14e"]
    assert {name for name, public in public_sets().items() if public.tried} == {
        "uskin-pick-move", "eflesh-tugs", "gtac-grasps", "gtac-manipulation",
    }  # fmt: skip
    assert find_set("sparsh-skin").size == 54_000_000_000


def test_an_unknown_name():
    with pytest.raises(ValueError, match="unknown data set 'slip'; there are uskin-pick-move, e"):
        find_set("slip")
    assert other_sets("eflesh-tugs").startswith("uskin-pick-move, gtac-grasps,")


def decode(*changes, **fields):
    document = {"schema": "holdfast.datasets/1", "datasets": list(changes), **fields}
    return msgspec.json.decode(json.dumps(document), type=Registry)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "a: files or a reason expected, one of the two"),
        ({"reason": "r", "files": [{"path": "x"}]}, "a: files or a reason expected"),
        ({"files": [{"path": "x"}]}, "a: an importer and an address with / at the end expected"),
        ({"files": [{"path": "../x"}]}, "matching regex"),
        ({"files": [{"path": "/etc/x"}]}, "matching regex"),
        ({"files": [{"path": "x", "sha256": "12"}]}, "matching regex"),
        ({"files": [{"path": "x", "size": -1}]}, ">= 0"),
        ({"reason": "r", "page": "file:///x"}, "matching regex"),
        ({"reason": "r", "owner": "x"}, "unknown field `owner`"),
        ({"importer": "csv", "files": [{"path": "x"}] * 2, "address": "https://h/"},
         "two files have the same path"),
    ],
)  # fmt: skip
def test_a_wrong_set_is_refused(fields, message):
    with pytest.raises(msgspec.ValidationError, match=message):
        decode({**SET, **fields})


def test_a_wrong_registry_is_refused():
    whole = {**SET, "reason": "r"}
    assert decode(whole).datasets[0].name == "a"
    with pytest.raises(msgspec.ValidationError, match="two data sets have the same name"):
        decode(whole, whole)
    with pytest.raises(msgspec.ValidationError, match=r"schema holdfast\.datasets/1 expected"):
        decode(whole, schema="holdfast.datasets/2")
    assert len(DOCUMENT["datasets"]) == len(public_sets())


def test_the_page_of_data_sets_has_those_that_can_be_downloaded():
    page = Path(__file__).parents[4].joinpath("docs/datasets.md").read_text("utf-8")
    for name, public in public_sets().items():
        if public.files:
            assert f"| `{name}` |" in page
            assert f"| {public.licence} | {'yes' if public.tried else 'untried'} |" in page
    files = [file for public in public_sets().values() for file in public.files]
    copies = sum(file.sha256 is not None for file in files) - 3
    assert f"Checksums** of {copies} files" in page
    assert f"The other {len(files) - copies - 3} files" in page
