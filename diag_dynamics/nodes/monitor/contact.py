# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Predicted contact at the monitor's states, and its limits."""

import numpy as np

from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN, Status, counted

LEVELS = (OK, WARN, ERROR)


class ContactWatch:
    """Contact at states, and the levels of points with limits.

    A point is at WARN from `contact.warn_at` of its allowed speed and at ERROR above all of it,
    until it is below `contact.release` of that.
    """

    def __init__(self):
        self._exceeded, self._reported = 0, 0
        self.start_interval()

    def use(self, dynamics, settings, points):
        """Use a model and settings; `points` are parameters.contact_points, None if unchanged."""
        self._dynamics = dynamics
        self._warn_at = settings.values["contact.warn_at"]
        self._release = settings.values["contact.release"]
        if points is not None:
            self.points, self._without_shape = points
            self.has_limits = bool(self.points.limited.any())
            self.forget()

    def forget(self):
        """Restart at the next state, for example after a jump of time."""
        self._last = self._contact = None
        self._levels = np.zeros(len(self.points), dtype=int)

    def start_interval(self):
        """Start a report interval."""
        self._count, self._level, self._alarm = 0, 0, ""

    def compute(self, state):
        """Return the contact at a RobotState."""
        if self._last is not state:
            self._contact = self._dynamics.contact(state.position, state.velocity, self.points)
            self._last = state
        return self._contact

    def accept_state(self, state):
        """Return whether a RobotState is worse than the last report."""
        contact = self.compute(state)
        usage, before = contact.usage, self._levels
        risen = (usage >= self._warn_at).astype(int) + (usage > 1.0)
        held = (usage >= self._release * self._warn_at).astype(int) + (usage >= self._release)
        self._levels = np.maximum(risen, np.minimum(before, held))
        self._exceeded += int(((self._levels == 2) & (before < 2)).sum())
        self._count += 1
        level = int(self._levels.max())
        if level > self._level:
            k = int(np.argmax(np.where(self._levels == level, usage, -1.0)))
            verb = "exceeds" if usage[k] > 1.0 else "is close to"
            limit = f"the allowed speed of region '{contact.region(k)}'"
            self._level, self._alarm = level, f"'{contact.names[k]}' {verb} {limit}"
        return level > self._reported

    def report(self):
        """Return the status of this interval; STALE without states."""
        if not self._count:
            return Status("contact", STALE, "no states since the last report")
        values = {"limits exceeded": self._exceeded}
        if self._contact is not None and (k := self._contact.worst) >= 0:
            c = self._contact
            values |= {
                "smallest margin at": c.names[k],
                "speed [m/s]": f"{c.speed[k]:.4g}",
                "allowed speed [m/s]": f"{c.allowed_speed[k]:.4g}",
                "reflected mass [kg]": f"{c.reflected_mass[k]:.4g}",
                "transferable energy [J]": f"{c.energy[k]:.4g}",
                "force [N]": f"{c.force[k]:.4g}",
            }
        message = self._alarm or "within limits"
        if links := sorted(set(self._without_shape) & set(self.points.links)):
            values["links without shape"] = counted(links)
            message += f"; links without shape, checked at their frames: {len(links)}"
        self._reported = self._level
        return Status("contact", LEVELS[self._reported], message, values)
