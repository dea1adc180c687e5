# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a touch would cost at the monitor's states: limits that are kept or not, and what diagnostics say of it."""

import numpy as np

from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN, Status, counted
from diag_dynamics.parameters.contact_points import contact_points


def prepared(model, description, wanted):
    """Points of a robot and shapes that do not count; no points where they may wait until somebody listens.

    Raises
    ------
    InputError
        Parameters name a link that the robot lacks, or meshes cannot be read for want of trimesh.
    """
    if wanted.limits or wanted.geometry == "meshes" or wanted.links or wanted.points:
        return contact_points(model, description, wanted)
    return None, {}


class ContactWatch:
    """Contact at states, against limits where there are any; nothing is computed of a state that nobody asks for.

    Each point has a level: WARN from `contact.warn_at` of its allowed speed on, ERROR above all of it. A level holds from
    one state to the next until the point is below `contact.release` of where it began.

    Parameters
    ----------
    description : str or bytes
        The robot's URDF, or the path of one.
    """

    def __init__(self, description):
        self._description, self._points, self._left_out = description, None, {}
        self._wanted = self._dynamics = None
        self._exceeded = 0  # how often a limit was
        self._reported, self._told = OK, ""
        self._begin()

    def use(self, dynamics, settings, prepared):
        """Watch by a model and settings; `prepared` is what :func:`prepared` said if one of them is another, else None."""
        self._dynamics, self._wanted = dynamics, settings.contact
        self._warn_at, self._release = (settings.values[f"contact.{name}"] for name in ("warn_at", "release"))
        if prepared is not None:
            self._points, self._left_out = prepared
            self.forget()

    @property
    def points(self):
        """ContactPoints of the robot."""
        if self._points is None:
            self._points, self._left_out = contact_points(self._dynamics.model, self._description, self._wanted)
        return self._points

    @property
    def judges(self):
        """Whether there is a limit."""
        return self._wanted.limits is not None and bool(self.points.limited.any())

    def forget(self):
        """Begin anew at the next state, as after a jump of time or a pause."""
        self._last = self._contact = self._levels = None

    def _begin(self):
        """Begin another interval between two reports."""
        self._count, self._level, self._cause = 0, 0, ""
        self._most = 0.0, ""  # largest part of the allowed speed, and the point

    def at(self, state):
        """Contact at a RobotState."""
        if self._last is not state:
            self._contact = self._dynamics.contact(state.position, state.velocity, self.points)
            self._last = state
        return self._contact

    def take(self, state):
        """Judge a RobotState; return whether this is worse than all reported last."""
        contact = self.at(state)
        usage = contact.usage
        before = np.zeros(len(usage), int) if self._levels is None else self._levels
        entered = (usage >= self._warn_at).astype(int) + (usage > 1.0)
        held = np.where(usage >= self._release, 2, np.where(usage >= self._release * self._warn_at, 1, 0))
        levels = np.maximum(entered, np.minimum(before, held))
        self._exceeded += int(((levels == 2) & (before < 2)).sum())
        self._levels = levels
        self._count += 1
        k = int(np.argmax(usage))
        if usage[k] > self._most[0]:
            self._most = float(usage[k]), contact.names[k]
        worst = int(levels.max(initial=0))
        if worst > self._level:
            self._level, self._cause = (
                worst,
                self._said(contact, int(np.argmax(np.where(levels == worst, usage, -1.0)))),
            )
        return worst > self._reported_rank

    @property
    def _reported_rank(self):
        return {OK: 0, WARN: 1, ERROR: 2}[self._reported]

    def _said(self, contact, k):
        """Which limit a point comes near to, or exceeds."""
        region, point = contact.region(k), contact.names[k]
        on = "" if contact.links[k] == point else f" on '{contact.links[k]}'"
        beyond = "exceeds" if contact.usage[k] > 1.0 else "comes near to"
        return f"'{point}'{on} {beyond} the speed that keeps the limits of '{region}'"

    def report(self):
        """Status of all states since the last report; without any, what was reported last does not become better."""
        if not self._count:
            return Status("contact", STALE, f"no state since: {self._told or 'within limits'}")
        values = {"limits exceeded": self._exceeded, "points": self.points.count, "entries": len(self.points)}
        if self._most[1]:
            values["largest part of the allowed speed"] = f"{self._most[0]:.4g}, '{self._most[1]}'"
        if self._contact is not None and (k := self._contact.worst) >= 0:
            c = self._contact
            values |= {
                "least margin at": c.names[k],
                "speed [m/s]": f"{c.speed[k]:.4g}",
                "allowed speed [m/s]": f"{c.allowed_speed[k]:.4g}",
                "reflected mass [kg]": f"{c.reflected_mass[k]:.4g}",
                "transferable energy [J]": f"{c.energy[k]:.4g}",
                "force [N]": f"{c.force[k]:.4g}",
            }
        self._reported, self._told = (OK, WARN, ERROR)[self._level], self._cause
        message = self._told or "within limits"
        if bare := sorted(set(self._left_out) & set(self.points.links)):
            values["shapes left out"] = counted(bare)
            message += f"; {len(bare)} links are looked at by their frames alone, and may reach farther"
        self._begin()
        return Status("contact", self._reported, message, values)
