import holdfast
import holdfast_grip
from holdfast.openable import Openable


def test_a_hand_is_a_layout_and_a_hand_device_takes_commands():
    assert issubclass(holdfast_grip.HandDevice, Openable)
    assert not issubclass(holdfast_grip.HandDevice, holdfast.Hand)


def test_public_names():
    """The contract of the package."""
    assert {"Limits", "HandDevice", "GripController", "GripCommand", "GripLoop", "HandError"} <= {
        *holdfast_grip.__all__
    }
