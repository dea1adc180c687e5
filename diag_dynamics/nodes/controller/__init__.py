"""The controller: joint_states and targets in, efforts out."""
