"""The features of sliding against slow NumPy over whole arrays, and their laws."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.detection import Tare
from holdfast.detection.features import extract
from holdfast.detection.plan import StreamPlan
from holdfast.detection.specs import (
    SLIDING_FEATURES,
    SLIDING_LAGS,
    ZERO_KINDS,
    FeatureSpec,
)
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor
from holdfast.sensors import sensor as built_in

RATE = 75.0
AVERAGES = {"30ms": 0.015, "100ms": 0.05, "400ms": 0.2}


def features_of(readings, times, sensor, rate=RATE, specs=SLIDING_FEATURES, loaded=False):
    plan = StreamPlan({"a": sensor}, {"a": specs}, 14, Tare.parse("first"), rate)
    module = Tactile(sensor, times, readings)
    recording = Recording("made", {"a": module}, {"starts_loaded": loaded})
    return extract(plan, recording)["a"].features


def naive(readings, times, sensor, rate=RATE, loaded=False):
    """(n, 97) from the definitions: a stretch between gaps at a time, all its samples at once."""
    readings = readings.astype(float)
    changed = np.append(False, (np.diff(readings, axis=0) != 0).any(axis=(1, 2)))
    gaps = np.flatnonzero(np.diff(times) > max(3.0003 / rate, 0.10001)) + 1
    rows = np.full((len(times), len(SLIDING_FEATURES)), np.nan)
    least, own = np.inf, readings - readings[0]
    # Without a known zero, normal forces count from the least normal force of the finger so far.
    along = np.einsum("nij,tnj->ti", sensor.rotations, own) @ sensor.normal
    newest = np.where(along == np.minimum.accumulate(along), np.arange(len(own)), 0)
    zero = own[np.maximum.accumulate(newest)]
    for stretch in np.split(np.arange(len(times)), gaps):
        noise, least = noise_of(own[stretch], times[stretch], changed[stretch], sensor, rate, least)
        if len(stretch) < 2:
            continue
        rest = zero[stretch] if loaded else 0.0
        values = of_stretch(own[stretch], times[stretch], noise, sensor, rate, rest)
        for j, spec in enumerate(SLIDING_FEATURES):
            rows[stretch[1:], j] = values[spec.kind, spec.seconds][1:]
    return rows


def noise_of(own, times, changed, sensor, rate, least):
    """(n,) noise of a reading: the least mean square step over blocks of 0.2 s so far."""
    floor = sensor.step or (1.0 if sensor.unit == "count" else 1e-6 * np.sqrt(12))
    floor_of_units = 1.0 if sensor.unit == "count" else 1e-6 * np.sqrt(12)
    now, block, began, found = floor_of_units / np.sqrt(12), [], times[0], []
    for k, time in enumerate(times):
        if k and changed[k] and time - times[k - 1] <= 3.0003 / rate:
            block.append(((own[k] - own[k - 1]) ** 2).mean() / 2)
        if block:
            now = max(np.sqrt(np.mean(block)), floor_of_units / np.sqrt(12))
            if time - began >= 0.2 and len(block) >= 5:
                least, block, began = min(least, now), [], time
        found.append(max(now if np.isinf(least) else least, floor / np.sqrt(12)))
    return np.array(found), least


def nearest(times, k, when, samples):
    """Return the sample before k nearest to a time; of two equals that of even times."""
    first = max(0, k - 4 * round(samples) - 9)  # times are not so uneven
    near = np.abs(times[first:k] - when)
    best = first + int(near.argmin())
    for other in (best - 1, best + 1):
        if first <= other < k:
            excess = near[other - first] - near[best - first]
            if excess <= 0.02 * abs(times[other] - times[best]):
                likely = k - max(1, round(samples))
                best = min(max(likely, min(best, other)), max(best, other))
    return best


def before(times, lag, samples):
    """(n,) the sample nearest to a lag before each; the first for the first."""
    later = [nearest(times, k, times[k] - lag, samples) for k in range(1, len(times))]
    return np.array([0, *later])


def smoothed(values, times, seconds):
    means = [values[0]]
    for value, step in zip(values[1:], np.diff(times), strict=True):
        means.append(means[-1] + step / (step + seconds) * (value - means[-1]))
    return np.array(means)


def of_stretch(own, times, s, sensor, rate, zero):
    """Return each kind and lag: (n,)."""
    n, m = own.shape[:2]
    norm = lambda vectors: np.sqrt((vectors**2).sum(axis=-1))  # noqa: E731
    places = sensor.positions - sensor.positions.mean(axis=0)
    places = places / (np.sqrt((places**2).sum(axis=1).mean()) or 1.0)
    sheared, pressed = own[..., :2], np.abs((own - zero)[..., 2])
    load = pressed.sum(axis=1)
    w = pressed / np.maximum(load, 1e-300)[:, None]
    force = np.einsum("nij,tnj->ti", sensor.rotations, own)
    along = force @ sensor.normal
    across = force - along[:, None] * sensor.normal
    tangent = across / np.maximum(norm(across), 1e-300)[:, None]
    whole = s * np.sqrt(m)
    by_load = np.maximum(load, 10 * whole)
    r = np.minimum(norm(across) / np.maximum(np.abs(along), 10 * whole), 5)
    ratios = np.minimum(norm(sheared) / np.maximum(pressed, 5 * s[:, None]), 5)
    q, centre = (w * ratios).sum(axis=1), w @ places
    values = {
        ("friction", 0.014): r, ("taxel_friction", 0.014): q,
        ("force_to_noise", 0.014): np.log1p(norm(force) / whole),
    }  # fmt: skip
    mean = smoothed(r, times, 0.01)
    blocks = np.floor((times - times[0]) * 16)
    for seconds in (0.5, 2.0):
        inside = (blocks[:, None] - blocks < 16 * seconds) & (np.arange(n) <= np.arange(n)[:, None])
        most = np.where(inside, mean, 0).max(axis=1)
        values["friction_margin", seconds] = mean / np.maximum(most, 1e-300)
    for lag in SLIDING_LAGS:
        then = before(times, lag, lag * rate)
        d, change, shear = own - own[then], force - force[then], sheared - sheared[then]
        change_across = change - (change @ sensor.normal)[:, None] * sensor.normal
        common = (w[..., None] * shear).sum(axis=1)
        spread = np.sqrt((w * norm(shear - common[:, None]) ** 2).sum(axis=1))
        turned = norm(sheared) - norm(sheared[then])
        values |= {
            ("shear_by_load", lag): np.log((norm(change_across) + whole) / by_load),
            ("normal_by_load", lag): change @ sensor.normal / by_load,
            ("force_by_load", lag): (norm(force) - norm(force[then])) / by_load,
            ("friction_rise", lag): r - r[then],
            ("taxel_friction_rise", lag): q - q[then],
            ("alignment", lag): (change_across * tangent).sum(axis=1) / by_load,
            ("centre_shift", lag): np.log(norm(centre - centre[then]) + 1e-3),
            ("divergence", lag): np.log((spread + s) * m / by_load),
            ("relative_divergence", lag): np.log((spread + s) / (norm(common) + s)),
            ("normal_divergence", lag): np.log(
                (np.sqrt((d[..., 2] ** 2).mean(axis=1)) + s) * m / by_load
            ),
            ("falling_share", lag): (w * (turned < -2 * s[:, None])).sum(axis=1),
            ("rising_share", lag): (w * (turned > 2 * s[:, None])).sum(axis=1),
        }
    for what, energy in energies(own, times, rate).items():
        values[f"fast_{what}", 0.014] = np.log1p(energy / s**2) / 2
        for over, seconds in AVERAGES.items():
            # The first sample has no difference: the average begins at the second.
            mean = np.append(0, smoothed(energy[1:], times[1:], seconds))
            values[f"fast_{what}_{over}", 0.014] = np.log1p(mean / s**2) / 2
    return values


def energies(own, times, rate):
    """Return the mean squares of the first and second differences of the taxels."""
    steps, seconds = np.zeros_like(own), np.zeros_like(own)
    near = before(times, 0.014, 0.014 * rate)
    for k in range(2, len(own)):
        middle = near[k]
        spacing = (times[k] - times[middle]) / (k - middle)
        if 2 * times[middle] - times[k] < times[0] - spacing / 2:
            middle = k - min(k - middle, k // 2)
        later = times[k] - times[middle]
        oldest = min(nearest(times, k, times[middle] - later, 2 * (k - middle)), middle - 1)
        earlier = times[middle] - times[oldest]
        even = abs(later - earlier) <= 0.02 * (later + earlier)
        a = 1.0 if even else 2 * earlier / (later + earlier)
        steps[k] = own[k] - own[middle]
        seconds[k] = a * own[k] - 2 * own[middle] + (2 - a) * own[oldest]
    squares = lambda x: (x**2).sum(axis=-1).mean(axis=-1)  # noqa: E731
    shear, normal = seconds[..., :2], seconds[..., 2:]
    return {
        "step": squares(steps[..., :2]), "shear": squares(shear), "normal": squares(normal),
        "all": squares(seconds), "own": squares(shear - shear.mean(axis=1, keepdims=True)),
    }  # fmt: skip


def made(name):
    """Return a sensor without a field of the earth in its readings."""
    if name == "quantised":  # in newtons, by steps, exactly 0 without contact
        return replace(built_in("uskin-4x4"), name=name, unit="N", range=(-100.0, 100.0), step=0.01,
                       magnetic=False, rests_at_zero=True)  # fmt: skip
    if name == "one":
        return Sensor(name, np.zeros((1, 3)), np.eye(3)[None], np.array([0, 0, 1.0]), 100.0, "N")
    return replace(built_in(name), magnetic=False)


def walk(sensor, seed, n=400, rate=RATE, uneven=0.0, gaps=()):
    """Return readings that rest, are pressed and move, and their times."""
    rng = np.random.default_rng(seed)
    steps = 1 + uneven * rng.uniform(-1, 1, n)
    for k, periods in gaps:
        steps[k] = periods
    shape = (n, sensor.n_taxels, 3)
    # Released over some samples: a load that goes at once is a new baseline.
    load = np.clip(np.minimum((np.arange(n) - 60) / 30, (n - 40 - np.arange(n)) / 10), 0, 1)
    moving = np.cumsum(rng.normal(size=shape), axis=0) * 0.02
    # Mostly shear, so that the ratios reach their bound; and by less than a step at a time.
    push = np.array([9, 0, 1] if sensor.name == "papillarray" else [0, 0, 1])
    moving *= 0.05 if sensor.step else 1
    force = load[:, None, None] * (push + rng.random((sensor.n_taxels, 3)) + moving)
    noise = rng.normal(size=shape) * 0.003
    times = 3.0 + np.cumsum(steps) / rate
    if sensor.unit == "count":
        return np.rint(32000 + 300 * (force + noise)), times
    if sensor.step:
        return np.rint(100 * force) / 100, times
    return force + noise, times


SENSORS = ("uskin-4x4", "uskin-curved", "papillarray", "quantised")
STREAMS = {
    "even": {}, "uneven": {"uneven": 0.3}, "bridged gaps": {"gaps": ((100, 4), (101, 6), (250, 7))},
    "gaps": {"gaps": ((3, 40), (150, 9), (151, 400)), "uneven": 0.1},
}  # fmt: skip


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("stream", STREAMS)
def test_equal_the_definitions(name, stream):
    sensor = made(name)
    readings, times = walk(sensor, seed=len(stream), **STREAMS[stream])
    found = features_of(readings, times, sensor)
    assert np.isfinite(found).all(axis=1).mean() > 0.98
    np.testing.assert_allclose(found, naive(readings, times, sensor), rtol=1e-9, atol=1e-9)


def test_equal_the_definitions_without_a_known_zero():
    sensor = made("uskin-curved")
    readings, times = (values[120:] for values in walk(sensor, 2, gaps=((300, 30),)))
    found = features_of(readings, times, sensor, loaded=True)
    expected = naive(readings, times, sensor, loaded=True)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    changes = [spec.kind not in ZERO_KINDS for spec in SLIDING_FEATURES]
    known = features_of(readings, times, sensor)
    assert (np.abs(found - known)[-60:, changes] > 0.1).any()  # the load is that which went


def test_one_taxel_has_those_that_compare_none():
    sensor = made("one")
    specs = tuple(spec for spec in SLIDING_FEATURES if spec.min_taxels == 1)
    readings, times = walk(sensor, 0)
    found = features_of(readings, times, sensor, specs=specs)[1:]
    assert np.isfinite(found).all()
    columns = [SLIDING_FEATURES.index(spec) for spec in specs]
    np.testing.assert_allclose(found, naive(readings, times, sensor)[1:, columns], atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(factor=st.floats(0.01, 100.0), angle=st.floats(-3.2, 3.2), shift=st.integers(-1000, 1000))
def test_do_not_depend_on_unit_direction_and_clock(factor, angle, shift):
    sensor = replace(made("uskin-4x4"), unit="N", range=None)  # flat: all normals are z
    readings, times = walk(sensor, 5, n=150, uneven=0.2)
    times = np.round(times * 2**20) / 2**20  # so that a shift rounds no difference
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    turned = factor * np.concatenate([readings[..., :2] @ turn, readings[..., 2:]], axis=2)
    np.testing.assert_allclose(
        features_of(turned, times + shift, sensor), features_of(readings, times, sensor), atol=1e-8
    )


@pytest.mark.parametrize(
    ("push", "signs"),
    [
        ((0.0, 0.0, 0.5), {"normal_by_load": 1, "alignment": 0, "friction_rise": -1}),
        ((0.5, 0.0, 0.0), {"normal_by_load": 0, "alignment": 1, "friction_rise": 1}),
        ((-0.1, 0.0, 0.0), {"normal_by_load": 0, "alignment": -1, "friction_rise": -1}),
    ],
)
def test_signs_tell_a_press_from_a_pull_and_a_release(push, signs):
    sensor = replace(made("uskin-4x4"), unit="N", range=None)
    readings = 1e-5 * np.random.default_rng(0).normal(size=(120, 16, 3))
    readings[40:] += [0.2, 0.0, 1.0]
    readings[100:] += push
    specs = tuple(FeatureSpec(kind, transform="relative", seconds=0.1) for kind in signs)
    found = features_of(readings, np.arange(120) / RATE, sensor, specs=specs)[100]
    assert np.sign(np.round(found, 2)).tolist() == list(signs.values())
