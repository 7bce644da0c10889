"""A run as a ROS 2 bag. Needs the optional package `rosbags`; no ROS 2 is needed."""
