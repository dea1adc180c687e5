# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers, subscriptions and services with their QoS, and rate limits."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind

from diag_dynamics.exceptions import InputError

OVERRIDABLE = QoSOverridingOptions(
    (
        QoSPolicyKind.HISTORY,
        QoSPolicyKind.DEPTH,
        QoSPolicyKind.RELIABILITY,
        QoSPolicyKind.DURABILITY,
    )
)
"""Policies that parameters qos_overrides.<topic>.<publisher|subscription>.<policy> override."""

SERVICE_QOS = QoSProfile(depth=1000)
"""Requests that wait; rclpy's default keeps ten and drops others without an answer."""


def latched():
    """Return the QoS of robot_description: who subscribes late receives the last message."""
    return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def newest():
    """Return the QoS of joint_states: new messages count, lost ones do not return."""
    return QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)


def connected(create, kind, topic, *arguments, **options):
    """Return the publisher or subscription that `create` makes with overridable QoS.

    Raise InputError if that fails.
    """
    try:
        return create(kind, topic, *arguments, qos_overriding_options=OVERRIDABLE, **options)
    except Exception as error:  # rclpy names neither the topic nor the parameter
        raise InputError(f"topic '{topic}', parameters qos_overrides: {error}") from error


class RateLimit:
    """Lets a message through no sooner than a period after the one before, by their stamps."""

    def __init__(self, rate):
        self._period = 1e9 / rate if rate else 0.0
        self._last = self._next = None

    def due(self, stamp):
        """Return whether a message stamped `stamp` [ns] goes out, and note that it does."""
        if not self._period:
            return True
        # Jitter of the stamps must not drop every second message. A stamp before the last one
        # restarts time.
        if self._last is not None and self._last <= stamp < self._next - 0.05 * self._period:
            return False
        on_time = self._last is not None and abs(stamp - self._next) < self._period
        self._next = (self._next if on_time else stamp) + self._period
        self._last = stamp
        return True
