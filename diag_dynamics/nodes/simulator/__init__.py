"""The simulator: efforts in, joint_states out."""
