# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Links: their placements, Jacobians and motions, and what wrenches on them do."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.arrays import Array, Frame, PointLike, VectorLike
from diag_dynamics.checks import numbers, unit
from diag_dynamics.dynamics.sweeping import Sweeping
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.wrenches import wrenches_at

ROUNDING = 4e-15
"""What ℓJᵀu may be of the entries of ℓJᵀ, for each degree of freedom, and still be nothing but rounding."""


class Links(Sweeping):
    """The methods of DiagonalDynamics that are about a link."""

    def placement(self, q: VectorLike, link: str) -> Array:
        """Placement of a link's frame in the world, shape (4, 4): its axes, and in the last column its origin [m].

        Raises
        ------
        InputError
            No such link.
        """
        body, in_body = self.model.placement_in_body(link)
        result = np.zeros((4, 4))
        result[3, 3] = 1.0
        q = self._positions(q)
        self._checked(sweeps.placement(self._robot, q, body, result[:3]), q)
        return result @ in_body

    def jacobian(self, q: VectorLike, link: str, point: PointLike = (0.0, 0.0, 0.0), *, frame: Frame = "link") -> Array:
        """J of a point of a link, shape (6, nv): linear rows [m, 1] first, then angular ones [1, 1/m]; O(N).

        J q̇ is :meth:`link_velocity`.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Positions.
        link : str
            Name of the link.
        point : array_like, shape (3,)
            From the link's origin in the link's axes [m].
        frame : {"link", "world"}
            Axes of the rows: Pinocchio's LOCAL, or its LOCAL_WORLD_ALIGNED.

        Raises
        ------
        InputError
            No such link, or numbers that are not finite or of the wrong shape.
        """
        body, in_body = self._point(link, point, frame)
        q, J = self._positions(q), np.empty((6, self.model.nv))
        self._checked(sweeps.jacobian(self._robot, q, body, in_body[:3, 3].copy(), J), q)
        return _turned(self._axes(q, body, in_body, frame), J)

    def link_velocity(
        self,
        q: VectorLike,
        qd: VectorLike,
        link: str,
        point: PointLike = (0.0, 0.0, 0.0),
        *,
        frame: Frame = "link",
    ) -> Array:
        """Velocity of a point of a link [m/s] and of its rotation [rad/s], shape (6,), linear first: J q̇, in O(N).

        Arguments and errors are those of :meth:`jacobian`.
        """
        twist, _, turn = self._motion(q, qd, self._zero, link, point, frame)
        return _turned(turn, twist)

    def link_acceleration(
        self,
        q: VectorLike,
        qd: VectorLike,
        qdd: VectorLike,
        link: str,
        point: PointLike = (0.0, 0.0, 0.0),
        *,
        frame: Frame = "link",
        spatial: bool = False,
    ) -> Array:
        """Acceleration of a point of a link [m/s²] and of its rotation [rad/s²], shape (6,), linear first, in O(N).

        Without gravity: what an accelerometer shows has −g besides. It is the second derivative of the point's place,
        Pinocchio's getFrameClassicalAcceleration, in the axes that `frame` says.

        Parameters
        ----------
        spatial : bool
            Whether to return the spatial acceleration instead, the rate of the twist's components in the link's own axes,
            Pinocchio's getFrameAcceleration: less ω × v.
        q, qd, link, point, frame
            As of :meth:`jacobian`; qdd are accelerations [rad/s², m/s²].
        """
        twist, rate, turn = self._motion(q, qd, qdd, link, point, frame)
        if not spatial:
            rate[:3] += np.cross(twist[3:], twist[:3])
        return _turned(turn, rate)

    def _point(self, link: str, point: PointLike, frame: Frame) -> tuple[int, Array]:
        """Body of a link, and the placement in it of axes parallel to the link's at a point of the link."""
        check_frame(frame)
        at = numbers("point", point, (3,), "three finite numbers [m]")
        body, placement = self.model.placement_in_body(link)
        in_body = placement.copy()
        in_body[:3, 3] += placement[:3, :3] @ at
        return body, in_body

    def _axes(self, q: Array, body: int, in_body: Array, frame: Frame) -> Array:
        """Rotation that takes components in a body's axes to those that `frame` says."""
        if frame == "link":
            return in_body[:3, :3].T
        X = np.empty((3, 4))
        self._checked(sweeps.placement(self._robot, q, body, X), q)
        return X[:, :3]

    def _motion(
        self, q: VectorLike, qd: VectorLike, qdd: VectorLike, link: str, point: PointLike, frame: Frame
    ) -> tuple[Array, Array, Array]:
        """Twist and its rate at a point of a link, in the body's axes, and the rotation to those that `frame` says."""
        body, in_body = self._point(link, point, frame)
        q, qd, qdd = self._positions(q), self._vector("qd", qd), self._vector("qdd", qdd)
        found = np.empty((2, 6))
        self._checked(sweeps.motion(self._robot, q, qd, qdd, body, found), q, qd=qd, qdd=qdd)
        for V in found:
            V[:3] += np.cross(V[3:], in_body[:3, 3])
        return found[0], found[1], self._axes(q, body, in_body, frame)

    def wrench_factor(
        self, q: VectorLike, link: str, point: PointLike = (0.0, 0.0, 0.0), frame: Frame = "link"
    ) -> Array:
        """ℓJᵀ, shape (nv, 6): what unit wrenches at a point of a link add to ε, a column each; O(N).

        Parameters
        ----------
        q : array_like, shape (nq,)
            Positions.
        link : str
            Name of the link.
        point : array_like, shape (3,)
            Where the wrench acts, from the link's origin in the link's axes [m].
        frame : {"link", "world"}
            Axes of the wrench, force (x, y, z) [J^½/(s N)] first, then moment [J^½/(s N m)].

        Raises
        ------
        InputError
            No such link, or numbers that are not finite or of the wrong shape.
        """
        return self._factor_of_wrenches(q, link, np.eye(6), point, frame)

    def epsilon_from_wrench(
        self,
        q: VectorLike,
        link: str,
        wrench: VectorLike,
        point: PointLike = (0.0, 0.0, 0.0),
        frame: Frame = "link",
    ) -> Array:
        """ℓJᵀw [J^½/s], shape (nv,), of one wrench, force [N] then moment [N m]; else as :meth:`wrench_factor`."""
        w = numbers("wrench", wrench, (6,), "six finite numbers, force [N] then moment [N m]")
        return self._factor_of_wrenches(q, link, w[None], point, frame)[:, 0]

    def operational_inverse_inertia(
        self, q: VectorLike, link: str, point: PointLike = (0.0, 0.0, 0.0), frame: Frame = "link"
    ) -> Array:
        """J M⁻¹ Jᵀ = (ℓJᵀ)ᵀ(ℓJᵀ), shape (6, 6): how a wrench at a point of a link accelerates it; M is not formed.

        Blocks [1/kg], [1/(kg m)] and [1/(kg m²)]; arguments as of :meth:`wrench_factor`.
        """
        factor = self.wrench_factor(q, link, point, frame)
        return _squared(factor, point)

    def reflected_mass(
        self,
        q: VectorLike,
        link: str,
        direction: VectorLike,
        point: PointLike = (0.0, 0.0, 0.0),
        frame: Frame = "link",
    ) -> float:
        """1/|ℓJᵀu|² [kg]: the mass that a push along u at a point of a link meets.

        It is inf where the point cannot move that way, or moves no more than rounding would have it.

        Parameters
        ----------
        direction : array_like, shape (3,)
            Any vector along u, in the axes that `frame` says.
        q, link, point, frame
            As of :meth:`wrench_factor`.

        Raises
        ------
        InputError
            As there, or the direction is zero.
        """
        u = unit("direction", direction)
        factor = self.wrench_factor(q, link, point, frame)
        w = factor[:, :3] @ u
        if np.abs(w).max(initial=0.0) <= ROUNDING * max(self.model.nv, 3) * np.abs(factor).max(initial=0.0):
            return math.inf
        return 1.0 / float(_squared(w, point))

    def _factor_of_wrenches(self, q: VectorLike, link: str, wrenches: Array, point: PointLike, frame: Frame) -> Array:
        """ℓJᵀw of wrenches, shape (number, 6), at a point of a link, a column each."""
        records = wrenches_at(self.model, link, wrenches, point, frame)
        q, epsilon = self._positions(q), np.empty((self.model.nv, len(records)))
        self._checked(sweeps.factor_of_wrenches(self._robot, q, records, frame == "world", epsilon), q)
        if not np.isfinite(epsilon).all():
            raise InputError(f"point {list(point)} or the wrench are too large: a result overflows.")
        return epsilon


def _turned(rotation: Array, V: Array) -> Array:
    """Linear and angular rows, turned by a rotation."""
    return np.concatenate([rotation @ V[:3], rotation @ V[3:]])


def _squared(factor: Array, point: PointLike) -> Any:
    """FᵀF of what belongs to a point of a link, refused if it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = factor.T @ factor
    if not np.isfinite(square).all():
        raise InputError(f"point {list(point)} is too far away: a result overflows.")
    return square


def check_frame(frame: str) -> None:
    """Refuse axes that there are none of."""
    if frame not in ("link", "world"):
        raise InputError(f"frame is {frame!r}, expected 'link' or 'world'.")
