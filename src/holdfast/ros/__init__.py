"""ROS without an installation of ROS: messages, their codec, and transports of ROS 1 and 2."""
