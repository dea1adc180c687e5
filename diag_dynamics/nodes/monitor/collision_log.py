# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Log lines on collisions: one where a collision begins, one where it ends."""

import numpy as np

from diag_dynamics.sweeps.spatial import LINEAR_X, LINEAR_Y, LINEAR_Z

SECOND = 1_000_000_000

PAUSE = SECOND // 2
"""Shortest time [ns] between two collisions in the log: a rise within it, or within alarm.hold_off, belongs to the first."""

FEW = 3
"""Number of joints that a line names."""


class CollisionLog:
    """Writer of log lines on collisions; the caller takes them by :meth:`pop`.

    A collision ends where nothing has risen for the hold-off. So the log has at most four lines a second, and no collision
    is lost: the last line says how often the torque rose.

    Parameters
    ----------
    model : RobotModel
    hold_off : float
        Time after a collision within which another rise belongs to it [s].
    """

    def __init__(self, model, hold_off=0.0):
        self._lines, self._start, self._quiet = [], None, True
        self.use(model, hold_off)

    def use(self, model, hold_off=0.0):
        """Write of another model."""
        self.end()
        bodies = model.bodies[1:]
        slides = bodies["dof"][np.isin(bodies["direction"], (LINEAR_X, LINEAR_Y, LINEAR_Z))]
        self._names = model.dof_names
        self._units = ["N" if k in slides else "N m" for k in range(model.nv)]
        self._pause = max(round(hold_off * SECOND), PAUSE)

    def pop(self):
        """Return the lines since the last call, each with whether it is of a beginning."""
        lines, self._lines = self._lines, []
        return lines

    def accept_state(self, stamp, collision, torque, limits, cause):
        """Log a collision that begins or ends with a state.

        Parameters
        ----------
        stamp : int
            [ns].
        collision : bool
        torque : ndarray, shape (nv,), or None
            External torque [N m, N], where there is a result; NaN for joints without one.
        limits : ndarray, shape (nv,)
            Thresholds of the joints [N m, N], infinite for none.
        cause : callable
            Returns words on what exceeds which threshold.
        """
        if self._start is not None and self._is_over(stamp, collision):
            self.end()
        if not collision or torque is None:
            self._quiet = self._quiet or not collision
            return
        if self._start is None:
            self._start, self._rises, self._largest, self._most = stamp, 0, -1.0, ""
            self._quiet = True
            self._lines.append((f"Collision: {cause()}.", True))
        self._rises += self._quiet
        self._quiet, self._last = False, stamp
        size = np.where(np.isnan(torque), 0.0, np.abs(torque))
        limited = np.isfinite(limits)
        part = np.divide(size, limits, out=np.zeros(len(size)), where=limited) if limited.any() else size
        k = int(np.argmax(part))
        if part[k] > self._largest and not np.isnan(torque).all():
            self._largest = part[k]
            self._most = f": at most {size[k]:.3g} {self._units[k]} at joint '{self._names[k]}'"

    def _is_over(self, stamp, collision):
        """Whether time went back, or nothing has risen for the hold-off, however far apart states are."""
        return stamp < self._last or (stamp - self._last > self._pause and (self._quiet or not collision))

    def end(self):
        """Write that the collision is over, if there is one."""
        if self._start is None:
            return
        rises = f", {self._rises} rises" if self._rises > 1 else ""
        duration = (self._last - self._start) * 1e-9
        self._lines.append((f"Collision over after {duration:.3g} s{self._most}{rises}.", False))
        self._start = None

    def of_norm(self, norm, threshold, torque):
        """Words on a norm of the residual beyond its threshold."""
        k = int(np.argmax(np.abs(torque)))
        most = f"{abs(torque[k]):.3g} {self._units[k]} at joint '{self._names[k]}'"
        return f"|r| {norm:.3g} J^0.5/s, threshold {threshold:.3g}; most {most}"

    def of_joints(self, torque, limits, otherwise):
        """Words on joints beyond their thresholds; `otherwise` where none is."""
        above = [int(k) for k in np.argsort(-np.abs(torque) / limits) if abs(torque[k]) > limits[k]]
        if not above:
            return otherwise
        k, others = above[0], [f"'{self._names[k]}'" for k in above[1:FEW]]
        others += [f"{len(above) - FEW} more"] if len(above) > FEW else []
        also = f"; also {', '.join(others)}" if others else ""
        return f"joint '{self._names[k]}' {abs(torque[k]):.3g} {self._units[k]}, threshold {limits[k]:.3g}{also}"
