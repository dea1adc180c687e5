# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Disturbance observer: external torque without accelerations, and its working moment ℓτ_ext."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, VectorLike
from diag_dynamics.checks import (
    check_finite,
    choice,
    instance,
    number,
    per_name,
    positive,
    vector,
)
from diag_dynamics.control.laws import Gain
from diag_dynamics.control.limiters import names_where
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps.evaluation import observe_samples


class Disturbance(NamedTuple):
    """Result of the observer for one sample. Arrays have shape (nv,) and are the caller's own."""

    valid: bool  # False for the first sample, after a reset, and without efforts
    reason: str  # why there is no result; empty otherwise
    residual: Array | None = None  # r, which follows ε_ext = ℓτ_ext [J^½/s]; None if not valid
    external_torque: Array | None = (
        None  # m r, which follows the external torque τ_ext [N m, N]; None if not valid
    )
    norm: float = 0.0  # |r| [J^½/s]; |r|² follows τ_extᵀM⁻¹τ_ext

    @property
    def is_whole(self) -> bool:
        """Whether there is a result of all joints."""
        return self.valid and not math.isnan(self.norm)

    @property
    def torque_norm(self) -> float:
        """‖m r‖ of all joints together [N m, N of prismatic joints]; 0 if not valid."""
        torque = self.external_torque
        return 0.0 if torque is None else math.sqrt(torque @ torque)


class DisturbanceObserver:
    """Observer of the external torque τ_ext, and of its working moment r = ℓτ_ext.

    The unit of |r|² is the same for all joints. The observer needs no acceleration. Each component
    of m r follows as a first-order filter, on a moving arm as well: (m r)˙ = K_O(τ_ext − m r), from
    ṗ = τ + τ_ext + C_sᵀq̇ − g − τ_fric with p = M q̇. In total joint rates this is ṙ = K_O(ε_ext −
    r) − ℓṁ r.

    The mean of τ_ext between two samples is the change of p over the interval, minus the mean of
    the other terms by the trapezoidal rule. The filter's response to it is exact: stable for any
    K_O dt, where an Euler step requires K_O dt < 0.5.

    The gain is K_O > 0 [1/s], one for all components or one for each. Efforts are "sampled" with
    the state, or "held" on the joints since the last sample, as a command is. The friction is that
    of the model, if any, without static friction, which remains in r:
    :meth:`DiagonalDynamics.friction_torque`. An interval of more than `max_gap` [s] resets. Use an
    observer in one thread.
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        gain: Gain,
        *,
        effort: Literal["sampled", "held"] = "sampled",
        friction: bool = True,
        max_gap: float = 0.1,
    ) -> None:
        instance("dynamics", dynamics, DiagonalDynamics)
        choice("effort", effort, ("sampled", "held"))
        self._dynamics = dynamics
        self._names = dynamics.model.dof_names
        self.gain = per_name("gain", gain, self._names, "a finite number > 0 [1/s]")
        self.max_gap = positive("max_gap", max_gap, "[s]")
        self._held = effort == "held"
        self._friction = bool(friction)
        self.reset()
        self.use(dynamics)

    def use(self, dynamics: DiagonalDynamics) -> None:
        """Use another model of the same degrees of freedom.

        Reset unless it differs in gravity alone.
        """
        if dynamics.model.dof_names != self._names:
            actual, expected = (
                ", ".join(names) for names in (dynamics.model.dof_names, self._names)
            )
            raise InputError(f"dynamics have the degrees of freedom {actual}; expected {expected}.")
        before = self._dynamics
        self._dynamics = dynamics
        dynamics.compile("momentum", "epsilon_from_tau")
        observe_samples.compile()
        if dynamics.model.bodies is not before.model.bodies:
            self.reset()

    def reset(self) -> None:
        """Reset r to zero; the next sample is the first one."""
        self._time: float | None = None  # of the last sample
        self._memory = np.zeros((4, len(self._names)))  # m r, and terms of the last sample
        self._last = Disturbance(False, "no sample since the reset")

    def update(
        self, time: float, q: VectorLike, qd: VectorLike, tau: VectorLike | None
    ) -> Disturbance:
        """Update r by a sample; after an InputError the observer is unchanged.

        A time before the last one, or more than `max_gap` after it, resets. A sample at the time of
        the last one is ignored. One without efforts counts as lost: the next one integrates over
        the gap.

        The sample is the time [s], positions [rad, m], shape (nq,), rates [rad/s, m/s], shape
        (nv,), and joint efforts [N m, N] with gravity, shape (nv,): nan where unknown, None if all
        are. m r of joints with unknown efforts is nan, and so are the components of r that these
        change; "held" efforts require all.
        """
        time = number("time", time, "a finite number [s]")
        if tau is None:
            return Disturbance(False, "no effort of any joint")
        q = vector("q", q, self._dynamics.model.coordinate_names)
        applied = vector("tau", tau, self._names, finite=False)
        unknown = np.isnan(applied)
        check_finite("tau", np.where(unknown, 0.0, applied), self._names)
        if unknown.any() and (unknown.all() or self._held):
            missing = ", ".join(f"'{name}'" for name in names_where(self._names, unknown))
            return Disturbance(False, f"no effort of {missing}")
        qd = vector("qd", qd, self._names)
        interval = 0.0 if self._time is None else time - self._time
        reason = ""
        if self._time is None:
            reason = "first sample"
        elif interval == 0.0:
            return self._last
        elif interval < 0.0:
            reason = f"time went back by {-interval:g} s"
        elif interval > self.max_gap:
            reason = f"no sample for {interval:g} s"
        dynamics = self._dynamics
        p, resisting = dynamics.momentum(q, qd)
        resisting = -resisting
        if self._friction and dynamics.model.has_friction:
            resisting += dynamics.friction_torque(qd, q)
        if reason:
            self.reset()
            interval = 0.0
        elif self._held:
            self._memory[3] = applied
        self._time = time
        torque = np.empty((1, len(applied)))
        norm = np.empty(1)
        terms = p[None], resisting[None], applied[None]
        observe_samples(self.gain, np.array([interval]), *terms, self._memory, torque, norm)
        if not math.isfinite(norm[0]):
            reason = "the residual was larger than any number"
        elif np.isnan(torque).all():
            reason = "no effort of any joint at both ends of the interval"
        self._last = Disturbance(False, reason) if reason else self._result(q, torque[0])
        return self._last

    def _result(self, q: Array, torque: Array) -> Disturbance:
        unknown = np.isnan(torque)
        r = self._dynamics.epsilon_from_tau(q, np.where(unknown, 0.0, torque))
        if unknown.any():
            r[unknown @ influence(self._dynamics)] = np.nan
        return Disturbance(True, "", r, torque, math.sqrt(r @ r))


def influence(dynamics: DiagonalDynamics) -> BoolArray:
    """Return which components of ε each joint's torque changes, bool (nv, nv), at any position."""
    nv = dynamics.model.nv
    q = np.tile(dynamics.model.random(0), (nv, 1))
    changes: BoolArray = dynamics.epsilon_from_tau(q, np.eye(nv)) != 0.0
    return changes
