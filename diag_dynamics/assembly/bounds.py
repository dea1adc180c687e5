# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bounds on joint values. Beyond them lie degrees sent for radians, overrun counters, broken encoders."""

import numpy as np

from diag_dynamics.assembly.rejected import RejectedError


class Bounds:
    """Bounds of positions and velocities.

    Parameters
    ----------
    names : sequence of str
        The joints.
    lower, upper : array_like, shape (n,)
        Their position limits [rad, m], infinite where there are none.
    turns : array_like of bool, shape (n,)
        Joints whose position is an angle that turns round: it has no bound, however often it has turned.
    options : Options
        Its `max_position` [rad, m], `max_velocity` [rad/s, m/s], `beyond_limits`, how far outside of its limits a joint
        may be [rad, m], and `beyond_velocity`, how many times its velocity limit a velocity may be; 0 for no bound.
    velocity_limit : array_like, shape (n,), optional
        [rad/s, m/s]; infinite or 0, which is how URDFs say that they do not know, where there is none.

    Attributes
    ----------
    lower, upper : ndarray
        Positions beyond them are refused [rad, m].
    fastest : ndarray
        So are velocities beyond them [rad/s, m/s].
    """

    def __init__(self, names, lower, upper, turns, options, velocity_limit=None):
        self._names = names
        most = np.where(turns, np.inf, options.max_position or np.inf)
        slack = options.beyond_limits or np.inf
        self.lower = np.maximum(np.asarray(lower, dtype=float) - slack, -most)
        self.upper = np.minimum(np.asarray(upper, dtype=float) + slack, most)
        self.fastest = times_limit(options.beyond_velocity, velocity_limit, options.max_velocity, len(names))

    def check(self, position, velocity, here):
        """Refuse values beyond the bounds; NaN passes, as other rules judge it.

        Raises
        ------
        RejectedError
            Names the joint, the value and the bounds.
        """
        outside = (position < self.lower[here]) | (position > self.upper[here])
        if outside.any():
            k = int(np.argmax(outside))
            at = here[k]
            raise RejectedError(
                "absurd value",
                f"joint '{self._names[at]}': position is {position[k]:.9g}, expected within "
                f"{self.lower[at]:g} … {self.upper[at]:g} (absurd.position, absurd.beyond_limits)",
            )
        fastest = self.fastest[here]
        fast = (np.abs(velocity) > fastest) & np.isfinite(velocity)
        if fast.any():
            k = int(np.argmax(fast))
            raise RejectedError(
                "absurd value",
                f"joint '{self._names[here[k]]}': velocity is {velocity[k]:.9g}, expected within "
                f"±{fastest[k]:g} (absurd.velocity, absurd.beyond_velocity)",
            )


def times_limit(factor, limit, most, count):
    """Bounds by multiples of a limit, and by one number for all; 0 is no bound, nor is a limit of 0 one.

    Returns
    -------
    ndarray, shape (count,)
        Infinite where there is none.
    """
    limit = np.full(count, np.inf) if limit is None else np.asarray(limit, dtype=float)
    own = np.full(count, np.inf)
    given = np.isfinite(limit) & (limit > 0.0)
    if factor:
        own[given] = factor * limit[given]
    return np.minimum(own, most or np.inf)
