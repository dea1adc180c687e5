# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mobilities of links, and what contact at their points could transfer."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from diag_dynamics import batch, sweeps
from diag_dynamics.arrays import Array, Frame, MatrixLike, PointLike, VectorLike
from diag_dynamics.checks import unit
from diag_dynamics.contact.impact import Impact, impact
from diag_dynamics.contact.points import ContactPoint, ContactPoints
from diag_dynamics.contact.results import Contact
from diag_dynamics.dynamics.many_states import ManyStates, threads_of
from diag_dynamics.exceptions import InputError


class Contacts(ManyStates):
    """The methods of DiagonalDynamics that are about contact. All they say is advisory: nothing here is safety-rated."""

    _frames: Any = None

    def mobilities(self, q: VectorLike) -> Array:
        """Υ = J M⁻¹Jᵀ of every link at its origin, in its axes, shape (links, 6, 6), linear part first; one sweep, O(N).

        In the order of ``model.link_names``; blocks [1/kg], [1/(kg m)], [1/(kg m²)]. A wrench h on the link, at its origin,
        gives it the twist Υ h per unit of time, and 1/hᵀΥh is the mass it meets; zero of links that nothing moves. That of
        any other point, or of one link alone, is :meth:`operational_inverse_inertia`.
        """
        if self._frames is None:
            self._frames = _frames(self.model)
        result = np.empty((len(self._frames), 6, 6))
        q = self._positions(q)
        self._checked(sweeps.mobilities(self._robot, q, self._frames, result), q)
        return result

    def contact(self, q: VectorLike, qd: VectorLike, points: ContactPoints | Iterable[ContactPoint]) -> Contact:
        """What contact at points could transfer: speed, reflected mass, energy ½(ŵᵀν)², force, allowed speed; O(N).

        Rotors count with their armature, that of joints that are rigid. It is the safe side: they make the reflected mass
        larger, and what stands between them and the link is stiffer than a body.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Positions.
        qd : array_like, shape (nv,)
            Rates.
        points : ContactPoints
            Or an iterable of :class:`ContactPoint`, of which one is made at every call.

        Raises
        ------
        InputError
            `points` are of another robot, or not such.
        """
        at = self._points(points)
        q, qd = self._positions(q), self._vector("qd", qd)
        nu, results = np.empty(self._nv), np.empty((len(at), sweeps.CONTACT_COLUMNS))
        self._checked(sweeps.contacts(self._robot, at.table, q, qd, nu, results), q, qd=qd)
        return Contact(at, nu, results)

    def contact_batch(
        self,
        Q: MatrixLike,
        QD: MatrixLike,
        points: ContactPoints | Iterable[ContactPoint],
        *,
        threads: int | None = None,
    ) -> Contact:
        """:meth:`contact` at many states, on all cores; each array of the result has a row for each state.

        Parameters
        ----------
        Q, QD : array_like, shape (T, nq) and (T, nv)
            Positions and rates.
        points : ContactPoints
        threads : int, optional
            How many to use, by default as many as there are processors for this process.

        Raises
        ------
        InputError, SingularMassMatrixError
            As :meth:`contact`, naming the first state that fails.
        """
        at, number = self._points(points), threads_of(threads)
        states, rates = self._states(Q=Q, QD=QD)
        nu, results = np.empty((len(states), self._nv)), np.empty((len(states), len(at), sweeps.CONTACT_COLUMNS))

        def sweep(robot: int, first: int, last: int) -> int:
            return sweeps.contacts_each(robot, at.table, states, rates, first, last, nu, results)

        failing = batch.in_pieces(self._workspaces, len(states), sweep, number)
        self._refuse_state(failing, lambda t: self.contact(states[t], rates[t], at))
        return Contact(at, nu, results)

    def impact(
        self,
        q: VectorLike,
        qd: VectorLike,
        link: str,
        direction: VectorLike,
        point: PointLike = (0.0, 0.0, 0.0),
        frame: Frame = "link",
        *,
        mass: float = math.inf,
        restitution: float = 0.0,
    ) -> Impact:
        """ν⁺ = ν − (1+e) μ v_u ℓJᵀu of an impact with a mass at rest, along u at a point of a link; O(N).

        Parameters
        ----------
        q, qd : array_like
            State before it.
        link : str
            Name of the link.
        direction : array_like, shape (3,)
            Any vector along u, from the link to what it meets, in the axes that `frame` says.
        point : array_like, shape (3,)
            From the link's origin in the link's axes [m].
        frame : {"link", "world"}
            Axes of the direction.
        mass : float
            m_H [kg] of what it meets, free to move; inf if it is clamped.
        restitution : float
            e: 0 if both go on together, 1 if no energy is lost.

        Raises
        ------
        InputError
            No such link, or a number is wrong.
        """
        u = unit("direction", direction)
        w = self.epsilon_from_wrench(q, link, np.concatenate([u, np.zeros(3)]), point, frame)
        after = impact(self.nu_from_qd(q, qd), w, mass, restitution)
        return after._replace(qd_after=self.qd_from_nu(q, after.nu_after))

    def _points(self, points: ContactPoints | Iterable[ContactPoint]) -> ContactPoints:
        if not isinstance(points, ContactPoints):
            return ContactPoints(self.model, points)
        own, other = self.model, points.model
        if own is not other and (own.link_names, own.dof_names) != (other.link_names, other.dof_names):
            raise InputError(f"points are of robot '{other.name}', not of '{own.name}'.")
        return points


def _frames(model: Any) -> Any:
    """Frames of all links, as sweeps take them."""
    frames = np.zeros(len(model.link_names), sweeps.FRAME)
    for k, link in enumerate(model.link_names):
        body, X = model.placement_in_body(link)
        frames[k] = body, np.array_equal(X, np.eye(4)), X[:3, :3].ravel(), X[:3, 3]
    return frames
