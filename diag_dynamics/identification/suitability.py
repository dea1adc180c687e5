# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a recording must be before anything is fitted to it: units, delays and gravity right, and the motion rich enough."""

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.torques import smoothed
from diag_dynamics.recordings.account import Finding
from diag_dynamics.recordings.balance import Moments
from diag_dynamics.sweeps.spatial import ANGULAR_X

INCREMENT = 0.05
"""Time over which positions are compared with integrated velocities [s]."""

TOLERANCE = 0.02
"""Distance from 1 of the slope of positions over integrated velocities that is accepted."""

LEAST_CORRELATION = 0.7
"""Correlation of the two without which a joint moves too little to be judged."""

DELAYS = np.arange(-20.0, 40.5, 0.5) * 1e-3
"""Delays of velocities against positions that are tried [s]."""

UNITS = (
    (-1.0, "of the other sign"),
    (np.pi / 180.0, "in degrees per second"),
    (np.pi / 30.0, "in revolutions per minute"),
    (2.0 * np.pi, "in revolutions per second"),
    (180.0 / np.pi, "right, and positions in degrees"),
    (1e-3, "in mm/s or mrad/s"),
    (1e3, "right, and positions in mm or mrad"),
)
"""Slopes of positions over integrated velocities, and what velocities then are."""

PART = 1000
"""Increments that are looked at together: all delays of them take memory."""

TINY = 1e-30
"""Sum of squares of a joint that does not move [rad², m²]."""

HEAVY = 3.0
"""Standard deviation of gravity's effort from which it can be looked for in what was measured [N m, N]."""

COLUMNS = 6
"""Of the regression: gravity, what resists (three), acceleration, and the effort itself."""

MOVING, EACH_WAY, RANGE = 0.05, 1.0, 0.5
"""Velocity [rad/s], time above it in each direction [s] and range of positions [rad] that a joint's friction needs."""

PRISMATIC = 0.1
"""What these are times in m, of a prismatic joint."""


class Velocities:
    """Compares positions with integrated velocities, portion by portion.

    Parameters
    ----------
    model : RobotModel
    """

    def __init__(self, model):
        self._names = model.dof_names
        coupled = {joint for group in model.coupled_groups for joint in group}
        self._turning = np.array([name in model.continuous_joints and name not in coupled for name in model.dof_names])
        self._size, self._product, self._square = np.zeros(model.nv), *np.zeros((2, len(DELAYS), model.nv))
        self._t, self._q, self._integral = None, None, None  # of the segment, as far as further increments need them
        self._qd, self._begin, self._number = (
            None,
            0.0,
            0,
        )  # its last velocities, time 0 of its grid, and its next point

    def take(self, states, begins):
        """Take in a Portion."""
        t, q, qd = states.t, states.q, states.qd
        if begins:
            integral = np.zeros_like(qd[:1])
            self._begin, self._number = t[0] - DELAYS[0], 0
        else:
            t, qd = np.r_[self._t[-1], t], np.r_[self._qd, qd]
            q, integral = np.r_[self._q[-1:], q], self._integral[-1:]
        q = q.copy()
        q[:, self._turning] = np.unwrap(q[:, self._turning], axis=0)
        steps = 0.5 * (qd[1:] + qd[:-1]) * np.diff(t)[:, None]
        columns = t, q, np.cumsum(np.r_[integral, steps], axis=0)
        if not begins:
            columns = (
                np.r_[old[:-1], new] for old, new in zip((self._t, self._q, self._integral), columns, strict=True)
            )
        self._t, self._q, self._integral = columns
        self._qd = qd[-1:]
        self._compare()

    def _compare(self):
        """Take in the increments that are known by now."""
        last = self._t[-1] - DELAYS[-1] - self._begin
        if self._number == 0 and last < 2.0 * INCREMENT:
            return
        end = int(np.ceil(last / INCREMENT))  # first point of the grid that is too late
        for first in range(self._number, end - 1, PART):
            some = self._begin + INCREMENT * np.arange(first, min(first + PART + 1, end))
            q = np.column_stack([np.interp(some, self._t, column) for column in self._q.T])
            at = some + DELAYS[:, None]
            values = np.stack([np.interp(at, self._t, column) for column in self._integral.T], axis=-1)
            increments, integrals = np.diff(q, axis=0), np.diff(values, axis=1)
            self._size += (increments**2).sum(axis=0)
            self._product += (integrals * increments).sum(axis=1)
            self._square += (integrals**2).sum(axis=1)
        self._number = max(self._number, end - 1)
        oldest = self._begin + INCREMENT * self._number + DELAYS[0]
        past = max(0, int(np.searchsorted(self._t, oldest, side="right")) - 1)
        self._t, self._q, self._integral = self._t[past:], self._q[past:], self._integral[past:]

    def delay(self):
        """Delay of velocities against positions [s], where both are of the same units.

        Raises
        ------
        InputError
            Positions of a joint do not change as its velocity says.
        """
        size, product, square = self._size, self._product, self._square
        if not size.any():
            return 0.0
        size, square = np.maximum(size, TINY), np.maximum(square, TINY)
        explained = np.maximum(0.0, 1.0 - product**2 / (square * size))  # unexplained share, by delay and joint
        telling = np.sqrt(np.maximum(0.0, 1.0 - explained.min(axis=0))) >= LEAST_CORRELATION
        if not telling.any():
            return 0.0
        cost = explained[:, telling].sum(axis=1)
        best = int(np.argmin(cost))
        for k in np.flatnonzero(telling):
            # Noise of velocities makes one slope too small, that of positions the other one too large.
            slopes = sorted((product[best, k] / square[best, k], size[k] / product[best, k]), key=abs)
            low, high = min(slopes), max(slopes)
            if high < 1.0 - TOLERANCE or low > 1.0 + TOLERANCE:
                slope = float(slopes[0])
                raise InputError(
                    f"positions of joint '{self._names[k]}' change by {slope:.4g} times what its velocities say"
                    f"{_unit(slope)}."
                )
        return _refined(cost, best)


def _refined(cost, best):
    """Delay of the smallest cost, by the parabola through it and its neighbours."""
    if not 0 < best < len(DELAYS) - 1:
        return float(DELAYS[best])
    before, here, after = cost[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(DELAYS[best] + shift * (DELAYS[1] - DELAYS[0]))


def _unit(slope):
    for value, text in UNITS:
        if abs(slope / value - 1.0) < 0.05:
            return f", expected 1: velocities seem to be {text}"
    return ", expected 1: are velocities those of the motor, or of another joint?"


class Efforts:
    """Looks for the model's gravity in efforts, portion by portion.

    Parameters
    ----------
    model : RobotModel
    """

    def __init__(self, model):
        self._model, self._dynamics = model, DiagonalDynamics(model)
        self._gravity = Moments(model.nv)
        self._triangles = np.zeros((model.nv, COLUMNS, COLUMNS))

    def take(self, states):
        """Take in states one after the other."""
        if len(states.t) < 2:
            return
        q, qd, tau, qdd = smoothed(states, states.tau)
        gravity = self._dynamics.gravity_torque_batch(q)
        self._gravity.take(gravity)
        turned = np.tanh(qd / max(self._model.friction_velocity, 1e-9))
        # The acceleration is a column, for in a swing it goes with gravity: a rotor's inertia would be taken for less weight.
        for k, triangle in enumerate(self._triangles):
            columns = gravity[:, k], qd[:, k], turned[:, k], np.ones(len(q)), qdd[:, k], tau[:, k]
            self._triangles[k] = np.linalg.qr(np.vstack([triangle, np.column_stack(columns)]), mode="r")

    def judge(self, tolerant, findings):
        """Judge all that was taken in; what cannot be judged is added to the findings.

        Parameters
        ----------
        tolerant : bool
            Whether the robot may carry what the model does not, or lack what it has.
        findings : list of Finding

        Raises
        ------
        InputError
            Gravity is not in them, of the other sign, or much too large or small.
        """
        names, spread = self._model.dof_names, np.sqrt(self._gravity.variance)
        heavy = np.flatnonzero(spread > HEAVY)
        if not len(heavy):
            findings.append(
                Finding(
                    "efforts not judged",
                    1,
                    f"gravity changes the effort of no joint by {HEAVY:g} N m or N: whether efforts are in these units, and "
                    "hold gravity, is for you to know",
                )
            )
            return
        slopes = {}
        for k in heavy.tolist():
            triangle = self._triangles[k]
            slopes[k] = float(np.linalg.lstsq(triangle[:, :-1], triangle[:, -1], rcond=None)[0][0])
        if all(abs(slope) < 0.35 for slope in slopes.values()):
            k = max(slopes, key=lambda k: spread[k])
            raise InputError(
                f"gravity is not in the efforts: that of joint '{names[k]}' changes by {slopes[k]:.2f} times what the "
                "model's gravity does. If the driver has taken it out, read the recording with "
                "parameters={'effort_includes_gravity': ['*=false']}."
            )
        low, high = (0.2, 5.0) if tolerant else (0.6, 1.6)
        wrong = {k: slope for k, slope in slopes.items() if not low <= slope <= high}
        for k, slope in wrong.items():
            if -1.6 <= slope <= -0.4:
                raise InputError(
                    f"the effort of joint '{names[k]}' is of the other sign: it changes by {slope:.2f} times what the "
                    f"model's gravity does (effort_scale: '{names[k]}=-1')."
                )
        for k, slope in wrong.items():
            raise InputError(
                f"the effort of joint '{names[k]}' changes by {slope:.3g} times what the model's gravity does, expected "
                f"{low:g} to {high:g}: is it in N m or N, on the joint's side of the gear, and are the joints in order? "
                "(effort_scale, docs/recordings.md)"
            )


class Excitation:
    """Which joints move enough for their friction to be known, portion by portion.

    Parameters
    ----------
    model : RobotModel
    """

    def __init__(self, model):
        self._names = model.dof_names
        own = model.bodies[1:][model.bodies["owner"][1:] == np.arange(1, len(model.bodies))]
        self._unit = np.ones(model.nv)
        self._unit[own["dof"][own["direction"] < ANGULAR_X]] = PRISMATIC
        self._forward, self._backward = np.zeros((2, model.nv))
        self._low, self._high = np.full(model.nv, np.inf), np.full(model.nv, -np.inf)
        self._last = 0.0  # time of the last state

    def take(self, states, begins):
        """Take in a Portion."""
        step = np.diff(states.t, prepend=states.t[0] if begins else self._last)[:, None]
        self._forward += ((states.qd > MOVING * self._unit) * step).sum(axis=0)
        self._backward += ((states.qd < -MOVING * self._unit) * step).sum(axis=0)
        self._low = np.minimum(self._low, states.q.min(axis=0))
        self._high = np.maximum(self._high, states.q.max(axis=0))
        self._last = states.t[-1]

    def enough(self, findings):
        """Degrees of freedom that do, bool, shape (nv,); of the others it is told in the findings."""
        moved, unit = self._high - self._low, self._unit
        enough = (self._forward >= EACH_WAY) & (self._backward >= EACH_WAY) & (moved >= RANGE * unit)
        for k in np.flatnonzero(~enough):
            metre = unit[k] != 1.0
            findings.append(
                Finding(
                    "not excited",
                    1,
                    f"joint '{self._names[k]}' moves {self._forward[k]:.2g} s forward and {self._backward[k]:.2g} s backward "
                    f"above {MOVING * unit[k]:g} {'m/s' if metre else 'rad/s'}, over {moved[k]:.2g} "
                    f"{'m' if metre else 'rad'}; its friction needs {EACH_WAY:g} s each way, and {RANGE * unit[k]:g}: it "
                    "stays as the model has it",
                )
            )
        return enough
