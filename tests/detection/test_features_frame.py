"""Features as a DataFrame: those of the arrays, without windows across gaps."""

import sys

import numpy as np
import pytest

from holdfast import features_frame
from holdfast.detection import FEATURE_NAMES, Tare, fingertip_force, haar_features
from holdfast.errors import MissingExtra
from holdfast.recordings import Recording, Tactile
from holdfast.synthetic import synthetic_recording


def test_the_frame_has_the_features_of_the_arrays():
    made = synthetic_recording("made", 0, ("thumb", "index"))
    frame = features_frame(made, window=8, tare=Tare.parse("first"))
    assert frame["time"].is_monotonic_increasing
    for name, module in made.modules.items():
        force = fingertip_force(module.readings, module.sensor, "first", module.times)
        rows = frame[frame["finger"] == name]
        np.testing.assert_array_equal(rows[list(FEATURE_NAMES)], haar_features(force, 8))
        np.testing.assert_array_equal(rows["time"], module.times)


def test_no_window_goes_across_a_gap():
    (module,) = synthetic_recording("made", 0, ("thumb",)).modules.values()
    kept = np.r_[0:600, 700:1000]
    gapped = Tactile(module.sensor, module.times[kept], module.readings[kept])
    frame = features_frame(Recording("gapped", {"thumb": gapped}), window=8, tare="first")
    missing = np.flatnonzero(frame["sigma"].isna())
    assert missing.tolist() == [*range(7), *range(600, 607)]


def test_bad_input(monkeypatch):
    made = synthetic_recording("made", 0, ("thumb",))
    with pytest.raises(ValueError, match="3 given"):
        features_frame(made, window=3)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtra, match="pandas"):
        features_frame(made)
