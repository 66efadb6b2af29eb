"""Targets: which samples train a head, and with which values."""

from dataclasses import replace

import numpy as np

from holdfast.metrics.slip_truth import SLIDING, STILL, slip_truth
from holdfast.training.targets import STILL_STEP, TargetInput, speed_target, true_speed

from .build import sliding_recording


def test_samples_are_those_of_long_slips_and_some_that_hold_still():
    made = sliding_recording(0, ("thumb",), slips=(400, 700))
    arrays = made.truth.fingers["thumb"]
    speed = arrays["slip_speed"].copy()
    speed[700:740] /= 5  # 0.8 mm
    fingers = {"thumb": arrays | {"slip_speed": speed}}
    made = replace(made, truth=replace(made.truth, fingers=fingers))
    times = made.modules["thumb"].times
    truth = slip_truth(made, "thumb", times)
    features = np.arange(len(times), dtype=float)[:, None]
    features[405] = np.nan
    units = np.zeros(len(times), dtype=int)
    given = TargetInput(made, "thumb", truth, units, 3, 1, is_any=False)
    found = speed_target(given, features)
    assert (found.recordings == 3).all()
    rows = found.features[:, 0].astype(int)
    slides = found.values > 0
    assert rows[slides].tolist() == [*range(400, 405), *range(406, 440)]
    np.testing.assert_allclose(found.values[slides], 10.0)
    assert rows[~slides].tolist() == np.flatnonzero(truth.codes == STILL)[::STILL_STEP].tolist()
    assert (true_speed(made, "thumb", times)[truth.codes == SLIDING] >= 2.0 - 1e-9).all()
    assert speed_target(given._replace(recording=replace(made, truth=None)), features) is None
