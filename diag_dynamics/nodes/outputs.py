"""What the monitor publishes: each topic's message, made only where somebody listens, and no more often than wanted."""

from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind

from diag_dynamics.exceptions import InputError
from diag_dynamics.msg import (
    CoriolisTerm,
    DiagonalizedState,
    JointSpaceDynamics,
    KineticEnergy,
    MassMatrixFactors,
    TotalJointRates,
    WorkingMoments,
)

TOPICS = {
    "total_joint_rates": (TotalJointRates, 0.0),
    "working_moments": (WorkingMoments, 0.0),
    "coriolis": (CoriolisTerm, 0.0),
    "mass_matrix_factors": (MassMatrixFactors, 50.0),
    "kinetic_energy": (KineticEnergy, 0.0),
    "joint_space_dynamics": (JointSpaceDynamics, 50.0),
    "state": (DiagonalizedState, 0.0),
}
"""Each output topic: its type, and the highest rate it is published at by default [Hz], 0 for every state."""

ORDER = ("kinetic_energy", *(topic for topic in TOPICS if topic != "kinetic_energy"))
"""What is watched for safety goes out before the rest."""


OVERRIDABLE = QoSOverridingOptions(
    (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)
)
"""Lets the parameters qos_overrides.<topic>.<publisher|subscription>.<policy> have a say."""


def connected(create, kind, topic, *arguments, **options):
    """Publisher or subscription that `create` makes, whose QoS parameters may override.

    Raises
    ------
    InputError
        They make no sense.
    """
    try:
        return create(kind, topic, *arguments, qos_overriding_options=OVERRIDABLE, **options)
    except Exception as error:  # rclpy names neither the topic nor the parameter
        raise InputError(f"topic '{topic}', parameters qos_overrides: {error}") from error


class RateLimit:
    """Lets through what comes no sooner than a period after what it let through before, by the stamps."""

    def __init__(self, rate):
        self._period = 1e9 / rate if rate else 0.0
        self._last = self._next = None

    def due(self, stamp):
        """Whether a message stamped `stamp` [ns] goes out, and note that it does."""
        if not self._period:
            return True
        # A hair early is on time, lest a source of exactly this rate with jittering stamps lose every second message.
        # A stamp before the last one means that time has started anew.
        if self._last is not None and self._last <= stamp < self._next - 0.05 * self._period:
            return False
        on_time = self._last is not None and abs(stamp - self._next) < self._period
        self._next = (self._next if on_time else stamp) + self._period
        self._last = stamp
        return True


class Outputs:
    """The publishers of a managed node.

    Parameters
    ----------
    node : rclpy.lifecycle.LifecycleNode
    """

    def __init__(self, node):
        self._node = node
        self._limits = {topic: RateLimit(0.0) for topic in TOPICS}
        self._publishers = {}
        try:
            for topic, (kind, _) in TOPICS.items():
                self._publishers[topic] = connected(
                    node.create_lifecycle_publisher, kind, f"~/{topic}", QoSProfile(depth=10)
                )
        except BaseException:
            self.destroy()
            raise

    def destroy(self):
        """Take the publishers off the graph."""
        for publisher in self._publishers.values():
            self._node.destroy_lifecycle_publisher(publisher)
        self._publishers = {}

    def limit(self, topic, rate):
        """Publish a topic at no more than this rate [Hz]; 0 for every state."""
        self._limits[topic] = RateLimit(rate)

    def publish(self, dynamics, maker, state, s, with_inverse):
        """Publish an Evaluation `s` of a RobotState where somebody listens; `with_inverse` adds ℓ to the factors.

        `maker` is a MessageMaker, or makes the bytes of what that makes.
        """
        for topic in ORDER:
            publisher = self._publishers[topic]
            if publisher.handle.get_subscription_count() and self._limits[topic].due(state.newest):
                if topic == "mass_matrix_factors":
                    message = maker.mass_matrix_factors(dynamics.factors(state.position), with_inverse, state)
                elif topic == "joint_space_dynamics":
                    message = maker.joint_space_dynamics(*classical(dynamics, state), state)
                else:
                    message = getattr(maker, topic)(s, state)
                # By way of the handle it takes half as long: what rclpy puts around is not in the processor's cache after
                # a millisecond.
                if isinstance(message, bytes) and publisher.is_activated:
                    publisher.handle.publish_raw(message)
                else:
                    publisher.publish(message)


def classical(dynamics, state):
    """M, c and g of a RobotState."""
    q, qd = state.position, state.velocity
    return dynamics.mass_matrix(q), dynamics.bias(q, qd), dynamics.gravity_torque(q)
