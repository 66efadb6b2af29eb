"""Drivers of hands on ROS 2, each test in a ROS domain of its own on this machine."""

import gc

import pytest

from holdfast_ros.hands import ros_hand

from .drivers import Ros2Driver


@pytest.fixture
def driver(domain, monkeypatch):
    """A function that starts a driver."""
    gc.collect()  # participants that tests before left in cycles are still in the domain
    monkeypatch.setattr(ros_hand, "DISCOVERY_TIME", 0.05)
    made = []

    def start(described, **changes):
        made.append(Ros2Driver(described, domain, **changes))
        return made[-1]

    yield start
    for one in made:
        one.close()


@pytest.fixture
def impatient(monkeypatch):
    """A hand that waits a short time for its driver."""
    monkeypatch.setattr(ros_hand, "HAND_OPEN_TIMEOUT", 0.2)
