import numpy as np
import pytest

from holdfast.twin.hand import FINGERS
from holdfast.twin.simulation import Grasp, simulate
from holdfast_grip import FingerCommand, GripCommand, LoopState
from holdfast_grip.hands.live_twin import LiveTwin

pytestmark = pytest.mark.slow

URI = "twin:?object=ball&case=1&profile=finger-vigorous"


def command(scale, **given):
    fingers = {finger: FingerCommand(scale) for finger in FINGERS}
    return GripCommand(0.0, LoopState.REACT, fingers, **given)


def read_until(twin, held_for):
    while twin.simulation.held_for < held_for:
        twin.read(0.0)


@pytest.mark.usefixtures("short_grasps")
def test_without_commands_it_sends_the_recording_of_the_grasp():
    expected = simulate(Grasp("ball", 1, 1, profile="finger-vigorous"))
    with LiveTwin(URI, speed=0) as twin:
        arrivals = list(twin)
        assert twin.ended
        assert twin.sensors.keys() == expected.modules.keys()
    for finger, module in expected.modules.items():
        np.testing.assert_array_equal([one.samples[finger] for one in arrivals], module.readings)
        np.testing.assert_array_equal([one.time for one in arrivals], module.times)


@pytest.mark.usefixtures("short_grasps")
def test_a_command_changes_the_force_and_release_opens_the_hand():
    with LiveTwin(URI, speed=0) as twin:
        read_until(twin, 0.8)
        before = twin.simulation.world.loads.sum()
        twin.send(command(1.5))
        read_until(twin, 1.2)
        assert twin.simulation.world.loads.sum() > 1.3 * before
        twin.send(command(1.5, release=True))
        for _ in range(200):
            twin.read(0.0)
        assert not twin.simulation.world.loads.any()


def test_in_real_time_a_sample_is_not_there_before_it_is_due():
    with LiveTwin(URI, speed=1e-6) as twin:
        assert twin.read(0.0) is not None
        assert twin.read(0.01) is None


def test_the_effects_of_a_server_are_refused():
    with pytest.raises(ValueError, match="server=false expected"):
        LiveTwin("twin:?server=true")
