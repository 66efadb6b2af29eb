"""Plug-ins of other packages: found by name, loaded late, and named if they are skipped."""

import json
import re
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

import holdfast
from holdfast.cli import main
from holdfast.cli.extensions import (
    EXPORTER_PLUGINS,
    PLUGIN_GROUPS,
    PUBLISHER_PLUGINS,
    SIMULATOR_PLUGINS,
    flags_of,
    plugin_states,
)
from holdfast.devices.uri import open_source, parse
from holdfast.errors import PACKAGE_PARTS, HoldfastError, RecordingError
from holdfast.io import import_recordings
from holdfast.io.foreign import end_children
from holdfast.io.importers import IF_IN_CONTACT
from holdfast.plugins import PluginGroup
from holdfast.removed import REMOVED
from holdfast.sensors import sensor
from holdfast_grip.hands import open_hand
from installed import install, install_project, on_the_path

TEMPLATE = Path(holdfast.__file__).parents[2] / "examples" / "plugin"

PARTS = '''
from pathlib import Path
from holdfast_grip.hands.local import LogFile

pad_name = "pad"

def count(to: int = 1) -> None:
    """Count."""
    print(*range(1, to + 1))

class Hand(LogFile):
    def __init__(self, uri):
        super().__init__(uri, "commands")

class Mute(Exception):
    def __str__(self):
        raise RuntimeError

def __getattr__(name):
    if name == "mute":
        raise Mute
    if name == "odd":
        raise GeneratorExit
    raise AttributeError(name)

def not_a_hand(uri):
    return Path(uri)
'''
POINTS = {
    "holdfast.sensors": {"pad": "parts:pad_name"},
    "holdfast.laws": {"twice": "parts:pad_name"},
    "holdfast.hands": {"grab": "parts:Hand", "hollow": "parts:not_a_hand"},
    "holdfast.sources": {
        "gone": "no_such_module:source",
        "number": "parts:__name__",
        "mute": "parts:mute",
        "odd": "parts:odd",
        "twin": "parts:pad_name",
    },
    "holdfast.importers": {"broken": "broken", "half": "parts"},
    "holdfast.verbs": {"count": "parts:count", "sum": "parts:pad_name"},
}


@pytest.fixture
def parts(tmp_path, monkeypatch):
    """A package with plug-ins of all kinds, some of which cannot be used."""
    broken = "import sys\nprint('imported', file=sys.stderr)\nraise RuntimeError('no\\n\x1bdevice')"
    files = {"parts.py": PARTS, "broken.py": broken}
    # A name of its own: each reason is reported once in a process.
    install(tmp_path / "site", f"acme-{tmp_path.name}", files, POINTS)
    with on_the_path(tmp_path / "site", monkeypatch):
        yield tmp_path


def reports(caplog):
    return [record.getMessage() for record in caplog.records if record.name == "holdfast.plugins"]


def test_each_is_found_by_its_name_and_listed_after_our_own(parts, caplog):
    assert open_hand("grab:left").name == "grab:left"
    assert parse("gone://host")[0] == "gone"
    with pytest.raises(ValueError, match="of plug-ins: grab, hollow, ros2"):
        open_hand("grip:left")
    with pytest.raises(ValueError, match="xela:, twin:, serial:, orca:, gone:, mute:"):
        open_source("none:")
    (report,) = reports(caplog)
    assert report.startswith("plug-in twin (sources of acme")
    assert open_source("twin:").name == "twin:"


def test_nothing_is_imported_before_it_is_used(parts):
    parse("gone://host"), open_source("twin:")
    with pytest.raises(ValueError, match="is no hand"):
        open_hand("none:")
    assert "parts" not in sys.modules


@pytest.mark.parametrize(
    ("name", "reason"),
    [("gone", "no_such_module"), ("number", "parts"), ("mute", "Mute"), ("odd", "GeneratorExit")],
)
def test_one_that_cannot_be_used_is_named_and_skipped(parts, caplog, name, reason):
    with pytest.raises(ValueError, match=r"unknown|holdfast doctor"):
        open_source(f"{name}:")
    begin = f"plug-in {name} (sources of acme"
    assert any(text.startswith(begin) and reason in text for text in reports(caplog))


def test_what_is_no_hand_is_named(parts):
    with pytest.raises(ValueError, match="plug-in hollow must return a subclass of HandDevice"):
        open_hand("hollow:left")


def test_a_broken_importer_does_not_hinder_the_others(parts, caplog):
    (parts / "a.txt").write_text("hello")
    for _ in range(2):
        with pytest.raises(RecordingError, match=r"plug-ins:.* broken, .*half, "):
            import_recordings(parts / "a.txt")
    broken, half = reports(caplog)
    assert broken.startswith("plug-in broken (importers of acme")
    assert broken.endswith("no device")
    assert half.startswith("plug-in half (importers of acme")
    with pytest.raises(ValueError, match=r"half .*holdfast doctor"):
        import_recordings(parts / "a.txt", "half")


def test_formats_of_packages_that_are_not_installed_are_named(tmp_path, monkeypatch):
    monkeypatch.setitem(PACKAGE_PARTS, "holdfast-far", {"importers": ("far",)})
    with pytest.raises(ValueError, match=r"far \(holdfast-far\)"):
        import_recordings(tmp_path, "near")
    with pytest.raises(HoldfastError, match=r"holdfast-far.*(\[far\]|extra far)"):
        import_recordings(tmp_path, "far")


VERB_OF_KIND = {"exporters": "export", "simulators": "simulate", "publishers": "serve"}
"""The verb that gets the options of a kind of plug-ins."""
PACKAGES = ["holdfast-lab", *sorted(path.name for path in TEMPLATE.parents[1].glob("packages/*"))]
"""Distributions beside the core."""


@pytest.mark.parametrize("package", PACKAGES)
def test_the_table_of_packages_has_their_entry_points(package):
    parts, options = {}, []
    for point in metadata.distribution(package).entry_points:
        kind = point.group.removeprefix("holdfast.")
        parts.setdefault(kind, set()).add(point.name)
        if kind in VERB_OF_KIND:
            flags = flags_of(point.load().OPTIONS)
            options += [f"{VERB_OF_KIND[kind]} {flag}" for flag in flags]
    if options:
        parts["options"] = set(options)
    assert {kind: set(names) for kind, names in PACKAGE_PARTS[package].items()} == parts


def test_two_packages_with_one_name(tmp_path, monkeypatch, caplog):
    for package in ("zeta", "alpha"):
        files = {f"{package}.py": f"value = '{package}'"}
        install(tmp_path, package, files, {"holdfast.things": {"thing": f"{package}:value"}})
    group = PluginGroup("things", (), lambda name, loaded: loaded)
    with on_the_path(tmp_path, monkeypatch):
        assert (group.load("thing"), group.load("thing")) == ("alpha", "alpha")
        states = [(plugin.package, plugin.error) for plugin in group.states(lambda *_: "")]
    refusal = "alpha 1.2 has thing as well; another name expected"
    assert sorted(states) == [("alpha 1.2", ""), ("zeta 1.2", refusal)]
    assert reports(caplog) == [f"plug-in thing (things of zeta 1.2) is skipped: {refusal}"]


@pytest.mark.slow  # each plug-in is imported in a process of its own
def test_doctor_lists_them(parts):
    plugins = plugin_states()
    works = {plugin.name for plugin in plugins if not plugin.error}
    assert works == {"grab", "hollow", "count"}
    assert all(plugin.package.startswith("acme") for plugin in plugins)
    (broken,) = [plugin for plugin in plugins if plugin.name == "broken"]
    assert broken.error.endswith("no device")


def test_a_kind_that_was_removed_is_named_with_what_to_use_instead(tmp_path, monkeypatch):
    points = {f"holdfast.{kind}": {f"old-{kind}": "none:none"} for kind in REMOVED["plugins"]}
    install(tmp_path / "site", "acme", {}, points)
    with on_the_path(tmp_path / "site", monkeypatch):
        with pytest.raises(ValueError, match="unknown sensor"):
            sensor("old-sensors")
        errors = {plugin.name: plugin.error for plugin in plugin_states()}
    for kind, instead in REMOVED["plugins"].items():
        assert errors[f"old-{kind}"].endswith(instead)


def test_help_lists_verbs_of_plug_ins_and_imports_none(parts, capsys):
    assert main(["--help"]) == 0
    assert " count " in capsys.readouterr().out
    assert "parts" not in sys.modules
    assert main(["count", "--to", "3"]) == 0
    assert capsys.readouterr().out == "1 2 3\n"


EXTENSIONS = (
    (PUBLISHER_PLUGINS, "publisher"),
    (EXPORTER_PLUGINS, "export"),
    (SIMULATOR_PLUGINS, "simulate"),
)


@pytest.mark.parametrize(("group", "function"), EXTENSIONS, ids=[f for _, f in EXTENSIONS])
def test_what_adds_options_needs_them_and_its_function(group, function, tmp_path, monkeypatch):
    site, kind = tmp_path / "site", group.kind
    text = (
        "from dataclasses import dataclass\n"
        "@dataclass(frozen=True)\nclass Options:\n    x: int = 1\n"
        f"class whole:\n    OPTIONS = Options()\n    {function} = print\n"
        "class empty:\n    OPTIONS = Options()\n"
        f"class odd:\n    OPTIONS = Options\n    {function} = print\n"
    )
    points = {name: f"adding:{name}" for name in ("whole", "empty", "odd")}
    install(site, "acme", {"adding.py": text}, {f"holdfast.{kind}": points})
    with on_the_path(site, monkeypatch):
        assert group.error("whole") == ""
        for name in ("empty", "odd"):
            assert re.search(f"OPTIONS.*{function} expected for {name}", group.error(name))


def test_packages_of_another_version_are_refused(tmp_path, monkeypatch, caplog, capsys):
    """`install` writes version 1.2."""
    points = {"holdfast.verbs": {"trial": "nothing:trial"}}
    install(tmp_path / "site", "holdfast-lab", {}, points)
    with on_the_path(tmp_path / "site", monkeypatch):
        assert main(["trial", "--help"]) == 2
    assert caplog.text == ""
    (line,) = capsys.readouterr().err.splitlines()
    assert f"holdfast-lab 1.2 given, {metadata.version('holdfast-tactile')} expected" in line


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """A function that runs a verb with the template package of `examples/plugin` installed."""
    install_project(tmp_path / "site", TEMPLATE)
    monkeypatch.chdir(tmp_path)
    end_children()  # those of other tests have another path

    def run(*words, code=0):
        assert main([*words]) == code
        out, err = capsys.readouterr()
        return err if code else out

    with on_the_path(tmp_path / "site", monkeypatch):
        yield run


@pytest.mark.slow  # each plug-in is imported in a process of its own
def test_the_template_is_listed_by_doctor(run):
    assert [(plugin.kind, plugin.name, plugin.error) for plugin in plugin_states()] == [
        ("sources", "pins", ""),
        ("importers", "pins-log", ""),
    ]


def test_the_source_of_the_template(run, tmp_path):
    run("record", "pins:?seconds=2", "press.mcap")
    recording = holdfast.load_recording(tmp_path / "press.mcap")
    assert recording.modules["finger1"].n_samples == 200
    assert recording.modules["finger1"].sensor.name == "pin-skin"
    lines = run("detect", "builtin:any", "pins:?seconds=2", "--json").splitlines()
    states = [json.loads(line)["state"] for line in lines]
    assert states[90] == "NO_CONTACT"
    assert states[-1] == "STABLE"
    assert "parameter secs" in run("record", "pins:?secs=2", "a.mcap", code=2)


def test_the_format_of_the_template(run, tmp_path):
    times = np.arange(200) / 100
    rows = np.column_stack([times, np.random.default_rng(0).normal(size=(200, 18)).round(6)])
    np.savetxt(tmp_path / "press.pins", rows, "%.6f")
    imported = json.loads(run("import", "press.pins", "out", "--json"))
    assert imported["n_samples"] == 200
    assert imported["hint"] == IF_IN_CONTACT
    loaded = holdfast.load_recording(tmp_path / imported["recordings"][0]["path"])
    np.testing.assert_allclose(loaded.modules["finger1"].readings.reshape(200, 18), rows[:, 1:])
    (tmp_path / "bad.pins").write_text("0.0 1 2\n")
    assert "bad.pins, line 1" in run("import", "bad.pins", "bad", "--format", "pins-log", code=2)


def test_every_kind_is_described():
    page = (TEMPLATE.parents[1] / "docs" / "plugins.md").read_text("utf-8")
    kinds = re.findall(r"^\| `holdfast.(\w+)`", page, re.M)
    assert sorted(kinds) == sorted(PLUGIN_GROUPS)
