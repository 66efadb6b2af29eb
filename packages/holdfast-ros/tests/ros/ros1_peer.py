"""Other processes of ROS 1: what publishes as XELA's node does, what listens, and holdfast's own.

python ros1_peer.py publish N             sends N messages of XELA at 150 Hz
python ros1_peer.py chatter               says hello, ten times a second
python ros1_peer.py source URI SECONDS    prints what holdfast's source gives, as JSON
python ros1_peer.py read                  prints what comes on holdfast's topics, JSON lines
python ros1_peer.py estimates             publishes estimates as holdfast does
"""

import json
import sys
import time

from holdfast_ros.rospy_node import rospy_module
from holdfast_ros.sensor_messages import SENS_STREAM

N_TAXELS = 30


def emit(value):
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def publish(n):
    rospy = rospy_module()
    from genpy.dynamic import generate_dynamic

    types = generate_dynamic("xela_server_ros/SensStream", SENS_STREAM)
    names = ("SensStream", "SensorFull", "Taxel", "Forces")
    stream, full, taxel, forces = (types[f"xela_server_ros/{name}"] for name in names)
    if stream._md5sum != "70e7f953be62543e749f1bc3d640bc6c":
        raise SystemExit(f"another message than XELA's: {stream._md5sum}")
    rospy.init_node("xela", anonymous=True, disable_signals=True)
    publisher = rospy.Publisher("/xServTopic", stream, queue_size=10)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    start = time.time()
    for k in range(int(n)):
        taxels = [taxel(k, place, 65535) for place in range(N_TAXELS)]
        newtons = [forces(0.5 * k, 1.0, 2.0)] * N_TAXELS
        sensors = [full(k, start + k / 150, "uSCuAH", i, taxels, newtons) for i in (1, 2)]
        publisher.publish(stream(sensors))
        time.sleep(max(0.0, start + (k + 1) / 150 - time.time()))
    time.sleep(0.5)
    rospy.signal_shutdown("all is said")


def chatter():
    rospy = rospy_module()
    from std_msgs.msg import String

    rospy.init_node("chatter", anonymous=True, disable_signals=True)
    publisher = rospy.Publisher("/chatter", String, queue_size=10)
    while True:
        publisher.publish("hello")
        time.sleep(0.1)


def source(uri, until, patience=5.0):
    """Ends soon after a notice, or after 60 s."""
    from holdfast.devices.sources import open_source
    from holdfast.errors import HoldfastError
    from holdfast_ros.sources import topic

    topic.TOPIC_OPEN_TIMEOUT = float(patience)
    result = {"numbers": [], "times": [], "n_lost": 0, "notices": []}
    try:
        with open_source(uri) as opened:
            result["sensors"] = {name: [s.name, s.unit] for name, s in opened.sensors.items()}
            emit("open")
            end = time.monotonic() + 60
            n_after = 0
            while time.monotonic() < end and n_after < 3:
                arrival = opened.read(0.2)
                if arrival is not None:
                    note(result, arrival)
                n_after += any(notice.startswith(until) for notice in result["notices"])
    except HoldfastError as error:
        result["error"] = str(error)
    emit(result)


def note(result, arrival):
    result["notices"] += arrival.notices
    result["n_lost"] += arrival.n_lost
    if arrival.samples:
        first = next(iter(arrival.samples.values()))
        result["numbers"].append(float(first[0, 0]))
        result["times"].append(arrival.time)
        result["sample"] = first[1].tolist()


def read():
    rospy = rospy_module()
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import Vector3Stamped, WrenchStamped
    from std_msgs.msg import Float64, String

    topics = {
        "/holdfast/thumb/state": String,
        "/holdfast/thumb/stable_probability": Float64,
        "/holdfast/thumb/instability": Float64,
        "/holdfast/thumb/force": WrenchStamped,
        "/holdfast/index_1/force": Vector3Stamped,
        "/holdfast/hand/state": String,
        "/holdfast/grip/state": String,
        "/holdfast/thumb/force_scale": Float64,
        "/diagnostics": DiagnosticArray,
    }
    rospy.init_node("reader", anonymous=True, disable_signals=True)
    found = {}
    keep = [
        rospy.Subscriber(name, kind, lambda message, name=name: found.update({name: message}))
        for name, kind in topics.items()
    ]
    emit("ready")
    while len(found) < len(topics):
        time.sleep(0.02)
    for subscriber in keep:
        subscriber.unregister()
    force, vector = found["/holdfast/thumb/force"], found["/holdfast/index_1/force"]
    status = {one.name: one for one in found["/diagnostics"].status}
    thumb = status["holdfast: thumb"]
    emit(
        {
            "state": found["/holdfast/thumb/state"].data,
            "hand": found["/holdfast/hand/state"].data,
            "probability": found["/holdfast/thumb/stable_probability"].data,
            "instability": found["/holdfast/thumb/instability"].data,
            "force": [force.wrench.force.x, force.wrench.force.y, force.wrench.force.z],
            "frame": force.header.frame_id,
            "age": time.time() - force.header.stamp.to_sec(),
            "vector": [vector.vector.x, vector.vector.y, vector.vector.z],
            "level": thumb.level,
            "values": {pair.key: pair.value for pair in thumb.values},
            "grip": found["/holdfast/grip/state"].data,
            "scale": found["/holdfast/thumb/force_scale"].data,
            "grip_message": status["holdfast: grip"].message,
        }
    )
    rospy.signal_shutdown("all is published")


def estimates():
    from grip.fakes import FakeGrip
    from holdfast_ros.publisher import Ros1Publisher
    from live.estimates import UNITS, estimate

    with Ros1Publisher(UNITS, grip=FakeGrip()) as publisher:
        emit("open")
        while True:
            publisher.publish(estimate())
            time.sleep(0.02)


if __name__ == "__main__":
    what, *given = sys.argv[1:]
    {
        "publish": publish, "chatter": chatter, "source": source, "read": read,
        "estimates": estimates,
    }[what](*given)  # fmt: skip
