from socket import create_server

import pytest

from holdfast.errors import SourceError
from holdfast_ros.publisher import Ros1Publisher
from live.estimates import UNITS, check_received
from ros.ros1_master import lines, running_master


def test_another_program_reads_what_is_published(tmp_path):
    with running_master(tmp_path) as master:
        reader = lines(master.peer("read"))
        assert next(reader) == "ready"
        publisher = master.peer("estimates")
        check_received(next(reader))
        publisher.terminate()
        assert list(lines(publisher)) == ["open"]  # and nothing else on stdout


def test_without_a_master():
    with create_server(("127.0.0.1", 0)) as free:
        uri = f"http://127.0.0.1:{free.getsockname()[1]}"
    with (
        pytest.raises(SourceError, match="no ROS master answers"),
        Ros1Publisher(UNITS, master=uri),
    ):
        pass
    with pytest.raises(ValueError, match="a ROS master like http"):
        Ros1Publisher(UNITS, master="robot")
