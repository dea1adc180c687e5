"""Parameters of the nodes: their tables, and the checks on values that belong together. No ROS."""
