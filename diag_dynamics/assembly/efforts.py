# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meaning of a driver's efforts: their unit, whether gravity is in them, whether they can be used at all."""

import numpy as np

from diag_dynamics.assembly.bounds import times_limit
from diag_dynamics.entries import by_name
from diag_dynamics.exceptions import InputError


class Efforts:
    """Converter of efforts as sent to N m (prismatic: N), joint by joint.

    Parameters
    ----------
    joints : sequence of str
        The independent joints.
    followers : sequence of str
        Joints that follow one of these.
    options : Options
        Its `effort_available`, `effort_scale` and `effort_includes_gravity` by joint, ``*`` for all others. What is
        undeclared is taken as available where it is sent, in N m, gravity included. Its `max_effort` [N m, N] and
        `beyond_effort`, how many times its effort limit the effort of a joint may be; 0 for no bound.
    effort_limit : array_like, shape (n,), optional
        Effort limits of the independent joints [N m, N]; infinite or 0 for none.

    Attributes
    ----------
    without_gravity : ndarray or None
        1 for each joint whose effort has gravity taken out, 0 for the others; None if there is none.
    factors, follower_factors : ndarray
        Factors of efforts; NaN for efforts that cannot be used.
    most : float
        Effort [N m, N] beyond which any effort is absurd.
    strongest : ndarray
        Efforts [N m, N] beyond which those of the independent joints are absurd.
    undeclared : tuple of str
        Joints of which scale or gravity is not declared, although their efforts count.

    Raises
    ------
    InputError
        A joint that is not the robot's, or gravity of a follower, which is its leader's.
    """

    def __init__(self, joints, followers, options, effort_limit=None):
        for name in options.effort_includes_gravity:
            if name in followers:
                raise InputError(
                    f"parameter 'effort_includes_gravity' names '{name}', which follows another joint: gravity is "
                    "declared for the joint it follows."
                )
        names = (*joints, *followers)
        available = by_name("effort_available", options.effort_available, names)
        scale = by_name("effort_scale", options.effort_scale, names)
        gravity = by_name("effort_includes_gravity", options.effort_includes_gravity, names)

        def factors(some):
            return np.array([scale.get(n, 1.0) if available.get(n, True) else np.nan for n in some], dtype=float)

        self.factors, self.follower_factors = factors(joints), factors(followers)
        self.most = options.max_effort or np.inf
        self.strongest = times_limit(options.beyond_effort, effort_limit, options.max_effort, len(joints))
        without = np.array([not gravity.get(name, True) for name in joints], dtype=float)
        self.without_gravity = without if without.any() else None
        self.undeclared = tuple(n for n in joints if available.get(n, True) and (n not in scale or n not in gravity))

    def of(self, effort, here):
        """Efforts of joints [N m, N], NaN where unknown; and whether one of them was absurd, which is as unknown."""
        return _taken(effort * self.factors[here], self.strongest[here])

    def of_followers(self, effort, here):
        """Convert efforts of followers, as :meth:`of` those of joints."""
        return _taken(effort * self.follower_factors[here], self.most)


def _taken(effort, most):
    absurd = np.abs(effort) > most
    if absurd.any() or np.isinf(effort).any():
        return np.where(absurd | np.isinf(effort), np.nan, effort), True
    return effort, False
