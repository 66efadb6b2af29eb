"""Hands that take commands on topics of ROS 1 or ROS 2."""
