"""Joint states as rclpy reads them."""

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState


def read_joint_state(raw):
    """JointState of its bytes; whatever rclpy raises where they are none."""
    return deserialize_message(raw, JointState)
