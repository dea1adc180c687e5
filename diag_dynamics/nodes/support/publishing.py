# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers and subscriptions whose QoS parameters may override; and how often something is published."""

from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind

from diag_dynamics.exceptions import InputError

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
