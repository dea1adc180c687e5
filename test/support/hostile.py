# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings with faults: joint states as bytes, with times of reception."""

import numpy as np

from diag_dynamics.assembly.assembler import joints_of
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import message_type

MS, S = 10**6, 10**9
START = 1_700_000_000 * S
JOINT_STATE = "sensor_msgs/msg/JointState"
JointState = message_type(JOINT_STATE)


def serialized(stamp, names, position, velocity, effort=()):
    """Return the bytes of a joint state."""
    message = JointState(name=list(names), position=list(position), velocity=list(velocity), effort=list(effort))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
    message.header.frame_id = "base"
    return Template(message).encoded()


class Driver:
    """A source of states of a robot in slow motion, with faults."""

    def __init__(self, model, seed, names=None, effort=True):
        self.rng, self.effort = np.random.default_rng(seed), effort
        joints = joints_of(model)
        self.names = list(names or joints.names)
        places = [joints.names.index(joints.mimics[n].leader if n in joints.mimics else n) for n in self.names]
        low, high = (np.nan_to_num(x[places], posinf=1.0, neginf=-1.0) for x in (joints.lower, joints.upper))
        self.middle, self.reach = 0.5 * (low + high), np.minimum(0.2, 0.2 * (high - low))
        self.phase = 0.7 * np.array(places)
        following = [joints.mimics[n][1:] if n in joints.mimics else (1.0, 0.0) for n in self.names]
        self.multiplier, self.offset = np.array(following).T
        self.stuck = 0, 0  # stamps from which to which values stand still

    def stick(self, stamp, time):
        """Send old values under fresh stamps for some time [ns]."""
        self.stuck = stamp, stamp + time

    def state(self, stamp):
        """Return names, positions, velocities and efforts at a time [ns]."""
        begin, end = self.stuck
        t = ((begin if begin <= stamp < end else stamp) - START) / S
        position = self.multiplier * (self.middle + self.reach * np.sin(t + self.phase)) + self.offset
        velocity = self.multiplier * self.reach * np.cos(t + self.phase)
        return self.names, position, velocity, np.sin(self.phase + 3.0 * t) if self.effort else ()

    def good(self, stamp):
        """Return a valid message."""
        return serialized(stamp, *self.state(stamp))

    def bad(self, stamp):
        """Return a message with one of many faults."""
        names, position, velocity, effort = self.state(stamp)
        position, velocity, effort = position.copy(), velocity.copy(), np.array(effort)
        k = self.rng.integers(len(names))
        order = self.rng.permutation(len(names))
        some = order[: self.rng.integers(1, len(names) + 1)]
        kind = self.rng.integers(18)
        if kind == 0:
            return serialized(stamp, names, position, velocity, effort)[: self.rng.integers(1, 60)]
        if kind == 1:
            raw = bytearray(serialized(stamp, names, position, velocity, effort))
            raw[self.rng.integers(len(raw))] ^= 1 << self.rng.integers(8)
            return bytes(raw)
        if kind == 2:
            position[k] = self.rng.choice([np.nan, np.inf, 1e297, 253.0, 4.0, -40.0])
        elif kind == 3:
            velocity[k] = self.rng.choice([np.nan, -np.inf, 1e200, 253.0, 30.0])
        elif kind == 4 and self.effort:
            effort[k] = self.rng.choice([np.nan, np.inf, 1e9, 253.0])
        elif kind == 5:
            stamp -= int(self.rng.choice([1, 40, 3000, 40_000])) * MS
        elif kind == 6:
            stamp += int(self.rng.choice([1, 40, 3000, 40_000])) * MS
        elif kind == 7:
            stamp = 0
        elif kind == 8:
            position += self.rng.choice([0.05, 0.2, 1.0])
        elif kind == 9:
            return serialized(stamp, names, position[:-1], velocity, effort)
        elif kind == 10:
            return serialized(stamp, names, position, (), effort)
        elif kind == 11:
            return serialized(stamp, ["elsewhere", "nobody"], [0.0, 1.0], [0.0, 0.0])
        elif kind == 12:
            return serialized(stamp, [names[0], names[0]], [0.0, 1.0], [0.0, 0.0])
        elif kind == 13:
            position[:], velocity[:] = 253.0, 253.0
        elif kind == 14:
            return serialized(stamp, [*names, "gripper"], [*position, 0.0], [*velocity, 0.0])
        elif kind == 15:
            velocity[:] = 0.3
            return serialized(stamp, names, self.multiplier * self.middle + self.offset, velocity, effort)
        else:
            return serialized(
                stamp, [names[j] for j in some], position[some], velocity[some], effort[some] if self.effort else ()
            )
        return serialized(stamp, names, position, velocity, effort)


def hostile(model, seed, count=1500, odd=0.1, drivers=None):
    """Return messages of one or two drivers and times of reception, with faults, stalls, bursts and old values.

    Without `drivers` there are two where the seed is even.
    """
    rng, names = np.random.default_rng(seed), joints_of(model).names
    if drivers is None:
        half, effort = len(names) // 2, seed % 3 > 0
        both = seed % 2 == 0 and len(names) > 2
        two = [Driver(model, seed, names[:half], effort), Driver(model, seed + 1, names[half:])]
        drivers = two if both else [Driver(model, seed, effort=effort)]
    now, found = START + 50 * MS, []
    for k in range(count):
        now += int(rng.choice([2, 4, 80, 700], p=[0.95, 0.035, 0.01, 0.005])) * MS
        driver = drivers[k % len(drivers)]
        stamp = now - int(rng.integers(MS // 8))
        if rng.random() < 0.005:
            driver.stick(stamp, int(rng.choice([90, 700])) * MS)
        found.append((driver.bad(stamp) if rng.random() < odd else driver.good(stamp), now))
    return found
