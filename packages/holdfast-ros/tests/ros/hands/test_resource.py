"""What only one controller may command: the same for all URIs of one hand."""

from holdfast_grip.hands import open_hand


def test_a_ros_1_topic_by_any_name_of_this_machine(monkeypatch):
    monkeypatch.setattr("holdfast_ros.rospy_node.gethostname", lambda: "Robot")
    hosts = ("localhost", "127.0.0.1", "127.0.1.1", "[::1]", "LOCALHOST", "robot")
    uri = "ros1:gripper?topic=/grip&effort=1&max_effort=2&master=http://{}:11311"
    found = {open_hand(uri.format(host)).resource for host in hosts}
    assert found == {"/grip at the ROS master localhost:11311"}
    assert open_hand(uri.format("other")).resource not in found
    monkeypatch.setenv("ROS_MASTER_URI", "http://Robot:11311/")
    assert open_hand(uri.partition("&master")[0]).resource in found


def test_a_ros_2_topic_by_its_domain(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    uri = "ros2:gripper?topic=/grip&effort=1&max_effort=2"
    assert open_hand(uri).resource == open_hand(f"{uri}&domain=7").resource
    assert open_hand(uri).resource != open_hand(f"{uri}&domain=0").resource
