import subprocess
import sys
from pathlib import Path

import pytest

from holdfast.devices.sources import SCHEMES, open_source
from holdfast.devices.sources.replay import ReplaySource
from holdfast.devices.uri import SOURCE_PLUGINS, is_uri, parse

KNOWN = "there are " + ", ".join(
    f"{name}:" for name in ("xela", "twin", "serial", *SOURCE_PLUGINS.names())
)


def test_the_parts_of_a_uri():
    scheme, address = parse("xela://10.0.0.2:5000/hand?values=counts&fingers=1:thumb,2:index")
    assert scheme == "xela"
    assert (address.host, address.path) == ("10.0.0.2:5000", "/hand")
    assert address.parameters == {"values": "counts", "fingers": "1:thumb,2:index"}
    assert address.text == "xela://10.0.0.2:5000/hand?values=counts&fingers=1:thumb,2:index"


def test_what_is_encoded_is_decoded():
    assert parse("twin:?object=a%20b+c&seed=")[1].parameters == {"object": "a b c", "seed": ""}


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


@pytest.mark.parametrize("text", ["grasp.csv:", "udp://host", "http://host/a", "can", "", ":"])
def test_unknown_schemes(text):
    with pytest.raises(ValueError, match=re.escape(repr(text))):
        parse(text)


def test_another_scheme_opens_nothing():
    with pytest.raises(ValueError, match="'udp://host'"):
        open_source("udp://host")


def test_a_parameter_that_is_given_twice():
    with pytest.raises(ValueError, match="twice"):
        parse("twin:?seed=1&seed=2")


def test_an_invalid_uri():
    with pytest.raises(ValueError, match="no URI"):
        open_source("xela://[1:2")


def test_a_parameter_without_a_value():
    with pytest.raises(ValueError, match="'loop'"):
        parse("twin:?object=can&loop")


def test_what_comes_after_a_hash_is_refused():
    with pytest.raises(ValueError, match="after #"):
        parse("twin:?object=can#1")


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
    "given", ["thumb", "1:", ":thumb", "one:thumb", "-1:thumb", "1=thumb", "²:t"]
)
def test_invalid_names(given):
    with pytest.raises(ValueError, match=repr(given)):
        parse(f"xela:?fingers={given}")[1].names()


@pytest.mark.parametrize("given", ["1:thumb,2:thumb", "1:thumb,1:index"])
def test_repeated_names(given):
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
        assert (source.paced, source._loops) == (False, True)
        assert source.name == text


def test_every_scheme_is_described():
    for scheme, text in SCHEMES.items():
        assert f"{scheme}:" in text


def test_nothing_is_imported_for_other_schemes():
    import subprocess

    code = (
        "import sys; from holdfast.devices.sources import open_source; open_source('a.parquet'); "
        "print([n for n in ('serial', 'websockets', 'cyclonedds', 'mujoco') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("module", ["uri", "sources"])
def test_a_module_can_be_imported_first(module):
    subprocess.run([sys.executable, "-c", f"import holdfast.devices.{module}"], check=True)
