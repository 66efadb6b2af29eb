from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import Decisions, FingerDecisions
from holdfast_lab.study.evaluation.held_object import count_glitches, held_errors
from holdfast_lab.study.methods import HAND
from study.example_recordings import GLITCH, TIMES, inside, truth_of

GROUND_TRUTH = truth_of(TIMES, ("thumb", "index"))
LABELS = np.where((TIMES >= 2.3) & (TIMES < 9.5), STABLE, UNSTABLE)
LABELS = np.where((TIMES >= 5.3 - 1e-9) & (TIMES < 6.5), UNSTABLE, LABELS).astype(np.int8)


def decided(states, names=("thumb", "index")):
    finger = FingerDecisions(TIMES, LABELS, states, np.full(len(TIMES), 0.5))
    return Decisions("one", dict.fromkeys(names, finger), finger)


@pytest.mark.parametrize(("names", "n"), [(("thumb", "index"), 2), ((HAND,), 1)])
def test_errors_count_while_the_object_is_held(names, n):
    """Held for 7.2 s, disturbed for 1.2 s of them; a finger or a hand decides."""
    stable = np.full(1725, STABLE, dtype=np.int8)
    assert held_errors(GROUND_TRUTH, decided(stable, names)) == (1080 * n, 180 * n)
    late = np.where(TIMES < 6.0 - 1e-9, UNKNOWN, UNSTABLE).astype(np.int8)
    assert held_errors(GROUND_TRUTH, decided(late, names)) == (525 * n, 450 * n)
    assert held_errors(None, decided(stable, names)) == (0, 0)


def sliding(*spans, speed=0.01):
    """Return the truth with sliding on the index alone, at other times [s] and speeds [m/s]."""
    given = speed * inside(spans)
    fingers = {name: dict(arrays) for name, arrays in GROUND_TRUTH.fingers.items()}
    fingers["thumb"]["slip_speed"] = np.zeros(len(TIMES))
    fingers["index"]["slip_speed"] = given
    return replace(GROUND_TRUTH, fingers=fingers)


def test_nothing_slides_that_is_not_held_or_not_touched():
    """Sliding that began in the glitch counts until it is over, but not once it is released."""
    released = count_glitches(sliding((GLITCH + 0.05, 9.9)))
    assert released.distances == [pytest.approx(0.01 * (9.5 - GLITCH - 0.05), rel=0.01)]
    moved = sliding((GLITCH + 0.05, GLITCH + 0.25))
    fingers = {
        f: {**own, "contact_force": np.zeros((len(TIMES), 3))} for f, own in moved.fingers.items()
    }
    assert count_glitches(replace(moved, fingers=fingers)).distances == [0.0]
