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

MATRICES = ("mass_matrix_factors", "joint_space_dynamics")
"""Topics that are not made of the evaluation of a state."""

ORDER = ("kinetic_energy", "state", "total_joint_rates", "working_moments", "coriolis", *MATRICES)
"""What is watched for safety goes out first, matrices last."""


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
        self._limits = {}  # of topics that have one
        self._publishers = {}
        try:
            for topic, (kind, _) in TOPICS.items():
                self._publishers[topic] = connected(
                    node.create_lifecycle_publisher, kind, f"~/{topic}", QoSProfile(depth=10)
                )
        except BaseException:
            self.destroy()
            raise
        # By the handles: what rclpy puts around them takes longer than they do, as it is not in the processor's cache after
        # a millisecond.
        handles = {topic: self._publishers[topic].handle for topic in ORDER}
        self._listeners = [(topic, handle.get_subscription_count) for topic, handle in handles.items()]
        self._send_bytes = {topic: handle.publish_raw for topic, handle in handles.items()}

    def destroy(self):
        """Take the publishers off the graph."""
        for publisher in self._publishers.values():
            self._node.destroy_lifecycle_publisher(publisher)
        self._publishers, self._listeners, self._send_bytes = {}, [], {}

    def limit(self, topic, rate):
        """Publish a topic at no more than this rate [Hz]; 0 for every state."""
        if rate:
            self._limits[topic] = RateLimit(rate)
        else:
            self._limits.pop(topic, None)

    def publish(self, dynamics, maker, state, s, with_inverse):
        """Publish an Evaluation `s` of a RobotState where somebody listens; `with_inverse` adds ℓ to the factors.

        `maker` is a MessageMaker, or makes the bytes of what that makes.
        """
        if not self._publishers[ORDER[0]].is_activated:
            return
        limits, stamp = self._limits, state.newest
        wanted = [
            topic
            for topic, listeners in self._listeners
            if listeners() and (topic not in limits or limits[topic].due(stamp))
        ]
        about_state = tuple([topic for topic in wanted if topic not in MATRICES])
        for topic, message in zip(
            about_state, maker.messages(about_state, s, state) if about_state else (), strict=True
        ):
            self._send(topic, message)
        if "mass_matrix_factors" in wanted:
            factors = dynamics.factors(state.position)
            self._send("mass_matrix_factors", maker.mass_matrix_factors(factors, with_inverse, state))
        if "joint_space_dynamics" in wanted:
            self._send("joint_space_dynamics", maker.joint_space_dynamics(*classical(dynamics, state), state))

    def _send(self, topic, message):
        if type(message) is bytes:
            self._send_bytes[topic](message)
        else:
            self._publishers[topic].publish(message)


def classical(dynamics, state):
    """M, c and g of a RobotState."""
    q, qd = state.position, state.velocity
    return dynamics.mass_matrix(q), dynamics.bias(q, qd), dynamics.gravity_torque(q)
