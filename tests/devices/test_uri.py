import subprocess
import sys
from pathlib import Path

import pytest

from holdfast.devices.sources import open_source
from holdfast.devices.sources.replay import ReplaySource
from holdfast.devices.uri import is_uri, parse


def test_the_parts_of_a_uri():
    scheme, address = parse("xela://10.0.0.2:5000/hand?values=counts&fingers=1:thumb,2:index")
    assert scheme == "xela"
    assert (address.host, address.path) == ("10.0.0.2:5000", "/hand")
    assert address.parameters == {"values": "counts", "fingers": "1:thumb,2:index"}
    assert address.text == "xela://10.0.0.2:5000/hand?values=counts&fingers=1:thumb,2:index"


@pytest.mark.parametrize(
    ("text", "host", "path"),
    [
        ("serial:///dev/ttyACM0", "", "/dev/ttyACM0"),
        ("serial:/dev/ttyACM0", "", "/dev/ttyACM0"),
        ("serial:COM3", "", "COM3"),
        ("xela://auto", "auto", ""),
        ("twin:", "", ""),
    ],
)
def test_host_and_path(text, host, path):
    _, address = parse(text)
    assert (address.host, address.path) == (host, path)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        *((text, repr(text)) for text in ("grasp.csv:", "udp://host", "http://host/a", "can", "")),
        ("xela://[1:2", "no URI"),
        ("twin:?seed=1&seed=2", "twice"),
        ("twin:?object=can&loop", "'loop'"),
        ("twin:?object=can#1", "after #"),
    ],
)
def test_what_is_no_uri_of_a_source(text, named):
    with pytest.raises(ValueError, match=named):
        parse(text)


def test_unknown_parameters():
    address = parse("twin:?objekt=can&seed=1&sede=2")[1]
    address.only("objekt", "seed", "sede")
    with pytest.raises(ValueError, match="objekt, sede; there are object, seed"):
        address.only("object", "seed")


def test_names_of_fingers():
    assert parse("xela:?fingers=1:thumb,%202%20:%20palm/1")[1].names() == {1: "thumb", 2: "palm/1"}
    assert parse("xela:?fingers=")[1].names() == {}
    assert parse("xela:")[1].names() == {}


@pytest.mark.parametrize(
    "given",
    [
        *("thumb", "1:", ":thumb", "one:thumb", "-1:thumb", "1=thumb", "²:t"),
        *("1:thumb,2:thumb", "1:thumb,1:index"),
    ],
)
def test_invalid_names(given):
    with pytest.raises(ValueError, match=repr(given)):
        parse(f"xela:?fingers={given}")[1].names()


def test_an_existing_file_is_no_uri(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert is_uri("twin:a.parquet")
    Path("twin:a.parquet").touch()
    assert not is_uri("twin:a.parquet")
    assert isinstance(open_source("twin:a.parquet"), ReplaySource)


@pytest.mark.parametrize("text", ["a.parquet", "/a/b.mcap", r"C:\a.parquet", "C:/a.mcap", "TWIN:"])
def test_everything_else_is_a_file(text):
    assert not is_uri(text)
    assert isinstance(open_source(text), ReplaySource)


def test_speed_and_loop_are_for_the_replay_and_the_twin(tmp_path):
    for text in ("a.parquet", "twin:"):
        source = open_source(text, speed=0, loop=True)
        assert (source.paced, source.name) == (False, text)


def test_nothing_is_imported_for_other_schemes():
    code = (
        "import sys; from holdfast.devices.sources import open_source; open_source('a.parquet'); "
        "print([n for n in ('serial', 'websockets', 'cyclonedds', 'mujoco') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
