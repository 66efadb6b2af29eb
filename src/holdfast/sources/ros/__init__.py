"""What the sources of ROS 1 and ROS 2 share: messages to arrivals, the watch on a topic."""
