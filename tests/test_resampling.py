import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from holdfast.contact import ContactState
from holdfast.detection import Model, detect
from holdfast.errors import ModelError, StreamError
from holdfast.recordings import Label, Recording, Tactile
from holdfast.resampling import (
    Resampler,
    UpdateFilter,
    at_rate,
    resample,
    rows_per_update,
    true_updates,
)
from holdfast.sensors import Sensor
from holdfast.twin.simulation import Grasp, simulate

SENSOR = Sensor("one", [[0.0, 0.0, 0.0]], [np.eye(3)], [0.0, 0.0, 1.0], 100.0)


def made(signal, times, labels=()):
    readings = np.asarray(signal, dtype=float)[:, None, None] * [[[1.0, 2.0, -1.0]]]
    return Recording("made", {"thumb": Tactile(SENSOR, times, readings, labels=labels)})


def after(signal, times, rate, labels=()):
    return resample(made(signal, times, labels), rate).modules["thumb"]


RATES = [(100, 150), (150, 100), (100, 100), (1000, 150), (160, 150), (100, 99), (60, 400)]


@pytest.mark.parametrize(("source", "rate"), RATES)
def test_a_constant_stays(source, rate):
    times = np.arange(300) / source
    found = after(np.full(300, 7.0), times, rate)
    assert found.readings == pytest.approx(np.tile([7.0, 14.0, -7.0], (found.n_samples, 1, 1)))
    assert found.times[0] == times[0]
    assert times[-1] - found.times[-1] < 1 / rate + 1e-6
    assert found.rate == pytest.approx(rate)
    assert found.n_samples == pytest.approx(299 / source * rate + 1, abs=1)


@pytest.mark.parametrize(("source", "rate"), RATES)
def test_a_slow_sine_stays(source, rate):
    def wave(times):
        return np.sin(2 * np.pi * 1.0 * times)

    times = np.arange(5 * source) / source
    found = after(wave(times), times, rate)
    behind = max(1 / rate - 1 / source, 0) / 2  # the mean since the last sample is so far back
    expected = wave(found.times - behind)
    one_sample = 2 * np.pi * 1.0 / source  # how far the wave gets in a period of the source
    assert np.abs(found.readings[2:, 0, 0] - expected[2:]).max() < 1.01 * one_sample


def test_down_is_the_mean_since_the_last():
    found = after(np.arange(13.0), np.arange(13) / 400, 100.0)
    assert found.readings[:, 0, 0].tolist() == [0.0, 2.5, 6.5, 10.5]


def test_up_is_linear():
    found = after([0.0, 1.0, 0.0], np.arange(3) / 100, 400.0)
    assert found.readings[:, 0, 0] == pytest.approx([0, 0.25, 0.5, 0.75, 1, 0.75, 0.5, 0.25, 0])


@pytest.mark.parametrize("rate", [40.0, 100.0, 230.0])
def test_gaps_stay(rate):
    times = np.r_[np.arange(50), np.arange(80, 130), [200]] / 100
    found = after(times, times, rate)
    assert found.n_gaps == 2
    assert not ((found.times > 0.4901) & (found.times < 0.7999)).any()
    assert {0.0, 0.8, 2.0} <= set(found.times.round(9))
    assert found.readings[-1, 0, 0] == 2.0  # a stretch of one sample


def test_a_module_without_samples_stays():
    empty = Tactile(SENSOR, np.empty(0), np.empty((0, 1, 3)))
    one = made([1.0, 2.0], [0.0, 0.01]).modules["thumb"]
    found = resample(Recording("made", {"thumb": one, "index": empty}), 150.0)
    assert found.modules["index"].n_samples == 0


@pytest.mark.parametrize(("source", "rate"), [*RATES, (100, 65), (150, 40)])
@pytest.mark.parametrize("n", [2, 57, 58, 59, 200])
def test_labels_stay_up_to_the_last_sample(source, rate, n):
    middle, end = (n // 2) / source, (n + 0.4) / source
    labels = (
        Label(0.0, middle, ContactState.STABLE),
        Label(middle, end, ContactState.UNSTABLE, evidence="hand"),
    )
    found = after(np.zeros(n), np.arange(n) / source, rate, labels)
    assert found.labels[0] == labels[0]
    expected = np.where(found.times < middle, ContactState.STABLE.code, ContactState.UNSTABLE.code)
    assert np.array_equal(found.label_states, expected)
    if len(found.labels) > 1:
        assert (found.labels[1].start, found.labels[1].evidence) == (middle, "hand")


def test_everything_else_stays():
    one = made(np.zeros(9), np.arange(9) / 100)
    found = resample(
        Recording("made", one.modules, {"object": "can"}, markers=((0.01, "push"),)), 150.0
    )
    assert (found.name, found.metadata["object"], found.markers) == (
        "made", "can", ((0.01, "push"),),
    )  # fmt: skip


@given(
    cut=st.integers(30, 119),
    pair=st.sampled_from(RATES),
    jitter=st.floats(0, 0.4),
    seed=st.integers(0, 9),
)
def test_every_value_depends_on_samples_up_to_the_first_at_or_after_it(cut, pair, jitter, seed):
    source, rate = pair
    rng = np.random.default_rng(seed)
    times = np.sort(np.arange(120) + jitter * rng.uniform(-1, 1, size=120)) / source
    signal = rng.normal(size=120)
    changed = signal.copy()
    changed[cut:] += 10
    one, two = after(signal, times, rate), after(changed, times, rate)
    known = one.times < times[cut - 1] - 2e-3 / rate
    assert np.array_equal(one.readings[known], two.readings[known])


def fed(module, rate):
    """Return the result of a `Resampler` for a module, sample by sample."""
    resampler = Resampler(1 / module.period, rate)
    samples = [
        one
        for time, reading in zip(module.times, module.readings, strict=True)
        for one in resampler.push(time, reading)
    ]
    return np.array([time for time, _ in samples]), np.array([reading for _, reading in samples])


def uneven(source, jitter, gaps, seed, start=0.0, n=300):
    """Samples at uneven times with gaps, some values not finite, two now and then at once."""
    rng = np.random.default_rng(seed)
    steps = 1 + jitter * rng.uniform(-1, 1, size=n)
    steps[rng.random(n) < 0.02] = 1e-3
    for gap in gaps:
        steps[gap] = rng.uniform(1.5, 40)
    signal = rng.normal(size=n)
    signal[rng.integers(n)] = np.nan
    return made(signal, start + steps.cumsum() / source).modules["thumb"]


@given(
    pair=st.sampled_from([*RATES, (2000, 100), (20, 1000), (150, 149)]),
    jitter=st.floats(0, 0.9),
    gaps=st.lists(st.integers(1, 299), max_size=4),
    start=st.sampled_from([0.0, -3.7, 1.7e9]),
    seed=st.integers(0, 999),
)
def test_live_is_offline(pair, jitter, gaps, start, seed):
    source, rate = pair
    module = uneven(source, jitter, gaps, seed, start)
    assume(abs(rate * module.period - 1) > 1e-9)  # where either way is right
    expected = resample(Recording("made", {"thumb": module}), rate).modules["thumb"]
    times, readings = fed(module, rate)
    assert np.array_equal(times, expected.times)
    assert np.array_equal(readings, expected.readings, equal_nan=True)


@pytest.mark.parametrize("time", [0.5, 0.4, np.nan, np.inf])
def test_live_refuses_times_that_do_not_go_forward(time):
    resampler = Resampler(100.0, 150.0)
    resampler.push(0.5, np.ones((1, 3)))
    with pytest.raises(StreamError, match="time"):
        resampler.push(time, np.ones((1, 3)))
    with pytest.raises(StreamError, match="time nan"):
        Resampler(100.0, 150.0).push(np.nan, np.ones((1, 3)))


@pytest.mark.parametrize("rates", [(0.0, 100.0), (np.nan, 100.0), (100.0, -1.0)])
def test_live_refuses_rates(rates):
    with pytest.raises(ValueError, match="rate"):
        Resampler(*rates)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_refuses_rates(rate):
    with pytest.raises(ValueError, match="rate"):
        resample(made([1.0], [0.0]), rate)


def changes(n_rows, ratio, start=0.0):
    """Changed rows of a sensor that updates every `ratio` rows."""
    updates = np.floor((np.arange(n_rows) + start) / ratio)
    return np.append(True, np.diff(updates) > 0)


class TestRowsPerUpdate:
    @given(st.floats(1.6, 12.0), st.floats(0.0, 10.0), st.integers(80, 400))
    @settings(max_examples=60)
    def test_of_a_sensor_that_updates_evenly(self, ratio, start, n_rows):
        assert rows_per_update(changes(n_rows, ratio, start)) == pytest.approx(ratio, rel=0.15)

    @given(st.floats(0.02, 0.98), st.integers(0, 1000))
    @settings(max_examples=60)
    def test_of_readings_that_repeat_at_random(self, share, seed):
        assert rows_per_update(np.random.default_rng(seed).random(1000) < share) == 1.0

    @pytest.mark.parametrize("n_rows", [0, 1, 5, 16])
    def test_of_too_few_updates(self, n_rows):
        assert rows_per_update(changes(n_rows, 4.0)[:n_rows]) == 1.0

    def test_of_a_sensor_that_drops_single_samples(self):
        changed = np.random.default_rng(0).random(500) > 0.1
        assert rows_per_update(changed) == 1.0


def slow_and_held(grasp, rows=4, slow_rate=50.0):
    """A grasp at a low rate, and the same with each sample held over some rows."""
    slow, held = {}, {}
    for name, module in grasp.modules.items():
        step = round(module.rate / slow_rate)
        values = np.asarray(module.readings, dtype=float)[::step]
        times = np.arange(rows * len(values)) / (rows * slow_rate)
        slow[name] = Tactile(module.sensor, times[::rows], values, labels=module.labels)
        held[name] = Tactile(
            module.sensor, times, np.repeat(values, rows, axis=0), labels=module.labels
        )
    return Recording("slow", slow), Recording("held", held)


@pytest.fixture(scope="module")
def grasp():
    whole = simulate(Grasp("can", case=1, repeat=1, profile="gentle"))
    return Recording("grasp", {name: whole.modules[name] for name in ("thumb", "index")})


@pytest.mark.slow
class TestSampleAndHold:
    def test_true_updates_are_those_of_the_sensor(self, grasp):
        slow, held = slow_and_held(grasp)
        assert true_updates(slow) is slow
        updates = true_updates(held)
        for name, module in updates.modules.items():
            assert np.array_equal(module.times, slow.modules[name].times)
            assert np.array_equal(module.readings, slow.modules[name].readings)
            assert module.labels == held.modules[name].labels
        assert updates.rate == pytest.approx(50.0)

    @pytest.mark.parametrize("name", ["builtin:any", "builtin:twin"])
    def test_estimates_are_those_of_the_slow_recording(self, grasp, name):
        slow, held = slow_and_held(grasp)
        expected, estimated = (detect(Model.load(name), r).fingers for r in (slow, held))
        for finger, trace in expected.items():
            assert np.array_equal(trace.times, estimated[finger].times)
            assert np.array_equal(trace.state, estimated[finger].state)
            assert np.array_equal(
                trace.stable_probability, estimated[finger].stable_probability, equal_nan=True
            )

    @pytest.mark.parametrize(
        ("rate", "expected"), [(None, 50.0), (59.0, 50.0), (41.7, 50.0), (100.0, 100.0)]
    )
    def test_the_rate_of_a_model_is_compared_with_that_of_the_updates(self, grasp, rate, expected):
        slow, held = slow_and_held(grasp)
        assert at_rate(held, rate).rate == pytest.approx(expected, rel=0.01)
        assert (at_rate(slow, rate) is slow) is (expected == 50.0)

    @pytest.mark.parametrize("jitter", [0, 2])
    @pytest.mark.parametrize("slow_rate", [5.0, 10.0])
    def test_a_slow_sensor_is_refused_as_without_its_copies(self, grasp, slow_rate, jitter):
        """Also where the updates come at uneven rows, and beside a module that does not hold."""
        slow, held = slow_and_held(grasp, rows=10, slow_rate=slow_rate)
        rows = np.arange(held.modules["thumb"].n_samples)
        early = np.random.default_rng(0).integers(0, jitter + 1, size=rows[-1] // 10 + 2)
        at = np.minimum(rows // 10 + (rows % 10 >= 10 - early[rows // 10]), rows[-1] // 10)
        modules = {
            name: Tactile(m.sensor, held.modules[name].times, m.readings[at])
            for name, m in slow.modules.items()
        }
        messages = []
        for recording in (slow, Recording("held", modules)):
            with pytest.raises(ModelError, match=f"{slow_rate:.0f}.* Hz given") as error:
                detect(Model.load("builtin:any"), recording)
            messages.append(str(error.value).split(" Hz")[0])
        assert float(messages[1]) == pytest.approx(slow_rate, rel=0.12)
        noise = np.random.default_rng(0).normal(size=modules["index"].readings.shape)
        lively = Tactile(modules["index"].sensor, modules["index"].times, noise)
        mixed = Recording("mixed", {"thumb": modules["thumb"], "index": lively})
        updates = true_updates(mixed).modules
        assert updates["index"] is lively
        assert updates["thumb"].rate == pytest.approx(slow_rate, rel=0.12)


def test_a_reading_that_remains_is_a_sample_again():
    repeats = UpdateFilter(rate=10.0)
    same = np.full((1, 3), np.nan)
    kept = [k for k in range(40) if repeats.is_update(k / 40, same)]
    assert kept == list(range(0, 40, 7))  # 0.16 s later, in rows of 0.025 s
