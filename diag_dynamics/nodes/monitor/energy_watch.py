# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is watched over all states: energies against their thresholds, the balance of power, and the numbers' health."""

import numpy as np

from diag_dynamics.model.single_joints import places, single_joints
from diag_dynamics.nodes.monitor.last_minute import LastMinute
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN, Status
from diag_dynamics.parameters.monitor import share_thresholds

HEALTHY = 1e-9
"""Relative error up to which what must hold exactly does."""

CONTINUOUS = 0.5
"""Time between two states [s] beyond which the change of energy is not put down to the power in between."""


class EnergyWatch:
    """Kinetic energy of every state against thresholds, and its change against the power of the efforts.

    The power-balance residual is the measured change of K less the integral of ν·(ε − ε_g), both over the time since the
    last report: what friction, contact and payloads that the model does not know take out or put in, or efforts that are
    not what they are declared to be. Beside it stands the explained share of the last minute, which a recording has, too,
    and which holds the URDF's friction. No balance, however poor, is a warning: what the URDF lacks (friction, rotor
    inertias) and what robots are for (contact, loads) spoil it, and a robot that is well would warn all day.

    Parameters
    ----------
    model : RobotModel
    thresholds : Thresholds

    Raises
    ------
    InputError
        The thresholds name a joint that is not there.
    """

    def __init__(self, model, thresholds):
        self._model, self._minute = model, LastMinute()
        self.configure(model, thresholds)
        self._K = self._power = self._last = None
        self._since = 0.0  # length of the last interval that was integrated [s]
        self._reported, self._alarm_reported = OK, ""
        self._begin()

    def configure(self, model, thresholds):
        """Watch a model, which may be another one, by these thresholds; nothing changes if they are refused.

        Raises
        ------
        InputError
            They name a joint that is not there.
        """
        names = single_joints(model)
        warn, error = (np.array(shares) for shares in share_thresholds(thresholds, names))
        self._names, self._at = names, np.array(places(names, model.dof_names), dtype=int)
        self._thresholds, self._shares = thresholds, ((ERROR, "error", error), (WARN, "warn", warn))
        self._watch_shares = bool(np.isfinite([*warn, *error]).any())
        if model is not self._model:
            self._model = model
            self._minute.clear()
        self.forget()

    def forget(self):
        """Take the next state as the first one."""
        self._last = None
        self._minute.restart()

    def _begin(self):
        """Begin another interval between two reports."""
        self._count, self._largest, self._level, self._alarm = 0, 0.0, OK, ""
        self._gained = self._explained = self._time = 0.0
        self._share = 0.0, ""  # the largest one above a threshold, and its joint

    def take(self, stamp, s, lifting=0.0, friction=0.0):
        """Take in a state; return whether this is worse than all reported last.

        Parameters
        ----------
        stamp : int
            [ns]
        s : Evaluation
        lifting, friction : float
            ν·ε_g and ν·ε_fric [W].
        """
        K = s.kinetic_energy
        self._count += 1
        self._largest = max(self._largest, K)
        self._judge(K, s)
        power = s.effort_power
        self._balance(stamp, K, power)
        if power is not None:
            self._minute.add_state(stamp, K, power - friction)
        self._last, self._K, self._power = stamp, K, power
        return self._level > self._reported

    def _balance(self, stamp, K, power):
        """Take in what K has gained since the last state and what the power explains of it."""
        again = stamp == self._last  # in pieces: of the states with one stamp the last one counts
        if not again:
            self._since = 0.0 if self._last is None else (stamp - self._last) * 1e-9
        if power is None or self._power is None or not 0.0 < self._since <= CONTINUOUS:
            self._since = 0.0
            return
        self._gained += K - self._K
        self._explained += 0.5 * (power - self._power if again else power + self._power) * self._since
        if not again:
            self._time += self._since

    def _judge(self, K, s):
        warn, error = self._thresholds.warn, self._thresholds.error
        if error and error < K:
            self._raise(ERROR, f"kinetic energy > error_energy = {error:g} J")
        elif warn and warn < K:
            self._raise(WARN, f"kinetic energy > warn_energy = {warn:g} J")
        if self._watch_shares:
            share = s.energy_share[self._at]
            for level, word, most in self._shares:
                beyond = np.flatnonzero(share > most)
                if len(beyond):
                    k = beyond[0]
                    name = self._names[k]
                    self._raise(level, f"energy share of joint '{name}' > {word}_energy_share = {most[k]:g} J")
                    self._share = max(self._share, (float(share[k]), name))

    def _raise(self, level, alarm):
        if level > self._level:
            self._level, self._alarm = level, alarm

    def report(self):
        """Status of all states since the last report; without any, what was reported last does not become better."""
        if not self._count:
            return Status("energy", STALE, f"no state since: {self._alarm_reported or 'within thresholds'}")
        values = {"largest kinetic energy [J]": f"{self._largest:.6g}"}
        if self._last is not None:
            values["kinetic energy [J]"] = f"{self._K:.6g}"
            if self._power is not None:
                values["power [W]"] = f"{self._power:.6g}"
        if self._share[1]:
            values[f"largest energy share of '{self._share[1]}' [J]"] = f"{self._share[0]:.6g}"
        if self._time:
            values["power-balance residual [W]"] = f"{(self._gained - self._explained) / self._time:.6g}"
        if self._last is not None:
            values |= self._minute.values(self._last)
        self._reported, self._alarm_reported = self._level, self._alarm
        self._begin()
        return Status("energy", self._reported, self._alarm_reported or "within thresholds", values)


def numerical_health(dynamics, state):
    """Status of one RobotState, or of none: what must hold exactly, and how near the mass matrix is to a singular one."""
    if dynamics is None or state is None:
        return Status("numerical health", STALE, "no state")
    q, qd = state.position, state.velocity
    s = dynamics.evaluate(q, qd)
    size = np.linalg.norm(s.nu) * np.linalg.norm(s.coriolis)
    work = abs(s.nu @ s.coriolis) / size if size > 0.0 else 0.0
    K = 0.5 * qd @ dynamics.mass_matrix(q) @ qd
    apart = abs(s.kinetic_energy - K) / K if K > 0.0 else 0.0
    values = {"|nu.C| / (|nu| |C|)": f"{work:.1e}", "|K - qd.M.qd / 2| / K": f"{apart:.1e}"}
    D = s.articulated_inertia
    if len(D):
        k = int(np.argmin(D))
        values |= {"smallest D [kg m^2, kg]": f"{D[k]:.6g}", "its joint": dynamics.model.dof_names[k]}
    unhealthy = [key for key, number in zip(values, (work, apart), strict=False) if not number <= HEALTHY]
    if unhealthy:
        return Status("numerical health", WARN, f"{' and '.join(unhealthy)} > {HEALTHY:g}", values)
    return Status("numerical health", OK, "exact but for rounding", values)
