# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Watches of the monitor's states: contact limits, energy, loops and stuck sensors."""

from collections import deque

import numpy as np

from diag_dynamics.exceptions import LoopError
from diag_dynamics.model.joint_types import places, single_joints
from diag_dynamics.model.mimic import FollowerMotion, loop_title
from diag_dynamics.nodes.monitor.collisions import CollisionWatch, LoadWatch
from diag_dynamics.nodes.monitor.watch import Watch
from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.statuses import ERROR, OK, STALE, WARN, Status, problem_status
from diag_dynamics.parameters.contact_limits import contact_points
from diag_dynamics.parameters.monitor import TOTAL
from diag_dynamics.recordings.balance import MIN_POWER, MIN_WINDOWS, WINDOW, explained_share
from diag_dynamics.sweeps.couplings import NEARLY_SINGULAR

LEVELS = (OK, WARN, ERROR)

WARN_AT, RELEASE = 0.8, 0.9
"""Fraction of the allowed speed above which diagnostics warn; hysteresis of warnings, as a fraction
of their limit."""


class ContactLimitsWatch(Watch):
    """Predicted contact at states, and the levels of points with limits.

    A point is at WARN from WARN_AT of its allowed speed and at ERROR above all of it, until it is
    below RELEASE of that.
    """

    def __init__(self, robot, node):
        super().__init__(robot, node)
        self._dynamics = self._limits = None
        self._exceeded = 0
        self._reported = 0
        self._start_interval()

    def configure(self, dynamics, settings):
        """See Watch."""
        is_new = self._dynamics is None or dynamics.model is not self._dynamics.model
        if is_new or settings.contact_limits != self._limits:
            points = contact_points(dynamics.model, self._robot.source, settings.contact_limits)
            self.points, self._without_shape = points
            self.has_limits = bool(self.points.limited.any())
            self.forget()
        self._dynamics = dynamics
        self._limits = settings.contact_limits

    def forget(self):
        """Restart at the next state, for example after a jump of time."""
        self._last = self._contact = None
        self._levels = np.zeros(len(self.points), dtype=int)

    def _start_interval(self):
        self._count = 0
        self._level = 0
        self._alarm = ""

    def _compute(self, state):
        """Return the predicted contact at a RobotState."""
        if self._last is not state:
            self._contact = self._dynamics.contact_limits(
                state.position, state.velocity, self.points
            )
            self._last = state
        return self._contact

    def publish(self, moment, outputs):
        """See Watch."""
        state = moment.state
        encoder = self._robot.encoder
        outputs.publish_beside(
            "contact_limits",
            state.newest,
            lambda: encoder.contact_limits(self._compute(state), state),
        )

    def accept(self, moment):
        """See Watch."""
        if not self.has_limits:
            return []
        contact = self._compute(moment.state)
        usage = contact.usage
        before = self._levels
        risen = (usage >= WARN_AT).astype(int) + (usage > 1.0)
        sustained = (usage >= RELEASE * WARN_AT).astype(int) + (usage >= RELEASE)
        self._levels = np.maximum(risen, np.minimum(before, sustained))
        self._exceeded += int(((self._levels == 2) & (before < 2)).sum())
        self._count += 1
        level = int(self._levels.max())
        if level > self._level:
            k = int(np.argmax(np.where(self._levels == level, usage, -1.0)))
            verb = "exceeds" if usage[k] > 1.0 else "is close to"
            limit = f"the allowed speed of region '{contact.region(k)}'"
            self._level = level
            self._alarm = f"'{contact.names[k]}' {verb} {limit}"
        return [self._status()] if level > self._reported else []

    def report(self):
        """See Watch."""
        statuses = [self._status()] if self.has_limits else []
        self._start_interval()
        return statuses

    def _status(self):
        """Return the status of this interval; STALE without states."""
        if not self._count:
            return Status("contact limits", STALE, "no states since the last report")
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
        return Status("contact limits", LEVELS[self._reported], message, values)


# --- Energy

MAX_INTERVAL = 0.5  # between two states that the power balance integrates over [s]
MINUTE = 60_000_000_000  # [ns]
NOTHING = 0.0, 0.0, 0.0  # length of a window [s], change of K [J], and its unexplained part [J]


class EnergyWatch(Watch):
    """Compare energies of all states with thresholds, and the change of K with the power."""

    def __init__(self, robot, node):
        super().__init__(robot, node)
        self._reported = OK
        self._start_interval()

    def configure(self, dynamics, settings):
        """See Watch."""
        model = dynamics.model
        names = single_joints(model)
        limits = settings.thresholds.by_joint(names)
        self._limits = {name: x for name, x in limits.items() if np.isfinite(x).any()}
        self._names = (TOTAL, *names)
        self._places = np.array(places(names, model.dof_names), dtype=int)
        self._windows = deque(maxlen=round(1e-9 * MINUTE / WINDOW))
        self.forget()

    def forget(self):
        """Restart the balance at the next state, for example after a jump of time."""
        self._last = None
        self._window = NOTHING

    def _start_interval(self):
        self._count = 0
        self._largest = 0.0
        self._level = OK
        self._alarm = ""
        self._time = self._residual = 0.0

    def accept(self, moment):
        """See Watch."""
        stamp = moment.state.newest
        s = moment.evaluation
        self._count += 1
        self._newest = stamp
        self._energy = s.kinetic_energy
        self._power = s.effort_power
        self._largest = max(self._largest, self._energy)
        for parameter, limits in self._limits.items():
            level = ERROR if parameter == "energy.error" else WARN
            energies = np.append(self._energy, s.energy_share[self._places])
            is_above = energies > limits
            if level > self._level and is_above.any():
                k = int(np.argmax(is_above))
                quantity = f"energy share of joint '{self._names[k]}'" if k else "kinetic energy"
                self._level = level
                self._alarm = f"{quantity} > {parameter} = {limits[k]:g} J"
        if self._power is None:
            self.forget()
        elif self._last is None or stamp != self._last[0]:  # of one stamp the first state
            self._integrate(stamp, self._energy, self._power, self._robot.friction_power(s))
        return [self._status()] if self._level > self._reported else []

    def _integrate(self, stamp, energy, power, friction):
        """Add ΔK less the integral of ν·(ε − ε_g) since the last state."""
        last = self._last
        self._last = (stamp, energy, power, friction)
        time = 1e-9 * (stamp - last[0]) if last else 0.0
        if not 0.0 < time <= MAX_INTERVAL:
            self._window = NOTHING
            return
        gained = energy - last[1]
        residual = gained - 0.5 * time * (power + last[2])
        self._time = self._time + time
        self._residual = self._residual + residual
        length, change, unexplained = self._window
        length = length + time
        change = change + gained
        unexplained += residual + 0.5 * time * (friction + last[3])
        self._window = length, change, unexplained
        if length > (1.0 - 1e-6) * WINDOW:
            self._windows.append((stamp, change / length, unexplained / length))
            self._window = NOTHING

    def _explained(self):
        """Return the share of the last minute; None of few windows or of a robot at rest."""
        recent = [powers for at, *powers in self._windows if 0 <= self._newest - at < MINUTE]
        change, residual = np.array(recent).reshape(-1, 2).T
        if len(recent) < MIN_WINDOWS or (change**2).mean() < MIN_POWER**2:
            return None
        return explained_share(residual.var(), change.var())

    def report(self):
        """See Watch."""
        status = self._status()
        self._start_interval()
        return [status]

    def _status(self):
        """Return the status of this interval; STALE without states."""
        if not self._count:
            return Status("energy", STALE, "no states since the last report")
        values = {"largest kinetic energy [J]": f"{self._largest:.6g}"}
        values["kinetic energy [J]"] = f"{self._energy:.6g}"
        if self._power is not None:
            values["power [W]"] = f"{self._power:.6g}"
        if self._time:
            values["power-balance residual [W]"] = f"{self._residual / self._time:.6g}"
        if (share := self._explained()) is not None:
            values["variance explained of dK/dt (last minute)"] = f"{share:.4g}"
        self._reported = self._level
        message = self._alarm or "within thresholds"
        return Status("energy", self._reported, message, values)


class LoopWatch(Watch):
    """Report near singularities of loops at the last state."""

    def __init__(self, robot, node):
        super().__init__(robot, node)
        self._model = self._motion = None

    def configure(self, dynamics, settings):
        """See Watch."""
        if dynamics.model is not self._model:
            self._model = dynamics.model
            self._motion = FollowerMotion(self._model) if self._model.loops else None

    def report(self):
        """See Watch."""
        return [self._status()] if self._motion else []

    def _status(self):
        state = self._robot.state
        if state is None:
            return Status("loops", STALE, "no state")
        try:
            now = self._motion.at(state.position, state.velocity)
        except LoopError as error:
            return problem_status("loops", [str(error)], "", {})._replace(level=ERROR)
        titles = [loop_title(self._model, number) for number in range(len(now.singularity))]
        values = {
            f"singularity of {title}": f"{singularity:.3g}"
            for title, singularity in zip(titles, now.singularity, strict=True)
        }
        nearly = np.array(titles)[np.array(now.singularity) < NEARLY_SINGULAR]
        if nearly.size:
            return Status("loops", WARN, f"nearly singular: {'; '.join(nearly)}", values)
        return Status("loops", OK, "closed", values)


class StuckWatch(Watch):
    """Report sensors that repeat a value while the robot moves, or a velocity of a standing one."""

    _count = 0

    def accept(self, _):
        """See Watch. The rules of joint states compare the values."""
        self._count += 1
        return []

    def report(self):
        """See Watch."""
        text = self._robot.assembler.stuck_text if self._count else ""
        self._count = 0
        return [problem_status("stuck sensors", [text] * bool(text), "none", {})]


WATCHES = CollisionWatch, LoadWatch, ContactLimitsWatch, EnergyWatch, LoopWatch, StuckWatch
"""All watches in the order in which they accept a state: collisions first."""
