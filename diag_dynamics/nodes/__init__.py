"""ROS 2 nodes: parameters, QoS, message conversion. No physics here, and rclpy nowhere else."""
