# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One robot of `top`: its last minute in slots of time, its peaks, limits and alarms."""

import math
from collections import deque, namedtuple

import numpy as np
from lxml import etree

SLOT, SLOTS, MAX_HOLD = 0.05, 1200, 5
"""Length [s] and number of slots, which store the largest values of their time, and of how many one state fills."""

Quantity = namedtuple("Quantity", "name symbol unit limit", defaults=("",))
QUANTITIES = (
    Quantity("energy", "½ν²", "J"),
    Quantity("torque", "τ", "N m", "limit"),
    Quantity("external torque", "m r", "N m", "threshold"),
    Quantity("velocity", "q̇", "rad/s", "limit"),
    Quantity("exchange", "νC", "W"),
    Quantity("inertia", "D", "kg m²"),
)
ENERGY, TORQUE, EXTERNAL, VELOCITY, EXCHANGE, INERTIA = range(len(QUANTITIES))

UNKNOWN = (math.nan, math.inf)
"""A norm and its threshold without a result of the observer."""


class Robot:
    """States, external torques and limits of one robot.

    Arrays have the shape (quantities, nv); `values` and `energies` have one for each slot, the newest last.
    """

    def __init__(self, title, topic):
        self.title, self.topic, self.names, self.rejected, self.alarm = title, topic, [], 0, ""
        self.latency = self.power = math.nan
        self.torque = self.residual = UNKNOWN
        self._received, self._external, self._thresholds, self._urdf = deque(maxlen=5000), [], [], {}

    @property
    def energy(self):
        """Kinetic energy [J]."""
        return float(self.last[ENERGY].sum())

    def rate(self, now):
        """Return the number of states of the last second."""
        while len(self._received) > 1 and self._received[0] <= now - 1.0:
            self._received.popleft()  # the last one is the begin of a silence
        return len(self._received) if self.silence(now) < 1.0 else 0

    def silence(self, now):
        """Return the time since the last state [s]."""
        return now - self._received[-1] if self._received else 0.0

    def reset_peaks(self):
        """Reset the largest magnitudes of all states."""
        if self.names:
            self.peak, self.energy_peak = np.zeros_like(self.last), 0.0

    def accept_state(self, message, now, steady):
        """Store a state, received at a time of the node's clock [ns] and of the steady clock [s]."""
        if self.names != list(message.dof_names):
            self.names, self._slot = list(message.dof_names), None
            self.last = np.full((len(QUANTITIES), len(self.names)), math.nan)
            self.values = np.full((SLOTS, *self.last.shape), math.nan, dtype=np.float32)
            self.energies = np.full(SLOTS, math.nan)
            self.reset_peaks()
            self._set_limits()
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        self._store(1e-9 * stamp, self._quantities(message))
        self.latency = 1e-9 * (now - stamp)
        self.power = message.power if message.effort_valid else math.nan
        self._received.append(steady)

    def accept_external_torque(self, message, *_):
        """Store a result of the observer."""
        self._external, self.alarm = np.array(message.external_torque), ""
        self.torque = self.residual = UNKNOWN
        if message.valid:
            self.torque = message.torque_norm, _limit(message.torque_norm_threshold)
            self.residual = message.norm, _limit(message.threshold)
            self._thresholds = [_limit(threshold) for threshold in message.torque_threshold]
            self._set_limits()
            joints = zip(message.dof_names, message.joint_collision, strict=False)
            above = ", ".join(name for name, collision in joints if collision)
            self.alarm = f"collision: {above}" if above else "collision" if message.collision else ""

    def accept_description(self, message, *_):
        """Read the limits of effort and velocity of a URDF."""
        parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
        joints = etree.fromstring(message.data.encode(), parser).iterfind("joint[limit]")
        limits = {joint.get("name"): joint.find("limit") for joint in joints}
        self._urdf = {
            name: [_limit(float(limit.get(key, 0.0))) for key in ("effort", "velocity")]
            for name, limit in limits.items()
        }
        self._set_limits()

    def external_scale(self):
        """Return the external torque at which ‖m r‖ or |r| reaches its threshold; 0 without one."""
        (_, threshold), (norm, norm_threshold) = self.torque, self.residual
        if threshold < math.inf:
            return threshold
        if norm_threshold < math.inf and norm > 0.0:
            return np.nanmax(np.abs(self.last[EXTERNAL]), initial=0.0) * norm_threshold / norm
        return 0.0

    def _set_limits(self):
        self.limits = np.full((len(QUANTITIES), len(self.names)), math.inf)
        for k, name in enumerate(self.names):
            self.limits[[TORQUE, VELOCITY], k] = self._urdf.get(name, math.inf)
        if len(self._thresholds) == len(self.names):
            self.limits[EXTERNAL] = self._thresholds

    def _quantities(self, message):
        values, nu = np.full(self.last.shape, math.nan), np.array(message.nu)
        values[ENERGY], values[EXCHANGE] = 0.5 * nu * nu, nu * np.array(message.coriolis)
        values[VELOCITY], values[INERTIA] = message.velocity, message.articulated_inertia
        if message.effort_valid:
            values[TORQUE] = message.effort
        if len(self._external) == len(self.names):
            values[EXTERNAL] = self._external
        return values

    def _store(self, stamp, values):
        size, energy, slot = np.abs(values), float(values[ENERGY].sum()), math.floor(stamp / SLOT)
        self.peak, self.energy_peak = np.fmax(self.peak, size), max(self.energy_peak, energy)
        count = slot - self._slot if self._slot is not None else SLOTS
        count = min(count, SLOTS) if count >= 0 else SLOTS  # time has jumped back
        for slots, new in ((self.values, size), (self.energies, energy)):
            if count:
                slots[:-count] = slots[count:]
                slots[-count:] = new if count <= MAX_HOLD else math.nan
            slots[-1] = np.fmax(slots[-1], new)
        self._slot, self.last = slot, values


def _limit(value):
    """Return a limit; inf where there is none."""
    return value if 0.0 < value < math.inf else math.inf
