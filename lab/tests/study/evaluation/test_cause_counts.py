from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import CAUSES, SLIP_CODE, STABLE, UNSTABLE, Cause
from holdfast_lab.study.evaluation import cause_counts
from holdfast_lab.study.evaluation.cause_counts import (
    ESTIMATED,
    TRUE_CAUSES,
    cause_table,
    count_causes,
)
from study.example_recordings import SLIPS, recording_with_truth

DISTURBANCE = CAUSES.index(Cause.DISTURBANCE) + 1


class Trace:
    """What `count_causes` reads of a trace."""

    def __init__(self, times, state, cause):
        self.times, self.state, self.cause = times, state, cause


@pytest.fixture
def counted(monkeypatch):
    """Count the causes of a recording by given states and causes of its fingers."""
    recording = recording_with_truth("grasp", 0)
    times = recording.modules["thumb"].times

    def count(state, cause, finger="thumb", recording=recording):
        trace = Trace(times, state(times), cause(times))
        detection = type("Detected", (), {"fingers": {finger: trace}})
        monkeypatch.setattr(cause_counts, "detect", lambda *_: detection)
        return count_causes(None, recording)

    return count


def everywhere(code):
    return lambda times: np.full(len(times), code, dtype=np.int8)


def test_true_causes_are_sliding_a_push_and_neither(counted):
    """Held from 2.3 to 9.5 s, pushed from 5.3 to 6.5 s, sliding in it for 0.5 s."""
    counts = counted(everywhere(UNSTABLE), everywhere(DISTURBANCE))
    n = dict(zip(TRUE_CAUSES, counts.sum(axis=1), strict=True))
    sliding = sum(end - start for start, end in SLIPS)
    assert n["slip"] == pytest.approx(150 * sliding, abs=2)
    assert n["disturbance"] == pytest.approx(150 * (1.2 - sliding), abs=4)
    assert n["neither"] == pytest.approx(150 * (7.2 - 1.2), abs=4)
    assert counts[:, ESTIMATED.index("disturbance")].sum() == counts.sum()


def test_samples_count_that_are_unstable_or_decided_to_slide(counted):
    def in_slip(code):
        return lambda times: np.where((times > 5.6) & (times < 5.8), code, 0).astype(np.int8)

    assert counted(everywhere(STABLE), everywhere(0)).sum() == 0
    counts = counted(everywhere(STABLE), in_slip(SLIP_CODE))
    assert counts[0, ESTIMATED.index("slip")] == counts.sum() == pytest.approx(30, abs=1)


def test_without_a_truth_there_are_no_counts(counted):
    recording = replace(recording_with_truth("grasp", 0), truth=None)
    assert not counted(everywhere(UNSTABLE), everywhere(SLIP_CODE), recording=recording).any()


def test_the_table_has_shares_of_each_true_cause():
    counts = np.zeros((len(TRUE_CAUSES), len(ESTIMATED)), dtype=np.int64)
    counts[0, SLIP_CODE], counts[0, DISTURBANCE], counts[1, DISTURBANCE] = 3, 1, 10
    table = cause_table({"mine": [counts, counts]})
    values = {(r.keys["true cause"], r.keys["figure"]): r.ours for r in table.rows}
    assert values["slip", "slip [%]"] == 75
    assert values["slip", "disturbance [%]"] == 25
    assert values["disturbance", "disturbance [%]"] == 100
    assert values["slip", "samples"] == 8
    assert values["neither", "slip [%]"] is None
    assert ("slip", "glitch [%]") not in values


def test_a_cause_that_only_another_model_gives_has_a_share_of_none():
    rare = np.zeros((len(TRUE_CAUSES), len(ESTIMATED)), dtype=np.int64)
    rare[0, SLIP_CODE] = 4
    full = rare.copy()
    full[1, DISTURBANCE] = 2
    table = cause_table({"rare": [rare], "full": [full]})
    values = {(r.keys["model"], r.keys["true cause"], r.keys["figure"]): r.ours for r in table.rows}
    assert values["rare", "slip", "disturbance [%]"] == 0
    assert values["full", "disturbance", "disturbance [%]"] == 100
    assert [r.keys["figure"] for r in table.rows[:3]] == ["disturbance [%]", "slip [%]", "samples"]
