"""Recordings for the tests of the label server."""

from dataclasses import replace

from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

NOW = "2026-01-02T03:04:05+00:00"
FINGERS = ("thumb", "index")


def made(folder, name="grasp", seed=0, suffix=".parquet", bare=True, **changes):
    """Save a synthetic recording and return its path."""
    recording = replace(synthetic_recording(name, seed, FINGERS), **changes)
    path = folder / f"{name}{suffix}"
    save_recording(recording.with_labels({}) if bare else recording, path)
    return path
