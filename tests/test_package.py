import subprocess
import sys
from dataclasses import fields
from importlib import metadata
from pathlib import Path

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
        assert name in dir(holdfast)


def test_the_order_of_fields_is_fixed():
    assert [field.name for field in fields(holdfast.Label)] == [
        *("start", "end", "state", "cause", "evidence", "confidence", "author"),
    ]
    assert [field.name for field in fields(holdfast.Tactile)] == [
        *("sensor", "times", "readings", "unit", "labels"),
    ]


def test_version_is_that_of_the_distribution():
    assert holdfast.__version__ == metadata.version("holdfast")


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
