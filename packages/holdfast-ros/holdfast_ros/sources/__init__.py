"""Source of ROS 2 topics."""
