# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames: all that a page shows of a state as one row of float32; of one state or of many."""

from typing import Any, NamedTuple

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.page.layout import CAUSES, Layout

GAP = 0.5
"""Largest time between two states over which dK/dt is a difference [s]."""

MAX_DELAY, MODEL_TOLERANCE = 1.0, 1e-6
"""Delay above which a state is flagged `late` [s]; relative difference between K and the sum of link energies above which
the monitor has another model."""

UPPER = np.triu_indices(3)


class States(NamedTuple):
    """T states, a row each. Fields have the names of a frame; NaN or None is unknown."""

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
    latency: Any = np.nan
    rate: Any = np.nan
    contact_worst: Any = np.nan
    """Index of the worst point, −1 for none; `contact_position` is that point's, in the root link's axes."""
    contact_position: Any = np.nan
    contact_speed: Any = np.nan
    contact_mass: Any = np.nan
    contact_energy: Any = np.nan
    contact_allowed: Any = np.nan

    @classmethod
    def of(cls, t, q, qd, effort, s, **others):
        """Return states of an Evaluation or a BatchEvaluation at stamps, positions, rates and efforts (None: unknown)."""
        terms = q, qd, effort, s.nu, s.epsilon, s.coriolis, s.gravity, s.articulated_inertia
        rows = (None if x is None else np.atleast_2d(x) for x in terms)
        return cls(np.atleast_1d(t), *rows, np.atleast_1d(s.kinetic_energy), **others)

    def with_contact(self, contact):
        """Return the states with the :class:`~diag_dynamics.contact.Contact` at them."""
        position = contact.position[np.arange(len(self.t)), contact.worst]
        return self._replace(
            contact_worst=contact.worst,
            contact_position=np.where(contact.worst[:, None] < 0, np.nan, position),
            contact_speed=contact.speed,
            contact_mass=contact.reflected_mass,
            contact_energy=contact.energy,
            contact_allowed=contact.allowed_speed,
        )


class FrameMaker:
    """Make the frames of a robot.

    Parameters
    ----------
    dynamics : DiagonalDynamics
        Used by one thread at a time.
    points : iterable of (str, str)
        Name and link of each point of contact.

    Attributes
    ----------
    layout : Layout
    """

    def __init__(self, dynamics, points=()):
        self._dynamics, self.layout = dynamics, Layout(dynamics.model, points)
        self._before = np.nan, np.nan  # time and K of the last state

    def frames(self, states):
        """Return the frames of states, shape (T,) of ``layout.dtype``; dK continues from the last call."""
        layout, K = self.layout, np.asarray(states.K)
        frames = np.empty(len(states.t), dtype=layout.dtype)
        frames["t"], x = states.t, frames["numbers"]
        energies = self._link_energies(states)
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # a page shows infinity as unknown
            computed = {
                **states._asdict(),
                **self._powers(states),
                "gravity_torque": self._rows("tau_from_epsilon", states.q, states.gravity),
                "link_energy": energies,
                "torque_norm": np.sqrt(np.square(states.external_torque).sum(axis=-1)),
                "coriolis_work": _coriolis_work(states.nu, states.coriolis),
                "flags": _flags(states, np.abs(energies.sum(axis=1) - K) <= MODEL_TOLERANCE * K + 1e-12),
            }
            x[:] = np.nan
            for name, value in computed.items():
                if value is not None and value is not np.nan and name in layout.places:
                    x[:, layout.places[name]] = value[:, None] if np.ndim(value) == 1 else value
        return frames

    def chosen(self, q, nu, link):
        """Return the fields of a chosen link, float32, in the world's axes.

        With F the linear columns of ℓJᵀ at the link's origin, the linear part of JM⁻¹Jᵀ is FᵀF [1/kg]. Its symmetric root
        maps the unit sphere to the ellipsoid of velocities that ½ J allows; the frame has its upper triangle, row by row.
        The velocity is Fᵀν [m/s].
        """
        factor = self._dynamics.wrench_factor(q, link, frame="world")[:, :3]
        values, axes = np.linalg.eigh(factor.T @ factor)
        root = (axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T
        return np.concatenate([root[UPPER], factor.T @ nu]).astype("<f4")

    def _rows(self, name, *arrays):
        """Return the result of a method of the dynamics, by its batch where there are several states."""
        if len(arrays[0]) == 1:
            return getattr(self._dynamics, name)(*(row[0] for row in arrays))[None]
        return getattr(self._dynamics, f"{name}_batch")(*arrays)

    def _powers(self, states):
        """Return the powers into K [W]."""
        nu, friction = states.nu, np.zeros(len(states.t))
        if self._dynamics.model.has_friction:
            friction = -_dot(states.qd, self._rows("friction_torque", states.qd))
        changes = np.empty((2, len(states.t)))
        for change, before, x in zip(changes, self._before, (states.t, states.K), strict=True):
            change[0], change[1:] = x[0] - before, x[1:] - x[:-1]
        self._before = states.t[-1], states.K[-1]
        step, change = changes
        return {
            "p_effort": np.nan if states.epsilon is None else _dot(nu, states.epsilon),
            "p_gravity": -_dot(nu, states.gravity),
            "p_friction": friction,
            "p_external": np.nan if np.ndim(states.residual) == 0 else _dot(nu, states.residual),
            "dK": np.where((step > 0.0) & (step <= GAP), change / step, np.nan),
        }

    def _link_energies(self, states):
        model = self._dynamics.model
        energies = np.empty((len(states.t), len(model.link_names)))
        q, qd = (np.ascontiguousarray(x, dtype=float) for x in (states.q, states.qd))
        if not sweeps.link_energies(model.bodies, model.links, q, qd, energies):
            energies[:] = np.nan
        return energies


def _flags(states, same_model):
    is_set = {
        "velocity_estimated": states.velocity_estimated,
        "effort_missing": states.effort is None or np.isnan(states.effort).any(axis=1),
        "no_external_torque": np.isnan(states.norm),
        "collision": states.collision,
        "late": np.greater(states.latency, MAX_DELAY),
        "receive_time": states.receive_time,
        "other_model": ~same_model,
    }
    return sum(CAUSES[name] * flag for name, flag in is_set.items())


def _coriolis_work(nu, coriolis):
    """Return |νᵀC| relative to |ν||C|: zero but for rounding, NaN at rest. In doubles: floats would hide it."""
    return np.abs(_dot(nu, coriolis)) / (np.linalg.norm(nu, axis=1) * np.linalg.norm(coriolis, axis=1))


def _dot(a, b):
    """Return the scalar product of each pair of rows."""
    return np.asarray(np.einsum("tk,tk->t", a, b))
