"""From joint states and odometry to whole states of a robot, each refused by name where it is not usable. No ROS."""
