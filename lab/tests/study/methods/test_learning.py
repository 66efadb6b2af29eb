"""Learning methods from publications."""

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.detection import Tare
from holdfast.errors import TrainingError
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors import Sensor
from holdfast_lab.study.methods import HAND, METHODS, hand_signal
from holdfast_lab.study.methods.learning import (
    hand_motion,
    motion_features,
    shear_statistics,
    taxel_motion,
)


def test_shear_statistics_by_hand():
    # Two taxels, windows of 2; the normal does not count.
    # Samples: (1, 2) (0, -1); (3, 2) (0, 1); (3, -6) (0, 1). The deviation of two values is
    # half their difference.
    shear = np.array([[[1, 2], [0, -1]], [[3, 2], [0, 1]], [[3, -6], [0, 1]]], dtype=float)
    found = shear_statistics(shear, window=2)
    first = [3 - -1, 1 + 2 + 0 - 1 + 3 + 2 + 0 + 1, 1 + 0 + 0 + 1]
    second = [3 - -6, abs(3 + 2 + 0 + 1 + 3 - 6 + 0 + 1), 0 + 4 + 0 + 0]
    np.testing.assert_allclose(found, [[np.nan] * 3, first, second])


PAIR = Sensor(
    name="pair",
    positions=np.zeros((2, 3)),
    rotations=np.stack([np.eye(3)] * 2),
    normal=np.array([0.0, 0.0, 1.0]),
    rate=100.0,
)


def finger(times, readings):
    end = float(times[-1]) + 0.01
    label = Label(float(times[0]), end, ContactState.STABLE)
    return Tactile(PAIR, np.array(times), np.array(readings, dtype=float), labels=(label,))


def hand(tare="none", **fingers):
    return hand_signal(Recording("tiny", fingers), Tare.parse(tare))


THUMB = finger(
    [0.0, 0.01, 0.02],
    [
        [[1, 2, 3], [4, 5, 6]],
        [[1, 4, 3], [0, 5, 7]],
        [[2, 4, 0], [0, 6, 9]],
    ],
)
INDEX = finger([0.005, 0.013, 0.023], np.zeros((3, 2, 3)))


def test_features_of_motions_by_hand():
    """Two taxels move along x and y, by 3 and 4: the mean is (1.5, 2), of length 2.5."""
    (row,) = motion_features(np.array([[[3.0, 0.0], [0.0, 4.0]]]))
    mean_unit = np.hypot(0.5, 0.5)
    assert row == pytest.approx([3.5, 0.5, 2.5, 0.6, 0.8, 1 - mean_unit, 3.0, 4.0])


def test_a_motion_is_the_change_of_the_shear_over_a_sixtieth_of_a_second():
    """At 100 Hz these are 2 samples: of 0 and 0.02 s, (1, 2) to (2, 4) and (4, 5) to (0, 6)."""
    rows = taxel_motion(hand(thumb=THUMB))["thumb"]
    assert np.isnan(rows[:2]).all()
    assert rows[2] == pytest.approx(motion_features(np.array([[[1.0, 2.0], [-4.0, 1.0]]]))[0])


def test_motions_of_a_hand_are_at_the_times_of_the_first_finger():
    """At 0.03 s the thumb has its own sample, the index that of 0.023 s."""
    times, readings = np.arange(5) * 0.01, np.arange(5.0)[:, None, None] * np.ones((5, 2, 3))
    thumb, index = finger(times, readings), finger(times + 0.003, 2 * readings)
    found = hand_motion(hand(thumb=thumb, index=index))
    assert list(found) == [HAND]
    rows = found[HAND]
    assert rows.shape == (5, 16)
    assert np.isfinite(rows).all(axis=1).tolist() == [False, False, False, True, True]
    assert rows[3, [0, 8]] == pytest.approx([2 * np.sqrt(2), 4 * np.sqrt(2)])


@pytest.mark.parametrize("name", ["jl_global_logreg", "jl_global_svm"])
def test_a_whole_hand_method_needs_two_fingers(name):
    with pytest.raises(TrainingError, match="at least two fingers"):
        METHODS[name].features(hand(index=INDEX))
