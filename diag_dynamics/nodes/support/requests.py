# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Requests of services as vectors in the model's order; errors name the field."""

import numpy as np

from diag_dynamics.checks import choice
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.odometry import base_state
from diag_dynamics.model.joint_types import single_joints

MAX_WRENCHES = 1000  # more would keep the node from other work


def read_state(model, request, followers):
    """Return q, q̇, τ and the places of joints in a request; τ is None if it is empty."""
    state = request.state
    joints = _find_joints(model, request.state.name)
    if joints and not len(state.position):
        raise InputError(f"state.position is empty; expected {len(joints)} entries.")
    q = _vector(model, "state.position", state.position, joints)
    positions = _of_followers(followers, state.position, joints)
    for disagreement in followers.disagreements(q, positions):
        raise InputError(f"state.{disagreement}.")
    qd = _vector(model, "state.velocity", state.velocity, joints)
    tau = None
    if len(state.effort):
        tau = _vector(model, "state.effort", state.effort, joints)
        tau = followers.reflected(q, tau, _of_followers(followers, state.effort, joints))
    if not model.floating_base:
        return q, qd, tau, joints
    p = request.base_pose.position
    o = request.base_pose.orientation
    twist = _six("base_twist", request.base_twist.linear, request.base_twist.angular)
    base = base_state(model, model.root_link, (p.x, p.y, p.z), (o.x, o.y, o.z, o.w), twist)
    tau = None if tau is None else np.r_[np.zeros(6), tau]
    return np.r_[base[0], q], np.r_[base[1], qd], tau, joints


def read_acceleration(model, request, joints):
    """Return q̈ of a request; that of joints is zero if it is empty."""
    acceleration = _vector(model, "acceleration", request.acceleration, joints)
    if not model.floating_base:
        return acceleration
    base = request.base_acceleration
    return np.r_[_six("base_acceleration", base.linear, base.angular), acceleration]


def read_wrenches(model, request):
    """Return the arguments `f_ext` and `frame` of a request; wrenches on one link are added."""
    links = request.wrench_links
    wrenches = request.wrenches
    f_ext = {}
    if len(links) != len(wrenches) or len(wrenches) > MAX_WRENCHES:
        expected = f"one for each of {len(links)} wrench_links, no more than {MAX_WRENCHES}"
        raise InputError(f"wrenches has {len(wrenches)} entries; expected {expected}.")
    for link, wrench in zip(links, wrenches, strict=True):
        choice("entry of wrench_links", link, model.link_names)
        force = _six(f"wrenches on link '{link}'", wrench.force, wrench.torque)
        f_ext[link] = f_ext.get(link, 0.0) + force
    return {"f_ext": f_ext, "frame": "world" if request.wrenches_in_world else "link"}


def _find_joints(model, names):
    """Return the place of each joint in a request."""
    joints = {}
    needed = single_joints(model)
    allowed = {
        *needed,
        *model.fixed_joints,
        *model.mimic_joints,
        *model.followers,
        *model.locked_joints,
    }
    for k, name in enumerate(names):
        if name not in allowed or name in joints:
            expected = f"each joint of robot '{model.name}' once"
            raise InputError(f"state.name has '{name}'; expected {expected}.")
        joints[name] = k
    if missing := [name for name in needed if name not in joints]:
        raise InputError(f"state.name: joint '{missing[0]}' is missing.")
    return joints


def _vector(model, field, values, joints):
    """Return a field in the model's order; zero if it is empty."""
    names = single_joints(model)
    if not len(values):
        return np.zeros(len(names))
    if len(values) != len(joints):
        raise InputError(f"{field} has {len(values)} entries for {len(joints)} names.")
    vector = np.array([values[joints[name]] for name in names])
    for k in np.flatnonzero(~np.isfinite(vector)):
        raise InputError(f"{field} of joint '{names[k]}' is {vector[k]}; expected a finite number.")
    return vector


def _of_followers(followers, values, joints):
    """Return the values of mimic joints; NaN where they are not listed."""
    return np.array(
        [values[joints[name]] if name in joints else np.nan for name in followers.names]
    )


def _six(field, *vectors):
    numbers = np.array([number for v in vectors for number in (v.x, v.y, v.z)])
    if not np.isfinite(numbers).all():
        raise InputError(f"{field} is {numbers.tolist()}; expected finite numbers.")
    return numbers
