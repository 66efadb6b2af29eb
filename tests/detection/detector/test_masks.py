"""Masks of taxels: a finger goes on without its faulty taxels, as if they were healthy."""

import numpy as np
import pytest

from holdfast.contact import ContactState, Fault, Reason
from holdfast.detection import Detector, Model, detect
from holdfast.metrics.masks import runs as stretches_of
from holdfast.recordings import Recording, Tactile
from holdfast.twin.simulation import Grasp, simulate

from .build import RATE, feed, model, sensor

NO_CONTACT, STABLE, UNKNOWN = (
    state.code for state in (ContactState.NO_CONTACT, ContactState.STABLE, ContactState.UNKNOWN)
)
FINGER = "thumb"
LIMIT = 65_535.0
LOST_SECONDS = 0.5
"""HF_LOST_SECONDS of `kernel/masks.c`."""


@pytest.fixture(scope="module")
def grasp():
    whole = simulate(Grasp("can", case=1, repeat=1, profile="gentle"))
    return Recording("grasp", {FINGER: whole.modules[FINGER]})


@pytest.fixture(scope="module", params=["builtin:any", "builtin:twin"])
def shipped(request):
    return Model.load(request.param)


def longest_hold(module):
    """First sample and end of the longest stable stretch."""
    stretches = stretches_of(module.label_states == STABLE).tolist()
    return max(stretches, key=lambda stretch: stretch[1] - stretch[0])


def loads(module):
    """Load of each taxel in the longest hold, and the taxels from the least to the most."""
    first, end = longest_hold(module)
    values = np.asarray(module.readings, dtype=float)
    held = np.linalg.norm(values[first:end].mean(axis=0) - values[:50].mean(axis=0), axis=1)
    return held / held.sum(), np.argsort(held)


def break_taxels(recording, taxels, kind, start, end=None):
    module = recording.modules[FINGER]
    values = np.array(module.readings, dtype=float)
    broken = {"frozen": values[start, taxels], "nan": np.nan, "rail": LIMIT}[kind]
    values[start:end, taxels] = broken
    return Recording("broken", {FINGER: Tactile(module.sensor, module.times, values)})


def moments(module):
    first, end = longest_hold(module)
    return {"empty": 100, "hold": (first + end) // 2, "release": end}


def trace_of(hand_model, recording):
    return detect(hand_model, recording).fingers[FINGER]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["frozen", "nan", "rail"])
@pytest.mark.parametrize("moment", ["empty", "hold", "release"])
@pytest.mark.parametrize("n_broken", [1, 4])
class TestAFewTaxels:
    """Of small and of large loads."""

    def broken(self, grasp, kind, moment, n_broken):
        share, order = loads(grasp.modules[FINGER])
        rng = np.random.default_rng(n_broken)
        for taxels in (order[:n_broken], rng.permutation(30)[:n_broken], order[-2:-1]):
            if share[taxels].sum() < 0.3:
                start = moments(grasp.modules[FINGER])[moment]
                yield start, taxels, break_taxels(grasp, taxels, kind, start)

    def test_states_stay_near_those_of_the_whole_finger(
        self, grasp, shipped, kind, moment, n_broken
    ):
        healthy = trace_of(shipped, grasp)
        share, _ = loads(grasp.modules[FINGER])
        for start, taxels, recording in self.broken(grasp, kind, moment, n_broken):
            trace = trace_of(shipped, recording)
            after = slice(start + 400, None)
            if (kind, moment) == ("frozen", "release") and share[taxels].sum() > 0.05:
                # It is found after the release, when it carries most of what is left.
                assert set(trace.state[after]) <= {UNKNOWN, NO_CONTACT}
                continue
            assert np.mean((trace.state == healthy.state)[after]) > 0.9, taxels
            assert not (trace.state[after] == UNKNOWN).any()
            bits = sum(1 << int(taxel) for taxel in taxels)
            assert np.mean(trace.faulty_taxels[after, 0] == bits) > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["frozen", "nan", "rail"])
class TestTooManyTaxels:
    def test_past_half_of_the_load_the_finger_is_unknown(self, grasp, shipped, kind):
        module = grasp.modules[FINGER]
        share, order = loads(module)
        first, end = longest_hold(module)
        start = (first + end) // 2
        n_broken = int(np.searchsorted(np.cumsum(share[order[::-1]]), 0.6)) + 1
        assert n_broken < 15  # fewer than half of the taxels
        trace = trace_of(shipped, break_taxels(grasp, order[::-1][:n_broken], kind, start))
        held = slice(start + 100, end)
        assert (trace.state[held] == UNKNOWN).all()
        assert set(trace.reason[held]) == {tuple(Reason).index(Reason.FAULT)}

    def test_more_than_half_of_the_taxels_of_an_empty_finger(self, grasp, shipped, kind):
        trace = trace_of(shipped, break_taxels(grasp, np.arange(16), kind, 100))
        assert (trace.state[500:] == UNKNOWN).all()

    def test_just_less_than_half_of_the_taxels_of_an_empty_finger(self, grasp, shipped, kind):
        trace = trace_of(shipped, break_taxels(grasp, np.arange(15), kind, 100))
        assert (trace.state[500:] != UNKNOWN).all()


@pytest.mark.slow
class TestForce:
    def forces(self, grasp, kind, taxels, start, end=None):
        trace = trace_of(Model.load("builtin:any"), break_taxels(grasp, taxels, kind, start, end))
        return np.asarray(trace.force)

    def test_no_step_when_a_taxel_is_masked_and_when_it_comes_back(self, grasp):
        module = grasp.modules[FINGER]
        share, order = loads(module)
        first, end = longest_hold(module)
        start, back = first + (end - first) // 3, first + 2 * (end - first) // 3
        whole = self.forces(grasp, "nan", [], start)
        taxels = order[-4:-1]
        assert 0.1 < share[taxels].sum() < 0.5
        for kind in ("nan", "rail", "frozen"):
            force = self.forces(grasp, kind, taxels, start, back)
            usual = np.linalg.norm(np.diff(whole[first:end], axis=0), axis=1).max()
            steps = np.linalg.norm(np.diff(force[first:end], axis=0), axis=1)
            carried = share[taxels].sum() * np.linalg.norm(whole[start])
            assert carried > 5 * usual  # a step would show
            assert steps.max() < 1.5 * usual, kind
            assert np.linalg.norm(force[-1] - whole[-1]) < 0.05 * np.linalg.norm(whole[start])

    def test_what_is_filled_in_goes_with_the_load(self, grasp):
        module = grasp.modules[FINGER]
        share, order = loads(module)
        assert 0.1 < share[order[-4:-1]].sum() < 0.5
        start = sum(longest_hold(module)) // 2
        whole = self.forces(grasp, "nan", [], start)
        force = self.forces(grasp, "frozen", order[-4:-1], start)
        size = np.linalg.norm(whole, axis=1)
        held = slice(start, int(np.flatnonzero(size > 0.5 * size[start])[-1]))
        error = np.linalg.norm(force - whole, axis=1)
        assert np.median(error[held]) < 0.1 * size[start]
        assert error[-1] < 0.05 * size[start]  # the object is released
        assert np.nanmax(np.linalg.norm(force, axis=1)) < 1.3 * np.nanmax(size)


def noise(n=900, n_taxels=6, seed=0):
    rng = np.random.default_rng(seed)
    return np.rint(30_000.0 + rng.normal(scale=3.0, size=(n, n_taxels, 3)))


TIP = sensor(6, "tip", limits=(0.0, LIMIT))


class TestEstimates:
    def estimates(self, values, which=TIP, **options):
        return feed(Detector(model(("thumb",), which=which, **options)), values)

    def test_a_masked_finger_has_an_estimate_and_names_its_fault(self):
        values = noise()
        values[300:500, 2, 1] = np.nan
        found = self.estimates(values)
        assert {e.state is ContactState.UNKNOWN for e in found[300:]} == {False}
        assert {(e.reason, e.faults, e.faulty_taxels) for e in found[300:500]} == {
            (Reason.NONE, (Fault.NOT_FINITE,), (2,))
        }
        assert {e.faults for e in found[500:]} == {()}
        assert np.isfinite([e.force for e in found[50:]]).all()

    def test_two_faults_at_once(self):
        values = noise()
        values[300:, 2, 1] = np.inf
        values[310:, 4, 0] = -5.0
        last = self.estimates(values)[-1]
        assert (last.faults, last.faulty_taxels) == (
            (Fault.NOT_FINITE, Fault.OUT_OF_RANGE), (2, 4)
        )  # fmt: skip
        assert last.state is not ContactState.UNKNOWN

    @pytest.mark.parametrize("tare", ["0.5", "first", "none"])
    def test_a_taxel_that_is_never_a_number(self, tare):
        values = noise()
        values[:, 3] = np.nan
        found = self.estimates(values, tare=tare)
        wait = round((LOST_SECONDS + 0.5) * RATE) + 10
        assert {e.state is ContactState.UNKNOWN for e in found[wait:]} == {False}
        assert {(e.faults, e.faulty_taxels) for e in found[wait:]} == {((Fault.NOT_FINITE,), (3,))}
        whole = self.estimates(np.delete(values, 3, axis=1), _without(TIP, 3), tare=tare)
        assert np.allclose(found[-1].force, whole[-1].force, atol=30.0)


def _without(which, taxel):
    return type(which)(
        which.name, np.delete(which.positions, taxel, axis=0),
        np.delete(which.rotations, taxel, axis=0), which.normal, which.rate, which.unit,
        which.range,
    )  # fmt: skip
