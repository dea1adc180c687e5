# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Disturbance observer on total joint rates: external torque without the derivative of M."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, cast

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import array_of, choice, in_order, instance, number, per_name, positive, vector
from diag_dynamics.control.laws import Gain
from diag_dynamics.control.limits import names_where
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError


class Disturbance(NamedTuple):
    """Result of the observer for one sample. Arrays have shape (nv,) and are the caller's own."""

    valid: bool  # False for the first sample, after a reset, and without efforts
    reason: str  # why there is no result; empty otherwise
    residual: Array | None = None  # r, which follows ε_ext = ℓτ_ext [J^½/s]; None if not valid
    external_torque: Array | None = None  # m r, which follows the external torque τ_ext [N m, N]; None if not valid
    norm: float = 0.0  # |r| [J^½/s]; |r|² follows τ_extᵀM⁻¹τ_ext
    collision: bool = False  # whether the norm has exceeded the threshold, and not fallen below `release` since

    @property
    def torque_norm(self) -> float:
        """‖m r‖ of all joints together [N m, N of prismatic joints]; 0 if not valid."""
        torque = self.external_torque
        return 0.0 if torque is None else math.sqrt(torque @ torque)


class _Sample(NamedTuple):
    time: float  # [s]
    q: Array
    nu: Array
    resisting: Array  # C + ε_g + ε_fric
    epsilon: Array


class DisturbanceObserver:
    """Observer ṙ = K_O(ε_ext − r) of working moments beyond ε = ℓτ, from r = K_O[ν − ν₀ − ∫(ε − C − ε_g − ε_fric + r)dt].

    It needs no acceleration and no derivative of M. Each component of r is a first-order filter of its own. |r|² has the same
    unit for all joints, so that one threshold serves them. A constant τ_ext on a moving arm is a varying ε_ext, which r
    follows with a lag of 1/K_O.

    The impulse of ε_ext between two samples is Δν − ∫(ε − C − ε_g − ε_fric)dt by the trapezoidal rule. r is the exact
    response to it spread evenly: stable for any K_O dt, where an Euler step needs K_O dt < 0.5.

    The gain is K_O > 0 [1/s], one for all components or one for each. `collision` is set above the threshold of |r| [J^½/s],
    by default never, and reset below `release`, by default half of it. Efforts are "sampled" with the state, or "held" on the
    joints since the last sample, as a command is. The friction is that of the model, if any, without static friction, which
    remains in r: :meth:`DiagonalDynamics.friction_torque`. An interval of more than `max_gap` [s] resets.
    Use an observer in one thread.
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        gain: Gain,
        threshold: float = math.inf,
        release: float | None = None,
        *,
        effort: Literal["sampled", "held"] = "sampled",
        friction: bool = True,
        max_gap: float = 0.1,
    ) -> None:
        instance("dynamics", dynamics, DiagonalDynamics)
        choice("effort", effort, ("sampled", "held"))
        self._dynamics, self._names = dynamics, dynamics.model.dof_names
        self.gain = per_name("gain", gain, self._names, "a finite number > 0 [1/s]")
        self.threshold = _threshold("threshold", threshold)
        self.release = 0.5 * self.threshold if release is None else _threshold("release", release)
        if self.release > self.threshold:
            raise InputError(f"release is {release!r} J^½/s, expected no more than the threshold, {threshold!r}.")
        self.max_gap = positive("max_gap", max_gap, "[s]")
        self._held, self._friction = effort == "held", bool(friction)
        self.reset()
        self.use(dynamics)

    def use(self, dynamics: DiagonalDynamics) -> None:
        """Use another model of the same degrees of freedom, and reset unless it differs in gravity alone."""
        if dynamics.model.dof_names != self._names:
            others, own = (", ".join(names) for names in (dynamics.model.dof_names, self._names))
            raise InputError(f"dynamics have the degrees of freedom {others}, expected {own}.")
        before, self._dynamics = self._dynamics, dynamics
        dynamics.compile("evaluate", "tau_from_epsilon", "epsilon_from_tau")
        if dynamics.model.bodies is not before.model.bodies:
            self.reset()

    def reset(self) -> None:
        """Reset r to zero; the next sample is the first one."""
        self._sample: _Sample | None = None
        self._residual: Array = np.zeros(len(self._names))
        self._collision = False
        self._last = Disturbance(False, "no sample since the reset")

    def update(self, time: float, q: VectorLike, qd: VectorLike, tau: VectorLike | None) -> Disturbance:
        """Update r by a sample; after an InputError the observer is unchanged.

        A time before the last one, or more than `max_gap` after it, resets. A sample at the time of the last one is ignored.
        One without efforts counts as lost: the next one integrates over the gap.

        The sample is the time [s], positions [rad, m], shape (nq,), rates [rad/s, m/s], shape (nv,), and joint efforts
        [N m, N] with gravity, shape (nv,): nan where unknown, None if all are.
        """
        time = number("time", time, "a finite number [s]")
        if tau is None:
            return Disturbance(False, "no effort of any joint")
        q = vector("q", q, self._dynamics.model.coordinate_names)
        effort = in_order("tau", tau, self._names)
        known = array_of(effort)
        if known is not None and known.shape == (len(self._names),) and np.isnan(known).any():
            missing = ", ".join(f"'{name}'" for name in names_where(self._names, np.isnan(known)))
            return Disturbance(False, f"no effort of {missing}")
        before = self._sample
        interval = 0.0 if before is None else time - before.time
        if before and interval == 0.0:
            return self._last
        dynamics = self._dynamics
        s = dynamics.evaluate(q, qd, effort, friction=self._friction and dynamics.model.has_friction)
        resisting, applied = s.coriolis + s.gravity, cast(Array, s.epsilon)  # there are efforts
        resisting += 0.0 if s.friction is None else s.friction
        reason = "" if before else "first sample"
        if interval < 0.0:
            reason = f"time went back by {-interval:g} s"
        elif interval > self.max_gap:
            reason = f"no sample for {interval:g} s"
        if before is None or reason:
            self.reset()
            self._last = Disturbance(False, reason)
        else:
            epsilon = dynamics.epsilon_from_tau(before.q, effort) if self._held else before.epsilon
            mean = 0.5 * (epsilon + applied - before.resisting - resisting)
            external = (s.nu - before.nu) / interval - mean
            self._residual = self._residual - np.expm1(-self.gain * interval) * (external - self._residual)
            self._last = self._result(q)
        self._sample = _Sample(time, q, s.nu, resisting, applied)
        return self._last

    def _result(self, q: Array) -> Disturbance:
        r = self._residual
        with np.errstate(over="ignore", invalid="ignore"):
            norm = math.sqrt(r @ r)
        if not math.isfinite(norm):  # an overflow does not recover
            self.reset()
            return Disturbance(False, "the residual was larger than any number")
        self._collision = norm >= self.release if self._collision else norm > self.threshold
        return Disturbance(True, "", r.copy(), self._dynamics.tau_from_epsilon(q, r), norm, self._collision)


def _threshold(name: str, value: float) -> float:
    """Return a positive number, or inf."""
    return np.inf if value == np.inf else positive(name, value, "[J^½/s]")
