# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Outcome of one trajectory by tolerances, with the rules of control_msgs/FollowJointTrajectory."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control.by_dof import by_dof
from diag_dynamics.control.references import nearest
from diag_dynamics.text import distinct

SUCCESSFUL, INVALID_GOAL, PATH_TOLERANCE_VIOLATED, GOAL_TOLERANCE_VIOLATED = 0, -1, -4, -5
"""Error codes of control_msgs/FollowJointTrajectory."""

STOPPED = 0.05
"""Default of the maximum speed at the end of a trajectory [rad/s, m/s]."""

_KINDS = ("position", "velocity")


class Tolerances(NamedTuple):
    """Maximum errors of position [rad, m] and velocity [rad/s, m/s], shape (2, nv).

    An infinite number is no limit.
    """

    path: np.ndarray  # before the end of the trajectory
    goal: np.ndarray  # at its end
    time: float  # from its end until the errors are within `goal` [s]; infinite: none

    @classmethod
    def of_parameters(cls, values, names):
        """Return the defaults by the parameters of the controller."""
        none = np.full(len(names), np.inf)
        path, goal = (
            by_dof(name, values[name], names, none) for name in ("path_tolerance", "goal_tolerance")
        )
        speed = np.full(len(names), STOPPED)
        return cls(
            np.array([path, none]), np.array([goal, speed]), values["goal_time_tolerance"] or np.inf
        )


class Outcome(NamedTuple):
    """End of a trajectory: an error code, and its reason."""

    code: int
    reason: str = ""
    canceled: bool = False  # by request, or by a newer trajectory


class Following:
    """Motion of joints `names` along a trajectory that ends at a time [ns].

    `continuous` is a mask of joints. `outcome` is None until the end. `state` and `desired` are
    those of the last cycle.
    """

    def __init__(self, names, trajectory, tolerances, continuous):
        self.names = names
        self._tolerances = tolerances
        self._continuous = continuous
        self.start = trajectory.start
        self._end = trajectory.end
        self.outcome = self.state = self.desired = None

    def finish(self, outcome):
        """Set the outcome; return whether there was none."""
        is_open = self.outcome is None
        self.outcome = outcome if is_open else self.outcome
        return is_open

    @property
    def error(self):
        """Desired minus actual position [rad, m] and velocity [rad/s, m/s], shape (2, nv)."""
        state = self.state
        desired = self.desired
        position = nearest(desired.position, state.position, self._continuous) - state.position
        return np.array([position, desired.velocity - state.velocity])

    def check(self, state, desired):
        """Return why the errors of a RobotState exceed the tolerances; empty if they do not.

        A joint must remain within its path tolerance until the end, and be within its goal
        tolerance from the end to the goal time at least once, with all others.
        """
        if self.outcome:
            return ""
        self.state = state
        self.desired = desired
        late = (state.newest - self._end) * 1e-9
        tolerances = self._tolerances
        limits = tolerances.path if late < 0.0 else tolerances.goal
        error = np.abs(self.error)
        beyond = np.argwhere(~(error <= limits))
        if late < 0.0 and len(beyond):
            self._fail(PATH_TOLERANCE_VIOLATED, "path_tolerance", error, limits, beyond[0])
        elif late >= 0.0 and not len(beyond):
            self.finish(Outcome(SUCCESSFUL))
        elif late > tolerances.time:
            when = f"{late:.3g} s after the end of the trajectory"
            self._fail(GOAL_TOLERANCE_VIOLATED, "goal_tolerance", error, limits, beyond[0], when)
        return self.outcome.reason if self.outcome else ""

    def _fail(self, code, name, error, limits, where, when="on the trajectory"):
        kind, k = where
        quantity = f"{_KINDS[kind]} error of joint '{self.names[k]}' {when}"
        value, limit = distinct(error[kind, k], limits[kind, k], digits=3)
        reason = f"{quantity} is {value}; expected at most {name} = {limit}."
        self.finish(Outcome(code, reason))
