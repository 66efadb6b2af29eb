"""ROS without an installation of ROS: messages and their codec."""
