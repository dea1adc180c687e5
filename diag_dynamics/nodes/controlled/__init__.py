"""A robot under control: settings, targets, trajectories, safety, and the loop they make up. No rclpy."""
