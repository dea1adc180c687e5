# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS 2 nodes: parameters, QoS, message conversion. No physics here, and rclpy nowhere else."""
