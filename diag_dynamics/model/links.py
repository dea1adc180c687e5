# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The end-effector link of a model, and external wrenches on links as records of the sweeps."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from diag_dynamics.arrays import FRAMES, Array, VectorLike
from diag_dynamics.checks import array_of, choice, mapping, numbers
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.robot import RobotModel
from diag_dynamics.sweeps.records import WRENCH

FINGER_LENGTH = (
    0.25  # maximum length of a finger, as a fraction of the length of the chain that carries it
)
# Minimum mass of the end-effector link, as a fraction of the mass of all links that are fixed to it
MIN_MASS = 0.1
SAME_PLACE = 1e-6  # distance below which two links have the same origin [m]


def end_effector_link(model: RobotModel) -> str:
    """Return the name of the end-effector link; the root link, if no joint moves.

    It is the deepest link of the first longest chain of actuated joints whose end carries no other
    joints than fingers. A mimic joint is not actuated. A floating base counts as one joint.

    Fingers are the moving children of a moving link: at least two, none of them with more joints
    than the chain that carries them, none longer than :data:`FINGER_LENGTH` of that chain. The jaws
    of a gripper, casters and rotors are fingers. Legs and the arms of a torso are none.

    The deepest link is the one farthest outboard, of those fixed to each other that have
    :data:`MIN_MASS`: neither the frame of a camera nor a tool centre point.
    """
    bodies = model.bodies
    count = len(bodies)
    children: list[list[int]] = [[] for _ in range(count)]
    # from the base to each body
    joints = np.zeros(count, dtype=int)
    length = np.zeros(count)
    is_actuated = (bodies["leader"] == np.arange(count)) & (bodies["rank"] == 0)
    distance = np.where(bodies["parent"] > 0, np.linalg.norm(bodies["translation"], axis=1), 0.0)
    for k in range(1, count):
        parent = int(bodies["parent"][k])
        children[parent].append(k)
        joints[k] = joints[parent] + is_actuated[k]
        length[k] = length[parent] + distance[k]
    # Joints and length from the base through a body to the ends of its chains
    all_joints = joints.copy()
    all_length = length.copy()
    arm_joints = joints.copy()  # likewise, without fingers
    ends = list(range(count))
    for k in reversed(range(count)):
        if not children[k]:
            continue
        all_joints[k] = all_joints[children[k]].max()
        all_length[k] = all_length[children[k]].max()
        reach = [all_length[child] - length[child] for child in children[k]]
        fingers = all_joints[k] - joints[k] <= joints[k] and max(reach) <= FINGER_LENGTH * length[k]
        if k and len(children[k]) > 1 and fingers:
            continue
        outward = max(children[k], key=lambda child: arm_joints[child])
        arm_joints[k] = arm_joints[outward]
        ends[k] = ends[outward]
    return _deepest_link(model, ends[0])


def _deepest_link(model: RobotModel, body: int) -> str:
    """Return the link with mass that is farthest from the joint of a body."""
    if not body:
        return model.root_link
    links = model.links[model.links["body"] == body]
    deepest = model.link_names[int(model.bodies["link"][body])]
    farthest = 0.0
    for record in links:
        name = model.link_names[int(record["index"])]
        distance = float(np.linalg.norm(model.placement_in_body(name)[1][:3, 3]))
        # Links are in the order of the tree: of two at one place the second one is on the first
        # one.
        if record["mass"] >= MIN_MASS * links["mass"].sum() and distance >= farthest - SAME_PLACE:
            deepest = name
            farthest = distance
    return deepest


# --- Wrenches


def wrenches_on_links(
    model: RobotModel, f_ext: Any, frame: str, *states: int
) -> npt.NDArray[np.void]:
    """Return a record for each link of `f_ext`.

    It has six numbers by link name, in the axes of "link" or "world". With a number of states,
    records follow state by state, and there may be as many rows of numbers.
    """
    choice("frame", frame, FRAMES)
    mapping("f_ext", f_ext)
    expected = "six finite numbers, force [N] then moment [N m]"
    expected += "".join(f", or ({count}, 6) of them: a row for each state" for count in states)
    records = np.zeros((*(states or (1,)), len(f_ext)), WRENCH)
    for k, (name, wrench) in enumerate(f_ext.items()):
        choice("link of f_ext", name, model.link_names)
        array = array_of(wrench)
        if array is None or array.shape not in ((6,), (*states, 6)) or not np.isfinite(array).all():
            raise InputError(f"f_ext on link '{name}' is {wrench!r}; expected {expected}.")
        wrenches = np.broadcast_to(array, (len(records), 6))
        records[:, k] = wrenches_at(model, name, wrenches, (0.0, 0.0, 0.0), frame)
    return records.reshape(-1)


def wrenches_at(
    model: RobotModel, link: str, wrenches: Array, point: VectorLike, frame: str
) -> npt.NDArray[np.void]:
    """Return records of wrenches, shape (number, 6), at a point of a link.

    The point [m] is from the link's origin and in its axes.
    """
    body, rotation, in_body = point_in_body(model, link, point, frame)
    turn = np.eye(3) if frame == "world" else rotation
    records = np.zeros(len(wrenches), WRENCH)
    records["body"] = body
    records["point"] = in_body
    records["force"] = wrenches[:, :3] @ turn.T
    records["moment"] = wrenches[:, 3:] @ turn.T
    return records


def point_in_body(
    model: RobotModel, link: str, point: VectorLike, frame: str
) -> tuple[int, Array, Array]:
    """Return the body of a link, their rotation, and a point of the link in the body's axes [m]."""
    choice("frame", frame, FRAMES)
    offset = numbers("point", point, (3,), "three finite numbers [m]")
    body, placement = model.placement_in_body(link)
    rotation = placement[:3, :3]
    return body, rotation, placement[:3, 3] + rotation @ offset
