"""Faults that last become notices, once each."""

import pytest

from holdfast.contact import ContactEstimate, ContactState, Fault, HandEstimate, Reason
from holdfast.live.fault_notices import FAULT_TEXTS, MIN_FAULT_DURATION, FaultWatch, Problem

PERIOD = 0.01


def hand(time, **faults):
    fingers = {
        name: ContactEstimate(time, ContactState.UNKNOWN, Reason.FAULT, 0.0, 0.0, (0, 0, 0), found)
        for name, found in faults.items()
    }
    return HandEstimate(time, ContactState.UNKNOWN, fingers)


def run(watch, start, seconds, **faults):
    """Return the problems of a time with the same faults, with their times."""
    times = [start + k * PERIOD for k in range(round(seconds / PERIOD))]
    return [(time, one) for time in times for one in watch.update(hand(time, **faults))]


LATE, STUCK = (Fault.LATE,), (Fault.STUCK,)


def test_every_fault_has_its_own_texts():
    assert set(FAULT_TEXTS) == set(Fault)
    assert len({text.words for text in FAULT_TEXTS.values()}) == len(Fault)
    assert not any("_" in text.words + text.advice for text in FAULT_TEXTS.values())


def test_a_fault_is_reported_once_when_it_has_lasted():
    watch = FaultWatch()
    ((time, problem),) = run(watch, 0.0, 20.0, thumb=LATE, index=())
    assert time == pytest.approx(MIN_FAULT_DURATION, abs=1.5 * PERIOD)
    assert problem == Problem(Fault.LATE, ("thumb",))
    assert watch.current == [problem]
    assert run(watch, 20.0, 0.1, thumb=(), index=()) == []
    assert watch.current == []


def test_a_fault_that_flickers_is_not_reported():
    watch = FaultWatch()
    for k in range(20):
        assert run(watch, k * 0.3, 0.2, thumb=LATE) == []
        assert run(watch, k * 0.3 + 0.2, 0.1, thumb=()) == []


def test_a_fault_that_returns_is_reported_again_after_a_while_only():
    watch = FaultWatch()
    assert len(run(watch, 0.0, 1.0, thumb=LATE)) == 1
    run(watch, 1.0, 1.0, thumb=())
    assert run(watch, 2.0, 1.0, thumb=LATE) == []
    assert watch.current == [Problem(Fault.LATE, ("thumb",))]
    run(watch, 3.0, 11.0, thumb=())
    assert len(run(watch, 14.0, 1.0, thumb=LATE)) == 1


def test_fingers_with_the_same_fault_share_a_notice():
    watch = FaultWatch()
    found = run(watch, 0.0, 1.0, thumb=(*LATE, *STUCK), index=LATE)
    assert [one for _, one in found] == [
        Problem(Fault.STUCK, ("thumb",)),
        Problem(Fault.LATE, ("thumb", "index")),
    ]
    found = run(watch, 1.0, 1.0, thumb=LATE, index=LATE, ring=LATE)
    assert [one for _, one in found] == [Problem(Fault.LATE, ("ring",))]


def test_invalid_readings_of_single_samples_are_reported_when_they_are_many():
    watch, found = FaultWatch(), []
    for k in range(2000):
        faults = (Fault.INVALID,) if k % 40 == 0 else ()
        found += [(k, problem) for problem in watch.update(hand(k * PERIOD, thumb=faults))]
    assert found == [(9 * 40, Problem(Fault.INVALID, ("thumb",)))]
    assert watch.current == [Problem(Fault.INVALID, ("thumb",))]
    few = FaultWatch()
    for k in range(9):
        assert few.update(hand(k * 7.0, thumb=(Fault.INVALID,))) == []
        assert few.update(hand(k * 7.0 + 1, thumb=())) == []
