from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.contact import ContactState, Fault, Reason
from holdfast.detector import detect
from holdfast.errors import ModelError, StreamError
from holdfast.live.judge import MOST_KEPT, Judge
from holdfast.recordings import Recording
from holdfast.resampling import resample

from . import build


def judged(recording, model=None, steps=None, **options):
    source = build.Script.of(recording, steps)
    judge = Judge(model or build.model(), source.sensors, **options)
    decisions = [said for arrival in source for said in judge.take(arrival)]
    return judge, decisions + judge.finish()


def check_equal(decisions, expected):
    for name, trace in expected.fingers.items():
        mine = [d.estimate.fingers[name] for d in decisions if name in d.fingers]
        assert len(mine) == len(trace)
        assert all(build.same(one, trace.estimate(k)) for k, one in enumerate(mine))
    assert [d.estimate.state.code for d in decisions] == expected.hand.tolist()


def test_decisions_are_those_of_the_recording_sample_by_sample():
    recording = build.grasp()
    _, decisions = judged(recording)
    check_equal(decisions, detect(build.model(), recording))
    assert {d.estimate.state for d in decisions} == set(ContactState)


def test_a_source_of_another_rate_is_resampled_as_the_recording_is():
    recording = build.grasp()
    slow = Recording(
        "slow", {name: replace(m, times=m.times * 2.5) for name, m in recording.modules.items()}
    )
    judge, decisions = judged(slow)
    assert judge.resampled
    expected = detect(build.model(), resample(slow, 150.0))
    for name, trace in expected.fingers.items():
        mine = [d.estimate.fingers[name] for d in decisions if name in d.fingers]
        n = min(len(mine), len(trace))  # the last sample may wait for one that never comes
        assert abs(len(mine) - len(trace)) <= 1
        states = np.array([one.state.code for one in mine[:n]])
        assert (states == trace.state[:n]).mean() > 0.999
        forces = np.array([one.force for one in mine[:n]])
        np.testing.assert_allclose(forces, trace.force[:n], rtol=1e-6, atol=1e-6)


def test_a_source_of_another_rate_is_refused_where_that_is_asked_for():
    recording = build.grasp()
    slow = Recording(
        "slow", {name: replace(m, times=m.times * 2) for name, m in recording.modules.items()}
    )
    text = r"^75 Hz given, the model expects 150 Hz within 20 % \(--rate resample takes it all the"
    with pytest.raises(ModelError, match=text):
        judged(slow, strict=True)


def test_nothing_is_said_before_the_rate_is_known_and_then_everything():
    arrivals = build.arrivals_of(build.grasp())
    judge = Judge(build.model(), build.Script.of(build.grasp()).sensors)
    said = [judge.take(arrival) for arrival in arrivals[:80]]
    first = next(k for k, decisions in enumerate(said) if decisions)
    assert 70 <= first <= 76
    assert len(said[first]) == first + 1
    assert judge.rate == pytest.approx(150.0)


def test_a_source_that_ends_early_is_judged_all_the_same():
    recording = build.grasp()
    _, decisions = judged(recording, steps=build.arrivals_of(recording)[:20])
    assert len(decisions) == 20
    assert decisions[-1].estimate.fingers["thumb"].reason is Reason.TARE


def test_a_fault_on_the_way_makes_its_finger_unknown_until_the_next_good_sample():
    recording = build.grasp()
    steps = build.arrivals_of(recording)
    k = 500
    thumbless = {n: s for n, s in steps[k].samples.items() if n != "thumb"}
    steps[k] = steps[k]._replace(samples=thumbless, faults={"thumb": (Fault.TAXEL_COUNT,)})
    steps.insert(k + 1, build.told("odd", index=[Fault.LATE]))
    _, decisions = judged(recording, steps=steps)
    before, at, told, after = (decisions[i].estimate for i in (k - 1, k, k + 1, k + 2))
    assert before.fingers["thumb"].state is not ContactState.UNKNOWN
    assert at.fingers["thumb"].state is ContactState.UNKNOWN
    assert at.fingers["thumb"].faults == (Fault.TAXEL_COUNT,)
    assert at.fingers["index"].faults == ()
    assert told.fingers["index"].state is ContactState.UNKNOWN
    assert told.fingers["index"].reason is Reason.FAULT
    assert np.isnan(told.fingers["index"].stable_probability)
    assert decisions[k + 1].fingers == ("index",)
    assert all(finger.faults == () for finger in after.fingers.values())


def test_while_nothing_comes_no_finger_is_stable():
    recording = build.grasp()
    judge = Judge(build.model(), build.Script.of(recording).sensors)
    assert judge.silent() is None
    for arrival in build.arrivals_of(recording)[:500]:
        judge.take(arrival)
    said = judge.silent()
    assert said.fingers == build.FINGERS
    assert said.estimate.state is ContactState.UNKNOWN
    for finger in said.estimate.fingers.values():
        assert (finger.state, finger.reason) == (ContactState.UNKNOWN, Reason.GAP)
        assert finger.faults == (Fault.PACKET_GAP,)


def test_word_after_silence_brings_no_finger_back():
    recording = build.grasp()
    arrivals = build.arrivals_of(recording)
    judge = Judge(build.model(), build.Script.of(recording).sensors)
    for arrival in arrivals[:500]:
        judge.take(arrival)
    judge.silent()
    (said,) = judge.take(build.told("odd", thumb=[Fault.TAXEL_COUNT]))
    assert {finger.state for finger in said.estimate.fingers.values()} == {ContactState.UNKNOWN}
    assert said.estimate.state is ContactState.UNKNOWN
    (back,) = judge.take(arrivals[500])
    assert all(finger.faults == () for finger in back.estimate.fingers.values())


def test_a_finger_that_stays_away_is_told_of_while_the_others_go_on():
    recording = build.grasp()
    judge = Judge(build.model(), build.Script.of(recording).sensors)
    decisions = []
    for k, arrival in enumerate(build.arrivals_of(recording)[:600]):
        there = {n: s for n, s in arrival.samples.items() if k < 500 or n != "thumb"}
        decisions += judge.take(arrival._replace(samples=there))
    told = [d for d in decisions[500:] if "thumb" in d.fingers]
    assert len(told) == 1
    thumb = told[0].estimate.fingers["thumb"]
    assert (thumb.state, thumb.reason) == (ContactState.UNKNOWN, Reason.GAP)


def test_what_is_kept_before_the_rate_is_known_is_bounded():
    recording = build.grasp()
    judge = Judge(build.model(), build.Script.of(recording).sensors)
    first, *_ = build.arrivals_of(recording)
    for k in range(3):
        for _ in range(MOST_KEPT):
            assert judge.take(build.told("odd", thumb=[Fault.TAXEL_COUNT])) == []
        judge.take(first._replace(time=0.01 * k))
    assert len(judge._kept) == 6
    stuck = build.arrivals_of(recording)[: MOST_KEPT // 8]
    for one in stuck:  # the clock of the device hardly moves
        judge.take(one._replace(time=0.03 + one.time * 1e-6))
    assert len(judge._kept) == 6 + len(stuck)
    assert judge._kept.maxlen == MOST_KEPT


def test_silence_is_longer_for_slow_sources():
    recording = build.grasp()
    judge = Judge(build.model(), build.Script.of(recording).sensors)
    assert judge.silence == 0.1
    for arrival in build.arrivals_of(recording)[:200]:
        judge.take(arrival._replace(time=20 * arrival.time))
    assert judge.silence == pytest.approx(0.4, rel=0.01)


def test_a_tare_in_contact_is_refused_and_one_without_is_taken_anew():
    recording = build.grasp()
    judge = Judge(build.model(), build.Script.of(recording).sensors)
    judge.tare()
    arrivals = build.arrivals_of(recording)
    for arrival in arrivals[:200]:
        judge.take(arrival)
    judge.tare()
    said = judge.take(arrivals[200])[-1].estimate.fingers["thumb"]
    assert (said.state, said.reason) == (ContactState.UNKNOWN, Reason.TARE)
    for arrival in arrivals[201:600]:
        judge.take(arrival)
    with pytest.raises(StreamError, match=r"^thumb, index, middle in contact: open the hand, the"):
        judge.tare()


def test_tared_readings_begin_at_zero():
    recording = build.grasp()
    judge = Judge(build.model(), build.Script.of(recording).sensors)
    arrivals = build.arrivals_of(recording)
    assert judge.tared(arrivals[0].samples) == {}
    for arrival in arrivals[:120]:
        judge.take(arrival)
    tared = judge.tared(arrivals[120].samples)
    assert set(tared) == set(build.FINGERS)
    assert all(np.abs(values).max() < 10 for values in tared.values())


def test_modules_that_the_model_does_not_judge_are_passed_over():
    recording = build.grasp()
    steps = build.arrivals_of(recording)
    palm = np.zeros((4, 3))
    more = [one._replace(samples={**one.samples, "palm/1": palm}) for one in steps]
    _, decisions = judged(recording, steps=more)
    check_equal(decisions, detect(build.model(), recording))


def test_a_tare_by_interval_is_refused():
    model = msgspec.structs.replace(build.model(), tare="0:1")
    with pytest.raises(ModelError, match=r"^the model's tare is the interval 0:1 s of a recordin"):
        Judge(model, build.Script.of(build.grasp()).sensors)


def test_ignored_taxels_count_for_nothing():
    recording = build.grasp()
    steps = build.arrivals_of(recording)
    for k, arrival in enumerate(steps):
        spoilt = arrival.samples["thumb"].copy()
        spoilt[3] = 65535 if k > 300 else spoilt[3]
        steps[k] = arrival._replace(samples={**arrival.samples, "thumb": spoilt})
    _, spoilt = judged(recording, steps=list(steps))
    assert spoilt[-1].estimate.fingers["thumb"].faults == (Fault.SATURATED,)
    assert spoilt[-1].estimate.fingers["thumb"].faulty_taxels == (3,)
    _, healthy = judged(recording, steps=list(steps), ignore={"thumb": (3,)})
    assert healthy[-1].estimate.fingers["thumb"].faults == ()
