"""What each node can be told: tables of parameters, and what their values say together. No ROS."""
