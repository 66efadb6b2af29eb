"""Differences of taxels, against numbers written out by hand."""

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.errors import TrainingError
from holdfast.features import Tare
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors import Sensor
from holdfast.study.methods import HAND, METHODS, hand_signal
from holdfast.study.methods.james_lepora import local, whole

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
INDEX = finger(
    [0.005, 0.013, 0.023],
    [
        [[0, 0, 0], [0, 0, 0]],
        [[1, 0, 0], [0, 2, 0]],
        [[1, 3, 0], [0, 2, 4]],
    ],
)


def test_differences_taxel_by_taxel():
    rows = local(hand(thumb=THUMB))["thumb"]
    assert np.isnan(rows[0]).all()
    assert rows[1:].tolist() == [[0, 2, 0, -4, 0, 1], [1, 0, -3, 0, 1, 2]]


def test_the_tare_takes_nothing_from_them():
    one, two = (local(hand(tare, thumb=THUMB))["thumb"] for tare in ("none", "first"))
    assert np.array_equal(one, two, equal_nan=True)


def test_no_difference_across_a_gap_or_a_lost_sample():
    readings = np.arange(8.0)[:, None, None] * np.ones((8, 2, 3))
    readings[2, 1, 0] = np.nan
    times = [0.0, 0.01, 0.02, 0.03, 0.04, 0.09, 0.10, 0.11]
    rows = local(hand(thumb=finger(times, readings)))["thumb"]
    assert np.isfinite(rows).all(axis=1).tolist() == [
        False, True, False, False, True, False, True, True,
    ]  # fmt: skip
    assert (rows[[1, 4, 6, 7]] == 1).all()


def test_a_finger_without_a_reading_has_the_same_width():
    dead = finger([0.0, 0.01], np.full((2, 2, 3), np.nan))
    rows = local(hand(thumb=dead))["thumb"]
    assert rows.shape == (2, 6)
    assert np.isnan(rows).all()


def test_a_hand_is_its_fingers_side_by_side_at_the_times_of_the_first():
    """The index gives at 0.01 s what it had at 0.005 s, at 0.02 s what it had at 0.013 s."""
    found = whole(hand(thumb=THUMB, index=INDEX))
    assert list(found) == [HAND]
    rows = found[HAND]
    assert rows.shape == (3, 12)
    assert np.isnan(rows[:2, 6:]).all()
    assert rows[1, :6].tolist() == [0, 2, 0, -4, 0, 1]
    assert rows[2].tolist() == [1, 0, -3, 0, 1, 2, 1, 0, 0, 0, 2, 0]


def test_a_finger_that_fell_silent_has_none():
    times = np.arange(10) * 0.01
    readings = np.arange(10.0)[:, None, None] * np.ones((10, 2, 3))
    rows = whole(hand(thumb=finger(times, readings), index=finger(times[:5], readings[:5])))[HAND]
    assert np.isfinite(rows[1:8]).all()
    assert np.isfinite(rows[8:, :6]).all()
    assert np.isnan(rows[8:, 6:]).all()


@pytest.mark.parametrize("name", ["jl_global_logreg", "jl_global_svm"])
def test_one_finger_is_no_hand(name):
    with pytest.raises(TrainingError) as raised:
        METHODS[name].features(hand(index=INDEX))
    assert str(raised.value) == (
        "the global classifier of James & Lepora needs at least two fingers, 1 given (index)"
    )


def test_four_methods():
    names = [f"jl_{scope}_{kind}" for scope in ("local", "global") for kind in ("logreg", "svm")]
    for name in names:
        method = METHODS[name]
        assert (method.name, method.category) == (name, "learning")
        assert method.whole_hand == ("global" in name)
        assert method.recipe.name in name
    assert len({METHODS[name].title for name in names}) == 4
