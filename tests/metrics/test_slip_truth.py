"""Slips by the truth: which samples slide, when a slip begins, is gross and ends."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from holdfast.contact import Cause, ContactState
from holdfast.metrics.slip_truth import (
    CREEPING,
    NOT_HELD,
    SLIDING,
    STILL,
    finger_slips,
    label_slips,
    slip_truth,
)
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import sensor

RATE = 100.0


def truth(speed, *, share=None, phase="locked", force=1.0):
    """Return the truth of a thumb with these speeds [m/s]."""
    n = len(speed)
    arrays = {
        "contact_force": np.tile([force, 0.0, 0.0], (n, 1)),
        "slip_speed": np.asarray(speed, dtype=float),
    }
    if share is not None:
        arrays["slipping_share"] = np.asarray(share, dtype=float)
    hand = {"phase": np.full(n, phase), "outside_force": np.zeros((n, 3))}
    return Truth(np.arange(n) / RATE, hand, {"thumb": arrays})


def speeds(*parts):
    """Return speeds [m/s] from pairs of a duration [s] and a speed [mm/s]."""
    return np.concatenate([np.full(round(RATE * t), 1e-3 * v) for t, v in parts])


def recording(made, labels=()):
    n = len(made.times)
    module = Tactile(sensor("uskin-4x4"), made.times, np.zeros((n, 16, 3)), labels=labels)
    return Recording("made", {"thumb": module}, {}, made)


class TestFingerSlips:
    def test_distance_is_the_integral_of_the_speed(self):
        (slip,) = finger_slips(truth(speeds((1, 0), (0.5, 4), (1, 0))), "thumb")
        assert_allclose([slip.onset, slip.end, slip.distance], [1.0, 1.5, 2e-3])

    def test_distances_are_reached_within_the_slip(self):
        (slip,) = finger_slips(truth(speeds((1, 0), (0.5, 4), (1, 0))), "thumb")
        assert_allclose(slip.reached[0], 1.25)
        assert math.isnan(slip.reached[1])

    def test_a_short_rest_joins_two_slides(self):
        made = truth(speeds((1, 0), (0.1, 5), (0.08, 0), (0.1, 5), (1, 0)))
        (slip,) = finger_slips(made, "thumb")
        assert_allclose([slip.onset, slip.end, slip.distance], [1.0, 1.28, 1e-3])

    @pytest.mark.parametrize(
        ("seconds", "speed", "n"), [(0.01, 5, 0), (0.01, 20, 1), (0.02, 2, 1), (0.5, 0.9, 0)]
    )
    def test_what_counts_as_a_slip(self, seconds, speed, n):
        made = truth(speeds((1, 0), (seconds, speed), (1, 0)))
        assert len(finger_slips(made, "thumb")) == n

    def test_gross_is_from_when_90_percent_of_the_load_slides(self):
        speed = speeds((1, 0), (0.5, 4), (1, 0))
        share = np.where(np.arange(len(speed)) >= 120, 0.95, 0.4)
        (slip,) = finger_slips(truth(speed, share=share), "thumb")
        assert_allclose(slip.gross, 1.2)

    def test_it_is_never_gross_without_shares(self):
        (slip,) = finger_slips(truth(speeds((1, 0), (0.5, 4), (1, 0))), "thumb")
        assert math.isnan(slip.gross)

    @pytest.mark.parametrize("change", [{"phase": "closing"}, {"force": 0.0}])
    def test_no_slip_without_a_hold(self, change):
        assert finger_slips(truth(speeds((1, 0), (0.5, 4), (1, 0)), **change), "thumb") == ()


class TestSlipTruth:
    def test_codes_by_speed(self):
        made = recording(truth([0.0, 0.00029, 0.0005, 0.001, 0.0011]))
        found = slip_truth(made, "thumb", made.truth.times)
        assert found.codes.tolist() == [STILL, STILL, CREEPING, CREEPING, SLIDING]
        assert found.onsets == "truth"

    def test_times_between_samples_have_the_truth_before(self):
        made = recording(truth([0.0, 0.0, 0.005, 0.005, 0.0]))
        found = slip_truth(made, "thumb", made.truth.times + 0.004)
        assert found.codes.tolist() == [STILL, STILL, SLIDING, SLIDING, STILL]

    def test_quiet_is_never_sliding(self):
        made = recording(truth([0.0, 0.0, 0.005]))
        found = slip_truth(made, "thumb", made.truth.times, np.ones(3, dtype=bool))
        assert found.quiet.tolist() == [True, True, False]

    def test_labels_where_there_is_no_truth(self):
        times = np.arange(800) / RATE
        labels = (
            Label(0.0, 1.0, ContactState.UNSTABLE, Cause.CLOSING),
            Label(1.0, 2.0, ContactState.STABLE),
            Label(2.0, 3.0, ContactState.UNSTABLE, Cause.SLIP),
            Label(3.0, 4.0, ContactState.UNSTABLE, Cause.DISTURBANCE),
            Label(4.0, 5.0, ContactState.UNSTABLE),
            Label(6.0, 7.0, ContactState.STABLE),
        )
        module = Tactile(sensor("uskin-4x4"), times, np.zeros((800, 16, 3)), labels=labels)
        found = slip_truth(Recording("made", {"thumb": module}), "thumb", times)
        at = [found.codes[round(RATE * t)] for t in np.arange(8) + 0.5]
        assert at == [NOT_HELD, STILL, SLIDING, STILL, CREEPING, CREEPING, STILL, NOT_HELD]
        assert found.onsets == "labels"
        assert [slip[:2] for slip in found.slips] == [(2.0, 3.0)]
        assert math.isnan(found.slips[0].distance)
        assert found.quiet.sum() == 200

    def test_nothing_without_truth_and_labels(self):
        times = np.arange(3) / RATE
        module = Tactile(sensor("uskin-4x4"), times, np.zeros((3, 16, 3)))
        assert slip_truth(Recording("made", {"thumb": module}), "thumb", times) is None

    def test_labels_that_touch_are_one_slip(self):
        labels = [
            Label(1.0, 1.5, ContactState.UNSTABLE, Cause.SLIP),
            Label(1.5, 2.0, ContactState.UNSTABLE, Cause.SLIP),
            Label(2.5, 3.0, ContactState.UNSTABLE, Cause.SLIP),
        ]
        assert [slip[:2] for slip in label_slips(labels)] == [(1.0, 2.0), (2.5, 3.0)]
