"""What the monitor publishes: each topic's message, made only where somebody listens, and no more often than wanted."""

import time

from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind

from diag_dynamics.exceptions import InputError
from diag_dynamics.msg import (
    CoriolisTerm,
    DiagonalizedState,
    ExternalTorque,
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

BESIDE = {"external_torque": (ExternalTorque, 0.0)}
"""Likewise, of what is made only where a parameter asks for it: of a disturbance observer, which has states of its own."""

MATRICES = ("mass_matrix_factors", "joint_space_dynamics")
"""Topics that are not made of the evaluation of a state."""

ORDER = ("kinetic_energy", "state", "total_joint_rates", "working_moments", "coriolis", *MATRICES)
"""What is watched for safety goes out first, matrices last."""

BITS = {topic: 1 << k for k, topic in enumerate(ORDER)}
"""A bit for each topic, where several of them are told of by one number."""

ABOUT_STATE, WITH_LINK_ENERGY = sum(BITS[topic] for topic in ORDER if topic not in MATRICES), BITS["kinetic_energy"]
"""Those of topics that are made of the evaluation of a state; and that of the one that says the energy of each link."""


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


SELDOM = 0.01
"""Time for which it is taken for granted that the same people listen [s]."""


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

    Who listens is not asked for every message: where they come fast, asking every publisher would cost as much as evaluating
    a state does. (ROS can tell of changes by itself, too, but an EventsExecutor then crashes when a publisher goes.)

    Parameters
    ----------
    node : rclpy.lifecycle.LifecycleNode
    """

    def __init__(self, node):
        self._node = node
        self._limits = {}  # of topics that have one
        self._publishers = {}
        self._handles = {}
        try:
            for topic, (kind, _) in (TOPICS | BESIDE).items():
                self._publishers[topic] = connected(
                    node.create_lifecycle_publisher, kind, f"~/{topic}", QoSProfile(depth=10)
                )
        except BaseException:
            self.destroy()
            raise
        # By the handles: what rclpy puts around them takes longer than they do, as it is not in the processor's cache after
        # a millisecond.
        self._handles = {topic: self._publishers[topic].handle for topic in (*ORDER, *BESIDE)}
        self.look()

    def look(self):
        """See who listens."""
        self._looked = time.monotonic()
        self._wanted = [t for t, handle in self._handles.items() if t in BITS and handle.get_subscription_count()]
        self._bits = sum(BITS[topic] for topic in self._wanted)

    def destroy(self):
        """Take the publishers off the graph."""
        for publisher in self._publishers.values():
            self._node.destroy_lifecycle_publisher(publisher)
        self._publishers, self._handles = {}, {}
        self.look()

    def limit(self, topic, rate):
        """Publish a topic at no more than this rate [Hz]; 0 for every state."""
        if rate:
            self._limits[topic] = RateLimit(rate)
        else:
            self._limits.pop(topic, None)

    def wanted(self):
        """Sum of the :data:`BITS` of topics about a state that somebody listens to; it holds for :meth:`publish`."""
        if time.monotonic() - self._looked > SELDOM:
            self.look()
        return self._bits & ABOUT_STATE

    def publish(self, stamp, about_state, matrix):
        """Publish where somebody listens.

        Parameters
        ----------
        stamp : int
            Of the state [ns].
        about_state : callable
            Makes a list of messages, or of their bytes, of a list of topics about the state.
        matrix : callable
            Makes one, of one of :data:`MATRICES`.
        """
        if not self._publishers[ORDER[0]].is_activated:
            return
        limits = self._limits
        due = [topic for topic in self._wanted if topic not in limits or limits[topic].due(stamp)]
        matrices = [topic for topic in due if topic in MATRICES]
        topics = due[: len(due) - len(matrices)]
        for topic, message in zip(topics, about_state(topics) if topics else (), strict=True):
            self._send(topic, message)
        for topic in matrices:
            self._send(topic, matrix(topic))

    def publish_beside(self, topic, stamp, make):
        """Publish one of :data:`BESIDE`, which `make` makes, of a state stamped `stamp` [ns], where somebody listens."""
        if not self._publishers[topic].is_activated or not self._handles[topic].get_subscription_count():
            return
        if topic not in self._limits or self._limits[topic].due(stamp):
            self._send(topic, make())

    def _send(self, topic, message):
        if type(message) is bytes:
            self._handles[topic].publish_raw(message)
        else:
            self._publishers[topic].publish(message)
