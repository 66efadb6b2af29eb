"""The URIs of the hands of the table: every wrong parameter is one clear line."""

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast_grip import Limits
from holdfast_grip.hands import open_hand

SIXTEEN = ",".join(["0.1"] * 16)
WIDTH = "ros2:width-gripper?topic=/g&joint=f&open=0.08&effort=4&max_effort=12&stiffness=2000"
JOINTS = "ros2:controller?topic=/h&joints=thumb:a:b,index:c&max_effort=1"


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("ros2:", "there are the hands ros2:plexus"),
        (
            "ros2:magic",
            "there are the hands ros2:plexus, ros2:v4, ros2:v5, ros2:v5-envelop",
        ),
        ("ros2:///plexus", "there are the hands ros2:plexus"),
        ("ros2:v4?torque=1", "unknown parameter torque; there are domain, shared, topic, type"),
        ("ros2:v4?domain=x", "a ROS domain from 0 to 232 expected, 'x' given"),
        (
            "ros2:plexus?effort=1",
            "max_effort: a number or 16 numbers, one for each joint, expected, nothing",
        ),
        ("ros2:plexus?max_effort=1", "effort: a number or 16 numbers, one for each joint, expecte"),
        ("ros2:plexus?effort=1,2&max_effort=1", "one for each joint, expected, '1,2' given"),
        ("ros2:plexus?effort=nan&max_effort=1", "one for each joint, expected, 'nan' given"),
        ("ros2:plexus?effort=1&max_effort=0", "max_effort: numbers above 0 expected, 0 given"),
        ("ros2:plexus?effort=1&max_effort=2&release=home", "home: 16 numbers, one for each joint,"),
        ("ros2:v4?effort=0.1", "effort: 16 numbers, one for each joint, expected, '0.1' given"),
        (
            "ros2:gripper?topic=/g&effort=4&max_effort=9&type=GripperCommand",
            "open: a number expected, nothing given",
        ),
        (
            "ros2:gripper?topic=/g&effort=4&max_effort=9&type=GripperCommand&open=0",
            "open= another position than closed= expected, 0 given",
        ),
        ("ros2:gripper?topic=/g&effort=4&max_effort=9&closed=0", "unknown parameter closed; there"),
        ("ros2:gripper?topic=/g&effort=4&max_effort=9&joint=a", "unknown parameter joint; there"),
        (
            "ros2:v5-envelop?effort=1&max_effort=2&release=limp&home_topic=/a",
            "parameter home_topic",
        ),
        (
            f"ros2:v5?max_effort=1&stiffness=2&home={SIXTEEN.replace('0.1', '45')}",
            "home: index joint 0: -3.14159 to 3.14159 rad expected, 45 given",
        ),
        (
            f"ros2:v5?max_effort=1&stiffness=2&home={SIXTEEN}&highest=0.05",
            "home: index joint 0: -3.14159 to 0.05 rad expected, 0.1 given",
        ),
        ("ros2:v4?highest=0.5", "0.5 rad expected"),
        ("ros2:v4?release=limp", "release=home expected, 'limp' given"),
        ("ros2:v4?topic=hand", "topic=/TOPIC expected, 'hand' given"),
        ("ros2:v4?states=/a b", "states=/TOPIC expected, '/a b' given"),
        ("ros2:v4?shared=yes", "shared=false or true expected, 'yes' given"),
        ("ros2:v4?joints=thumb:a", "joints: 4 of thumb, 4 of index, 4 of middle, 4 of ring expec"),
        ("ros2:v5?max_effort=1", "home: 16 numbers, one for each joint, expected, nothing given"),
        (f"ros2:v5?max_effort=1&home={SIXTEEN}", "stiffness: a number or 16 numbers"),
        (
            f"ros2:v5?max_effort=1&stiffness=-1&home={SIXTEEN}",
            "stiffness: numbers above 0 exp",
        ),
        ("ros2:v4?lowest=2", "lowest below highest expected for each joint"),
        ("ros2:v5-envelop?effort=1", "max_effort: a number expected, nothing given"),
        ("ros2:v5-envelop?effort=-1&max_effort=1", "effort: a number above 0 expected, -1 given"),
        ("ros2:gripper?effort=1&max_effort=1", "topic=/TOPIC expected, nothing given"),
        ("ros2:gripper?topic=/a&effort=1&max_effort=1&type=Int", "type=Float64 or Float32 or Grip"),
        ("ros2:gripper?topic=/a&effort=x&max_effort=1", "effort: a number expected, 'x' given"),
        (f"{WIDTH}&closed=0.08", "open= another position than closed= expected, 0.08 given"),
        (f"{WIDTH}&stroke=0", "stroke: a number above 0 expected, 0 given"),
        (f"{WIDTH}&gain=1999", "gain: at least the stiffness of 2000 N/m expected, of which it is"),
        (f"{WIDTH}&type=Int8", "type=JointTrajectory or Float64MultiArray or Float64 or Gripper"),
        (WIDTH.replace("joint=f&", ""), "joint=NAME expected, nothing given"),
        (WIDTH.replace("open=0.08", "open=80"), "a stroke of at most 1 m expected, 80 given: give"),
        (WIDTH.replace("&stiffness=2000", ""), "stiffness: a number expected, nothing given"),
        (f"{JOINTS}&stiffness=1", "home: 3 numbers, one for each joint, expected, nothing given"),
        (f"{JOINTS}&stiffness=1,2&home=0,0,0", "stiffness: a number or 3 numbers, one for each"),
        (f"{JOINTS}&stiffness=1&home=0,0,90", "home: index joint 0: -3.14159 to 3.14159 rad expe"),
        (f"{JOINTS}&stiffness=1&home=0,0,0&lowest=4", "lowest below highest expected for each joi"),
        (f"{JOINTS}&command=efforts&home=0,0,0", "unknown parameter home; there are domain, share"),
        (f"{JOINTS}&command=efforts&stiffness=1", "unknown parameter stiffness; there are domain"),
        (f"{JOINTS}&command=efforts&type=JointTrajectory", "type=Float64MultiArray expected, 'Jo"),
        ("ros2:controller?topic=/h", "joints=thumb:JOINT:JOINT,index:JOINT expected, each name"),
        ("ros2:controller?topic=/h&joints=thumb,index:c", "each name once, 'thumb,index:c' given"),
        ("ros2:controller?topic=/h&joints=thumb:a,index:a", "each name once, 'thumb:a,index:a' gi"),
    ],
)
def test_a_wrong_uri_is_refused(uri, message):
    with pytest.raises(ValueError) as failure:
        open_hand(uri)
    assert message in str(failure.value)


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        (
            "ros2:plexus?effort=0.2&max_effort=0.3",
            "joint 0: at most 0.3 N m expected, 0.4 N m given at max_scale 2: lower one of them",
        ),
        (
            "ros2:v5-envelop?effort=1&max_effort=1.5",
            "at most 1.5 expected, 2 given at max_scale 2: lower one of them",
        ),
        (
            WIDTH.replace("=12", "=6"),
            "at most 6 N expected, 8 N given at max_scale 2: lower one of them",
        ),
        (
            WIDTH.replace("=2000", "=40"),  # in N/mm
            "closing by at most 0.08 m expected, 0.1 m given at max_scale 2: lower it, or check "
            "stiffness= [N/m]",
        ),
        (
            f"{JOINTS}&stiffness=0.11&home=0,0,0&effort=0.1,0.1,0.4",  # in N m for each degree
            "index joint 0: a set-point at most 6.28319 rad from the joint expected, 7.27 rad "
            "given at max_scale 2: check stiffness= [N m/rad]",
        ),
    ],
)
def test_given_efforts_are_checked_at_start_up(uri, message):
    hand = open_hand(uri)
    with pytest.raises(ValueError) as failure:
        hand.check(Limits(max_scale=2.0), ["thumb"])
    assert str(failure.value).endswith(message)
    hand.check(Limits(max_scale=1.5), ["thumb"])


def test_a_ros_2_topic_by_its_domain(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    uri = "ros2:gripper?topic=/grip&effort=1&max_effort=2"
    assert open_hand(uri).resource == open_hand(f"{uri}&domain=7").resource
    assert open_hand(uri).resource != open_hand(f"{uri}&domain=0").resource
