"""Log the contact states that holdfast publishes on ROS 2 topics, and its faults.

Run `holdfast serve builtin:twin twin:?object=can --ros2` in a terminal, and in another one:

    python3 watch_states.py
    python3 watch_states.py --ros-args -p fingers:="[thumb, index]"
"""

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from std_msgs.msg import Float64, String

FINGERS = ["thumb", "index", "middle", "ring"]


class StateWatcher(Node):
    """Log each change of the state of the hand and of its fingers, and each fault."""

    def __init__(self) -> None:
        super().__init__("holdfast_state_watcher")
        fingers = self.declare_parameter("fingers", FINGERS).value
        self.states: dict[str, str] = {}
        self.probabilities: dict[str, float] = {}
        self.problems: dict[str, str] = {}
        for name in (*fingers, "hand"):
            self.create_subscription(String, f"/holdfast/{name}/state", self.state_of(name), 10)
        for name in fingers:
            topic = f"/holdfast/{name}/stable_probability"
            self.create_subscription(Float64, topic, self.probability_of(name), 10)
        self.create_subscription(DiagnosticArray, "/diagnostics", self.check, 10)

    def state_of(self, name: str):  # noqa: ANN201 (a callback)
        """Return the callback for the state of a finger or of the hand."""

        def log_change(message: String) -> None:
            before = self.states.get(name)
            self.states[name] = message.data
            if message.data != before:
                probability = self.probabilities.get(name)
                stable = "" if probability is None else f", P(stable) {probability:.2f}"
                self.get_logger().info(f"{name}: {before or 'nothing'} -> {message.data}{stable}")

        return log_change

    def probability_of(self, name: str):  # noqa: ANN201 (a callback)
        """Return the callback for the probability that the contact of a finger is stable."""

        def keep(message: Float64) -> None:
            self.probabilities[name] = message.data

        return keep

    def check(self, message: DiagnosticArray) -> None:
        """Log each new problem that holdfast reports. Other nodes use this topic too."""
        for status in message.status:
            if not status.name.startswith("holdfast: "):
                continue
            problem = "" if status.level == DiagnosticStatus.OK else status.message
            if problem and problem != self.problems.get(status.name):
                self.get_logger().warning(f"{status.name}: {problem}")
            self.problems[status.name] = problem


def main() -> None:
    """Run the node until Ctrl-C."""
    rclpy.init()
    node = StateWatcher()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
