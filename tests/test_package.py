import subprocess
import sys
from dataclasses import fields
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

import holdfast
import holdfast.sensors

PUBLIC = [
    *("FEATURE_NAMES", "features_frame", "fingertip_force", "haar_features"),
    *("Hand", "Sensor", "sensor", "Label", "Recording", "Tactile", "Truth"),
    *("load_dataset", "load_recording", "save_recording"),
    *("Model", "Detector", "StreamDetector", "detect", "export"),
    *("ContactEstimate", "ContactEvent", "ContactState", "HandEstimate"),
    *("Cause", "Fault", "Reason"),
    *("Setting", "StabilityClassifier", "teach", "train", "calibrate"),
    *("evaluate", "event_metrics", "sample_metrics"),
    *("EngineError", "HoldfastError", "MissingExtra", "ModelError", "OutputError"),
    *("RecordingError", "SourceError", "StreamError", "TrainingError"),
    *("Arrival", "Source", "open_source"),
]


def test_public_names_and_no_others():
    assert sorted([*PUBLIC, "__version__"]) == holdfast.__all__
    for name in PUBLIC:
        assert getattr(holdfast, name) is not None
    assert dir(holdfast) == holdfast.__all__


def test_star_imports_what_a_bare_install_has(monkeypatch):
    hidden = "import importlib.util as u; f = u.find_spec\n"
    hidden += "u.find_spec = lambda name, *a: None if name == 'sklearn' else f(name, *a)\n"
    code = (
        hidden + "from holdfast import *; print('train' in dir(), 'StabilityClassifier' in dir())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False"]


def test_names_are_taken_where_objects_are():
    times, readings = np.arange(200) / 100, np.random.default_rng(0).normal(size=(200, 16, 3))
    module = holdfast.Tactile("uskin-4x4", times, readings)
    assert module.sensor == holdfast.sensor("uskin-4x4")
    recording = holdfast.Recording("mine", {"index": module})
    model = holdfast.Model.load("builtin:any")
    by_name = holdfast.detect("builtin:any", recording)
    assert by_name.to_frame().equals(holdfast.detect(model, recording).to_frame())
    detector = holdfast.Detector("builtin:any", {"index": "uskin-4x4"})
    for value in (module, recording, model, by_name, by_name.fingers["index"], detector):
        assert len(repr(value)) < 100


@pytest.mark.parametrize(
    ("modules", "what"),
    [(np.zeros((9, 16, 3)), "ndarray"), ({"index": np.zeros((9, 16, 3))}, "ndarray"), (7, "int")],
)
def test_a_recording_of_arrays_names_what_it_needs(modules, what):
    with pytest.raises(holdfast.RecordingError, match=r"Tactile\(.*" + what):
        holdfast.Recording("mine", modules)
    with pytest.raises(holdfast.RecordingError, match=f"{type(modules).__name__} given"):
        holdfast.detect("builtin:any", modules)


def test_the_order_of_fields_is_fixed():
    assert [field.name for field in fields(holdfast.Label)] == [
        *("start", "end", "state", "cause", "evidence", "confidence", "author"),
    ]
    assert [field.name for field in fields(holdfast.Tactile)] == [
        *("sensor", "times", "readings", "unit", "labels"),
    ]


def test_version_is_that_of_the_distribution():
    assert holdfast.__version__ == metadata.version("holdfast-tactile")


def test_other_names_are_refused():
    with pytest.raises(AttributeError, match="'grasp'"):
        _ = holdfast.grasp


def test_type_checkers_know_every_name():
    source = Path(holdfast.__file__).read_text("utf-8")
    assert [name for name in PUBLIC if f" import {name} as {name}\n" not in source] == []


def test_import_loads_nothing_heavy():
    code = "import sys, holdfast; print(*{'numpy', 'sklearn', 'typer'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_import_changes_nothing_in_the_process():
    code = (
        "import os, sys\n"
        "parts = sys.meta_path, sys.path_hooks, os.environ, vars(os), vars(os.path)\n"
        "before = [part.copy() for part in parts]\n"
        "import holdfast\n"
        "assert [part.copy() for part in parts] == before\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
