import math
from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Phase
from holdfast.metrics import FingerDecisions
from holdfast.recordings import Truth
from holdfast_lab.study.paper.experiment_tables import find_disturbances, stable_after_lock
from holdfast_lab.study.plan import StudyPlan, scan_corpus
from study.example_recordings import TIMES, inside, recording_with_truth, save_all, truth_of

pytestmark = pytest.mark.slow

TRUTH = truth_of(TIMES, ("thumb", "index"))
"""Locked at 2.3 s, disturbed from 5.3 to 6.5 s, released at 9.5 s."""


def states(*spans, state=UNSTABLE):
    """Stable, but in those spans [s] another state."""
    return np.where(inside(spans), state, STABLE).astype(np.int8)


def hand(codes):
    return FingerDecisions(TIMES, np.full(len(TIMES), STABLE), codes, np.full(len(TIMES), np.nan))


class TestStableAfterLock:
    def test_a_short_stable_estimate_is_first_but_does_not_last(self):
        found = stable_after_lock(TIMES, states((0.0, 2.5), (2.6, 3.0)), TRUTH)
        assert found == (pytest.approx(0.2, abs=0.01), pytest.approx(0.7, abs=0.01))

    def test_stable_at_the_lock_already(self):
        assert stable_after_lock(TIMES, states(), TRUTH) == (0.0, 0.0)

    def test_never_stable_while_held(self):
        assert stable_after_lock(TIMES, states((0.0, 9.5)), TRUTH) == (math.inf, math.inf)

    def test_never_locked(self):
        free = Truth(TIMES, {"phase": np.full(len(TIMES), str(Phase.FREE))}, {})
        assert stable_after_lock(TIMES, states(), free) is None
        assert stable_after_lock(TIMES, states(), None) is None


LATE = pytest.approx(0.1, abs=0.007)


@pytest.mark.parametrize(
    ("spans", "state", "was_stable", "delay"),
    [
        ([(5.4, 5.6)], UNSTABLE, True, LATE),
        ([(5.4, 5.6)], NO_CONTACT, True, LATE),
        ([(5.4, 5.6)], UNKNOWN, True, math.inf),
        ([(5.0, 7.0)], UNSTABLE, False, math.inf),  # unstable all along: no alarm
        ([(5.2, 5.25), (6.6, 6.8)], UNSTABLE, True, math.inf),  # before and after it
        ([(5.2, 5.5), (6.0, 6.1)], UNSTABLE, False, pytest.approx(0.7, abs=0.007)),
    ],
)
def test_an_alarm_inside_a_disturbance_detects_it(spans, state, was_stable, delay):
    (found,) = find_disturbances(hand(states(*spans, state=state)), TRUTH)
    assert (found.start, found.end) == pytest.approx((5.3, 6.5 - 1 / 150), abs=0.007)
    assert (found.was_stable, found.delay) == (was_stable, delay)


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("experiments")
    corpora = {}
    for role, seeds, case in (("main", range(4), "2"), ("vigorous", range(8, 10), "failed")):
        made = []
        for seed in seeds:
            recording = recording_with_truth(f"grasp-{seed}", seed)
            made.append(replace(recording, metadata={**recording.metadata, "case": case}))
        corpora[role] = scan_corpus(role, save_all(folder / role, made))
    return StudyPlan(corpora, quick=True)
