"""The URIs of the hands of the table: every wrong parameter is one clear line."""

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast_grip import Limits
from holdfast_grip.hands import open_hand

SIXTEEN = ",".join(["0.1"] * 16)
WIDTH = "ros2:width-gripper?topic=/g&joint=f&open=0.08&effort=4&max_effort=12&stiffness=2000"
JOINTS = "ros2:controller?topic=/h&joints=thumb:a:b,index:c&max_effort=1"


GRIPPER = "ros2:gripper?topic=/g&effort=4&max_effort=9"
V5 = f"ros2:v5?max_effort=1&home={SIXTEEN}"
WRONG = [
    ("ros2:magic", "there are the hands ros2:plexus"),
    ("ros2:v4?torque=1", "unknown parameter torque"),
    ("ros2:v4?domain=x", "'x'"),
    ("ros2:plexus?effort=1", "max_effort: a number or 16 numbers"),
    ("ros2:plexus?effort=1,2&max_effort=1", "effort: .*'1,2'"),
    ("ros2:plexus?effort=1&max_effort=0", "max_effort: .*0 given"),
    ("ros2:plexus?effort=1&max_effort=2&release=home", "home: 16 numbers"),
    (f"{GRIPPER}&type=GripperCommand", "open: a number"),
    (f"{GRIPPER}&type=GripperCommand&open=0", "open= another"),
    (f"{GRIPPER}&closed=0", "unknown parameter closed"),
    (f"{GRIPPER}&type=Int", "type=Float64 or Float32"),
    (GRIPPER.replace("effort=4", "effort=x"), "effort: a number .*'x'"),
    (GRIPPER.replace("effort=4", "effort=-1"), "effort: a number above 0"),
    ("ros2:v5-envelop?effort=1&max_effort=2&release=limp&home_topic=/a", "home_topic"),
    (f"{V5.replace('0.1', '45')}&stiffness=2", r"home: index joint 0: -3\.14159 to 3\.14159"),
    (f"{V5}&stiffness=2&highest=0.05", r"home: index joint 0: -3\.14159 to 0\.05"),
    (V5, "stiffness: a number or 16 numbers"),
    ("ros2:v4?release=limp", "release=home"),
    ("ros2:v4?topic=hand", "topic=/TOPIC"),
    ("ros2:v4?shared=yes", "shared=false or true"),
    ("ros2:v4?joints=thumb:a", "joints: 4 of thumb"),
    ("ros2:v4?lowest=2", "lowest below highest"),
    (f"{WIDTH}&closed=0.08", "open= another"),
    (f"{WIDTH}&stroke=0", "stroke: .*above 0"),
    (f"{WIDTH}&gain=1999", "gain: .*2000"),
    (WIDTH.replace("joint=f&", ""), "joint=NAME"),
    (WIDTH.replace("open=0.08", "open=80"), "80 given"),
    (WIDTH.replace("&stiffness=2000", ""), "stiffness: a number"),
    (f"{JOINTS}&stiffness=1", "home: 3 numbers"),
    (f"{JOINTS}&command=efforts&home=0,0,0", "unknown parameter home"),
    (f"{JOINTS}&command=efforts&type=JointTrajectory", "type=Float64MultiArray"),
    ("ros2:controller?topic=/h", "joints=thumb:JOINT"),
    ("ros2:controller?topic=/h&joints=thumb,index:c", "'thumb,index:c'"),
    ("ros2:controller?topic=/h&joints=thumb:a,index:a", "'thumb:a,index:a'"),
]


@pytest.mark.parametrize(("uri", "message"), WRONG)
def test_a_wrong_uri_is_refused(uri, message):
    with pytest.raises(ValueError, match=message):
        open_hand(uri)


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("ros2:plexus?effort=0.2&max_effort=0.3", "joint 0: .*0.3 N m .*0.4 N m"),
        ("ros2:v5-envelop?effort=1&max_effort=1.5", "at most 1.5 .*2 given"),
        (WIDTH.replace("=12", "=6"), "at most 6 N .*8 N"),
        (WIDTH.replace("=2000", "=40"), "0.08 m .*0.1 m .*stiffness="),  # in N/mm
        (  # in N m for each degree
            f"{JOINTS}&stiffness=0.11&home=0,0,0&effort=0.1,0.1,0.4",
            "index joint 0: .*6.28319 rad .*7.27 rad .*stiffness=",
        ),
    ],
)
def test_given_efforts_are_checked_at_start_up(uri, message):
    hand = open_hand(uri)
    with pytest.raises(ValueError, match=message):
        hand.check(Limits(max_scale=2.0), ["thumb"])
    hand.check(Limits(max_scale=1.5), ["thumb"])
