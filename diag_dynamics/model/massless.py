# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints that move no inertia: the recursion finds them, they are named or locked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from diag_dynamics import rotations
from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import MasslessLinkError
from diag_dynamics.rigid_body import symmetric
from diag_dynamics.sweeps import followers
from diag_dynamics.sweeps.joints import REMOTE, SINGULAR
from diag_dynamics.sweeps.memory import Workspace
from diag_dynamics.sweeps.records import PLANAR, PRISMATIC, REVOLUTE, VIRTUAL
from diag_dynamics.sweeps.spatial import ANGULAR_X

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel
    from diag_dynamics.model.tree import Tree


def massless_freedoms(model: RobotModel, tree: Tree) -> tuple[npt.NDArray[np.int64], Array]:
    """Return the degrees of freedom that move no inertia in four configurations.

    The second result is the smallest D of each degree of freedom.
    """
    rng = np.random.default_rng(0)
    workspace = None if model.coupling_tables is None else model.new_workspace()
    smallest = np.full(model.nv, np.inf)
    massless = np.ones(model.nv, dtype=bool)
    turning = np.array([orientation < 0 for orientation in model.orientations], dtype=bool)
    for spread in (0.0, 1.0, 1.0, 1.0) if workspace is None else (0.0, 0.05, 0.05, 0.05):
        q = tree.start.copy()
        q[turning] += spread * rng.uniform(-1.0, 1.0, turning.sum())
        D, size = joint_inertias(model, q, workspace)
        massless &= ~(SINGULAR * size < D)
        smallest = np.minimum(smallest, D)
    return np.flatnonzero(massless), smallest


@np.errstate(all="ignore")  # numbers may be too large
def joint_inertias(model: RobotModel, q: Array, workspace: Workspace | None) -> tuple[Array, Array]:
    """Return D of each degree of freedom and its size, see sweeps.joints.

    A massless joint counts as locked.

    `workspace` is one of the model, None without joints that follow others by changing ratios. Its
    last state chooses the branch of a loop. Both are inf where a loop cannot be closed. The mass
    matrix of a group belongs to the twist of its carrier and the rates in the group, as in
    sweeps.groups.
    """
    bodies = model.bodies
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
    P, X, lever = _placed(bodies, q, position)
    magnitude = np.array([_traces(inertia) for inertia in P])
    total = magnitude.copy()
    D = np.zeros(model.nv)
    size = np.zeros(model.nv)
    last = len(bodies) - 1
    while last > 0:
        first = int(bodies["first"][last])
        group = range(first, last + 1)
        base = bodies["parent"][first]
        column = 6 + bodies["dof"] - bodies["start"][first]
        width = 1 + max(column[first : last + 1])
        M = np.zeros((width, width))
        twist = {base: np.eye(6, width)}
        rotor = dict[int, Array]()
        to_group = X[first] if first == last else np.eye(6)  # in the axes with the least rounding
        for i in group:
            twist[i] = (X[i] if first < last else np.eye(6)) @ twist[bodies["parent"][i]]
            twist[i][bodies["direction"][i], column[i]] += ratio[i]
            M += twist[i].T @ P[i] @ twist[i]
            turning = i - bodies["rank"][i] if bodies["kind"][i] == VIRTUAL else i
            rotor.setdefault(turning, np.zeros(width))[column[i]] += ratio[i]
        for i, rate in rotor.items():
            M += bodies["armature"][i] * np.outer(rate, rate)
        for i in reversed(group):
            parent = bodies["parent"][i]
            k = int(bodies["direction"][i] >= ANGULAR_X)
            size[bodies["dof"][i]] += ratio[i] ** 2 * max(magnitude[i, k], REMOTE * total[i, k])
            magnitude[parent] += magnitude[i] if bodies["rank"][i] else lever[i] @ _traces(P[i])
            total[parent] += lever[i] @ total[i]
            if parent >= first:
                P[parent] = P[parent] + X[i].T @ P[i] @ X[i]
        for k in reversed(range(6, width)):
            dof = k - 6 + bodies["start"][first]
            D[dof] = M[k, k]
            row = M[k, :k]
            if SINGULAR * size[dof] < D[dof]:
                M[:k, :k] -= np.outer(row / D[dof], row)
        if base > 0:
            P[base] = P[base] + to_group.T @ M[:6, :6] @ to_group
        last = first - 1
    return D, size


def _traces(P: Array) -> Array:
    """Return the traces of the linear and the angular part of an inertia."""
    return np.array([np.trace(P[:3, :3]), np.trace(P[3:, 3:])])


def _placed(
    bodies: npt.NDArray[np.void], q: Array, position: Array
) -> tuple[Array, Array, list[Array]]:
    """Return inertias of bodies, and their twists and sizes by those of their parents."""
    P = np.zeros((len(bodies), 6, 6))
    X = np.zeros((len(bodies), 6, 6))
    lever = []
    for i, body in enumerate(bodies):
        moment = _cross(body["first_moment"])
        P[i, :3, :3] = body["mass"] * np.eye(3)
        P[i, :3, 3:] = moment.T
        P[i, 3:, :3] = moment
        P[i, 3:, 3:] = symmetric(body["inertia"])
        R = np.eye(3)
        p = np.zeros(3)
        if i > 0 and body["rank"] == 0:
            R, p = _placement(body, q, position[i])
        X[i, :3, :3] = X[i, 3:, 3:] = R.T
        X[i, :3, 3:] = R.T @ _cross(p).T
        lever.append(np.array([[1.0, 0.0], [p @ p, 1.0]]))
    return P, X, lever


def _placement(body: np.void, q: Array, position: float) -> tuple[Array, Array]:
    """Return rotation and translation of a body that is the first one of its joint."""
    k = body["q"]
    turn = np.eye(3)
    shift = np.zeros(3)
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
    at = {name: k for k, name in enumerate(model.coordinate_names)}
    positions = {}
    for name in [model.dof_names[k] for k in massless]:
        if name in at:  # of one degree of freedom
            positions[name] = float(np.clip(0.0, model.lower[at[name]], model.upper[at[name]]))
    return positions


def reject_massless(
    model: RobotModel, tree: Tree, massless: npt.NDArray[np.int64], smallest: Array
) -> None:
    """Raise, naming all joints that move no inertia, and their cures."""
    if not len(massless):
        return
    names = [model.dof_names[k] for k in massless]
    joints = [joint for joint in tree.joints for _ in joint.type.freedoms]
    inertials = [(link.inertial, body) for link, body, _ in tree.links]
    heavy = {
        body
        for inertial, body in inertials
        if inertial is not None and (inertial.mass or np.any(inertial.inertia))
    }
    lines = []
    for k in massless:
        link = joints[k].joint.child
        is_heavy = tree.last_body[joints[k].name] in heavy
        why = "little or negative inertia about that axis" if is_heavy else "no <inertial>"
        lines.append(
            f"joint '{model.dof_names[k]}' (D = {smallest[k]:.3g}): link '{link}' has {why}"
        )
    advice = "Correct the mass and inertia of the link in the URDF, or make the joint fixed."
    single = next((name for name in names if name in model.coordinate_names), None)
    if single is not None:
        advice += (
            f" Or give the joint a rotor inertia (armature: {single}=…), or lock it "
            f"(locked_joints: {single}=0, or massless: lock)."
        )
    raise MasslessLinkError(
        f"robot '{model.name}' has {len(massless)} joint(s) that move no inertia, "
        f"which makes its mass matrix singular: {'; '.join(lines)}. {advice}",
        names,
        smallest[massless],
    )
