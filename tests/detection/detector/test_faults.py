"""Faults that show in the readings: their estimates, their begin and their end."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.contact import STABLE, ContactState, Fault, Reason
from holdfast.detection import ANY_FINGER, Detector, Model, Tare, detect
from holdfast.errors import ModelError
from holdfast.exporters import header_of
from holdfast.kernel.structs import n_mask_words
from holdfast.recordings import Label, Recording, Tactile
from holdfast.synthetic import synthetic_recording
from holdfast.training import train

from . import naive
from .build import RATE, feed, finger_model, lively, model, recording, runs, sensor, tactile
from .test_against_naive import same

UNKNOWN = ContactState.UNKNOWN
TIP = sensor(6, "tip", limits=(0.0, 65_535.0))
FLAT = sensor(6, "flat", limits=None)
IN_NEWTONS = sensor(6, "newtons", limits=None, unit="N")


class TestFaults:
    def faults(self, values, **options):
        return [e.faults for e in feed(Detector(model(("thumb",), **options)), values)]

    def test_stuck_after_half_a_second_and_until_it_moves(self):
        values = lively(300)
        values[150:250] = values[150]
        found = self.faults(values)
        assert runs(found, lambda f: f) == [((), 200), ((Fault.STUCK,), 50), ((), 50)]

    def test_a_quiet_sensor_is_not_stuck(self):
        values = np.full((900, 2, 3), 500.0)
        values[::70, 0, 0] += 1
        assert set(self.faults(values)) == {()}

    @pytest.mark.parametrize("limit", [0.0, 1000.0])
    def test_saturated_while_it_lasts(self, limit):
        values = lively(100)
        values[50:53, 1, 1] = limit
        found = self.faults(values)
        assert runs(found, lambda f: f) == [((), 50), ((Fault.SATURATED,), 3), ((), 47)]

    @pytest.mark.parametrize("value", [-1.0, 1001.0, -1e300, 1e300])
    def test_out_of_range_is_no_reading(self, value):
        values = lively(100)
        values[50:53, 1, 1] = value
        estimates = feed(Detector(model(("thumb",))), values)
        assert runs(estimates, lambda e: (e.reason, e.faults))[2:] == [
            (("", ()), 25), (("", (Fault.OUT_OF_RANGE,)), 3), (("", ()), 47),
        ]  # fmt: skip
        assert {e.faulty_taxels for e in estimates[50:53]} == {(1,)}
        assert np.isfinite([e.force for e in estimates[50:53]]).all()

    def loaded(self):
        rng = np.random.default_rng(3)
        values = 500 + np.rint(rng.normal(scale=2, size=(400, 2, 3)))
        values[:100, :, 2] += 200  # pressed while the tare is taken
        values[300:, :, 2] += 200
        return values

    def test_a_tare_under_load_shows_when_the_load_goes(self):
        found = self.faults(self.loaded())
        assert runs(found, lambda f: f) == [((), 124), ((Fault.TARE_LOADED,), 176), ((), 100)]

    @pytest.mark.parametrize("tare", ["first", "none"])
    def test_a_recording_may_begin_in_contact(self, tare):
        assert set(self.faults(self.loaded(), tare=tare)) == {()}


def white(n=900, which=TIP, seed=0, level=3.0, middle=30_000.0):
    """Noise of the sensor, in whole counts."""
    rng = np.random.default_rng(seed)
    return np.rint(middle + rng.normal(scale=level, size=(n, which.n_taxels, 3)))


def estimates_of(values, which=TIP, **options):
    return feed(Detector(model(("thumb",), which=which, **options)), values)


def told_faults(values, which=TIP, **options):
    return runs(estimates_of(values, which, **options), lambda e: (e.faults, e.faulty_taxels))


def ring(period):
    """Return a function that repeats the first samples."""
    return lambda values: values[np.arange(len(values)) % period]


UNTRUE = {
    "1 to 3 counts": lambda values: 1.0 + np.arange(values.size).reshape(values.shape) % 3,
    "near the upper end": lambda values: 65_535.0 - 300.0 - np.abs(values) % 7,
    "left together": lambda values: values - 20_000.0,
    "denormal": lambda values: 1e-318 * (1 + np.arange(values.size).reshape(values.shape) % 3),
    **{f"ring of {period}": ring(period) for period in (3, 10, 64)},
}
"""Functions that spoil all samples of a finger."""


def _equal_taxels(values, rng):
    values[:, 1] = values[:, 4]


def _frozen_axis(values, rng):
    values[:, :, 0] = values[0, :, 0]


def _equal_axes(values, rng):
    values[:, :, 0] = values[:, :, 2]


def _toggling(values, rng):
    values[:] = values[0] + rng.integers(0, 2, values.shape)


def _ring_with_a_living_taxel(values, rng):
    values[:, 1:] = values[np.arange(len(values)) % 23, 1:]


BROKEN = {
    "equal taxels": _equal_taxels, "frozen axis": _frozen_axis, "equal axes": _equal_axes,
    "toggling": _toggling, "living taxel": _ring_with_a_living_taxel,
}  # fmt: skip
"""Functions that break a law of a living skin (kernel/laws.c)."""
FOUND = {
    "1 to 3 counts": {Fault.SATURATED, Fault.OFFSET},
    "near the upper end": {Fault.SATURATED, Fault.OFFSET},
    "left together": {Fault.OFFSET},
    "denormal": {Fault.SATURATED, Fault.OUT_OF_RANGE, Fault.OFFSET},
}


class TestUntrue:
    """Readings that are valid and cannot be true."""

    @pytest.mark.parametrize("tare", ["0.2", "first", "none"])
    @pytest.mark.parametrize("way", UNTRUE)
    def test_all_readings_of_a_finger_are_a_fault_until_they_are_true_again(self, way, tare):
        values, start, end = white(900), 300, 600
        values[start:end] = UNTRUE[way](values[start:end])
        estimates = estimates_of(values, tare=tare)
        delay = int(way.split()[-1]) + 30 if "ring" in way else 0
        expected = FOUND.get(way, {Fault.REPEATED})
        bad = [(e.state, e.reason, set(e.faults)) for e in estimates[start + delay : end]]
        assert all(x == (UNKNOWN, Reason.FAULT, expected) for x in bad)
        end += 16 if "ring" in way else 1
        good = estimates[: start + delay - 16] + estimates[end:]
        assert {e.faults for e in good} == {()}

    @pytest.mark.parametrize("name", ["any", "twin", "noise-floor"])
    @pytest.mark.parametrize("way", UNTRUE)
    def test_a_held_finger_is_never_stable(self, way, name):
        made = synthetic_recording("made", 0, ("thumb",))
        module = made.modules["thumb"]
        values = np.array(module.readings, dtype=np.float64)
        start = int(np.argmax(module.times > 4.0))
        values[start:] = UNTRUE[way](values[start:])
        spoilt = Recording("made", {"thumb": Tactile(module.sensor, module.times, values)})
        trace = detect(Model.load(f"builtin:{name}"), spoilt).fingers["thumb"]
        found = start + 64 + 31 if way == "ring of 64" else start + 40
        assert (trace.state[start - 50 : start] == STABLE).any()
        assert set(trace.state[found:]) == {0}


class TestDead:
    def test_until_it_changes(self):
        values = white()
        values[:500, 4] = 30_000.0
        found = told_faults(values)
        assert found == [(((), ()), 200), (((Fault.DEAD,), (4,)), 300), (((), ()), 400)]

    def test_a_dead_band_is_no_fault(self):
        values = white()
        values[:, 2:] = 0.0  # two of six feel something
        assert told_faults(values, sensor(6, "tip", limits=None)) == [(((), ()), 900)]

    @pytest.mark.parametrize("n_dead", [2, 3, 5])
    def test_whatever_their_share(self, n_dead):
        values = white()
        values[:, :n_dead] = 30_000.0
        bad = ((Fault.DEAD,), tuple(range(n_dead)))
        found = told_faults(values)
        assert [faults for faults, _ in found] == [((), ()), bad]
        assert 200 <= found[0][1] <= 205  # of five in six, some samples change nothing

    @pytest.mark.parametrize("n_silent", [1, 3])
    def test_taxels_that_send_zeros_are_at_rest(self, n_silent):
        values = white(which=FLAT)
        values[:, :n_silent] = 0.0
        assert told_faults(values, FLAT) == [(((), ()), 900)]

    def test_integers_that_idle_while_others_carry_the_load(self):
        """Noise of less than a step: a taxel changes only while a load moves it."""
        values = np.full((1500, 6, 3), 7.0)
        values[100:, :3] += np.rint(np.random.default_rng(3).normal(scale=4, size=(1400, 3, 3)))
        dead = ((Fault.DEAD,), ())  # as a whole, until it moves
        assert told_faults(values, FLAT) == [(((), ()), 49), (dead, 51), (((), ()), 1400)]

    @pytest.mark.parametrize("parts", [2, 3, 6])
    def test_taxels_that_are_read_in_turns(self, parts):
        values = white()
        for k in range(1, len(values)):
            old = np.arange(6) % parts != k % parts
            values[k, old] = values[k - 1, old]
        assert told_faults(values) == [(((), ()), 900)]


class TestStuckTaxel:
    def test_after_half_a_second_and_until_it_moves(self):
        values = white()
        values[300:500, 2] = values[300, 2]
        found = told_faults(values)
        assert found == [(((), ()), 350), (((Fault.STUCK,), (2,)), 150), (((), ()), 400)]

    @pytest.mark.parametrize("n_stuck", [2, 3, 5])
    def test_whatever_their_share(self, n_stuck):
        values = white()
        values[300:500, :n_stuck] = values[300, :n_stuck]
        bad = ((Fault.STUCK,), tuple(range(n_stuck)))
        assert told_faults(values) == [(((), ()), 350), (bad, 150), (((), ()), 400)]

    def test_a_quiet_sensor_may_stand_still(self):
        values = white(level=0.25)
        values[:, 2] = 30_000.0
        values[:200:2, 2, 0] += 1.0  # flickered between two counts
        assert told_faults(values) == [(((), ()), 900)]


class TestNoisy:
    def noisy(self, level, which=TIP, taxels=(3,)):
        values = white(which=which)
        rng = np.random.default_rng(9)
        for taxel in taxels:
            values[300:500, taxel] += np.rint(rng.normal(scale=level, size=(200, 3)))
        return values

    def test_a_loose_wire(self):
        found = estimates_of(self.noisy(2000.0))
        bad = np.array([e.faults == (Fault.NOISY,) for e in found])
        assert not bad[:301].any()
        assert bad[310:500].all()
        assert not bad[800:].any()  # three seconds are twelve times what it is smoothed over
        assert {e.faulty_taxels for e in found} == {(), (3,)}
        assert max(e.instability for e in found[810:]) < 20.0

    def test_noise_that_is_not_loud(self):
        assert told_faults(self.noisy(12.0)) == [(((), ()), 900)]

    def test_noise_in_two_taxels_comes_from_outside(self):
        assert told_faults(self.noisy(2000.0, taxels=(2, 3))) == [(((), ()), 900)]

    @pytest.mark.parametrize("hertz", [1.0, 5.0, 12.0])
    def test_what_moves_is_no_noise(self, hertz):
        values = white()
        wave = 3000.0 * np.sin(2 * np.pi * hertz * np.arange(900) / RATE)
        values[:, 3, 0] += np.rint(wave)
        assert told_faults(values) == [(((), ()), 900)]

    def test_a_step_is_no_noise(self):
        values = white()
        values[300:, 3, 2] += 8000.0
        assert told_faults(values) == [(((), ()), 900)]

    def test_jumps_over_a_dead_band_are_no_noise(self):
        values = white(which=IN_NEWTONS)
        gate = np.random.default_rng(3).random(900) < 0.3
        values[gate, 3] = 0.0
        assert told_faults(values, sensor(6, "tip", limits=None)) == [(((), ()), 900)]

    def test_a_force_at_the_border_of_two_steps_is_no_noise(self):
        steps = replace(sensor(6, "steps", limits=None, unit="N"), step=0.1, rests_at_zero=True)
        values = np.zeros((900, 6, 3))
        values[300:, 3, 2] = 0.1 * np.random.default_rng(4).integers(3, 5, 600)
        assert told_faults(values, steps) == [(((), ()), 900)]

    def test_three_taxels_are_too_few(self):
        which = sensor(3, limits=(0.0, 65_535.0))
        assert told_faults(self.noisy(2000.0, which, (1,)), which) == [(((), ()), 900)]


class TestTareDrift:
    def crept(self, seconds, height=400.0, n=2000, start=500):
        """F_a that rises to `height` in a number of seconds, and remains there."""
        ramp = np.clip((np.arange(n) - start) / (seconds * RATE), 0, 1) * height
        values = white(n, sensor(1), level=5.0)
        values[:, 0] += np.rint(ramp)[:, None] * sensor(1).rotations[0].T[:, 0]
        return values

    def feed(self, values):
        which = sensor(1, limits=None)
        hand_model = model(("thumb",), which=which, threshold=100.0, window=14)
        return feed(Detector(hand_model), values)

    @pytest.mark.parametrize("seconds", [14.0, 40.0])
    def test_a_tare_follows_a_slow_rise(self, seconds):
        estimates = self.feed(self.crept(seconds, n=round(seconds + 10) * 100))
        assert {e.state for e in estimates[70:]} == {ContactState.NO_CONTACT}
        assert np.hypot.reduce(estimates[-1].force) > 300.0

    @pytest.mark.parametrize("seconds", [9.0, 10.0])
    def test_a_faster_rise_over_the_threshold_is_drift(self, seconds):
        estimates = self.feed(self.crept(seconds))
        above = [e for e in estimates[30:] if np.hypot.reduce(e.force) >= 280.0]
        drifted = [e for e in above if e.faults]
        assert len(drifted) > 0.98 * len(above) > 100  # but for noise, far under the threshold
        assert {(e.state, e.reason, e.faults, e.faulty_taxels) for e in drifted} == {
            (UNKNOWN, Reason.FAULT, (Fault.TARE_DRIFT,), ())
        }
        assert all(np.isnan(e.stable_probability) and np.isfinite(e.instability) for e in drifted)

    @pytest.mark.parametrize("seconds", [0.01, 0.3, 2.0])
    def test_a_touch_is_no_drift(self, seconds):
        estimates = self.feed(self.crept(seconds))
        assert {e.faults for e in estimates} == {()}
        assert UNKNOWN not in {e.state for e in estimates[40:]}

    def test_a_touch_ends_it(self):
        values = self.crept(10.0)
        values[1700:, 0, 2] += 900.0
        estimates = self.feed(values)
        assert {e.faults for e in estimates[1600:1700]} == {(Fault.TARE_DRIFT,)}
        assert {e.faults for e in estimates[1710:]} == {()}
        assert UNKNOWN not in {e.state for e in estimates[1710:]}


class TestIgnore:
    def test_contributes_nothing(self):
        values = white()
        spoiled = values.copy()
        spoiled[300:, 1] = np.nan
        spoiled[:, 4] = 1e9
        one = Detector(model(("thumb",), which=TIP), ignore={"thumb": (1, 4)})
        two = Detector(model(("thumb",), which=TIP), ignore={"thumb": [4, 1]})
        assert list(map(repr, feed(one, values))) == list(map(repr, feed(two, spoiled)))
        force = np.array([e.force for e in feed(Detector(model(("thumb",), which=TIP)), values)])
        kept = [0, 2, 3, 5]
        part = type(TIP)("part", TIP.positions[kept], TIP.rotations[kept], TIP.normal, RATE)
        alone = feed(Detector(model(("thumb",), which=part)), values[:, kept])
        two.reset()
        again = np.array([e.force for e in feed(two, spoiled)])
        assert again == pytest.approx(np.array([e.force for e in alone]), nan_ok=True)
        assert not np.allclose(again, force, equal_nan=True)

    @pytest.mark.parametrize(
        ("ignore", "message"),
        [
            ({"ring": [0]}, "'ring'"),
            ({"thumb": [0, 6]}, "thumb: taxel index 6"),
            ({"thumb": [-1]}, "thumb: taxel index -1"),
        ],
    )
    def test_refuses_unknown_fingers_and_taxels(self, ignore, message):
        hand_model = model(("thumb",), which=TIP)
        made = recording(thumb=tactile(which=TIP))
        for make in (
            lambda: Detector(hand_model, ignore=ignore),
            lambda: Detector.for_recording(hand_model, made, ignore=ignore),
        ):
            with pytest.raises(ValueError, match=message):
                make()


@st.composite
def ailing(draw, n=700):
    """Readings of six taxels of which some fail in some way for some time."""
    unit = draw(st.sampled_from(["count", "N"]))
    which = sensor(6, "tip", limits=(0.0, 65_535.0) if unit == "count" else None, unit=unit)
    seed = draw(st.integers(0, 999))
    level = draw(st.sampled_from([0.2, 0.6, 3.0]))
    values = white(n, which, seed, level)
    rng = np.random.default_rng([seed, 1])
    values += np.rint(rng.normal(scale=30, size=(n, 1, 3)).cumsum(axis=0) * draw(st.booleans()))
    creep = draw(st.sampled_from([0.0, 0.05, 0.2, 1.0]))
    values[:, :, 2] += np.rint(creep * np.arange(n))[:, None]
    ways = st.sampled_from(
        ["still", "noise", "step", "zero", "limit", "beyond", "nan", *BROKEN, *UNTRUE]
    )
    drawn = draw(st.lists(ways, max_size=4))
    for way in drawn:
        taxel, start = draw(st.integers(0, 5)), draw(st.sampled_from([0, 60, 250, 400]))
        if way in BROKEN:
            part = values[start : start + draw(st.sampled_from([30, 100, 250]))]
            BROKEN[way](part, rng)
            continue
        if way in UNTRUE:
            part = values[start : start + draw(st.sampled_from([5, 100, 250]))]
            part[:] = UNTRUE[way](part)
            continue
        part = values[start : start + draw(st.sampled_from([1, 5, 100, 700])), taxel]
        if way == "still":
            part[:] = part[0]
        elif way == "noise":
            part += np.rint(rng.normal(scale=draw(st.sampled_from([5, 3000])), size=part.shape))
        elif way == "step":
            part += 4000.0
        elif way == "zero":
            part[rng.random(len(part)) < 0.5] = 0.0
        else:
            part[:, 1] = {"limit": 65_535.0, "beyond": 7e4, "nan": np.nan}[way]
    kept = rng.random(n) > draw(st.sampled_from([0.0, 0.03]))
    for start in draw(st.lists(st.integers(1, n - 1), max_size=2)):
        kept[start : start + draw(st.sampled_from([3, 40]))] = False
    if any("ring" in way for way in drawn):
        kept[:] = True  # a lost sample gives a ring another period for a while: it delays it too
    if draw(st.booleans()):
        repeated = np.flatnonzero(rng.random(n - 1) < 0.4) + 1
        values[repeated] = values[repeated - 1]
    ignore = draw(st.sets(st.integers(0, 5), max_size=2))
    return which, values[kept], np.flatnonzero(kept) / RATE, {"finger1": sorted(ignore)}


@pytest.mark.slow
@given(
    sick=ailing(),
    tare=st.sampled_from(["0.2", "first", "none"]),
    noise=st.sampled_from([None, 5.0, 60.0]),
    cuts=st.lists(st.integers(1, 699), max_size=3),
)
@settings(max_examples=10)
def test_equals_the_naive_detector_live_and_in_any_chunks(sick, tare, noise, cuts):
    which, values, times, ignore = sick
    hand_model = Model(fingers={ANY_FINGER: finger_model(contact_noise=noise)}, window=6, tare=tare)
    sensors = {"finger1": which}
    live = Detector(hand_model, sensors, RATE, ignore=ignore)
    slow = naive.Hand(hand_model, sensors, Tare.parse(tare), RATE, ignore)
    offline = Detector(hand_model, sensors, RATE, ignore=ignore)
    bounds = sorted({0, len(values), *(cut for cut in cuts if cut < len(values))})
    pieces = [
        offline.run(recording(finger1=Tactile(which, times[a:b], values[a:b])))
        for a, b in pairwise(bounds)
    ]
    rows = [p.fingers["finger1"].estimate(k) for p in pieces for k in range(len(p.times))]
    for value, time, row in zip(values, times, rows, strict=True):
        estimate = live.update({"finger1": value}, time)
        same(estimate, slow.update({"finger1": value}, time))
        assert repr(estimate.fingers["finger1"]) == repr(row)


@pytest.mark.parametrize(("n_taxels", "dead"), [(6, 4), (64, 63), (70, 66), (512, 511)])
def test_a_recording_says_which_taxels(n_taxels, dead):
    which = sensor(n_taxels, "large", limits=(0.0, 65_535.0))
    values = white(400, which)
    values[:, dead] = 30_000.0
    made = recording(thumb=Tactile(which, np.arange(400) / RATE, values))
    detection = detect(model(("thumb",), which=which), made)
    found = detection.fingers["thumb"]
    words = [0] * n_mask_words(n_taxels)
    assert found.faulty_taxels[199].tolist() == words
    words[dead // 64] = 1 << dead % 64
    assert found.faulty_taxels[200].tolist() == words
    assert found.estimate(200).faulty_taxels == (dead,)
    assert detection.to_frame()["faulty_taxels"][200] == str(dead + 1)


LARGE = sensor(513, "large")
READINGS = Tactile(
    LARGE, np.arange(300) / RATE, np.zeros((300, LARGE.n_taxels, 3)),
    labels=(Label(1.0, 2.0, ContactState.STABLE), Label(2.0, 3.0, ContactState.UNSTABLE)),
)  # fmt: skip


@pytest.mark.parametrize(
    "use",
    [
        lambda floor: Detector(floor, {"skin": LARGE}),
        lambda floor: detect(floor, recording(skin=READINGS)),
        lambda floor: header_of(floor, {"skin": LARGE}, RATE),
        lambda floor: train(
            [
                Recording(name, {"skin": replace(READINGS, readings=np.full((300, 513, 3), k))})
                for k, name in enumerate("ab")
            ]
        ),
        lambda floor: model(("skin",), which=LARGE),
    ],
    ids=["Detector", "detect", "export", "train", "a model"],
)
def test_a_sensor_of_more_than_512_taxels_is_refused(use):
    with pytest.raises(ModelError, match=r"^.*(513.*512|512.*513).*$"):
        use(Model.load("builtin:noise-floor"))
