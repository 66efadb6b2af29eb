from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from holdfast.contact import Cause, ContactState, Phase
from holdfast.detection import fingertip_force
from holdfast.metrics.slip_truth import MIN_SLIP_DISTANCE, finger_slips
from holdfast.twin import hand, simulation
from holdfast.twin.objects import OTHER_OBJECTS, object_named
from holdfast.twin.profile import profile
from holdfast.twin.simulation import Grasp, simulate
from holdfast.twin.uskin_readout import UskinParameters

pytestmark = pytest.mark.slow

FINGERS = ("thumb", "index", "middle", "ring")
SHORT = msgspec.structs.replace(profile("finger-reference"), idle=(0.7, 0.8), hold=6.0)
MOVED = msgspec.structs.replace(profile("reference"), idle=(0.7, 0.8), hold=9.0, move_share=1.0)
GRAVITY = 9.81


def made(grasp, chosen=SHORT, glitches=0.0):
    """A recording of a short grasp whose controller has that many glitches per second."""
    with pytest.MonkeyPatch.context() as patch:
        chosen = msgspec.structs.replace(chosen, glitch_rate=glitches)
        patch.setattr(simulation, "profile", lambda _: chosen)
        return simulate(grasp)


@pytest.fixture(scope="module")
def held():
    return made(Grasp("can", 1, 1))


@pytest.fixture(scope="module")
def pushed():
    return made(Grasp("box", 2, 1), msgspec.structs.replace(SHORT, hold=8.0))


@pytest.fixture(scope="module")
def moved():
    return made(Grasp("box", 2, 1), MOVED)


@pytest.fixture(scope="module")
def dropped():
    return made(Grasp("bottle", 1, 1), msgspec.structs.replace(SHORT, grip=0.3))


def quiet(recording):
    """Samples at which the object is held, settled and undisturbed."""
    since = recording.truth.times - recording.metadata["locked_at"]
    return (since > 1.5) & (since < SHORT.hold - 0.2)


def turns(poses):
    return Rotation.from_quat(poses[:, [4, 5, 6, 3]])


def on_object(recording, span):
    fingers = recording.truth.fingers.values()
    return np.sum([finger["contact_force"][span] for finger in fingers], axis=0)


class TestHeldObject:
    @pytest.mark.parametrize(
        ("name", "table"), [("can", None), ("prism", None), ("spray", OTHER_OBJECTS)]
    )
    def test_its_weight_is_the_sum_of_the_contact_forces(self, name, table):
        recording = made(Grasp(name, 1, 1, table=table))
        weight = GRAVITY * recording.metadata["object_mass"]
        assert recording.metadata["object_mass"] == object_named(name, table).mass
        total = on_object(recording, quiet(recording)).mean(axis=0)
        np.testing.assert_allclose(total, [0, 0, weight], atol=0.02 * weight)

    def test_nothing_slides(self, held):
        """While the joints relax, a node or two at a patch's edge give way; then it rests."""
        rested = quiet(held) & (held.truth.times > held.metadata["locked_at"] + 4.0)
        for finger in held.truth.fingers.values():
            assert finger["slip_speed"][rested].max() < 1e-6
            assert finger["slipping_share"][quiet(held)].max() < 0.1
            assert finger["slip_speed"][quiet(held)].sum() / 150 < 2e-5


class TestReadings:
    def test_show_the_contact_force_in_the_fingertip_frame(self, held):
        per_newton = np.array(UskinParameters().counts_per_newton)
        span = quiet(held)
        for name, module in held.modules.items():
            finger = held.truth.fingers[name]
            wanted = turns(finger["tip_pose"][span]).inv().apply(finger["contact_force"][span])
            rest = module.readings[:75].mean(axis=0)
            got = fingertip_force((module.readings - rest) / per_newton, module.sensor, tare="none")
            wanted, got = wanted.mean(axis=0), got[span].mean(axis=0)
            assert np.linalg.norm(got - wanted) < 0.25 * np.linalg.norm(wanted)
            assert wanted[0] > 0.8  # presses along its x


class TestTruth:
    @pytest.fixture(params=["held", "pushed", "dropped"])
    def any_recording(self, request):
        return request.getfixturevalue(request.param)

    def test_has_all_documented_arrays(self, any_recording):
        truth, n = any_recording.truth, len(any_recording.truth.times)
        assert {name: array.shape for name, array in truth.hand.items()} == {
            "phase": (n,), "outside_force": (n, 3), "object_pose": (n, 7), "joints": (n, 16),
            "set_point_error": (n,),
        }  # fmt: skip
        assert tuple(truth.fingers) == tuple(any_recording.modules) == FINGERS
        for finger in truth.fingers.values():
            assert {name: array.shape for name, array in finger.items()} == {
                "contact_force": (n, 3), "slip_speed": (n,), "slipping_share": (n,),
                "tip_pose": (n, 7),
            }  # fmt: skip
            assert all(np.isfinite(array).all() for array in finger.values())
        for module in any_recording.modules.values():
            np.testing.assert_array_equal(module.times, truth.times)

    def test_is_possible(self, any_recording):
        truth, item = any_recording.truth, object_named(any_recording.metadata["object"])
        assert set(truth.hand["phase"]) <= set(Phase)
        poses = truth.hand["object_pose"]
        np.testing.assert_allclose(np.linalg.norm(poses[:, 3:], axis=1), 1.0, atol=1e-9)
        low, high = hand.HandModel.build(item).limits().T
        assert (truth.hand["joints"] > low - 0.05).all()
        assert (truth.hand["joints"] < high + 0.05).all()
        for finger in truth.fingers.values():
            assert (finger["slip_speed"] >= 0).all()
            share = finger["slipping_share"]
            assert ((share >= 0) & (share <= 1 + 1e-12)).all()
            away = np.linalg.norm(finger["contact_force"], axis=1) == 0
            assert not finger["slip_speed"][away].any()

    def test_motion_follows_from_the_forces(self, pushed):
        """Newton's law on the object, over the whole grasp: impulse is change of momentum."""
        truth, mass = pushed.truth, pushed.metadata["object_mass"]
        span = slice(200, None)
        force = on_object(pushed, span) + truth.hand["outside_force"][span]
        force[:, 2] -= GRAVITY * mass
        position = truth.hand["object_pose"][span, :3]
        velocity = np.gradient(position, 1 / 150, axis=0)
        for k in range(0, len(force) - 300, 150):
            gained = mass * (velocity[k + 299] - velocity[k])
            given = force[k : k + 299].sum(axis=0) / 150
            np.testing.assert_allclose(gained, given, atol=0.02)


class TestRecording:
    def test_metadata(self, held, dropped):
        assert held.metadata.keys() >= {
            "object", "object_mass", "case", "repeat", "profile", "seed", "hand", "source"
        }  # fmt: skip
        assert (held.name, held.metadata["lost_at"]) == ("can-case1-1", None)

    def test_a_failed_grasp_has_the_case_failed(self, dropped):
        assert dropped.name == "bottle-case1-1-failed1"
        assert (dropped.metadata["case"], dropped.metadata["planned_case"]) == ("failed", 1)
        lost = dropped.metadata["lost_at"]
        assert lost > dropped.metadata["locked_at"]
        after = dropped.truth.times >= lost + 0.3
        assert not np.isin(
            dropped.truth.hand["phase"][after], [Phase.LOCKED, Phase.DISTURBED]
        ).any()
        for module in dropped.modules.values():
            assert all(
                not (x.state == ContactState.STABLE and x.end > lost + 0.1) for x in module.labels
            )
            assert Cause.LOST in {x.cause for x in module.labels}
        assert dropped.truth.hand["object_pose"][-1, 2] < -0.2  # it fell, and out of the picture


class TestSeeds:
    def test_the_same_seed_gives_the_same_samples(self, held):
        assert made(Grasp("can", 1, 1)).digest == held.digest


class TestMovedByAHand:
    def test_the_object_goes_both_ways(self, moved):
        """The first disturbance is the one called down: it goes down, then up."""
        truth = moved.truth
        disturbed = np.isin(truth.hand["phase"], ("disturbed", "slipping"))
        first = int(np.argmax(disturbed))
        last = first + int(np.argmin(disturbed[first:]))
        height = truth.hand["object_pose"][first:last, 2] - truth.hand["object_pose"][first, 2]
        assert height.min() < -5e-4
        assert height.max() > 5e-4
        assert np.argmin(height) < np.argmax(height)


class TestGlitches:
    def test_a_grasp_can_have_its_own_rate_of_glitches(self, held):
        none = made(replace(Grasp("can", 1, 1), glitch_rate=0.0), SHORT, glitches=0.5)
        assert none.metadata["glitch_rate"] == 0.0
        assert not none.truth.hand["set_point_error"].any()
        wanted = held.modules["thumb"].readings
        np.testing.assert_array_equal(none.modules["thumb"].readings, wanted)


def test_in_handling_no_finger_slides():
    """Pushes and pulls go on, though the first attempt slides."""
    short = msgspec.structs.replace(profile("handling"), idle=(0.7, 0.8), hold=7.0)
    first = made(Grasp("can", 2, 1, seed=9), msgspec.structs.replace(short, without_slips=False))
    kept = made(Grasp("can", 2, 1, seed=9), short)

    def distances(recording):
        return [s.distance for f in FINGERS for s in finger_slips(recording.truth, f)]

    assert max(distances(first)) > 1e-3
    assert max(distances(kept), default=0.0) < MIN_SLIP_DISTANCE
    pushed = [np.mean(r.truth.hand["phase"] == Phase.DISTURBED) for r in (first, kept)]
    assert pushed[1] > 0.5 * pushed[0] > 0.05


def test_what_always_slides_is_refused(monkeypatch):
    monkeypatch.setattr(simulation, "MAX_EASED", 1)
    monkeypatch.setattr(simulation, "GRASP_ATTEMPTS", 1)
    short = msgspec.structs.replace(profile("handling"), idle=(0.7, 0.8), hold=7.0)
    with pytest.raises(ValueError, match="can-case2-1: something slides in each of 1 attempts"):
        made(Grasp("can", 2, 1, seed=9), short)
