import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast_ros.dds import Link
from holdfast_ros.publisher import Ros2Publisher
from live.estimates import UNITS, check_received, estimate

PEER = Path(__file__).with_name("ros2_peer.py")


def test_another_program_reads_what_is_published(domain):
    reader = subprocess.Popen(
        [sys.executable, PEER, "read", str(domain)], stdout=subprocess.PIPE, text=True
    )
    try:
        with Ros2Publisher(UNITS, Link()) as publisher:
            end = time.monotonic() + 60
            while reader.poll() is None:
                assert time.monotonic() < end, "not all topics were received"
                publisher.publish(estimate())
                time.sleep(0.02)
        found = dict(json.loads(line) for line in reader.stdout)
    finally:
        reader.kill()
        reader.wait()
        reader.stdout.close()
    assert publisher.n_failed == 0
    force = found["/holdfast/thumb/force"]
    stamp = force["header"]["stamp"]
    status = {one["name"]: one for one in found["/diagnostics"]["status"]}
    thumb = status["holdfast: thumb"]
    check_received(
        {
            "state": found["/holdfast/thumb/state"]["data"],
            "hand": found["/holdfast/hand/state"]["data"],
            "probability": found["/holdfast/thumb/stable_probability"]["data"],
            "instability": found["/holdfast/thumb/instability"]["data"],
            "force": list(force["wrench"]["force"].values()),
            "frame": force["header"]["frame_id"],
            "age": time.time() - stamp["sec"] - stamp["nanosec"] * 1e-9,
            "vector": list(found["/holdfast/index_1/force"]["vector"].values()),
            "level": thumb["level"],
            "values": {pair["key"]: pair["value"] for pair in thumb["values"]},
        }
    )


def test_domains():
    with pytest.raises(ValueError, match="'500'"):
        Link("500")
