"""The laws that a control loop chooses among, by name."""

GRAVITY_COMPENSATION, DAMPING, POSE, TRACKING = MODES = ("gravity_compensation", "damping", "pose", "tracking")
"""Names of the laws."""
