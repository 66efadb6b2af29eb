import time

from holdfast.contact import ContactState
from holdfast.live.judge import Judge
from holdfast.live.watch import Watch

from . import build


class Babbler(build.Script):
    """Says words that hold no samples, without end and without a pause."""

    def read(self, timeout):
        if self.steps:
            return super().read(timeout)
        time.sleep(0.001)
        return build.told("nonsense")


def watched(source, n_turns):
    watch = Watch(source, Judge(build.model(), source.sensors))
    return watch, [watch.turn() for _ in range(n_turns)]


def told_by(turns):
    return [(said, arrival) for arrival, decisions in turns for said in decisions]


def test_a_source_that_only_babbles_is_silent():
    recording = build.grasp()
    source = Babbler.of(recording, build.arrivals_of(recording)[:500], patient=True)
    watch, _ = watched(source, 500)
    assert not watch.silent
    said = []
    end = time.monotonic() + 30
    while not watch.silent and time.monotonic() < end:
        said += watch.turn()[1]
    (silence,) = said
    assert {one.state for one in silence.estimate.fingers.values()} == {ContactState.UNKNOWN}
    assert watch.turn()[1] == []


def test_samples_of_what_is_not_judged_do_not_break_the_silence():
    recording = build.grasp()
    arrivals = build.arrivals_of(recording)
    palm = [one._replace(samples={"palm/1": one.samples["thumb"]}) for one in arrivals[500:502]]
    source = build.Script.of(recording, [*arrivals[:500], None, *palm, arrivals[502]], patient=True)
    watch, turns = watched(source, 503)
    assert watch.silent
    assert [arrival is None for _, arrival in told_by(turns)[500:]] == [True]
    watch.turn()
    assert not watch.silent


def test_in_slow_motion_silence_is_longer():
    recording = build.grasp()
    asked = []

    class Slow(build.Script):
        speed = 0.1

        def read(self, timeout):
            asked.append(timeout)
            return super().read(0.0)

    watched(Slow.of(recording), 1)
    assert asked == [10 * Judge(build.model(), Slow.of(recording).sensors).silence]
