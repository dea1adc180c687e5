# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings with faults: joint states as bytes, with times of reception."""

import numpy as np

from bags import MS, START, S, serialized
from diag_dynamics.joint_states.robot_joints import joints_of

ODD = {
    "position": [np.nan, np.inf, 1e297, 253.0, 4.0, -40.0],
    "velocity": [np.nan, -np.inf, 1e200, 253.0, 30.0],
    "effort": [np.nan, np.inf, 1e9, 253.0],
}
"""Values of one joint that are not believed."""
DELAYS = 1, 40, 3000, 40_000
FAULTS = (
    *ODD,
    "cut",
    "flipped",
    "late",
    "early",
    "no stamp",
    "jump",
    "wrong length",
    "no velocity",
    "foreign",
    "twice",
    "garbage",
    "one more",
    "jump back",
    "some",
    "some",
)


class Driver:
    """A source of states of a robot in slow motion, with faults."""

    def __init__(self, model, seed, names=None, effort=True):
        self.rng = np.random.default_rng(seed)
        self.effort = effort
        joints = joints_of(model)
        self.names = list(names or joints.names)
        places = [
            joints.names.index(joints.mimics[n].leader if n in joints.mimics else n)
            for n in self.names
        ]
        low, high = (
            np.nan_to_num(x[places], posinf=1.0, neginf=-1.0) for x in (joints.lower, joints.upper)
        )
        self.middle = 0.5 * (low + high)
        self.reach = np.minimum(0.2, 0.2 * (high - low))
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
        position = (
            self.multiplier * (self.middle + self.reach * np.sin(t + self.phase)) + self.offset
        )
        velocity = self.multiplier * self.reach * np.cos(t + self.phase)
        return self.names, position, velocity, np.sin(self.phase + 3.0 * t) if self.effort else ()

    def good(self, stamp):
        """Return a valid message."""
        return serialized(stamp, *self.state(stamp), frame="base")

    def bad(self, stamp):
        """Return a message with one of many faults."""
        rng = self.rng
        (names, *values) = self.state(stamp)
        position, velocity, effort = map(np.array, values)
        fault = str(rng.choice(FAULTS))
        rows = list(range(len(names)))
        if fault in ODD:
            numbers = {"position": position, "velocity": velocity, "effort": effort}[fault]
            if len(numbers):
                numbers[rng.integers(len(numbers))] = rng.choice(ODD[fault])
        elif fault in ("late", "early"):
            stamp += int(rng.choice(DELAYS)) * MS * (1 if fault == "early" else -1)
        elif fault == "no stamp":
            stamp = 0
        elif fault == "jump":
            position += rng.choice([0.05, 0.2, 1.0])
        elif fault == "jump back":
            position = self.multiplier * self.middle + self.offset
            velocity = np.full(len(names), 0.3)
        elif fault == "wrong length":
            position = position[:-1]
        elif fault == "no velocity":
            velocity = ()
        elif fault in ("foreign", "twice"):
            names = ["elsewhere", "nobody"] if fault == "foreign" else [names[0], names[0]]
            position = [0.0, 1.0]
            velocity = [0.0, 0.0]
            effort = ()
        elif fault == "garbage":
            position[:] = 253.0
            velocity[:] = 253.0
        elif fault == "one more":
            names = [*names, "gripper"]
            position = [*position, 0.0]
            velocity = [*velocity, 0.0]
        elif fault == "some":
            rows = rng.permutation(rows)[: rng.integers(1, len(names) + 1)]
            names = [names[row] for row in rows]
            position = position[rows]
            velocity = velocity[rows]
            effort = effort[rows] if self.effort else ()
        raw = bytearray(serialized(stamp, names, position, velocity, effort, frame="base"))
        if fault == "flipped":
            raw[rng.integers(len(raw))] ^= 1 << rng.integers(8)
        return bytes(raw[: rng.integers(1, 60)] if fault == "cut" else raw)


def hostile(model, seed, count=1500, odd=0.1, drivers=None):
    """Return messages of one or two drivers and times of reception, with faults, stalls, bursts and
    old values.

    Without `drivers` there are two where the seed is even.
    """
    rng = np.random.default_rng(seed)
    names = joints_of(model).names
    if drivers is None:
        half = len(names) // 2
        effort = seed % 3 > 0
        both = seed % 2 == 0 and len(names) > 2
        two = [Driver(model, seed, names[:half], effort), Driver(model, seed + 1, names[half:])]
        drivers = two if both else [Driver(model, seed, effort=effort)]
    now = START + 50 * MS
    result = []
    for k in range(count):
        now += int(rng.choice([2, 4, 80, 700], p=[0.95, 0.035, 0.01, 0.005])) * MS
        driver = drivers[k % len(drivers)]
        stamp = now - int(rng.integers(MS // 8))
        if rng.random() < 0.005:
            driver.stick(stamp, int(rng.choice([90, 700])) * MS)
        result.append((driver.bad(stamp) if rng.random() < odd else driver.good(stamp), now))
    return result
