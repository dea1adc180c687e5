# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The modes of a control loop: each is a law, with what it takes for a target, its command and its measured rate."""

import numpy as np

from diag_dynamics.checks import vector
from diag_dynamics.control.by_dof import by_dof
from diag_dynamics.control.command import PoseError
from diag_dynamics.control.damping import GravityCompensation, RateDamping
from diag_dynamics.control.pose import PoseRegulation, rotation_vector
from diag_dynamics.control.references import PoseTarget, SetPoint, at_rest, nearest
from diag_dynamics.control.targets import aimed, require_within
from diag_dynamics.control.tracking import JointTracking
from diag_dynamics.control.trajectory import Trajectory
from diag_dynamics.exceptions import InputError

LONGEST_WAIT = 10.0
"""How long before its stamp a trajectory may come [s]: until then the robot goes towards its first point."""

SPEED = 1.0
"""Of a joint of which nobody says how fast it may be [rad/s, m/s]."""

STEP = 0.05
"""How far from the robot's place, and from where it should be, a trajectory may begin, or go on after a hold [rad, m]."""

APPROACH = 10.0
"""Rate at which the way to a pose decays in the end [1/s]."""

OVERSPEED = 1.1
"""How much faster than its limit a joint may be between the points of a trajectory."""


def velocity_limits(model):
    """Velocity limits [rad/s, m/s]; inf where the URDF says nothing, or 0."""
    return np.where(model.velocity_limit > 0.0, model.velocity_limit, np.inf)


def highest_speeds(model):
    """How fast joints may be [rad/s, m/s]: their limits, or :data:`SPEED` where there is none."""
    limits = velocity_limits(model)
    return np.where(np.isfinite(limits), limits, SPEED)


class Mode:
    """A law in a control loop.

    A new one is a subclass that is listed in :data:`LAWS`, beside the law's own file and its parameters.

    Parameters
    ----------
    law : Law
    values : dict
        Values of parameters.controller.PARAMETERS.

    Attributes
    ----------
    name : str
        By which it is chosen, as the parameter initial_mode and by the service ~/mode/<name>.
    targets : tuple of str
        Topics of what it takes for a target: take_pose is for "target", take_trajectory for "trajectory", take_set_point for
        "set_point".
    law : Law
    """

    name = ""
    targets = ()

    def __init__(self, law, values):
        self.law, self._model = law, law.dynamics.model
        self._longest, self._most_behind = values["max_state_age"], values["following_energy"] or np.inf
        self.void()

    @classmethod
    def of(cls, dynamics, values):
        """The mode of a robot, by parameters.

        Raises
        ------
        InputError
            They do not fit it.
        """
        raise NotImplementedError

    @staticmethod
    def missing(values):
        """What parameters lack for this mode, empty if they lack nothing."""
        return ""

    # --- Target

    def void(self):
        """Have targets begin at the next state."""
        self._begun, self._behind = False, 0.0
        self.forget_rate()

    def begin(self, state):
        """Take a state for the target, unless that has been done since targets were void."""
        if not self._begun:
            self._begun = True
            self._stay(state)

    def _stay(self, state):
        """Have the robot's position in a state for the target; what has no target has nothing to do."""

    @property
    def on_its_way(self):
        """Whether the target moves, and V with it."""
        return False

    # --- Every cycle

    def followed(self, state, held):
        """The law's command for a state, and why the target was given up, if it was; `held`: there was a hold before."""
        return self.command(state), ""

    def command(self, state):
        """The law's command for a state."""
        return self.law.command(state.position, state.velocity)

    @property
    def _lag(self):
        """How far the robot is behind the target, as V in parts of what is tolerated."""
        return self._behind / self._most_behind

    def measured_rate(self, command, elapsed):
        """dV/dt from the last command and this one, `elapsed` seconds later; None if they are not of one target."""
        self._behind = command.lyapunov
        last, self._lyapunov = self._lyapunov, None if self.on_its_way else command.lyapunov
        return (command.lyapunov - last) / elapsed if last is not None and elapsed > 0.0 else None

    def forget_rate(self):
        """Measure no rate from the last command to the next: something has come between them."""
        self._lyapunov = None


class GravityCompensationMode(Mode):
    """The robot weighs nothing, and is led by hand."""

    name = "gravity_compensation"

    @classmethod
    def of(cls, dynamics, values):
        """See :meth:`Mode.of`."""
        return cls(GravityCompensation(dynamics), values)


class DampingMode(Mode):
    """The robot is braked."""

    name = "damping"

    @classmethod
    def of(cls, dynamics, values):
        """See :meth:`Mode.of`."""
        return cls(RateDamping(dynamics, by_dof("damping", values["damping"], dynamics.model.dof_names)), values)


class PoseMode(Mode):
    """A link goes to a pose, at bounded speed.

    Attributes
    ----------
    aim : tuple of ndarray
        Position [m] and axes at which the law aims, on its way to the target.
    """

    name = "pose"
    targets = ("target",)

    def __init__(self, law, values):
        super().__init__(law, values)
        self._speed = np.array([values["position_speed"], values["orientation_speed"]])
        self.aim = self._target = None

    @classmethod
    def of(cls, dynamics, values):
        """See :meth:`Mode.of`."""
        law = PoseRegulation(
            dynamics,
            values["controlled_link"],
            by_dof("pose_damping", values["pose_damping"], dynamics.model.dof_names),
            values["position_stiffness"],
            values["orientation_stiffness"],
        )
        return cls(law, values)

    @staticmethod
    def missing(values):
        """See :meth:`Mode.missing`."""
        return (
            "" if values["controlled_link"] else "parameter 'controlled_link' is empty: there is no pose to regulate."
        )

    def _stay(self, state):
        self.aim, self._target = self.law.pose(state.position), None
        self.law.aim(*self.aim)

    @property
    def on_its_way(self):
        """Whether it aims elsewhere than at the target yet."""
        return self._target is not None

    def take_pose(self, state, link, position, orientation):
        """See :meth:`ControlLoop.take_pose`."""
        goal = aimed(link, position, orientation, self.law.dynamics, state.position)
        self.begin(state)
        rate = np.full(2, APPROACH)
        self._target = PoseTarget(goal, state.newest, self.aim, self._speed, rate, self._longest, self._target)
        self.forget_rate()

    def command(self, state):
        """Springs pull to where the aim has come on its way to the target; the error is from the target."""
        q, law, target = state.position, self.law, self._target
        if target is None:
            return law.command(q, state.velocity)
        self.aim = target.sample(state.newest, self._lag)
        law.aim(*self.aim)
        command = law.command(q, state.velocity)
        if target.arrived:
            self._target = None
            return command
        self.forget_rate()
        position, axes = law.pose(q)
        return command._replace(error=PoseError(target.goal[0] - position, rotation_vector(target.goal[1] @ axes.T)))


class TrackingMode(Mode):
    """Joints go to set-points, or follow trajectories.

    Attributes
    ----------
    desired : Desired
        Where the robot should be.
    """

    name = "tracking"
    targets = ("trajectory", "set_point")

    def __init__(self, law, values):
        super().__init__(law, values)
        model = self._model
        self._limits, self._highest = velocity_limits(model), highest_speeds(model)
        self._speed = values["set_point_speed"] * self._highest
        self._turns = np.array([name in model.continuous_joints for name in model.dof_names])
        self.desired = self._target = None

    @classmethod
    def of(cls, dynamics, values):
        """See :meth:`Mode.of`."""
        names = dynamics.model.dof_names
        law = JointTracking(
            dynamics,
            by_dof("tracking_gain", values["tracking_gain"], names),
            by_dof("tracking_convergence", values["tracking_convergence"], names),
            velocity_limits(dynamics.model),
        )
        return cls(law, values)

    def _stay(self, state):
        self.desired = at_rest(state.position)
        self._target = self._to(state.position, state)

    def _to(self, position, state):
        """A set-point that is gone to from where the robot should be."""
        here, moving, model = self.desired.position, self.desired.velocity, self._model
        room = np.where(moving > 0.0, model.upper - here, here - model.lower)
        rate, time = self.law.convergence, state.newest
        return SetPoint(position, time, self.desired, self._speed, rate, self._turns, self._longest, room)

    def take_set_point(self, state, position):
        """See :meth:`ControlLoop.take_set_point`."""
        position = vector("set_point.position", position, self._model.dof_names)
        require_within("set_point.position", position, self._model)
        self.begin(state)
        self._target = self._to(position, state)
        self.forget_rate()

    def take_trajectory(self, state, waypoints, stamp, now):
        """See :meth:`ControlLoop.take_trajectory`."""
        trajectory = Trajectory(waypoints, self._model.dof_names, self._model.continuous_joints, stamp)
        require_within("trajectory.points[{}].positions", trajectory.positions, self._model)
        wait = (stamp - now) * 1e-9
        if wait > LONGEST_WAIT:
            raise InputError(
                f"trajectory.header.stamp is {wait:.6g} s in the future, expected no more than {LONGEST_WAIT:g} s."
            )
        if trajectory.ends_before(now):
            raise InputError("trajectory.header.stamp is so long ago that the trajectory is over.")
        self.begin(state)
        trajectory.begin(state.newest, self.desired.position, self.desired.velocity)
        self._require_near(trajectory.sample(state.newest).position, state)
        self._require_speed(trajectory)
        self._target = trajectory
        self.forget_rate()

    def _way(self, there, here):
        """From one position to another [rad, m], the shorter way where joints turn round."""
        return nearest(there, here, self._turns) - here

    def _require_near(self, position, state):
        away = [np.abs(self._way(position, place)) for place in (state.position, self.desired.position)]
        away = np.minimum(*away)
        if (away > STEP).any():
            k = int(np.argmax(away))
            raise InputError(
                f"trajectory begins {away[k]:.3g} from where joint '{self._model.dof_names[k]}' is and should be, "
                f"expected no more than {STEP:g}."
            )

    def _require_speed(self, trajectory):
        fastest = trajectory.fastest().max(axis=0, initial=0.0)
        beyond = ~(fastest <= OVERSPEED * self._highest) | ~np.isfinite(fastest)
        if beyond.any():
            k = int(np.argmax(beyond))
            limit = f"its limit {self._highest[k]:g}"
            if np.isinf(self._limits[k]):
                limit = f"{self._highest[k]:g}, as the URDF has no velocity limit for it"
            raise InputError(
                f"trajectory has joint '{self._model.dof_names[k]}' move at {fastest[k]:.6g}, expected no more than {limit}."
            )

    def followed(self, state, held):
        """The law's command, and why the target was given up, if it was: the robot stays where it is then."""
        before = self.desired.position
        command = self.command(state)
        names, went = self._model.dof_names, np.abs(self._way(self.desired.position, before))
        if command.lyapunov > self._most_behind:
            k = int(np.argmax(np.abs(command.error)))
            lost = f"V is {command.lyapunov:.3g} J, expected no more than following_energy = {self._most_behind:g} J; joint "
            lost += f"'{names[k]}' is {abs(command.error[k]):.3g} behind"
        elif held and (went > STEP).any():
            k = int(np.argmax(went))
            lost = (
                f"that of joint '{names[k]}' has gone on by {went[k]:.3g} during a hold, expected no more than {STEP:g}"
            )
        else:
            return command, ""
        self.void()
        self.begin(state)
        return self.command(state), f"target given up: {lost}"

    def command(self, state):
        """Drive the joints to where they should be now."""
        self.desired = self._target.sample(state.newest, self._lag)
        return self.law.command(state.position, state.velocity, *self.desired)


LAWS = {mode.name: mode for mode in (GravityCompensationMode, DampingMode, PoseMode, TrackingMode)}
"""All modes by name."""

MODES = tuple(LAWS)
"""Their names."""

GRAVITY_COMPENSATION, DAMPING, POSE, TRACKING = MODES
