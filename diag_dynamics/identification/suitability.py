# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a recording must be before anything is fitted to it: gravity right in its efforts, and the motion rich enough."""

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.torques import smoothed
from diag_dynamics.recordings.account import Finding
from diag_dynamics.recordings.balance import Moments
from diag_dynamics.sweeps.spatial import ANGULAR_X

HEAVY = 3.0
"""Standard deviation of gravity's effort from which it can be looked for in what was measured [N m, N]."""

COLUMNS = 6
"""Of the regression: gravity, what resists (three), acceleration, and the effort itself."""

MOVING, EACH_WAY, RANGE = 0.05, 1.0, 0.5
"""Velocity [rad/s], time above it in each direction [s] and range of positions [rad] that a joint's friction needs."""

PRISMATIC = 0.1
"""What these are times in m, of a prismatic joint."""


class Efforts:
    """Looks for the model's gravity in efforts, portion by portion.

    Parameters
    ----------
    model : RobotModel
    """

    def __init__(self, model):
        self._model, self._dynamics = model, DiagonalDynamics(model)
        self._gravity = Moments(model.nv)
        self._products = np.zeros((model.nv, COLUMNS, COLUMNS))  # of columns with one another, by degree of freedom

    def take(self, states):
        """Take in states one after the other."""
        if len(states.t) < 2:
            return
        q, qd, tau, qdd = smoothed(states, states.tau)
        gravity = self._dynamics.gravity_torque_batch(q)
        self._gravity.take(gravity)
        turned = np.tanh(qd / max(self._model.friction_velocity, 1e-9))
        # The acceleration is a column, for in a swing it goes with gravity: a rotor's inertia would be taken for less weight.
        columns = np.stack([gravity.T, qd.T, turned.T, np.ones_like(qd.T), qdd.T, tau.T], axis=1)
        self._products += columns @ columns.transpose(0, 2, 1)

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
            square, right = self._products[k, :-1, :-1], self._products[k, :-1, -1]
            slopes[k] = float(np.linalg.lstsq(square, right, rcond=None)[0][0])
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
