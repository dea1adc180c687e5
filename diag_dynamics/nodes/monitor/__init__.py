"""The monitor: joint_states and robot_description in, diagonalized dynamics out."""
