# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Jacobians, motions and wrenches of links, and contact at their points."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, Frame, PointLike, VectorLike
from diag_dynamics.checks import numbers
from diag_dynamics.contact.points import ContactPoint, ContactPoints
from diag_dynamics.contact.results import Contact
from diag_dynamics.dynamics.arguments import check_frame
from diag_dynamics.dynamics.calls import States, SweepCaller
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.wrenches import wrenches_at
from diag_dynamics.sweeps import contacts, factorization, kinematics, mobilities

ROUNDING = 4e-15
"""Maximum of ℓJᵀu by rounding, as a fraction of the entries of ℓJᵀ, per degree of freedom."""


def jacobian(caller: SweepCaller, q: VectorLike, link: str, point: PointLike, frame: Frame) -> Array:
    """Return J of a point of a link, shape (6, nv)."""
    body, in_body = _point_in_body(caller.model, link, point, frame)
    q, J = caller.positions(q), np.empty((6, caller.nv))
    caller.check(kinematics.jacobian(caller.robot, q, body, in_body[:3, 3].copy(), J), q)
    return rotate(_axes(caller, q, body, in_body, frame), J)


def motion(
    caller: SweepCaller,
    q: VectorLike,
    qd: VectorLike,
    qdd: VectorLike,
    link: str,
    point: PointLike,
    frame: Frame,
) -> tuple[Array, Array, Array]:
    """Return twist and its rate at a point of a link, in the body's axes, and the rotation to those of `frame`."""
    body, in_body = _point_in_body(caller.model, link, point, frame)
    at, found = caller.one(q, qd=qd, qdd=qdd), np.empty((2, 6))
    caller.check(kinematics.motion(caller.robot, at.q, *at.vectors.values(), body, found), at.q, **at.vectors)
    for V in found:
        V[:3] += np.cross(V[3:], in_body[:3, 3])
    return found[0], found[1], _axes(caller, at.q, body, in_body, frame)


def _point_in_body(model: RobotModel, link: str, point: PointLike, frame: Frame) -> tuple[int, Array]:
    """Return the body of a link, and the placement in it of axes parallel to the link's at a point of the link."""
    check_frame(frame)
    offset = numbers("point", point, (3,), "three finite numbers [m]")
    body, placement = model.placement_in_body(link)
    in_body = placement.copy()
    in_body[:3, 3] += placement[:3, :3] @ offset
    return body, in_body


def _axes(caller: SweepCaller, q: Array, body: int, in_body: Array, frame: Frame) -> Array:
    """Return the rotation from a body's axes to those of `frame`."""
    if frame == "link":
        return in_body[:3, :3].T
    X = np.empty((3, 4))
    caller.check(kinematics.placement(caller.robot, q, body, X), q)
    return X[:, :3]


def rotate(rotation: Array, V: Array) -> Array:
    """Rotate linear and angular rows."""
    return np.concatenate([rotation @ V[:3], rotation @ V[3:]])


def wrench_factor(
    caller: SweepCaller, q: VectorLike, link: str, wrenches: Array, point: PointLike, frame: Frame
) -> Array:
    """Return ℓJᵀw of wrenches, shape (number, 6), at a point of a link, one column each."""
    records = wrenches_at(caller.model, link, wrenches, point, frame)
    q, epsilon = caller.positions(q), np.empty((caller.nv, len(records)))
    caller.check(factorization.factor_of_wrenches(caller.robot, q, records, frame == "world", epsilon), q)
    if not np.isfinite(epsilon).all():
        raise InputError(f"point {list(point)} or the wrench are too large: a result overflows.")
    return epsilon


def squared(factor: Array, point: PointLike) -> Any:
    """Return FᵀF of a factor at a point of a link, unless it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = factor.T @ factor
    if not np.isfinite(square).all():
        raise InputError(f"point {list(point)} is too far away: a result overflows.")
    return square


def reflected_mass(factor: Array, u: Array, point: PointLike) -> float:
    """Return 1/|ℓJᵀu|² of the factor ℓJᵀ at a point; inf if ℓJᵀu is nothing but rounding."""
    w = factor[:, :3] @ u
    if np.abs(w).max(initial=0.0) <= ROUNDING * max(len(w), 3) * np.abs(factor).max(initial=0.0):
        return math.inf
    return 1.0 / float(squared(w, point))


def frames(model: RobotModel) -> Any:
    """Return the frames of all links as records for mobilities.mobilities."""
    records = np.zeros(len(model.link_names), mobilities.FRAME)
    for k, link in enumerate(model.link_names):
        body, X = model.placement_in_body(link)
        records[k] = body, np.array_equal(X, np.eye(4)), X[:3, :3].ravel(), X[:3, 3]
    return records


def contact(caller: SweepCaller, states: States, points: ContactPoints | Iterable[ContactPoint]) -> Contact:
    """Return contact quantities at one state, or at many with one row each."""
    points = _checked_points(caller.model, points)
    if not states.threads:
        return _contact_at(caller, states, points)
    Q, QD = states.q, states.vectors["qd"]
    nu, results = np.empty((len(Q), caller.nv)), np.empty((len(Q), len(points), contacts.CONTACT_COLUMNS))

    def sweep(robot: int, first: int, last: int) -> int:
        return contacts.contacts_each(robot, points.table, Q, QD, first, last, nu, results)

    caller.run_chunks(sweep, len(Q), states.threads, lambda t: _contact_at(caller, states.at(t), points))
    return Contact(points, nu, results)


def _contact_at(caller: SweepCaller, state: States, points: ContactPoints) -> Contact:
    nu, results = np.empty(caller.nv), np.empty((len(points), contacts.CONTACT_COLUMNS))
    status = contacts.contacts(caller.robot, points.table, state.q, state.vectors["qd"], nu, results)
    caller.check(status, state.q, **state.vectors)
    return Contact(points, nu, results)


def _checked_points(model: RobotModel, points: ContactPoints | Iterable[ContactPoint]) -> ContactPoints:
    if not isinstance(points, ContactPoints):
        return ContactPoints(model, points)
    other = points.model
    if model is not other and (model.link_names, model.dof_names) != (other.link_names, other.dof_names):
        raise InputError(f"points are of robot '{other.name}', not of '{model.name}'.")
    return points
