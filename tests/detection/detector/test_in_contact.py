"""Recordings and streams that begin in contact."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Reason
from holdfast.detection import Detector, Model, detect
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

RATE = 100.0
SHARE = np.array([0.05, -0.03, 0.2])
"""Force on each taxel of a finger that holds something [N]."""
OFFSET = np.array([32000.0, 33000.0, 36000.0])
COUNTS_PER_NEWTON = 2000.0
MODELS = ("builtin:any", "builtin:noise-floor")


def held(shares, unit="count", noise=2.0, **metadata):
    """A recording whose load is a share of the grip at each sample, from the first on."""
    rng = np.random.default_rng(0)
    skin = sensor("uskin-4x4") if unit == "count" else sensor("papillarray")
    forces = np.asarray(shares)[:, None, None] * SHARE * np.ones((1, skin.n_taxels, 1))
    readings = COUNTS_PER_NEWTON * forces + rng.normal(0, noise, forces.shape)
    readings = np.round(readings + OFFSET) if unit == "count" else readings / COUNTS_PER_NEWTON
    module = Tactile(skin, np.arange(len(readings)) / RATE, readings, unit)
    return Recording("held", {"a": module}, metadata)


def released(seconds=3.0):
    n = round(seconds * RATE)
    return np.concatenate([np.ones(n), np.linspace(1, 0, 20), np.zeros(n)])


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("unit", ["count", "N"])
def test_no_tare_is_taken(name, unit):
    trace = detect(Model.load(name), held(np.ones(100), unit), in_contact=True).fingers["a"]
    assert (trace.state[30:] == STABLE).all()
    quiet = detect(Model.load(name), held(np.ones(100), unit)).fingers["a"]
    assert (quiet.state[30:] != STABLE).all()


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("unit", ["count", "N"])
def test_after_the_release_there_is_no_contact(name, unit):
    trace = detect(Model.load(name), held(released(), unit), in_contact=True).fingers["a"]
    assert (trace.state[30:300] == STABLE).all()
    assert (trace.state[375:] == NO_CONTACT).all()


def test_a_pull_is_unstable():
    shares = np.concatenate([np.ones(200), 1 + 0.5 * np.sin(np.arange(100) / 4)])
    trace = detect(Model.load("builtin:any"), held(shares), in_contact=True).fingers["a"]
    assert (trace.state[220:] == UNSTABLE).mean() > 0.6


def test_the_metadata_declare_it():
    model, recording = Model.load("builtin:any"), held(np.ones(300))
    marked = replace(recording, metadata={"starts_loaded": True})
    declared = detect(model, recording, in_contact=True).fingers["a"]
    np.testing.assert_array_equal(detect(model, marked).fingers["a"].state, declared.state)
    denied = detect(model, marked, in_contact=False).fingers["a"]
    assert (denied.state[30:] == NO_CONTACT).all()


def test_a_declared_baseline_gives_the_force():
    baseline = np.tile(OFFSET, (16, 1))
    recording = held(np.ones(100), starts_loaded=True, baselines={"a": baseline.tolist()})
    trace = detect(Model.load("builtin:any"), recording).fingers["a"]
    expected = 16 * COUNTS_PER_NEWTON * np.linalg.norm(SHARE)
    assert np.linalg.norm(trace.force[50]) == pytest.approx(expected, rel=0.01)
    live = Detector(
        Model.load("builtin:any"), {"a": sensor("uskin-4x4")}, RATE,
        in_contact=True, baselines={"a": baseline},
    )  # fmt: skip
    for k in range(51):
        estimate = live.update({"a": recording.modules["a"].readings[k]}, k / RATE)
    assert estimate.fingers["a"].force == pytest.approx(trace.force[50].tolist())


@pytest.mark.parametrize("values", [[[1, 2, 3]], "x", [[[np.nan] * 3] * 16]])
def test_a_wrong_baseline_is_refused(values):
    recording = held(np.ones(10), starts_loaded=True, baselines={"a": values})
    with pytest.raises(ValueError, match="baselines of a"):
        detect(Model.load("builtin:any"), recording)


def test_a_reset_keeps_the_declaration_unless_told():
    detector = Detector(
        Model.load("builtin:noise-floor"), {"a": sensor("uskin-4x4")}, RATE, in_contact=True
    )
    readings = held(np.ones(100)).modules["a"].readings
    for in_contact, reason in ((None, Reason.WARM_UP), (False, Reason.TARE)):
        detector.reset(in_contact=in_contact)
        detector.update({"a": readings[0]}, 0.0)
        estimate = detector.update({"a": readings[1]}, 0.01).fingers["a"]
        assert estimate.state.code == UNKNOWN and estimate.reason is reason
