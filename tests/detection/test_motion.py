"""The relative features against a slow implementation, and their laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.detection import Tare
from holdfast.detection.features import extract
from holdfast.detection.kernel_config import COUNT_NOISE, NEWTON_NOISE, stream_config
from holdfast.detection.plan import StreamPlan
from holdfast.detection.specs import (
    ANY_FEATURES,
    ANY_LAGS,
    SLIDING_FEATURES,
    FeatureSpec,
    kinds_of,
)
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor
from holdfast.sensors import sensor as built_in

RATE = 100.0
MOTION_KINDS = kinds_of("change", "load")
EVERY = tuple(
    FeatureSpec(kind, transform="relative", seconds=lag)
    for kind in MOTION_KINDS
    for lag in ANY_LAGS
)


def features_of(readings, given, rate=RATE, specs=EVERY, times=None):
    times = np.arange(len(readings)) / rate if times is None else times
    module = Tactile(given, times, readings)
    plan = StreamPlan({"a": given}, {"a": specs}, 14, Tare.parse("first"), rate)
    return extract(plan, Recording("made", {"a": module}))["a"].features


def naive(readings, given, rate=RATE):
    """(n, kinds * lags) by loops, from the definitions."""
    f = np.einsum("nij,tnj->tni", given.rotations, readings - readings[0].astype(float))
    normal, n_taxels = given.normal, given.n_taxels
    places = given.positions - given.positions.mean(axis=0)
    radius = math.sqrt((places**2).sum(axis=1).mean())
    places = places / radius if radius else np.zeros_like(places)
    step = COUNT_NOISE if given.unit == "count" else NEWTON_NOISE
    floor = step * math.sqrt(3 * n_taxels)
    total = f.sum(axis=1)
    along = total @ normal
    least_loaded = [int(along[: k + 1].argmin()) for k in range(len(f))]
    references = f[[0, *least_loaded[:-1]]]
    weights = np.abs((f - references) @ normal)
    centre = np.array([w @ places / w.sum() if w.sum() else np.zeros(3) for w in weights])
    moment = np.array([normal @ np.cross(places, sample).sum(axis=0) for sample in f])
    norm = lambda vectors: np.sqrt((vectors**2).sum())  # noqa: E731
    peak = peak_taxels = 0.0
    least = math.inf, math.inf
    block, began = [], 0.0
    rows = np.full((len(f), len(MOTION_KINDS) * len(ANY_LAGS)), np.nan)
    for k in range(len(f)):
        reference = least_loaded[k]
        load, taxel_load = norm(total[k] - total[reference]), norm(f[k] - f[reference])
        keep = math.exp(-1 / rate / 5.0)
        peak, peak_taxels = max(load, keep * peak), max(taxel_load, keep * peak_taxels)
        now = least
        if k and (readings[k] != readings[k - 1]).any():
            block.append((norm(total[k] - total[k - 1]) ** 2, norm(f[k] - f[k - 1]) ** 2))
        if block:
            found = tuple(max(math.sqrt(x / 2), floor) for x in np.mean(block, axis=0))
            if k / rate - began >= 0.2 and len(block) >= 5:
                least = tuple(map(min, least, found))
                block, began = [], k / rate
            now = found if math.isinf(least[0]) else least
        elif math.isinf(least[0]):
            now = floor, floor
        # Of a sensor that rests at zero, each other reading is rounded.
        n_rounded = np.count_nonzero(readings[k]) if given.rests_at_zero else 0
        rounding = (given.step or 0.0) * COUNT_NOISE * math.sqrt(n_rounded)
        noise, taxel_noise = (max(x, rounding) for x in now)
        if k < 1:
            continue
        whole, of_taxels = peak + 100 * noise, peak_taxels + 100 * taxel_noise
        for i, seconds in enumerate(ANY_LAGS):
            back = min(max(1, round(seconds * rate)), k)
            j = k - back
            change = total[k] - total[j]
            shear = change - change @ normal * normal
            rest = f[k] - f[j] - change / n_taxels
            rest_shear = rest - (rest @ normal)[:, None] * normal
            relative = lambda square, noise, load: math.hypot(  # noqa: E731
                math.sqrt(max(square - 4 * noise**2, 0.0)) / load, 0.005
            )
            two, turned = math.sqrt(2 / 3), moment[k] - moment[j]
            values = [
                relative(norm(change) ** 2, noise, whole),
                relative(norm(shear) ** 2, two * noise, whole),
                relative(norm(rest) ** 2, taxel_noise, of_taxels),
                relative(norm(rest_shear) ** 2, two * taxel_noise, of_taxels),
                norm(centre[k] - centre[j]) + 1e-3,
                relative(turned**2, math.sqrt(1 / 3) * taxel_noise, whole),
                whole / noise,
            ]
            rows[k, i :: len(ANY_LAGS)] = np.log(values)
    return rows


def sensor(name):
    """Return a built-in sensor from whose readings no field of the earth is taken."""
    return replace(built_in(name), magnetic=False)


def walk(given, n=150, seed=0, scale=300.0):
    """Readings that rest, are pressed, and move."""
    rng = np.random.default_rng(seed)
    load = np.clip((np.arange(n) - 30) / 20, 0, 1)[:, None, None]
    moving = np.cumsum(rng.normal(size=(n, given.n_taxels, 3)), axis=0) * 0.02
    noise = rng.normal(size=(n, given.n_taxels, 3)) * 0.003
    pressed = load * (1 + rng.random((given.n_taxels, 3))) + load * moving + noise
    if given.unit == "count":
        return np.rint(32000 + scale * pressed).astype(np.uint16)
    return pressed if given.step is None else given.step * np.rint(pressed / given.step)


@pytest.mark.parametrize(
    "name", ["uskin-4x4", "uskin-curved", "anyskin", "papillarray", "orca-thumb"]
)
@pytest.mark.parametrize("rate", [30.0, 100.0, 500.0])
def test_equal_the_definitions(name, rate):
    given = sensor(name)
    readings = walk(given)
    np.testing.assert_allclose(
        features_of(readings, given, rate), naive(readings, given, rate), rtol=1e-9, atol=1e-9
    )


def test_repeated_samples_are_no_noise():
    given = sensor("uskin-4x4")
    readings = np.repeat(walk(given, 60), 2, axis=0)
    np.testing.assert_allclose(features_of(readings, given), naive(readings, given), atol=1e-9)


def test_are_known_from_the_second_sample_on():
    given = sensor("uskin-4x4")
    found = features_of(walk(given), given)
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1:]).all()


@settings(max_examples=20)
@given(factor=st.floats(0.01, 100.0), seed=st.integers(0, 99))
def test_do_not_depend_on_the_gain_of_the_sensor(factor, seed):
    given = sensor("papillarray")
    readings = walk(given, 80, seed)
    np.testing.assert_allclose(
        features_of(factor * readings, given)[1:], features_of(readings, given)[1:], atol=1e-6
    )


def test_do_not_depend_on_the_frame_of_the_sensor():
    given = sensor("papillarray")
    readings = walk(given, 80)
    angle = 0.7
    turn = np.array(
        [[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]]
    )
    turned = Sensor(
        "other", given.positions @ turn.T, turn @ given.rotations, turn @ given.normal, 100.0, "N"
    )
    np.testing.assert_allclose(
        features_of(readings, turned), features_of(readings, given), atol=1e-8
    )


def test_a_common_motion_of_the_taxels_leaves_no_residual():
    given = sensor("papillarray")
    readings = 1e-4 * np.random.default_rng(0).normal(size=(90, 9, 3))
    readings[50:] += np.linspace(0, 1, 40)[:, None, None]
    found = features_of(readings, given)
    change, residual = (
        MOTION_KINDS.index(kind) * len(ANY_LAGS) for kind in ("force_change", "residual")
    )
    assert found[80, change] > -4
    assert found[80, residual] < -5


def test_a_stream_computes_only_the_families_that_it_needs():
    given = sensor("uskin-4x4")
    plan = StreamPlan({"a": given}, {"a": ANY_FEATURES}, 14, Tare.parse("first"), 150.0)
    assert stream_config(plan).lags["has_changes"].all()
    assert not stream_config(plan).lags["sliding"].any()
    plan = replace(plan, features={"a": SLIDING_FEATURES})
    assert not stream_config(plan).lags["has_changes"].any()


def test_a_gap_begins_anew_but_the_load_stays():
    given = sensor("uskin-4x4")
    readings = walk(given, 120)
    times = np.arange(120) / RATE
    times[60:] += 1.0
    found = features_of(readings, given, times=times)
    assert np.isnan(found[60]).all()
    assert np.isfinite(found[61]).all()
    load = MOTION_KINDS.index("load_to_noise") * len(ANY_LAGS)
    assert found[61, load] == pytest.approx(found[59, load], abs=0.3)


def test_one_taxel_has_floors_and_no_nan():
    given = Sensor("one", np.zeros((1, 3)), np.eye(3)[None], np.array([0, 0, 1.0]), 100.0, "N")
    readings = np.random.default_rng(0).normal(size=(50, 1, 3))
    assert np.isfinite(features_of(readings, given)[1:]).all()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kind": "residual"}, "the transform 'relative' is for force_change"),
        ({"kind": "F_a", "transform": "relative"}, "the transform 'relative' is for force_change"),
        ({"kind": "residual", "transform": "relative"}, "a lag above 0 s expected for relative"),
        ({"kind": "F_a", "seconds": 0.1}, "a lag above 0 s expected for relative kinds alone; F_a"),
        (
            {"kind": "residual", "transform": "relative", "seconds": 9.0},
            "a lag from 0 to 2 s expected, 9",
        ),
        ({"kind": "residual", "transform": "relative", "seconds": math.nan}, "a lag from 0 to 2 s"),
    ],
)
def test_specifications_that_contradict_themselves_are_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        FeatureSpec(**fields)


def test_the_list_for_any_hand():
    assert len(ANY_FEATURES) == 31
    assert {spec.transform for spec in ANY_FEATURES} == {"relative"}
    assert str(ANY_FEATURES[0]) == "relative(force_change[0.017 s])"
