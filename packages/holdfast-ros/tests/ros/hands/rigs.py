"""Hands of ROS for the tests of the contract, with their drivers on the other side."""

from contextlib import contextmanager

from grip.hands.rigs import Rigs
from holdfast_grip.hands import open_hand
from ros.domains import new_domain

from .drivers import ROS2, Ros2Driver

NAMES = list(ROS2)
WITH_STATES = [name for name, driver in ROS2.items() if driver.states is not None]


class RosRig:
    """A hand on topics, with a driver on the other side."""

    def __init__(self, hand, driver):
        self.hand, self.peer, self.driver = hand, driver, driver.driver
        self.per_finger = self.driver.effort is None
        self.fingers = self.driver.order or None

    def start(self):
        self.peer.messages.clear()
        self.hand.heartbeat = None

    @contextmanager
    def spoiled(self, position):
        """Every third reading of the first joint is wrong."""
        self.peer.spoil(position)
        yield
        self.peer.spoil(None)

    @contextmanager
    def other_hand(self, *, standby=False):
        """A second hand of the same URI, not yet open."""
        hand = open_hand(self.hand.name, standby=standby)
        yield hand
        hand.close()

    def forces(self, n):
        messages = self.peer.wait(n)
        assert len(messages) == n, messages
        return self.driver.meaning(messages)

    def close(self):
        self.hand.close()
        self.peer.close()


def ros2_rig(name):
    domain = new_domain()
    driver = ROS2[name]
    uri = with_parameter(driver.uri, f"domain={domain}")
    return RosRig(open_hand(uri), Ros2Driver(driver, domain))


def with_parameter(uri, text):
    return f"{uri}{'&' if '?' in uri else '?'}{text}"


class RosRigs(Rigs):
    """Rigs by the name of the driver."""

    def _new(self, name):
        return ros2_rig(name)
