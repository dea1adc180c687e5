# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From requests of services to vectors in the model's order, each wrong entry named."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.model.base import base_state
from diag_dynamics.model.single_joints import single_joints

MOST_WRENCHES = 1000
"""Wrenches of one request: more would keep the node from its other work."""


class Requested(NamedTuple):
    """The state of a request in the model's order."""

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray | None
    joints: "Listed"


class Listed(NamedTuple):
    """Where a request lists the joints of the model."""

    names: tuple
    order: np.ndarray
    count: int
    following: np.ndarray  # places of the followers, -1 for those not listed

    def vector(self, field, values):
        """One field of a request, checked, in the model's order; None if it is empty although joints are listed.

        Raises
        ------
        InputError
            It has the wrong length or holds a number that is not finite.
        """
        if len(values) == 0 and self.count > 0:
            return None
        if len(values) != self.count:
            raise InputError(f"{field} has {len(values)} entries for {self.count} names.")
        vector = np.array(values, dtype=np.float64)[self.order]
        for name, value in zip(self.names, vector, strict=True):
            if not np.isfinite(value):
                raise InputError(f"{field} of joint '{name}' is {value}, expected a finite number.")
        return vector

    def of_followers(self, values):
        """One field of a request, of the right length, as the followers have it; NaN for those not listed."""
        return np.append(np.array(values, dtype=np.float64), np.nan)[self.following]


def requested_state(model, request, followers):
    """State of a request: its JointState `state` and, for a floating base, base_pose and base_twist.

    Followers may be listed: their positions are compared with those that their leaders give them, their efforts reflected
    to these; what is not finite is unknown. Their velocities are not looked at.

    Raises
    ------
    InputError
        A joint is missing, unknown or listed twice, a field has the wrong length or is not finite, or a follower is not
        where its leader puts it.
    """
    state = request.state
    joints = _listed(model, state.name, followers)
    position = joints.vector("state.position", state.position)
    if position is None:
        raise InputError(f"state.position is empty, expected {joints.count} entries.")
    for disagreement in followers.disagreements(position, joints.of_followers(state.position)):
        raise InputError(f"state.{disagreement}.")
    velocity = joints.vector("state.velocity", state.velocity)
    effort = joints.vector("state.effort", state.effort)
    effort = None if effort is None else followers.reflected(effort, joints.of_followers(state.effort))
    velocity = np.zeros(len(position)) if velocity is None else velocity
    if model.floating_base:
        p, o = request.base_pose.position, request.base_pose.orientation
        twist = _six("base_twist", request.base_twist)
        try:
            base, rates = base_state(model, model.root_link, (p.x, p.y, p.z), (o.x, o.y, o.z, o.w), twist)
        except InputError as error:
            raise InputError(f"base_pose: {error}") from error
        position, velocity = np.concatenate([base, position]), np.concatenate([rates, velocity])
        effort = None if effort is None else np.concatenate([np.zeros(6), effort])
    return Requested(position, velocity, effort, joints)


def requested_acceleration(model, request, joints):
    """q̈ of a request; for a floating base base_acceleration comes first."""
    acceleration = joints.vector("acceleration", request.acceleration)
    acceleration = np.zeros(len(joints.names)) if acceleration is None else acceleration
    if model.floating_base:
        acceleration = np.concatenate([_six("base_acceleration", request.base_acceleration), acceleration])
    return acceleration


def requested_wrenches(model, request):
    """External wrenches of a request by link name, and the frame they are in.

    Raises
    ------
    InputError
        There are not as many as links, or too many; no such link, or a number that is not finite.
    """
    if len(request.wrench_links) != len(request.wrenches):
        raise InputError(f"wrenches has {len(request.wrenches)} entries for {len(request.wrench_links)} wrench_links.")
    if len(request.wrenches) > MOST_WRENCHES:
        raise InputError(f"wrenches has {len(request.wrenches)} entries, expected no more than {MOST_WRENCHES}.")
    wrenches = {}
    for link, wrench in zip(request.wrench_links, request.wrenches, strict=True):
        if link not in model.link_names:
            raise InputError(f"wrench_links: '{link}' is not a link of robot '{model.name}'.")
        f, n = wrench.force, wrench.torque
        # Several wrenches on one link act together.
        six = [f.x, f.y, f.z, n.x, n.y, n.z]
        if not np.isfinite(six).all():
            raise InputError(f"wrenches on link '{link}' is {six}, expected finite numbers.")
        wrenches[link] = wrenches.get(link, np.zeros(6)) + np.array(six)
    return wrenches, "world" if request.wrenches_in_world else "link"


def _listed(model, names, followers):
    places = {}
    known = set(single_joints(model)) | set(model.fixed_joints) | set(model.mimic_joints) | set(model.locked_joints)
    for k, name in enumerate(names):
        if name not in known:
            raise InputError(f"state.name: '{name}' is not a joint of robot '{model.name}'.")
        if name in places:
            raise InputError(f"state.name: joint '{name}' is listed twice.")
        places[name] = k
    wanted = single_joints(model)
    if alone := followers.without_leader(places):
        raise InputError(f"state.name: joint '{alone[1]}' is missing, which '{alone[0]}' follows.")
    missing = [name for name in wanted if name not in places]
    if missing:
        raise InputError(f"state.name: joint '{missing[0]}' is missing ({len(missing)} of {len(wanted)} are).")
    order = np.array([places[name] for name in wanted], dtype=int)
    return Listed(wanted, order, len(names), np.array([places.get(name, -1) for name in followers.names], dtype=int))


def _six(field, twist):
    numbers = [twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y, twist.angular.z]
    if not np.isfinite(numbers).all():
        raise InputError(f"{field} is {numbers}, expected finite numbers.")
    return np.array(numbers)


def requested_gravity(request):
    """Gravity of a request, or None where it does not override the model's."""
    if not request.override_gravity:
        return None
    g = request.gravity
    return (g.x, g.y, g.z)
