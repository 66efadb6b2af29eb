"""Transports of ROS: DDS of ROS 2, and rospy of ROS 1."""
