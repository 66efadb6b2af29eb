"""Each hand by itself; what every hand must fulfil is in `test_contract.py`."""

import builtins

import msgspec
import pytest

from holdfast_grip import FingerCommand, GripCommand, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.hands import open_hand
from holdfast_grip.hands.local import ScalarGripper

COMMAND = GripCommand(
    1.0, LoopState.REACT, {"thumb": FingerCommand(1.3), "index": FingerCommand(1.1)}
)
RELEASE = msgspec.structs.replace(COMMAND, release=True)


def test_a_missing_folder_is_an_error(tmp_path):
    with pytest.raises(HandError, match="no/hand"):
        open_hand(f"log:{tmp_path}/no/hand").open()


class TestScalarGripper:
    def test_a_function_that_fails_is_one_line(self):
        with (
            pytest.raises(HandError, match="call:: ZeroDivisionError: "),
            ScalarGripper(lambda scale: scale / 0) as gripper,
        ):
            gripper.send(COMMAND)

    def test_it_is_called_when_the_largest_scale_changes(self):
        given = []
        with ScalarGripper(given.append) as gripper:
            gripper.send(COMMAND)
            fingers = {"thumb": FingerCommand(1.3), "index": FingerCommand(1.2)}
            gripper.send(msgspec.structs.replace(COMMAND, fingers=fingers))
        assert given == [1.3]

    def test_the_function_asks_for_more_by_its_attributes(self):
        given = []

        def take(scale):
            given.append(scale)

        take.heartbeat, take.needs_idle = 1e-9, True
        idle = msgspec.structs.replace(COMMAND, state=LoopState.IDLE)
        with ScalarGripper(take) as gripper:
            gripper.send(idle)
            gripper.send(idle)
            gripper.send(COMMAND)
        assert (gripper.heartbeat, given) == (1e-9, [1.3] * 3)

    @pytest.mark.parametrize("heartbeat", [0, -1.0, float("inf"), float("nan"), "often"])
    def test_a_heartbeat_that_is_no_time_is_refused(self, heartbeat):
        def take(scale):
            pass

        take.heartbeat = heartbeat
        with pytest.raises(ValueError, match=r"heartbeat of the function: a time above 0 s expect"):
            ScalarGripper(take)

    @pytest.mark.parametrize("path", ["nothing:here", "builtins:nothing", "builtins", ":abs"])
    def test_a_function_that_does_not_exist_is_refused(self, path):
        with pytest.raises(ValueError, match=r"call:MODULE:FUNCTION expected"):
            open_hand(f"call:{path}")

    def test_what_is_no_function_is_refused(self):
        assert not callable(builtins.__name__)
        with pytest.raises(ValueError, match="builtins:__name__ is no function"):
            open_hand("call:builtins:__name__")


@pytest.mark.parametrize("uri", ["magic:", "log:", "hand", ""])
def test_an_unknown_hand_is_refused(uri):
    with pytest.raises(ValueError, match="is no hand; there are twin:, log:PATH"):
        open_hand(uri)
