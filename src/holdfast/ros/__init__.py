"""ROS without ROS: message definitions, the CDR codec, and the transports of ROS 1 and ROS 2."""
