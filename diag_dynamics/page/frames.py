# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames: all that a page shows of a state as one row of float32; of one state or of many."""

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.model.mimic import FollowerMotion
from diag_dynamics.page.forces import Forces
from diag_dynamics.page.layout import CAUSES, Layout, with_followers
from diag_dynamics.sweeps import evaluation

GAP = 0.5
"""Largest time between two states over which dK/dt is a difference [s]."""

MODEL_TOLERANCE = 1e-6
"""Relative difference between K and the sum of link energies above which the monitor has another
model."""

UPPER = np.triu_indices(3)
"""Entries of a symmetric matrix that a frame has, row by row."""


class States(NamedTuple):
    """T states, a row each. Fields have the names of a frame; NaN is unknown."""

    t: Any
    q: Any
    qd: Any
    effort: Any
    nu: Any
    epsilon: Any
    coriolis: Any
    gravity: Any
    D: Any
    K: Any
    residual: Any = np.nan
    external_torque: Any = np.nan
    norm: Any = np.nan
    """|r|, shape (T,); NaN where the observer has no result."""
    collision: Any = False
    velocity_estimated: Any = False
    receive_time: Any = False
    contact_limits_worst: Any = np.nan
    """Index of the worst point, −1 for none; `contact_limits_position` is that point's, in the
    root link's axes."""
    contact_limits_position: Any = np.nan
    contact_limits_speed: Any = np.nan
    contact_limits_mass: Any = np.nan
    contact_limits_energy: Any = np.nan
    contact_limits_allowed: Any = np.nan
    contact: Any = False
    touched_link: Any = np.nan
    """Indices of links that may be touched, the most probable one first, −1 for none; NaN where it
    is unknown."""
    touched_probability: Any = np.nan

    @classmethod
    def of(cls, t, q, qd, effort, s, **others):
        """Return states of an evaluation at stamps, positions, rates and efforts, or None."""
        terms = q, qd, effort, s.nu, s.epsilon, s.coriolis, s.gravity, s.articulated_inertia
        rows = (np.nan if x is None else np.atleast_2d(x) for x in terms)
        return cls(np.atleast_1d(t), *rows, np.atleast_1d(s.kinetic_energy), **others)

    def with_contact_limits(self, contact):
        """Return the states with a PredictedContact at them."""
        position = contact.position[np.arange(len(self.t)), contact.worst]
        return self._replace(
            contact_limits_worst=contact.worst,
            contact_limits_position=np.where(contact.worst[:, None] < 0, np.nan, position),
            contact_limits_speed=contact.speed,
            contact_limits_mass=contact.reflected_mass,
            contact_limits_energy=contact.energy,
            contact_limits_allowed=contact.allowed_speed,
        )


class FrameMaker:
    """Make the frames of a robot.

    Parameters
    ----------
    dynamics : DiagonalDynamics
        Used by one thread at a time.
    points : iterable of (str, str)
        Name and link of each point of contact.
    covariance : ndarray, shape (nv, nv), optional
        Of the external torque; without it forces are unknown.

    Attributes
    ----------
    layout : Layout
    """

    def __init__(self, dynamics, points=(), covariance=None):
        model = dynamics.model
        self._dynamics = dynamics
        self._model = model
        self.layout = Layout(model, points)
        self._forces = Forces(dynamics, covariance)
        self._before = np.nan, np.nan  # time and K of the last state
        self._workspace = model.new_workspace()
        self._motion = FollowerMotion(model) if model.followers else None

    def frames(self, states):
        """Return frames of states, shape (T,) of ``layout.dtype``.

        The change dK continues from the last call.
        """
        states = self._forces.with_touched_links(states)
        frames = np.empty(len(states.t), dtype=self.layout.dtype)
        frames["t"] = states.t
        x = frames["numbers"]
        x.fill(np.nan)
        places = self.layout.places
        with np.errstate(
            over="ignore", divide="ignore", invalid="ignore"
        ):  # a page shows infinity as unknown
            computed = self._computed(states) | self._forces.fields(states)
            computed["q"] = with_followers(self._model, states.q, self._motion)
            for name, value in (states._asdict() | computed).items():
                if value is not np.nan and name in places:
                    x[:, places[name] if np.ndim(value) == 2 else places[name].start] = value
        return frames

    def chosen(self, q, nu, link):
        """Return the fields of a chosen link, float32, in the world's axes.

        With F the linear columns of ℓJᵀ at the link's origin, the linear part of JM⁻¹Jᵀ is FᵀF
        [1/kg]. Its symmetric root maps the unit sphere to the ellipsoid of velocities that ½ J
        allows; the frame has its upper triangle, row by row. The velocity is Fᵀν [m/s].
        """
        fields = np.full(9, np.nan, dtype="<f4")
        with suppress(DiagDynamicsError):
            factor = self._dynamics.wrench_factor(q, link, frame="world")[:, :3]
            values, axes = np.linalg.eigh(factor.T @ factor)
            fields[:6] = ((axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T)[UPPER]
            fields[6:] = nu @ factor
        return fields

    def _computed(self, states):
        """Return fields that are computed from those of the states."""
        nu = states.nu
        K = states.K
        energies = self._link_energies(states)
        torque = np.broadcast_to(states.external_torque, nu.shape)
        return {
            "gravity_torque": self._rows("tau_from_epsilon", states.q, states.gravity),
            "link_energy": energies,
            "p_effort": (nu * states.epsilon).sum(axis=-1),
            "p_gravity": -(nu * states.gravity).sum(axis=-1),
            "p_friction": self._friction_power(states),
            "p_external": (nu * states.residual).sum(axis=-1),
            "dK": self._energy_rate(states.t, K),
            "torque_norm": np.linalg.norm(torque, axis=-1),
            "flags": _flags(
                states, np.abs(energies.sum(axis=1) - K) <= MODEL_TOLERANCE * K + 1e-12
            ),
        }

    def _rows(self, name, *arrays):
        """Return the result of a method of the dynamics, by rows where there are several states."""
        if len(arrays[0]) == 1:
            return getattr(self._dynamics, name)(*(row[0] for row in arrays))[None]
        return getattr(self._dynamics, name)(*arrays)

    def _friction_power(self, states):
        if not self._model.has_friction:
            return 0.0
        torque = self._rows("friction_torque", states.qd, states.q)
        return -(states.qd * torque).sum(axis=-1)

    def _energy_rate(self, t, K):
        """Return dK/dt as a difference, NaN over a gap."""
        time, energy = self._before
        self._before = t[-1], K[-1]
        step = np.diff(t, prepend=time)
        return np.where((step > 0.0) & (step <= GAP), np.diff(K, prepend=energy) / step, np.nan)

    def _link_energies(self, states):
        energies = np.empty((len(states.t), len(self._model.link_names)))
        q, qd = (np.ascontiguousarray(x, dtype=float) for x in (states.q, states.qd))
        if not evaluation.link_energies(self._workspace.robot, self._model.links, q, qd, energies):
            energies[:] = np.nan
        return energies


def _flags(states, same_model):
    is_set = {
        "velocity_estimated": states.velocity_estimated,
        "effort_missing": np.isnan(states.effort).any(axis=-1),
        "no_external_torque": np.isnan(states.norm),
        "collision": states.collision,
        "receive_time": states.receive_time,
        "other_model": ~same_model,
        "contact": states.contact,
    }
    return sum(CAUSES[name] * flag for name, flag in is_set.items())
