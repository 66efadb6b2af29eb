"""Troubles of magnetic skins in the twin: each shows as what it is, and none changes nothing."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.synthetic import synthetic_recording
from holdfast.twin.magnetic_faults import STILL_SECONDS_AT_START, MagneticFaults


@pytest.fixture(scope="module")
def grasp():
    return synthetic_recording("made", 0, ("thumb", "index"))


def spoiled(recording, rows=slice(None), **faults):
    times = np.asarray(recording.modules["thumb"].times)
    modules = recording.modules
    counts = MagneticFaults(**faults).apply(
        {name: module.sensor for name, module in modules.items()},
        {name: np.asarray(module.readings)[rows] for name, module in modules.items()},
        times[rows],
        {name: np.asarray(module.readings[:60]).mean(axis=0) for name, module in modules.items()},
        seed=5,
    )
    return {name: np.asarray(own) for name, own in counts.items()}


def recorded(recording, counts):
    modules = {n: replace(m, readings=counts[n]) for n, m in recording.modules.items()}
    return replace(recording, modules=modules)


def test_without_troubles_nothing_changes(grasp):
    assert MagneticFaults().changes_nothing and not MagneticFaults(field=1).changes_nothing
    for name, counts in spoiled(grasp).items():
        assert (counts == grasp.modules[name].readings).all()


def test_samples_one_by_one_are_those_of_a_batch(grasp):
    options = {"field": 50, "zero_share": 0.1, "drift": 5e3, "invented_months": 4}
    whole, last = spoiled(grasp, **options), spoiled(grasp, slice(700, 701), **options)
    for name in whole:
        assert (whole[name][700] == last[name][0]).all()


def test_a_field_is_common_to_all_taxels(grasp):
    faults, times = MagneticFaults(field=400), np.asarray(grasp.modules["thumb"].times)
    field = faults.field_at(times)
    assert (field[times <= STILL_SECONDS_AT_START] == 0).all()
    assert np.linalg.norm(field, axis=1).max() == pytest.approx(800, rel=0.1)
    for name, counts in spoiled(grasp, field=400).items():
        change = counts - np.asarray(grasp.modules[name].readings, dtype=float)
        turned = np.einsum("ijk,nik->nij", grasp.modules[name].sensor.rotations, change)
        assert np.abs(turned - field[:, None]).max() < 1  # rounding


def test_an_aged_skin_is_weaker_and_noisier(grasp):
    aged = spoiled(grasp, invented_months=4)["thumb"]
    fresh = np.asarray(grasp.modules["thumb"].readings, dtype=float)
    assert np.ptp(aged.astype(float).mean(axis=1)[:, 2]) < np.ptp(fresh.mean(axis=1)[:, 2])
    assert np.diff(aged[:60].astype(float), axis=0).std() > np.diff(fresh[:60], axis=0).std()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"drift": np.inf}, "drift"),
        ({"zero_share": 2}, "share"),
        ({"turn_time": 0}, "turn time"),
    ],
)
def test_troubles_that_cannot_be(options, message):
    with pytest.raises(ValueError, match=message):
        MagneticFaults(**options)
