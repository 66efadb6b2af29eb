"""An installation without extras: what works, and how it names the extra that is missing."""

import re
import subprocess
import sys
from importlib import metadata

import numpy as np
import pytest

from holdfast import save_recording
from holdfast.errors import (
    DISTRIBUTION,
    EXTRA_MODULES,
    PACKAGE_PARTS,
    MissingExtra,
    is_installed,
    missing_extra,
    require_extras,
)
from holdfast.synthetic import synthetic_recording
from training.build import normalised_model

BLOCK = """
import json, sys
from holdfast.errors import EXTRA_MODULES

for modules in EXTRA_MODULES.values():
    sys.modules.update(dict.fromkeys([*modules, "jinja2"]))
from holdfast.cli import main
for words in json.loads(sys.stdin.read()):
    for stream in (sys.stdout, sys.stderr):
        print(chr(30), end="", file=stream, flush=True)
    code = main(words)
    print(f"exit {code}", file=sys.stderr, flush=True)
"""
"""A program that runs verbs in one process, in which no module of an extra can be imported."""

CORE = [
    ["--version"],
    ["doctor"],
    ["sensors"],
    ["info", "builtin:any"],
    ["info", "grasp.mcap"],
    ["info", "."],
    ["detect", "builtin:any", "grasp.mcap"],
    ["detect", "builtin:twin", "grasp.mcap", "--json"],
    ["record", "grasp.mcap", "again.mcap", "--speed", "0"],
    ["import", "log.csv", "imported", "--sensor", "anyskin"],
    ["detect", "builtin:any", "imported/log.mcap"],
    ["calibrate", "normalised.json", "grasp.mcap", "-o", "mine.json", "--force"],
    ["detect", "mine.json", "grasp.mcap"],
    ["hold", "builtin:any", "grasp.mcap", "--hand", "log:commands.jsonl", "--speed", "0"],
    ["simulate", "--help"],
    ["label", "--help"],
    ["train", "--help"],
    ["play", "--help"],
    ["serve", "--help"],
]
"""Commands that work without any extra."""

DEMO = ["demo", "--speed", "0"]
"""Shows a real recording by the core alone, and names the extras of the rest."""

MISSING = {
    "twin,parquet": [
        ["simulate", "twin"],
        ["detect", "builtin:any", "twin:"],
        ["play", "twin:"],
        ["hold", "builtin:twin", "twin:", "--hand", "log:a.jsonl"],
    ],
    "twin": [["hold", "builtin:twin", "twin:", "--hand", "twin:", "--armed"]],
    "train": [
        ["train", ".", "-o", "m.json"],
        ["evaluate", "builtin:any", "."],
        ["tune", "builtin:any", ".", "-o", "m.json", "--false-alarms", "1"],
        ["import", "log.csv", "others", "--sensor", "anyskin", "--jobs", "2"],
    ],
    "label": [["label", "."], ["label", "auto", "signal", "grasp.mcap"]],
    "video": [["label", "markers", "sheet.pdf"]],
    "parquet": [
        ["info", "other/grasp.parquet"],
        ["detect", "builtin:any", "other/grasp.parquet"],
        ["import", "log.csv", "others", "--sensor", "anyskin", "--suffix", "parquet"],
    ],
    "plot": [["info", "grasp.mcap", "--plot", "a.png"], ["sensors", "anyskin", "--plot", "a.png"]],
    "serial": [["detect", "builtin:any", "serial:///dev/ttyACM0?sensor=anyskin"]],
    "cluster": [
        ["import", "log.csv", "others", "--sensor", "anyskin", "--engine", "dask:tcp://a:1"]
    ],
}
"""Commands that name an extra, and exit with 2."""


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """Return what each command printed on stdout and stderr, and its exit code."""
    import json

    folder = tmp_path_factory.mktemp("slim")
    recording = synthetic_recording("grasp", seed=0)
    save_recording(recording, folder / "grasp.mcap")
    normalised_model().save(folder / "normalised.json")
    (folder / "other").mkdir()
    (folder / "other" / "grasp.parquet").write_bytes(b"PAR1")
    columns = ["t", *(f"{axis}{taxel}" for taxel in range(1, 6) for axis in "xyz")]
    numbers = np.column_stack(
        [np.arange(300) / 100, np.random.default_rng(0).normal(size=(300, 15))]
    )
    np.savetxt(folder / "log.csv", numbers, "%.6f", ",", header=",".join(columns), comments="")
    commands = [*CORE, DEMO, *(words for group in MISSING.values() for words in group)]
    done = subprocess.run(
        [sys.executable, "-c", BLOCK], input=json.dumps(commands), capture_output=True,
        text=True, check=False, cwd=folder, timeout=200,
    )  # fmt: skip
    out, err = (text.split(chr(30))[1:] for text in (done.stdout, done.stderr))
    assert len(out) == len(err) == len(commands), done.stderr
    codes = [re.search(r"exit (\d+)\n$", text) for text in err]
    return {
        tuple(words): (out[k], err[k][: codes[k].start()], int(codes[k][1]))
        for k, words in enumerate(commands)
    }


@pytest.mark.parametrize("words", CORE, ids=" ".join)
def test_the_core_needs_no_extra(words, outcomes):
    out, err, code = outcomes[tuple(words)]
    assert code == 0, err
    assert out or words[0] == "record" or "--hand" in words


def test_the_demo_shows_a_real_recording_before_it_needs_extras(outcomes, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    out, err, code = outcomes[tuple(DEMO)]
    *shown, last = err.splitlines()
    assert (out, code) == ("", 2)
    assert any("finger1, hand   UNSTABLE" in line for line in shown)
    assert "the authors of the recording label: slip at " in shown[-1]
    expected = str(MissingExtra("mujoco", "twin,train,parquet,plot"))
    assert last == f"holdfast: {expected}"


@pytest.mark.parametrize(
    ("extra", "words"),
    [(extra, words) for extra, group in MISSING.items() for words in group],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_a_missing_extra_is_one_line(extra, words, outcomes, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # as the commands: outside the clone
    out, err, code = outcomes[tuple(words)]
    assert (out, code) == ("", 2)
    assert err.count("\n") == 1
    assert err.startswith("holdfast: this needs the package ")
    expected = str(MissingExtra("x", extra)).partition("installed: ")[2]
    assert err.rstrip("\n").endswith(f"not installed: {expected}")


def requirements(extra):
    """Return the names of the packages of an extra."""
    return {
        re.match(r"[\w.-]+", text)[0].lower()
        for text in metadata.requires(DISTRIBUTION)
        if re.search(rf"extra == ['\"]{extra}['\"]", text)
    }


def test_the_table_of_modules_fits_the_metadata():
    declared = set(metadata.metadata(DISTRIBUTION).get_all("Provides-Extra"))
    packages = {name.removeprefix("holdfast-") for name in PACKAGE_PARTS} - {"lab"}
    assert declared == {*EXTRA_MODULES, *packages, "all"}
    (every,) = (
        text for text in metadata.requires(DISTRIBUTION) if text.startswith(f"{DISTRIBUTION}[")
    )
    assert set(re.split(r"[\[\],]", every)[1:-1]) == declared - {"all"}
    assert every.endswith('; extra == "all"')


@pytest.mark.parametrize("extra", EXTRA_MODULES)
def test_each_module_belongs_to_a_package_of_its_extra(extra):
    packages = metadata.packages_distributions()
    for module in filter(is_installed, EXTRA_MODULES[extra]):
        assert requirements(extra) & {name.lower() for name in packages[module]}


def test_all_missing_extras_are_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtra, match="package mujoco, which") as raised:
        require_extras("twin", "parquet", "plot")
    assert raised.value.args == ("mujoco", "twin,plot")


def test_an_import_that_fails_names_its_extra():
    found = missing_extra(ModuleNotFoundError("no", name="pyarrow.parquet"))
    assert found.args == ("pyarrow", "parquet")
    found = missing_extra(ModuleNotFoundError("no", name="holdfast_grip.hands"))
    assert found.args == ("holdfast_grip", "grip")
    assert missing_extra(ModuleNotFoundError("no", name="holdfast_lab")) is None
    assert missing_extra(ModuleNotFoundError("no", name="numpy")) is None
    assert missing_extra(ModuleNotFoundError("no")) is None
