"""From results to messages and from requests to vectors. Dense numbers go through array('d'), the fast legal way."""

from array import array
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from diag_dynamics.exceptions import InputError
from diag_dynamics.model.base import base_state
from diag_dynamics.msg import (
    CoriolisTerm,
    DiagonalizedState,
    ExternalTorque,
    JointSpaceDynamics,
    KineticEnergy,
    MassMatrixFactors,
    TotalJointRates,
    WorkingMoments,
)
from diag_dynamics.nodes.robot import single_joints

MOST_WRENCHES = 1000
"""Wrenches of one request: more would keep the node from its other work."""


def doubles(values):
    """float64[] of a vector or, row-major, a matrix; empty for None."""
    if values is None:
        return array("d")
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def to_time(nanoseconds):
    """builtin_interfaces/Time of nanoseconds since the epoch."""
    sec, nanosec = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


class MessageMaker:
    """Messages about one model, whose names and frame they share."""

    def __init__(self, model, revision=0):
        self._revision = revision
        self._names = list(model.dof_names)
        self._positions = [] if model.coordinate_names == model.dof_names else list(model.coordinate_names)
        self._links = list(model.link_names)
        self._frame = model.root_link
        self._nv = model.nv

    def _begin(self, kind, state):
        message = kind(header=Header(stamp=to_time(state.newest), frame_id=self._frame), dof_names=self._names)
        message.stamp_is_receive_time = state.stamp_is_receive_time
        return message

    def messages(self, topics, s, state):
        """The messages of several topics that are about an Evaluation and the RobotState it came from."""
        return [getattr(self, topic)(s, state) for topic in topics]

    def total_joint_rates(self, s, state):
        """ν and ξ of an Evaluation."""
        message = self._begin(TotalJointRates, state)
        message.velocity_estimated = state.velocity_estimated
        message.nu, message.xi = doubles(s.nu), doubles(s.xi)
        return message

    def working_moments(self, s, state):
        """ε and κ, empty where the effort is unknown."""
        message = self._begin(WorkingMoments, state)
        message.epsilon, message.kappa = doubles(s.epsilon), doubles(s.kappa)
        message.effort_valid = s.epsilon is not None
        return message

    def coriolis(self, s, state):
        """C, C_ξ and ε_g."""
        message = self._begin(CoriolisTerm, state)
        message.velocity_estimated = state.velocity_estimated
        message.coriolis = doubles(s.coriolis)
        message.coriolis_unnormalized = doubles(s.coriolis_unnormalized)
        message.gravity = doubles(s.gravity)
        message.friction, message.friction_valid = doubles(s.friction), s.friction is not None
        return message

    def kinetic_energy(self, s, state):
        """K, its two splits and its rate."""
        message = self._begin(KineticEnergy, state)
        message.velocity_estimated = state.velocity_estimated
        message.total = s.kinetic_energy
        message.energy_share = doubles(s.energy_share)
        message.base_energy = s.base_energy
        message.link_names, message.link_energy = self._links, doubles(s.link_energy)
        message.power_valid = s.effort_power is not None
        message.power = s.effort_power or 0.0
        return message

    def mass_matrix_factors(self, factors, with_inverse, state):
        """M and D of Factors, and ℓ if wanted."""
        message = self._begin(MassMatrixFactors, state)
        message.model_revision, message.nv = self._revision, self._nv
        message.m, message.d = doubles(factors.m), doubles(factors.D)
        message.l, message.l_valid = doubles(factors.l if with_inverse else None), with_inverse
        return message

    def joint_space_dynamics(self, mass_matrix, bias, gravity, state):
        """M, c and g."""
        message = self._begin(JointSpaceDynamics, state)
        message.velocity_estimated = state.velocity_estimated
        message.mass_matrix = doubles(mass_matrix)
        message.bias, message.gravity = doubles(bias), doubles(gravity)
        return message

    def external_torque(self, seen, observation, state):
        """What an observer has seen: a Disturbance, by these thresholds, at a RobotState; empty where it is not valid."""
        message = self._begin(ExternalTorque, state)
        message.velocity_estimated, message.valid = state.velocity_estimated, seen.valid
        message.residual, message.external_torque = doubles(seen.residual), doubles(seen.external_torque)
        message.norm, message.collision = seen.norm, seen.collision
        message.threshold, message.release_threshold = observation.threshold, observation.release
        return message

    def state(self, s, state):
        """One evaluation, whole, with the RobotState it came from."""
        message = self._begin(DiagonalizedState, state)
        message.velocity_estimated = state.velocity_estimated
        message.oldest_stamp = to_time(state.oldest)
        message.model_revision, message.position_names = self._revision, self._positions
        message.position, message.velocity = doubles(state.position), doubles(state.velocity)
        message.effort, message.effort_valid = doubles(state.effort), state.effort is not None
        message.nu, message.xi = doubles(s.nu), doubles(s.xi)
        message.epsilon, message.kappa = doubles(s.epsilon), doubles(s.kappa)
        message.coriolis, message.gravity = doubles(s.coriolis), doubles(s.gravity)
        message.friction, message.friction_valid = doubles(s.friction), s.friction is not None
        message.articulated_inertia = doubles(s.articulated_inertia)
        message.kinetic_energy, message.power = s.kinetic_energy, s.effort_power or 0.0
        return message


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
