"""What people look at: the terminal view and pictures, of numbers that others give them. No ROS."""
