# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The end-effector link of a robot: the one rule of markers, page, reports and plots."""

from __future__ import annotations

import numpy as np

from diag_dynamics.model.robot import RobotModel

FINGER_LENGTH = 0.25
"""Maximum length of a finger, as a fraction of the length of the chain that carries it."""

MIN_MASS = 0.1
"""Minimum mass of the end-effector link, as a fraction of the mass of all links that are fixed to it."""

SAME_PLACE = 1e-6
"""Distance below which two links have the same origin [m]."""


def end_effector_link(model: RobotModel) -> str:
    """Return the name of the end-effector link; the root link, if no joint moves.

    It is the deepest link of the longest chain of actuated joints whose end carries no other joints than fingers. Of chains
    with equally many joints the first one counts. A mimic joint is not actuated. A floating base counts as one joint.

    Fingers are the moving children of a moving link: at least two, none of them with more joints than the chain that carries
    them, none longer than :data:`FINGER_LENGTH` of that chain. The jaws of a gripper, casters and rotors are fingers. Legs
    and the arms of a torso are none.

    The deepest link is the one farthest outboard, of those fixed to each other that have :data:`MIN_MASS`: neither the frame
    of a camera nor a tool centre point.
    """
    bodies = model.bodies
    count = len(bodies)
    children: list[list[int]] = [[] for _ in range(count)]
    joints, length = np.zeros(count, dtype=int), np.zeros(count)  # from the base to each body
    for k in range(1, count):
        parent = int(bodies["parent"][k])
        children[parent].append(k)
        is_actuated = bodies["leader"][k] == k and bodies["rank"][k] == 0
        joints[k] = joints[parent] + is_actuated
        length[k] = length[parent] + (float(np.linalg.norm(bodies["translation"][k])) if parent else 0.0)
    all_joints, all_length = joints.copy(), length.copy()  # from the base through a body to the ends of its chains
    arm_joints, ends = joints.copy(), list(range(count))  # likewise, without fingers
    for k in reversed(range(count)):
        if not children[k]:
            continue
        all_joints[k], all_length[k] = all_joints[children[k]].max(), all_length[children[k]].max()
        reach = [all_length[child] - length[child] for child in children[k]]
        fingers = all_joints[k] - joints[k] <= joints[k] and max(reach) <= FINGER_LENGTH * length[k]
        if k and len(children[k]) > 1 and fingers:
            continue
        outward = max(children[k], key=lambda child: arm_joints[child])
        arm_joints[k], ends[k] = arm_joints[outward], ends[outward]
    return _deepest_link(model, ends[0])


def _deepest_link(model: RobotModel, body: int) -> str:
    """Return the link with mass that is farthest from the joint of a body."""
    if not body:
        return model.root_link
    links = model.links[model.links["body"] == body]
    deepest, farthest = model.link_names[int(model.bodies["link"][body])], 0.0
    for record in links:
        name = model.link_names[int(record["index"])]
        distance = float(np.linalg.norm(model.placement_in_body(name)[1][:3, 3]))
        # Links are in the order of the tree: of two at one place the second one is on the first one.
        if record["mass"] >= MIN_MASS * links["mass"].sum() and distance >= farthest - SAME_PLACE:
            deepest, farthest = name, distance
    return deepest
