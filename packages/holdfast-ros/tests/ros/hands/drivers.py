"""What the drivers of hands send and take, written without the code under test."""

import math
import threading
import time
from dataclasses import dataclass, field

PATIENCE = 60.0
THUMB_FIRST = ("thumb", "index", "middle", "ring")
THUMB_LAST = ("index", "middle", "ring", "thumb")
POSITIONS = [0.27 + 0.002 * k for k in range(16)]
EFFORTS = [0.02 + 0.001 * k for k in range(16)]
AH_NAMES = [f"ah_joint{finger}{joint}" for finger in range(4) for joint in range(4)]
V5_NAMES = [f"joint_{k}.0" for k in range(16)]
SIXTEEN = ",".join(["0.1"] * 16)
OPEN_WIDTH = 0.08
PLEXUS = "/allegro_hand_position_effort_controller"
V4 = "/allegro_hand_position_controller/commands"


def wrong(values, value, joint=0):
    """Values of which one is wrong."""
    return [value if k == joint else one for k, one in enumerate(values)]


def readings(position, every, n):
    """Positions and efforts of the n-th joint states; every so many, those of joint 0 are wrong."""
    if position is None or n % every:
        return POSITIONS, EFFORTS
    return wrong(POSITIONS, position), wrong(EFFORTS, 2 * EFFORTS[0])


def ratios(values, order, base, counts=(4, 4, 4, 4)):
    """The ratio of the joints of each finger, which is the same for all of them."""
    found, begin = {}, 0
    for finger, n in zip(order, counts, strict=True):
        parts = [values[k] / base[k] for k in range(begin, begin + n)]
        assert max(parts) - min(parts) < 1e-6, (finger, parts)
        found[finger], begin = parts[0], begin + n
    assert len(values) == begin
    return found


def values_of(message):
    """The positions of a trajectory of one point that begins at once, or the numbers."""
    if "points" not in message:
        data = message.get("data", ())
        return [data] if isinstance(data, float) else list(data)
    assert message["header"]["stamp"] == {"sec": 0, "nanosec": 0}
    (point,) = message["points"]
    assert point["time_from_start"] == {"sec": 0, "nanosec": 20_000_000}
    assert len(message["joint_names"]) == len(point["positions"])
    return list(point["positions"])


@dataclass
class Driver:
    """A driver: how its hand is opened, and what its messages mean."""

    uri: str
    topics: dict
    states: str | None = None
    names: list = field(default_factory=list)
    order: tuple = ()
    stiffness: list | None = None
    home: list | None = None
    effort: float | None = None
    counts: tuple = (4, 4, 4, 4)
    strength: float | None = None

    def meaning(self, messages):
        """The force scales of the last message; "open" if it opens the hand."""
        if "home" in [message.get("data") for topic, message in messages if "lib" in topic]:
            return "open"
        _, message = messages[-1]
        if self.strength is not None:
            return width_meaning(values_of(message), self.effort, self.strength)
        if "max_effort" in message:  # opens by its position
            is_open = message["position"] == OPEN_WIDTH
            return "open" if is_open else message["max_effort"] / self.effort
        if self.effort is not None:
            return message["data"] / self.effort if message["data"] else "open"
        values = values_of(message) or list(message["effort"]) or message["position"]
        if self.stiffness is None:
            return "open" if not any(values) else ratios(values, self.order, EFFORTS, self.counts)
        if all(math.isclose(a, b, abs_tol=1e-3) for a, b in zip(values, self.home, strict=True)):
            return "open"
        parts = zip(self.stiffness, values, POSITIONS[: len(values)], strict=True)
        return ratios([k * (v - q) for k, v, q in parts], self.order, EFFORTS, self.counts)


def width_meaning(values, force, strength):
    """The scale of a gripper that is open at 0 rad, and closed by 80 mm at 0.8 rad."""
    (position,) = values
    if position == 0.0:
        return "open"
    narrower = 0.08 * (position - POSITIONS[0]) / 0.8
    return 1.0 + strength * narrower / force


MIXED = ("ring", "thumb", "index", "middle")
MIXED_COUNTS = (3, 4, 2, 1)
MIXED_NAMES = [f"j{k}" for k in range(16)]
MIXED_JOINTS = "ring:j0:j1:j2,thumb:j3:j4:j5:j6,index:j7:j8,middle:j9"
FINGER_NAMES = ["finger_joint", *MIXED_NAMES[1:]]
WIDTH = "joint=finger_joint&open=0&closed=0.8&stroke=0.08&effort=4&max_effort=10&stiffness=2000"
TRAJECTORY = "trajectory_msgs/JointTrajectory"
FLOATS, JOINTS = "std_msgs/Float64MultiArray", "sensor_msgs/JointState"
V4_HOME = {
    "thumb": [1.0472, 0.4363, 0.2618, 0.7854],
    "index": [0, -0.1745, 0.7854, 0.7854],
    "middle": [0, -0.1745, 0.7854, 0.7854],
    "ring": [0.0873, -0.0873, 0.8727, 0.7854],
}
FINGER, THUMB = [0.4167, 0.6667, 0.75, 0.4167], [0.8333, 0.5833, 0.5, 0.5]


def home(order):
    return [angle for finger in order for angle in V4_HOME[finger]]


ROS2 = {
    "plexus": Driver(
        f"ros2:plexus?max_effort=0.2&effort={','.join(map(str, EFFORTS))}",
        {f"{PLEXUS}/efforts": FLOATS}, order=THUMB_FIRST,
    ),
    "v4": Driver(
        "ros2:v4", {V4: FLOATS}, "/joint_states", AH_NAMES, THUMB_FIRST,
        stiffness=[*THUMB, *FINGER * 3], home=home(THUMB_FIRST),
    ),
    "v5": Driver(
        f"ros2:v5?max_effort=0.2&stiffness=2&home={SIXTEEN}",
        {"/allegroHand/joint_cmd": JOINTS}, "/allegroHand/joint_states", V5_NAMES, THUMB_LAST,
        stiffness=[2.0] * 16, home=[0.1] * 16,
    ),
    "v5-envelop": Driver(
        "ros2:v5-envelop?effort=1&max_effort=3",
        {"/allegroHand/envelop_torque": "std_msgs/Float32",
         "/allegroHand_0/lib_cmd": "std_msgs/String"},
        order=THUMB_FIRST, effort=1.0,
    ),
    "gripper": Driver(
        "ros2:gripper?topic=/gripper/force&effort=4&max_effort=10",
        {"/gripper/force": "std_msgs/Float64"}, effort=4.0,
    ),
    "parallel-gripper": Driver(
        "ros2:gripper?topic=/gripper/command&type=GripperCommand&effort=4&max_effort=10"
        f"&open={OPEN_WIDTH}",
        {"/gripper/command": "control_msgs/GripperCommand"}, effort=4.0,
    ),
    "width-gripper": Driver(
        f"ros2:width-gripper?topic=/gripper/joint_trajectory&{WIDTH}",
        {"/gripper/joint_trajectory": TRAJECTORY}, "/joint_states", FINGER_NAMES,
        effort=4.0, strength=2000.0,
    ),
    "width-gripper-number": Driver(
        f"ros2:width-gripper?topic=/gripper/command&type=Float64&states=/gripper/joint_states"
        f"&{WIDTH}",
        {"/gripper/command": "std_msgs/Float64"}, "/gripper/joint_states", FINGER_NAMES,
        effort=4.0, strength=2000.0,
    ),
    "width-gripper-array": Driver(
        f"ros2:width-gripper?topic=/gripper/commands&type=Float64MultiArray&{WIDTH}",
        {"/gripper/commands": FLOATS}, "/joint_states", FINGER_NAMES, effort=4.0, strength=2000.0,
    ),
    "controller": Driver(
        f"ros2:controller?topic=/hand/joint_trajectory&joints={MIXED_JOINTS}&max_effort=0.1"
        f"&stiffness=2&home={','.join(['0.1'] * 10)}",
        {"/hand/joint_trajectory": TRAJECTORY}, "/joint_states", MIXED_NAMES, MIXED,
        stiffness=[2.0] * 10, home=[0.1] * 10, counts=MIXED_COUNTS,
    ),
    "effort-controller": Driver(
        f"ros2:controller?topic=/hand/commands&joints={MIXED_JOINTS}&max_effort=0.1&command=efforts",
        {"/hand/commands": FLOATS}, "/joint_states", MIXED_NAMES, MIXED, counts=MIXED_COUNTS,
    ),
}  # fmt: skip


class Ros2Driver:
    """A driver on the topics of ROS 2, in a thread of this process."""

    def __init__(self, driver, domain, **changes):
        from holdfast.io.cdr import MessageDecoder, MessageEncoder
        from holdfast_ros import dds
        from holdfast_ros.topic_messages import JOINT_STATE, joint_message, topic_definition

        self.driver = driver
        self.messages = []
        self._node = dds.Node(domain)
        self._readers = []
        for topic, kind in driver.topics.items():
            definition = topic_definition(kind)
            reader = self._node.reader(topic, definition)
            self._readers.append((topic, reader, MessageDecoder(definition, ros2=True)))
        self._write, self._spoiled, self._n_states = None, (None, 1), 0
        if driver.states is not None:
            definition = topic_definition(JOINT_STATE)
            names, efforts = changes.get("names", driver.names), changes.get("efforts")
            # Other joints of the robot, and the hand's in another order: names decide.
            names = ["arm_1", *reversed(names)] if names else []
            turned = (lambda values: [9.0, *reversed(values)]) if names else list
            write = self._node.writer(driver.states, definition)
            encode = MessageEncoder(definition)

            def publish(positions, measured):
                given = measured if efforts is None else efforts
                message = joint_message(
                    1.0, names, positions=turned(positions), efforts=turned(given) if given else []
                )
                write(encode(message))

            self._write = publish
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        while not self._ending.wait(0.005):
            for topic, reader, decode in self._readers:
                self.messages += [(topic, decode(data)) for data in reader.take(0.0)]
            with self._lock:
                if self._write is not None:
                    self._n_states += 1
                    self._write(*readings(*self._spoiled, self._n_states))

    def spoil(self, position, every=3):
        """Publish a wrong position [rad] of joint 0 every so many states; None for right ones."""
        with self._lock:
            self._spoiled = position, every

    def stop_states(self):
        """Publish no joint states any more; none is on its way when this returns."""
        with self._lock:
            self._write = None
        time.sleep(0.05)

    def wait(self, n):
        """The messages, as soon as there are so many."""
        end = time.monotonic() + PATIENCE
        while len(self.messages) < n:
            assert time.monotonic() < end, f"{n} messages expected, {self.messages} came"
            time.sleep(0.002)
        return self.messages

    def close(self):
        self._ending.set()
        self._thread.join()
        self._readers.clear()
        self._write = self._node = None
