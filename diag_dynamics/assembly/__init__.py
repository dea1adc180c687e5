"""Assembly of whole robot states from joint states and odometry; an unusable message is refused by name. No ROS."""
