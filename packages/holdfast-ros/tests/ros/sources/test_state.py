"""What `holdfast doctor` reports of the sources."""

import pytest

from holdfast.devices.uri import source_states
from holdfast_ros import rospy_node
from holdfast_ros.sources import ros1, ros2

pytestmark = pytest.mark.slow


def test_both_are_in_the_report(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    found = source_states()
    assert list(found) == ["xela", "ros1", "ros2", "serial"]
    assert found["ros2"] == ros2.state() == "cyclonedds, domain 7"
    assert found["ros1"] == ros1.state()


def test_a_bad_master_is_reported(monkeypatch):
    monkeypatch.setattr(rospy_node, "rospy_module", lambda: None)
    monkeypatch.setenv("ROS_MASTER_URI", "nonsense")
    assert ros1.state() == ("a ROS master like http://localhost:11311 expected, 'nonsense' given")
