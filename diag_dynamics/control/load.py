# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Live estimate of a load from the external torque, and whether the torque is that of a load."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import instance, number, positive, vector
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.dynamics.noise import whitening
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import Payload
from diag_dynamics.rigid_body import RigidBody
from diag_dynamics.sweeps.mobilities import FRAME
from diag_dynamics.sweeps.regressors import LOAD, load_columns

PRIOR = 3.0, 0.3  # standard deviations of mass [kg] and first moment [kg m] without any state
MODEL_ERRORS = 5.0  # number of states that count as one beside those within the observer's memory
MIN_ENERGY = 2.0  # of m r in that of its noise: below it there is nothing to explain
MIN_SIGNIFICANCE = 2.0  # mass of a load in standard deviations
MAX_REST = (
    0.1  # fraction of a payload that counts as none once it is put down: its own mass has an error
)
MAX_DISTANCE = 0.4  # of the centre of a load from the link's origin [m]
MEMORY, HOLD = (
    0.5,
    0.6,
)  # time constant of weights; time that the conditions of a load must hold [s]
MIN_EXPLAINED = 0.8  # of the energy of m r beyond its noise


class Load(NamedTuple):
    """Result of the estimator for one state.

    It is a point-like body on the link, beside the payload of the model. The mass is negative if (a
    part of) that payload has been put down.
    """

    valid: bool  # False for the first state and after a reset
    reason: str  # why there is no result; empty otherwise
    mass: float = 0.0  # [kg]
    center: Array = np.zeros(
        3
    )  # centre of mass in the link's axes [m], shape (3,); 0 if the mass is not significant
    covariance: Array = (
        np.diag([PRIOR[0], *3 * [PRIOR[1]]]) ** 2
    )  # of mass and first moment [kg, kg m], shape (4, 4)
    explained: float = (
        0.0  # fraction of the weighted energy of m r beyond its noise that the load explains
    )
    is_load: bool = False  # whether m r has been that of a load for the hold time

    @property
    def mass_deviation(self) -> float:
        """Standard deviation of the mass [kg]."""
        return math.sqrt(self.covariance[0, 0])

    @property
    def is_significant(self) -> bool:
        """Whether the mass is beyond two standard deviations."""
        return abs(self.mass) > MIN_SIGNIFICANCE * self.mass_deviation

    @property
    def center_deviation(self) -> Array:
        """Standard deviations of the centre [m], shape (3,); inf if the mass is not significant."""
        if not self.is_significant:
            return np.full(3, np.inf)
        J = np.column_stack([-self.center, np.eye(3)]) / self.mass
        deviation: Array = np.sqrt(np.diag(J @ self.covariance @ J.T))
        return deviation


class LoadEstimator:
    """Recursive least squares of mass and first moment of a load on a link.

    The input is the external torque m r of an observer.

    The torque of a load π = (m, mc) on the robot is −[d/dt(Y_p π) + (Y_g − Y_∂)π], linear in π. The
    estimator filters these columns as the observer filters the external torque, without
    accelerations:

        m r = −Φπ,   Φ = K_O(Y_p − F Y_p) + F(Y_g − Y_∂),   F = K_O/(s + K_O)

    The weight of older states decays with the time constant MEMORY. The noise of m r is
    correlated over 1/K_O, and errors of the model longer. Therefore a state counts dt·K_O/10.

    `is_load` is set after HOLD seconds with all of these: the load explains MIN_EXPLAINED of
    the energy of m r beyond its noise, this energy is above twice that of the noise, the mass is
    above two standard deviations, and the centre is within 0.4 m of the link's origin. It begins
    only in a state where the load explains more of m r than any constant joint torque. At rest Φ is
    constant, so that no load does: move the arm. It lasts at rest. A downward force on one point of
    a moving link is like a weight; after HOLD it may count as a load. Use an estimator in one
    thread.

    Parameters
    ----------
    dynamics : DiagonalDynamics
        The observer's.
    link : str
        Link that carries the load.
    gain : float
        K_O of the observer [1/s].
    covariance : array_like, shape (nv, nv)
        Second moment of m r without contact [N m, N of prismatic joints], of :func:`calibrate`.
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        link: str,
        gain: float,
        covariance: MatrixLike,
    ) -> None:
        instance("dynamics", dynamics, DiagonalDynamics)
        self.link = link
        self.gain = positive("gain", gain, "[1/s]")
        nv = dynamics.model.nv
        self._whitening = np.ascontiguousarray(whitening(dynamics.model, covariance))
        self._prior = np.diag(np.r_[PRIOR[0], 3 * [PRIOR[1]]] ** -2.0)
        self._columns = np.zeros((2, nv, LOAD))  # Y_p and Y_g − Y_∂ of the last state
        self._filtered = np.zeros((nv, LOAD))  # Φ
        self._time: float | None = None
        load_columns.compile()
        self.dynamics = dynamics
        self.reset()
        self.use(dynamics)

    def use(self, dynamics: DiagonalDynamics) -> None:
        """Use another model of the same degrees of freedom.

        Reset unless it differs in gravity alone.
        """
        body, placement = dynamics.model.placement_in_body(self.link)
        if body == 0:
            raise InputError(f"link is '{self.link}'; expected a link that a joint moves.")
        before = self.dynamics
        self.dynamics = dynamics
        self._frames = np.zeros(1, FRAME)
        self._frames["body"] = body
        self._frames["rotation"] = placement[:3, :3].ravel()
        self._frames["translation"] = placement[:3, 3]
        self._workspace = dynamics.model.new_workspace()
        if dynamics.model.bodies is not before.model.bodies:
            self._time = None
            self.reset()

    def reset(self) -> None:
        """Reset the estimate. If the observer restarts, too, its next result is None."""
        self._since = math.inf  # time from which on the conditions hold
        self._information = np.zeros((LOAD + 1, LOAD + 1))  # of [π, m r]
        self._solve()
        self._count = 0.0
        self._constant = np.zeros(self.dynamics.model.nv)
        self._energy = 0.0
        self.last = Load(False, "no state since the reset")

    def update(
        self, time: float, q: VectorLike, qd: VectorLike, external_torque: VectorLike | None
    ) -> Load:
        """Update the estimate by a state and the observer's result for it.

        Parameters
        ----------
        time : float
            [s]; a time before the last one resets, a state at the last time is ignored.
        q, qd : array_like, shapes (nq,) and (nv,)
            Positions and rates.
        external_torque : array_like, shape (nv,), or None
            m r [N m, N]. None resets: the observer has restarted at this state. Do not pass states
            that it has skipped.
        """
        time = number("time", time, "a finite number [s]")
        model = self.dynamics.model
        q = vector("q", q, model.coordinate_names)
        qd = vector("qd", qd, model.dof_names)
        if external_torque is None or self._time is None or time < self._time:
            reason = "the observer has no result" if external_torque is None else "first state"
            self.reset()
            interval = 0.0
            torque = np.zeros(model.nv)
            self._response = 0.0
            self.last = Load(False, reason)
        else:
            interval = time - self._time
            torque = vector("external_torque", external_torque, model.dof_names)
            if interval == 0.0:
                return self.last
        weight = min(1.0, 0.5 * self.gain * interval) / MODEL_ERRORS
        columns = np.zeros_like(self._columns)
        status = load_columns(self._workspace.robot, q, qd, self._frames, *columns)
        with np.errstate(over="ignore", invalid="ignore"):
            if interval:
                self._add_state(columns, torque, interval, weight)
            else:
                self._filtered[:] = 0.0
            self._solve()
        if status or not math.isfinite(self._unexplained):
            self._time = None
            self.reset()
            raise InputError("q, qd or external_torque is too large: the estimate overflows.")
        self._columns = columns
        self._time = time
        self._add_constant(torque, interval, weight)
        if interval:
            self.last = self._result(time)
        return self.last

    def _add_state(self, columns: Array, torque: Array, interval: float, weight: float) -> None:
        """Add a state to the least squares m r = −Φπ, by the columns Y_p and Y_g − Y_∂.

        The observer spreads their mean over the interval. The information decays.
        """
        change = (columns[0] - self._columns[0]) / interval
        mean = change + 0.5 * (self._columns[1] + columns[1])
        self._filtered -= math.expm1(-self.gain * interval) * (mean - self._filtered)
        rows = self._whitening @ np.column_stack([-self._filtered, torque])
        self._information *= math.exp(-interval / MEMORY)
        self._information += weight * (rows.T @ rows)

    def _solve(self) -> None:
        """Compute the estimate, its covariance and the energy that it leaves of the information."""
        along = self._information[:LOAD, LOAD]
        self._covariance = np.linalg.inv(self._information[:LOAD, :LOAD] + self._prior)
        self._estimate = self._covariance @ along
        self._unexplained = float(self._information[LOAD, LOAD] - self._estimate @ along)

    def _add_constant(self, torque: Array, interval: float, weight: float) -> None:
        """Add a state to the least squares of a constant torque.

        The low-pass of this torque from the restart on is `_response`.
        """
        decay = math.exp(-interval / MEMORY)
        self._response -= math.expm1(-self.gain * interval) * (1.0 - self._response)
        self._count = self._count * decay + weight
        self._energy = self._energy * decay + weight * self._response**2
        self._constant = self._constant * decay + weight * self._response * (
            self._whitening @ torque
        )

    def _is_moved(self) -> bool:
        """Return whether the load leaves less energy of m r than the best constant torque."""
        energy = (
            self._information[LOAD, LOAD] - float(self._constant @ self._constant) / self._energy
        )
        return bool(self._unexplained < energy)

    def _result(self, time: float) -> Load:
        energy = float(self._information[LOAD, LOAD])
        mass = float(self._estimate[0])
        covariance = self._covariance
        noise = len(self._whitening) * self._count
        unexplained = max(0.0, self._unexplained - noise)
        explained = 1.0 - unexplained / (energy - noise) if energy > noise else 0.0
        load = Load(True, "", mass, np.zeros(3), covariance, explained)
        if load.is_significant:
            load = load._replace(center=self._estimate[1:] / mass)
        holds = (
            load.is_significant
            and self._known().mass + load.mass > -self._uncertain(load)
            and explained >= MIN_EXPLAINED
            and energy > MIN_ENERGY * noise
            and float(load.center @ load.center) < MAX_DISTANCE**2
        )
        self._since = min(self._since, time) if holds else math.inf
        return load._replace(
            is_load=time - self._since >= HOLD and (self.last.is_load or self._is_moved())
        )

    @property
    def torque(self) -> Array:
        """External torque of the estimated load at the last state, −Φπ [N m, N], shape (nv,)."""
        torque: Array = -self._filtered @ self._estimate
        return torque

    def _known(self) -> Payload:
        return self.dynamics.model.payloads.get(self.link, Payload(0.0))

    def _uncertain(self, load: Load) -> float:
        """Mass of the payload with the load below which it may be none [kg]."""
        return MIN_SIGNIFICANCE * load.mass_deviation + MAX_REST * self._known().mass

    def payload(self) -> Payload:
        """Return the payload of the model with the estimated load, a point at its centre.

        The mass is 0 if little remains.

        Raises
        ------
        InputError
            The mass of the estimate is not significant.
        """
        load = self.last
        payload = self._known()
        remaining = payload.mass + load.mass
        uncertain = self._uncertain(load)
        if not load.is_significant or remaining < -uncertain:
            estimate = (
                f"{load.mass:.3g} ± {load.mass_deviation:.2g} kg"
                if load.valid
                else f"unknown: {load.reason}"
            )
            raise InputError(
                f"load on link '{self.link}' is {estimate}; "
                "expected a mass above two standard deviations. Move the arm with the load."
            )
        if remaining < uncertain:
            return Payload(0.0)
        body = RigidBody(
            payload.mass, np.asarray(payload.com, float), np.asarray(payload.inertia, float)
        )
        union = RigidBody.union(body, RigidBody(load.mass, load.center, np.zeros((3, 3))))
        inertia = union.inertia if load.mass > 0.0 else body.inertia * (remaining / payload.mass)
        return Payload(union.mass, union.centre, inertia)
