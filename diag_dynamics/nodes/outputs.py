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
from diag_dynamics.nodes.messages import to_time

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
        """Publish an Evaluation `s` of a RobotState where somebody listens; `with_inverse` adds ℓ to the factors."""
        stamp, q = to_time(state.newest), state.position
        for topic, make in (
            ("state", lambda: maker.state(stamp, s, state)),
            ("kinetic_energy", lambda: maker.kinetic_energy(stamp, s, state)),
            ("total_joint_rates", lambda: maker.total_joint_rates(stamp, s, state)),
            ("working_moments", lambda: maker.working_moments(stamp, s, state)),
            ("coriolis", lambda: maker.coriolis(stamp, s, state)),
            (
                "mass_matrix_factors",
                lambda: maker.mass_matrix_factors(stamp, dynamics.factors(q), with_inverse, state),
            ),
            ("joint_space_dynamics", lambda: maker.joint_space_dynamics(stamp, *classical(dynamics, state), state)),
        ):
            publisher = self._publishers[topic]
            if publisher.get_subscription_count() and self._limits[topic].due(state.newest):
                publisher.publish(make())


def classical(dynamics, state):
    """M, c and g of a RobotState."""
    q, qd = state.position, state.velocity
    return dynamics.mass_matrix(q), dynamics.bias(q, qd), dynamics.gravity_torque(q)
