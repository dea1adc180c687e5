# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a recording must be before anything is fitted to it: gravity right in its efforts, and the motion rich enough."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.account import Finding
from diag_dynamics.recordings.effort_checks import complaint
from diag_dynamics.recordings.effort_relation import ERRORS, EffortRelation
from diag_dynamics.sweeps.spatial import ANGULAR_X

NOT_JUDGED = "efforts not judged"
"""Cause of the finding that the motion does not show the unit of the efforts."""

DOUBTFUL = "effort doubtful"
"""Cause of the finding that the effort of a joint which carries little is not that of the model."""

MOVING, EACH_WAY, RANGE = 0.05, 1.0, 0.5
"""Velocity [rad/s], time above it in each direction [s] and range of positions [rad] that a joint's friction needs."""

PRISMATIC = 0.1
"""What these are times in m, of a prismatic joint."""


class Efforts:
    """Looks for the torques that the model needs in efforts, portion by portion.

    Parameters
    ----------
    model : RobotModel

    Attributes
    ----------
    relation : Relation or None
        What was found; known once they were judged.
    """

    def __init__(self, model):
        self._compared, self.relation = EffortRelation(model), None

    def take(self, states):
        """Take in states one after the other."""
        self._compared.take(states)

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
            Gravity is not in them, of the other sign, or much too large or small; or the joints are in another order.
        """
        self.relation = of = self._compared.relation()
        wrong = complaint(self._compared, of, tolerant)
        if wrong and wrong.kind != "light":
            raise InputError(f"{wrong.text}.")
        if wrong:
            findings.append(Finding(DOUBTFUL, 1, wrong.text))
        if not of.judged().any():
            findings.append(Finding(NOT_JUDGED, 1, _not_judged(self._compared.model.dof_names, of)))


def _not_judged(names, of):
    """Return why efforts say nothing of their unit, in words."""
    if not np.isfinite(of.error).any():
        return (
            "the motion shows no torque of the model apart from friction and offset: whether efforts are in N m or N, and "
            "hold gravity, is for you to know"
        )
    k = int(np.nanargmin(np.where(np.isfinite(of.error), of.error + of.model_error, np.nan)))
    return (
        f"no effort has a clear relation to the motion: that of joint '{names[k]}' changes by {of.factor[k]:.2g} ± "
        f"{ERRORS * of.error[k]:.2g} times what the model needs. Whether efforts are in N m or N is for you to know"
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
