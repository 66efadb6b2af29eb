import pytest

from ros.domains import new_domain


@pytest.fixture
def domain(monkeypatch):
    """A ROS domain of this test alone, on this machine only."""
    number = new_domain()
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    return number
