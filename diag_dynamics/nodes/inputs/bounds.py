"""Values that no joint can have, whatever a driver says: degrees for radians, a counter that ran over, a sick encoder."""

import numpy as np

from diag_dynamics.nodes.inputs.rejected import RejectedError


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
        Its `max_position` [rad, m], `max_velocity` [rad/s, m/s] and `beyond_limits`, how far outside of its limits a joint
        may be [rad, m]; 0 for no bound.

    Attributes
    ----------
    lower, upper : ndarray
        Positions beyond them are refused [rad, m].
    fastest : float
        So are velocities beyond it [rad/s, m/s].
    """

    def __init__(self, names, lower, upper, turns, options):
        self._names = names
        most = np.where(turns, np.inf, options.max_position or np.inf)
        slack = options.beyond_limits or np.inf
        self.lower = np.maximum(np.asarray(lower, dtype=float) - slack, -most)
        self.upper = np.minimum(np.asarray(upper, dtype=float) + slack, most)
        self.fastest = options.max_velocity or np.inf

    def check(self, position, velocity, here):
        """Refuse what is beyond the bounds; NaN is not looked at.

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
        fast = (np.abs(velocity) > self.fastest) & np.isfinite(velocity)
        if fast.any():
            k = int(np.argmax(fast))
            raise RejectedError(
                "absurd value",
                f"joint '{self._names[here[k]]}': velocity is {velocity[k]:.9g}, expected within "
                f"±{self.fastest:g} (absurd.velocity)",
            )
