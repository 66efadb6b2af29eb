"""What `holdfast doctor` reports of the source."""

import pytest

from holdfast.devices.uri import source_states
from holdfast_ros.sources import ros2

pytestmark = pytest.mark.slow


def test_it_is_in_the_report(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    found = source_states()
    assert list(found) == ["xela", "ros2", "serial"]
    assert found["ros2"] == ros2.state() == "cyclonedds, domain 7"
