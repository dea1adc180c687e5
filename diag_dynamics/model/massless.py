# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints that move no inertia: the recursion finds them, they are named or locked."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from diag_dynamics import rotations
from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import MasslessLinkError
from diag_dynamics.rigid_body import symmetric
from diag_dynamics.sweeps import followers
from diag_dynamics.sweeps.memory import Workspace
from diag_dynamics.sweeps.records import PLANAR, PRISMATIC, REVOLUTE, VIRTUAL
from diag_dynamics.sweeps.spatial import ANGULAR_X

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel
    from diag_dynamics.model.tree import Tree

MASSLESS = 1e-12
"""D below this fraction of all inertia outboard is rounding."""

DISTINCT = 1e-9
"""D above this fraction is far from rounding by any order of operations."""


def massless_freedoms(model: RobotModel, tree: Tree) -> tuple[npt.NDArray[np.int64], Array]:
    """Return the degrees of freedom that move no inertia in four configurations.

    The second result is the smallest D of each degree of freedom.
    """
    rng = np.random.default_rng(0)
    workspace = None if model.coupling_tables is None else model.new_workspace()
    smallest = np.full(model.nv, np.inf)
    massless = np.ones(model.nv, dtype=bool)
    turning = np.array([orientation < 0 for orientation in model.orientations], dtype=bool)
    spread = 1.0 if workspace is None else 0.05
    for part in (0.0, spread, spread, spread):
        q = tree.start.copy()
        q[turning] += part * rng.uniform(-1.0, 1.0, turning.sum())
        D, size = joint_inertias(model, q, workspace)
        massless &= ~(MASSLESS * size < D)
        smallest = np.minimum(smallest, D)
    return np.flatnonzero(massless), smallest


@np.errstate(all="ignore")  # numbers may be too large
def joint_inertias(model: RobotModel, q: Array, workspace: Workspace | None) -> tuple[Array, Array]:
    """Return D of each degree of freedom, by elimination of M, and the inertia that it can move.

    A massless joint counts as locked.

    `workspace` is one of the model, None without joints that follow others by changing ratios. Its
    last state chooses the branch of a loop. Both are inf where a loop cannot be closed. The second
    result is the trace of all inertia outboard as if it were stretched out.
    """
    bodies = model.bodies
    numbers = range(1, len(bodies))
    position = np.zeros(len(bodies))
    ratio = bodies["multiplier"]
    if workspace is not None:
        ratios = np.zeros((len(bodies), 1 + 2 * model.nv))
        if followers.ratios(workspace.robot, q, np.zeros(model.nv), ratios) != 0:
            unknown = np.full(model.nv, np.inf)
            return unknown, unknown
        position = ratios[:, 0]
        ratio = ratios[np.arange(len(bodies)) - bodies["rank"], 1 + bodies["dof"]]
    elif model.nq:
        position = ratio * q[bodies["q"]] + bodies["offset"]
    X = np.zeros((len(bodies), 6, 6))
    P = np.zeros((len(bodies), 6, 6))
    J = np.zeros((len(bodies), 6, model.nv))
    rotor = np.zeros((len(bodies), model.nv))
    outboard = np.zeros((len(bodies), 2))
    levers = np.zeros(len(bodies))
    for i in numbers:
        body = bodies[i]
        R, p = _placement(body, q, position[i])
        X[i, :3, :3] = X[i, 3:, 3:] = R.T
        X[i, :3, 3:] = R.T @ _cross(p).T
        J[i] = X[i] @ J[body["parent"]]
        J[i, body["direction"], body["dof"]] += ratio[i]
        # One rotor turns at the sum of the rates of a follower's bodies.
        turning = i - body["rank"] if body["kind"] == VIRTUAL else i
        rotor[turning, body["dof"]] += ratio[i]
        moment = _cross(body["first_moment"])
        inertia = symmetric(body["inertia"])
        P[i, :3, :3] = body["mass"] * np.eye(3)
        P[i, :3, 3:] = moment.T
        P[i, 3:, :3] = moment
        P[i, 3:, 3:] = inertia
        outboard[i] = 3.0 * body["mass"], np.trace(inertia)
        levers[i] = p @ p
    M = rotor.T @ (bodies["armature"][:, None] * rotor)
    size = np.zeros(model.nv)
    force = P @ J  # of each body's inertia, and, added on the way to the base, of all outboard
    for i in reversed(numbers):
        body = bodies[i]
        M[body["dof"]] += ratio[i] * force[i, body["direction"]]
        force[body["parent"]] += X[i].T @ force[i]
        linear, angular = outboard[i]
        outboard[body["parent"]] += linear, angular + levers[i] * linear
        size[body["dof"]] += ratio[i] ** 2 * outboard[i, int(body["direction"] >= ANGULAR_X)]
    return _eliminated(M, size), size


def _eliminated(M: Array, size: Array) -> Array:
    """Return D of M = U D Uᵀ, in which a massless joint counts as locked."""
    with suppress(np.linalg.LinAlgError):
        D = np.diag(np.linalg.cholesky(M[::-1, ::-1]))[::-1] ** 2
        if (DISTINCT * size < D).all():
            return D
    D = np.zeros(len(M))
    for k in reversed(range(len(M))):
        D[k] = M[k, k]
        if MASSLESS * size[k] < D[k]:
            M[:k, :k] -= np.outer(M[k, :k] / D[k], M[k, :k])
    return D


def _placement(body: np.void, q: Array, position: float) -> tuple[Array, Array]:
    """Return rotation and translation of a body; the later ones of a joint are at the first."""
    k = body["q"]
    turn = np.eye(3)
    shift = np.zeros(3)
    if body["rank"] > 0:
        return turn, shift
    if body["kind"] == REVOLUTE:
        turn = rotations.from_rpy(0.0, 0.0, position)
    elif body["kind"] == PRISMATIC:
        shift[2] = position
    elif body["kind"] == PLANAR:
        turn = rotations.from_rpy(0.0, 0.0, q[k + 2])
        shift[:2] = q[k : k + 2]
    else:
        turn = rotations.from_quaternion(*q[k + 3 : k + 7])
        shift = q[k : k + 3]
    R = body["rotation"].reshape(3, 3)
    return R @ turn, body["translation"] + R @ shift


def _cross(r: Array) -> Array:
    """Return the matrix of the cross product with a vector from the left."""
    return np.asarray(np.cross(np.eye(3), r))


def positions_to_hold(model: RobotModel, massless: npt.NDArray[np.int64]) -> dict[str, float]:
    """Return positions of locked joints that move no inertia: zero, or the nearest limit."""
    nearest = np.clip(0.0, model.lower, model.upper).tolist()
    positions = dict(zip(model.coordinate_names, nearest, strict=True))
    names = [model.dof_names[k] for k in massless]  # those of one degree of freedom have positions
    return {name: positions[name] for name in names if name in positions}


def reject_massless(
    model: RobotModel, tree: Tree, massless: npt.NDArray[np.int64], smallest: Array
) -> None:
    """Raise, naming all joints that move no inertia, and their cures."""
    if not len(massless):
        return
    names = [model.dof_names[k] for k in massless]
    joints = [joint for joint in tree.joints for _ in joint.type.freedoms]
    lines = [
        f"joint '{model.dof_names[k]}' (D = {smallest[k]:.3g}), which carries "
        f"link '{joints[k].joint.child}'"
        for k in massless
    ]
    advice = (
        "Correct the mass and inertia of the link in the URDF, or make the joint fixed. A joint of "
        "one degree of freedom may have a rotor inertia (armature: joint=…) or be locked "
        "(locked_joints: joint=0, or massless: lock)."
    )
    raise MasslessLinkError(
        f"robot '{model.name}' has {len(massless)} joint(s) that move no inertia, "
        "because their links have little, negative or no inertia about that axis, which makes its "
        f"mass matrix singular: {'; '.join(lines)}. {advice}",
        names,
        smallest[massless],
    )
