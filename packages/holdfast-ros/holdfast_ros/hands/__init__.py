"""Hands that take commands on topics of ROS 2."""
