"""Publish by how much to grip harder, from the contact states that holdfast publishes.

The factor rises at once when the hand becomes UNSTABLE, unless the force of a finger is already
large, and falls slowly while the hand is STABLE. It is 1 while the state is not known or nothing
is held, or when holdfast is silent. Multiply the
grip force of your controller by `/grip/force_factor`. `holdfast hold` is the complete version.

    python3 grip_harder.py --ros-args -p largest_factor:=1.5
"""

import math

import rclpy
from geometry_msgs.msg import Vector3Stamped, WrenchStamped
from rclpy.node import Node
from std_msgs.msg import Float64, String

PERIOD = 0.02
"""Time between two factors [s]."""
SILENCE_TIMEOUT = 0.2
"""Time without a state after which the factor is 1 [s]."""


class GripHarder(Node):
    """Publish a factor for the grip force."""

    def __init__(self) -> None:
        super().__init__("grip_harder")
        self.largest = self.declare_parameter("largest_factor", 1.5).value
        self.fall_time = self.declare_parameter("fall_time", 2.0).value
        self.largest_force = self.declare_parameter("largest_force", 10000.0).value
        finger = self.declare_parameter("finger", "thumb").value
        self.factor = 1.0
        self.state = "UNKNOWN"
        self.state_at = self.now()
        self.force = (0.0, 0.0, 0.0)
        self.create_subscription(String, "/holdfast/hand/state", self.receive_state, 10)
        # The force has the type of its unit: a wrench in newtons, a vector in counts. A node
        # subscribes to the one that its sensor has.
        if self.declare_parameter("unit", "count").value == "N":
            self.create_subscription(
                WrenchStamped, f"/holdfast/{finger}/force", self.receive_wrench, 10
            )
        else:
            self.create_subscription(
                Vector3Stamped, f"/holdfast/{finger}/force", self.receive_vector, 10
            )
        self.publisher = self.create_publisher(Float64, "/grip/force_factor", 10)
        self.create_timer(PERIOD, self.update)

    def now(self) -> float:
        """Return the time of the node's clock [s]."""
        return self.get_clock().now().nanoseconds * 1e-9

    def receive_state(self, message: String) -> None:
        """Keep the state of the hand."""
        self.state, self.state_at = message.data, self.now()

    def receive_vector(self, message: Vector3Stamped) -> None:
        """Keep the fingertip force in counts, in the frame `message.header.frame_id`."""
        self.force = (message.vector.x, message.vector.y, message.vector.z)

    def receive_wrench(self, message: WrenchStamped) -> None:
        """Keep the fingertip force [N], in the frame `message.header.frame_id`."""
        force = message.wrench.force
        self.force = (force.x, force.y, force.z)

    def update(self) -> None:
        """Publish the factor."""
        silent = self.now() - self.state_at > SILENCE_TIMEOUT
        if silent or self.state not in {"STABLE", "UNSTABLE"}:
            self.factor = 1.0
        elif self.state == "UNSTABLE" and math.hypot(*self.force) < self.largest_force:
            self.factor = self.largest
        else:
            step = (self.largest - 1.0) * PERIOD / self.fall_time
            self.factor = max(1.0, self.factor - step)
        self.publisher.publish(Float64(data=self.factor))


def main() -> None:
    """Run the node until Ctrl-C."""
    rclpy.init()
    node = GripHarder()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
