"""Processes of ROS 1: a driver of a hand, and a hand of holdfast that takes orders on stdin.

python ros1_peer.py drivers   publishes joint states; prints each message that it gets as JSON;
                              a line [position, every] on stdin makes some joint states wrong
python ros1_peer.py hands     does what the lines on stdin say; prints an answer to each
"""

import json
import sys
import threading
import time

from holdfast_grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_grip.hands import open_hand
from holdfast_ros.hands import ros_hand
from holdfast_ros.rospy_node import message_type, rospy_module
from ros.hands.drivers import ROS1, readings


def emit(value):
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def drivers():
    """All drivers in one process."""
    rospy = rospy_module()
    rospy.init_node("drivers", anonymous=True, disable_signals=True)

    def take(message, topic):
        fields = ("data",) if hasattr(message, "data") else ("name", "position", "effort")
        emit([topic, {field: getattr(message, field) for field in fields}])

    keep = [
        rospy.Subscriber(topic, message_type(kind), take, topic, tcp_nodelay=True)
        for driver in ROS1.values()
        for topic, kind in driver.topics.items()
    ]
    kind = message_type("sensor_msgs/JointState")
    states = {driver.states: driver.names for driver in ROS1.values() if driver.states}
    publishers = {topic: rospy.Publisher(topic, kind, queue_size=1) for topic in states}
    emit(len(keep))
    spoiled = [(None, 1)]
    threading.Thread(target=listen, args=(spoiled,), daemon=True).start()
    n = 0
    while True:
        n += 1
        positions, efforts = readings(*spoiled[-1], n)
        for topic, publisher in publishers.items():
            publisher.publish(name=states[topic], position=positions, effort=efforts)
        time.sleep(0.01)


def listen(spoiled):
    """Append each line of stdin, and answer it."""
    for line in sys.stdin:
        spoiled.append(json.loads(line))
        emit("spoiled")


def hands():
    """Each line is [URI, whether it stands by, word, ...]."""
    ros_hand.DISCOVERY_TIME = 0.1
    ros_hand.HAND_OPEN_TIMEOUT = 20.0
    made = {}
    for line in sys.stdin:
        uri, standby, word, *given = json.loads(line)
        if (uri, standby) not in made:
            made[uri, standby] = open_hand(uri, standby=standby)
        try:
            answer = obey(made[uri, standby], word, given)
        except Exception as failure:
            emit([type(failure).__name__, str(failure)])
        else:
            emit(["", answer])


def obey(made, word, given):
    if word == "check":
        limits, fingers = given
        return made.check(Limits(max_scale=limits), fingers)
    if word == "send":
        time, state, release, scales, repeat = given
        fingers = {name: FingerCommand(float(scale)) for name, scale in scales.items()}
        return made.send(GripCommand(time, LoopState(state), fingers, release), repeat=repeat)
    if word == "set":
        return setattr(made, *given)
    if word == "get":
        return getattr(made, *given)
    return getattr(made, word)()


if __name__ == "__main__":
    {"drivers": drivers, "hands": hands}[sys.argv[1]]()
