"""A topic of ROS 2 fulfils what every source fulfils; the tests are those of the core."""

from threading import Event, Thread

import pytest

from devices.sources.sources import Ready
from devices.sources.test_contract import (  # noqa: F401 (pytest runs them)
    test_a_detector_takes_everything,
    test_closing_again_is_harmless,
    test_closing_what_was_never_open_is_harmless,
    test_entering_again_starts_again,
    test_entering_makes_the_modules_known,
    test_metadata_are_plain_and_name_the_source,
    test_reading_without_samples_waits_and_gives_none,
    test_samples_are_not_written_to_again,
    test_samples_have_the_shape_of_the_sensors,
    test_times_go_forward,
)
from holdfast.devices.sources import open_source
from holdfast.io.cdr import MessageEncoder
from holdfast_ros import dds
from holdfast_ros.sensor_messages import known_definition

pytestmark = pytest.mark.slow


@pytest.fixture
def ready(domain):
    definition = known_definition("xela_server_ros2/SensStream")
    node = dds.Node(domain)
    write, encode = node.writer("/xServTopic", definition), MessageEncoder(definition)
    quiet = Event()

    def publish():
        for k in range(10_000):
            write(encode({"sensors": [sensor_full(k, number) for number in (1, 2)]}))
            if quiet.wait(0.01):
                return

    thread = Thread(target=publish)
    thread.start()
    yield Ready(open_source(f"ros2:///xServTopic?domain={domain}&fingers=1:thumb"), quiet.set)
    quiet.set()
    thread.join()


@pytest.fixture
def lasting(ready):
    return ready


def sensor_full(k, number):
    """Sample `k` of a 4 x 4 patch, as XELA's server sends it in ROS 2."""
    return {
        "message": k,
        "time": 1000.0 + k / 100,
        "model": "uSPa44",
        "sensor_pos": number,
        "taxels": [{"x": k % 65536, "y": taxel, "z": 7} for taxel in range(16)],
        "forces": [],
    }
