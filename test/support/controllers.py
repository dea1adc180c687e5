# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A controller as tests see it, and its commands by Pinocchio alone."""

import contextlib

import numpy as np
import pinocchio as pin
from diag_dynamics.msg import ControllerStatus
from diag_dynamics.srv import SetState
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm import gravity_of as gravity_of
from arm import pinocchio_command as pinocchio_command
from arm import pose_of as pose_of
from nodes import MANY, UR5, Reports, S, Topic, joint_state, nanoseconds
from simulators import Simulator

NODE = "diag_dynamics_controller"
ACTIVE = ControllerStatus.PHASE_ACTIVE
HOLDING = ControllerStatus.PHASE_HOLDING
RAMPING_DOWN = ControllerStatus.PHASE_RAMPING_DOWN

GAINS = {"damping": ["*=8.0", "elbow_joint=5.0"], "tracking_gain": ["*=20.0", "wrist_1_joint=30.0"]}
"""For a UR5; all others are the defaults."""
START_AT = (0.3, -1.2, 1.4, -0.6, 0.5, 0.2)
"""A UR5 well away from singularities."""


class Controller:
    """A controller, its outputs and its inputs."""

    def __init__(
        self, peer, namespace, *arguments, commands="effort_controller/commands", **parameters
    ):
        """Start it; a context at whose end it ends."""
        self.peer = peer
        self.name = f"{namespace}/{NODE}"
        self.namespace = namespace
        self.status = peer.topic(ControllerStatus, f"{self.name}/status")
        self.sent = peer.topic(Float64MultiArray, f"{namespace}/{commands}")
        self.target = peer.publisher(PoseStamped, f"{namespace}/target")
        self.trajectory = peer.publisher(JointTrajectory, f"{self.name}/joint_trajectory")
        self.set_point = peer.publisher(JointState, f"{namespace}/set_point")
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        self._arguments = ("-r", f"effort_controller/commands:={commands}", *arguments)
        self._parameters = {"initial_mode": "tracking"} | parameters
        self.start()

    def start(self):
        """Start the process."""
        self.process = self.peer.start(
            "controller", "-r", f"__ns:={self.namespace}", *self._arguments, **self._parameters
        )

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.__exit__(*error)

    def listens(self):
        """Whether it takes targets."""
        return all(
            end.get_subscription_count() for end in (self.target, self.trajectory, self.set_point)
        )

    def connect(self):
        """Wait until it controls."""
        self.peer.wait_until(self.listens, f"{self.name} to listen")
        self.peer.wait_until(lambda: self.status.messages, f"status of {self.name}")
        return self

    def wait_for_report(self, condition, what, begin=None):
        """Return the first report for which a condition holds: see :meth:`Reports.wait_for`."""
        return self.reports.wait_for(condition, what, begin)

    def wait_until_told(self, entry, text, level=None, begin=None):
        """Return the first report of which one entry has this text, and this level."""

        def told(report):
            status = report.entries.get(entry)
            return status and text in status.message and level in (None, status.level)

        return self.wait_for_report(told, f"{entry}: {text}", begin)

    def wait_for(self, condition, what, timeout=60.0, since=None):
        """Return the first status, from now on or from the one of a number, for which a condition
        holds.

        The time [s] for it is that of the stamps: in lockstep, it takes a busy machine long to
        simulate a second.
        """
        at = len(self.status.messages) if since is None else since
        begun = None
        newest = None
        while begun is None or nanoseconds(newest.header.stamp) - begun < timeout * S:
            self.peer.wait_until(
                lambda at=at: len(self.status.messages) > at,
                f"a status, and {what}",
            )
            new = self.status.messages[at:]
            at = len(self.status.messages)
            if status := next(filter(condition, new), None):
                return status
            newest = new[-1]
            begun = nanoseconds(new[0].header.stamp) if begun is None else begun
        description = (
            f"phase {newest.phase}, mode {newest.mode}, K {newest.energy:g}, {newest.message}"
        )
        raise AssertionError(
            f"waited {timeout:g} s by the stamps in vain for {what}; last status: {description}"
        )

    def ask(self, mode):
        """Ask for a law."""
        return self.peer.call(Trigger, f"{self.name}/mode/{mode}", Trigger.Request(), self.name)

    def switch(self, mode):
        """Put a law in force; returns the status of its first command."""
        since = len(self.status.messages)
        answer = self.ask(mode)
        assert answer.success, answer.message
        return self.wait_for(lambda s: s.mode == mode, mode, since=since)

    def refuses(self, publish, said):
        """Publish something wrong, which is refused by name on the diagnostics."""
        begin = len(self.reports)
        publish()

        def told(report):
            inputs = report.entries.get("inputs")
            return (
                inputs
                and "rejected: " in inputs.message
                and said in report.values["last rejection"]
            )

        self.wait_for_report(told, f"refusal: {said}", begin)


@contextlib.contextmanager
def effort_controller(peer, namespace, joints):
    """A node that says which joints it drives, as ros2_control's effort controller."""
    node = peer.extra_node("effort_controller", namespace)
    node.declare_parameter("joints", list(joints))
    try:
        yield f"{namespace}/effort_controller"
    finally:
        peer.drop_node(node)


# --- with a simulator


class PassedOn(Topic):
    """Commands that the test passes on to the robot, as an effort controller does: in lockstep
    nothing is ahead of it.
    """

    def __init__(self, controller, simulator):
        """Take the place of what the controller has sent."""
        self._send = simulator.commands.publish
        name = controller.sent.subscription.topic_name
        controller.peer.node.destroy_subscription(controller.sent.subscription)
        super().__init__(controller.peer.node, Float64MultiArray, name, MANY)

    def _take(self, message):
        super()._take(message)
        self._send(message)


@contextlib.contextmanager
def lockstep_arm(peer, namespace, order, **parameters):
    """A UR5 at 250 Hz in lockstep with its controller, whose commands are in the order of joints
    `order`.
    """
    simulated = {"lockstep": True, "rate": 250.0, "command_joints": order, "wrench_timeout": 0.0}
    options = {
        "robot_compensates_gravity": False,
        "autostart": True,
        "use_sim_time": True,
        "command_joints": order,
    }
    with (
        effort_controller(peer, namespace, order),
        Simulator(peer, namespace, UR5, **simulated) as simulator,
    ):
        put(simulator, START_AT)
        quiet(simulator)
        with Controller(
            peer, namespace, commands="effort_controller/asked", **options, **parameters
        ) as controller:
            controller.simulator = simulator
            controller.sent = PassedOn(controller, simulator)
            states = peer.publisher(JointState, simulator.states.subscription.topic_name)
            states.publish(
                simulator.states.messages[-1]
            )  # the controller was not there when it came
            yield controller.connect()
            peer.node.destroy_publisher(states)


def begin_at_rest(arm):
    """Put the arm at rest at its start, with its position as the target."""
    arm.simulator.push("tool0", 0, 0, 0, 0, 0, 0)
    arm.switch("tracking")
    put(arm.simulator, START_AT)
    arm.switch("damping")
    arm.switch("tracking")
    record(arm)


def quiet(simulator):
    """Do not listen to what no test looks at: it is more than this process can take in."""
    for topic in (simulator.truth, simulator.odometry):
        simulator.peer.node.destroy_subscription(topic.subscription)


def put(simulator, q, qd=()):
    """Put a simulator's robot somewhere, by default at rest."""
    answer = simulator.call(SetState, "set_state", state=joint_state(simulator.robot.names, q, qd))
    assert answer.success, answer.message


def record(arm):
    """Forget what was said, to look at what comes."""
    for topic in (arm.status, arm.sent, arm.simulator.states):
        topic.forget()


# --- what should come


def untouched(status):
    """Whether no filter has changed a command."""
    return status.phase == ACTIVE and not status.saturated_dofs and not status.energy_limited


def pose_error(status):
    """Norms of position and orientation error; infinite where there is none."""
    if not status.pose_error_valid:
        return (np.inf, np.inf)
    return tuple(
        np.linalg.norm([e.x, e.y, e.z]) for e in (status.position_error, status.orientation_error)
    )


def pose_message(link, position, axes=None):
    """Return a PoseStamped."""
    message = PoseStamped()
    message.header.frame_id = link
    p = message.pose.position
    o = message.pose.orientation
    p.x, p.y, p.z = map(float, position)
    o.x, o.y, o.z, o.w = map(
        float, pin.Quaternion(np.eye(3) if axes is None else np.array(axes)).coeffs()
    )
    return message


def trajectory(points, names, stamp=0):
    """Return a JointTrajectory of (time, positions, velocities, accelerations)."""
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
    for seconds, *fields in points:
        point = JointTrajectoryPoint()
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(seconds * S), S)
        for field, values in zip(
            ("positions", "velocities", "accelerations"), fields, strict=False
        ):
            setattr(point, field, [float(x) for x in values])
        message.points.append(point)
    return message
