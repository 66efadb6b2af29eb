"""Publishers of estimates and samples: ROS 1, ROS 2 and the protocol of XELA."""
