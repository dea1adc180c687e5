# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Controller and monitor beside the real ros2_control, with the launch file, at 1 kHz.

DIAG_DYNAMICS_ROS2_CONTROL names a prefix with ros2_control, ros2_controllers, `ros2 launch`, `ros2
topic` and the hardware of test/plant: a rigid UR5 with brakes that obeys positions or efforts.
Real-time priority has to be permitted. `pytest -rP` shows the measured figures.
"""

import os
import signal
from pathlib import Path

import numpy as np
import pytest
import yaml
from controller_manager_msgs.srv import ListControllers, SwitchController
from rclpy.serialization import deserialize_message
from scipy.ndimage import maximum_filter1d
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from controllers import trajectory
from diag_dynamics.control.modes import LAWS
from nodes import LATCHED, UR5, QoSProfile, Reports, S, String, description, nanoseconds, robot
from processes import Process, node_process

PREFIX = os.environ.get("DIAG_DYNAMICS_ROS2_CONTROL", "")
pytestmark = [
    pytest.mark.full,
    pytest.mark.live,
    pytest.mark.skipif(not PREFIX, reason="DIAG_DYNAMICS_ROS2_CONTROL names no prefix"),
]

ROOT = Path(__file__).resolve().parents[2]
NAMES, START = robot(UR5).names, (0.0, -1.3, 1.5, -0.8, 0.7, 0.3)
EFFORTS, POSITIONS = "effort_controller", "joint_trajectory_controller"
NODE = "/diag_dynamics_controller"
MAX_SPEED, MAX_FALLS = 0.03, 5
"""Speed of an arm at rest [rad/s], and most cycles without a command after an activation."""
MARGIN = 1.1
"""Factor on the speed of a fall: periods of the loop are not those of the stamps."""
MAX_DISPLACEMENT, DAMPING = 0.01, 10.0
"""Maximum displacement of an arm at rest [rad], and rate by default at which it stops [1/s]."""
VELOCITY = 0.3
"""Velocity of all joints in a motion [rad/s]."""
ROUNDING = 0.01
"""Relative error of the constant velocity of a motion."""
PUSH = 25.0
"""External torque on the elbow [N m]."""
REAL_TIME = "chrt -f 40"
"""Command before programs that must not wait for a CPU."""


def hardware():
    """Return the URDF with the plant at its start."""
    joints = "".join(
        f'<joint name="{name}"><command_interface name="position"/>'
        f'<command_interface name="effort"/>'
        '<state_interface name="position"/><state_interface name="velocity"/>'
        '<state_interface name="effort"/></joint>'
        for name in NAMES
    )
    plugin = f'<plugin>dd_plant/Plant</plugin><param name="q">{" ".join(map(str, START))}</param>'
    system = (
        f'<ros2_control name="ur5" type="system">'
        f"<hardware>{plugin}</hardware>{joints}</ros2_control>"
    )
    return robot(UR5).urdf.replace("</robot>", f"{system}</robot>")


def parameters(folder):
    """Return the file of the launch file, with a trajectory controller and a link for poses."""
    values = yaml.safe_load((ROOT / "config" / "effort_controllers.yaml").read_text())
    manager = values["/**/controller_manager"]["ros__parameters"]
    manager[POSITIONS] = {"type": "joint_trajectory_controller/JointTrajectoryController"}
    interfaces = {"command_interfaces": ["position"], "state_interfaces": ["position", "velocity"]}
    values[f"/**/{POSITIONS}"] = {"ros__parameters": {"joints": list(NAMES)} | interfaces}
    values["/**/diag_dynamics_controller"]["ros__parameters"]["controlled_link"] = "tool0"
    path = folder / "arm.yaml"
    path.write_text(yaml.safe_dump(values))
    return path


class States:
    """Joint states that arrive from now on."""

    def __init__(self, peer):
        self._peer = peer
        self._raw = []
        self._subscription = peer.node.create_subscription(
            JointState, "joint_states", self._raw.append, QoSProfile(depth=4000), raw=True
        )

    def begin(self):
        """Return once the first state has arrived."""
        self._peer.wait_until(lambda: self._raw, "states")
        return self

    def end(self, seconds):
        """Read the states until a time from now: positions [rad] and velocities [rad/s]."""
        end = self._peer.now() + seconds * S
        self._peer.wait_until(lambda: self._raw and stamp_of(self._raw[-1]) >= end, "states")
        self._peer.node.destroy_subscription(self._subscription)
        messages = [deserialize_message(raw, JointState) for raw in self._raw]
        # joint_state_broadcaster may begin with a message that lacks values
        messages = [message for message in messages if len(message.effort) == len(NAMES)]
        order = [messages[0].name.index(name) for name in NAMES]
        self.position = np.array([message.position for message in messages])[:, order]
        self.velocity = np.array([message.velocity for message in messages])[:, order]
        self.speed = np.abs(self.velocity).max(axis=1)
        self.displacement = np.abs(self.position - self.position[0]).max()
        self.stamps = [nanoseconds(message.header.stamp) for message in messages]
        self.falls = ~np.array([any(message.effort) for message in messages])
        return self

    @property
    def limit(self):
        """Largest speed that the time without a command may add [rad/s].

        effort_controller forgets its command when it is activated. The arm falls until it receives
        the next one.
        """
        still = np.zeros(len(NAMES))
        times = maximum_filter1d(np.diff(self.stamps), 3)
        fall = robot(UR5).oracle.forward_dynamics(self.position[0], still, still)
        return max(MARGIN * np.abs(fall).max() * times[self.falls[1:]].sum() / S, MAX_SPEED)

    def require_rest(self):
        """See that an arm at rest has only fallen, and little."""
        assert self.speed.max() <= self.limit
        assert self.displacement <= MAX_DISPLACEMENT + self.limit / DAMPING

    def report(self, what):
        """Print the figures, and see that few cycles lacked a command."""
        print(
            f"{what}: peak {self.speed.max():.4f} rad/s, displacement {self.displacement:.5f} rad; "
            f"{self.falls.sum()} cycles without command"
        )
        assert self.falls.sum() <= MAX_FALLS


def stamp_of(raw):
    """Return the stamp of a serialized JointState [ns]."""
    return nanoseconds(deserialize_message(raw, JointState).header.stamp)


class Arm:
    """A simulated UR5 with ros2_control, started by the launch file."""

    def __init__(self, peer, folder):
        self.peer = peer
        self.file = parameters(folder)
        self._description = peer.publisher(String, "robot_description", LATCHED)
        self._description.publish(description(hardware()))
        self.targets = peer.publisher(JointTrajectory, f"{POSITIONS}/joint_trajectory")
        self.pushes = peer.publisher(Float64MultiArray, "plant/external_torque")
        self.first = States(peer)
        self.reports = Reports(peer.node, peer.wait_until, NODE)
        path = ROOT / "launch" / "ros2_control.launch.py"
        arguments = [f"params_file:={self.file}", f"prefix:={REAL_TIME}"]
        self.launched = Process(["ros2", "launch", path, *arguments])

    def wait_until_told(self, *texts):
        """Wait until the status of the law has one of these texts."""
        begin = len(self.reports)

        def is_told():
            assert self.launched.alive(), self.launched.tail()
            statuses = [report.entries.get("control") for report in self.reports[begin:]]
            return any(text in status.message for text in texts for status in statuses if status)

        self.peer.wait_until(is_told, texts)

    def service(self, kind, name, **fields):
        """Call a service of controller_manager."""
        return self.peer.call(kind, f"/controller_manager/{name}", kind.Request(**fields))

    def state_of(self, controller):
        """Return the state of a controller."""
        response = self.service(ListControllers, "list_controllers")
        states = {listed.name: listed.state for listed in response.controller}
        return states.get(controller)

    def spawn(self, *words):
        """Have a spawner load controllers."""
        program = Path(PREFIX, "lib", "controller_manager", "spawner")
        with Process([program, *words]) as spawner:
            assert spawner.wait() == 0, spawner.tail()

    def switch(self, on, off):
        """Switch controllers in one cycle."""
        response = self.service(
            SwitchController,
            "switch_controller",
            activate_controllers=on,
            deactivate_controllers=off,
            strictness=SwitchController.Request.STRICT,
            activate_asap=True,
        )
        assert response.ok, response.message

    def run(self, seconds):
        """Return the states of the next seconds."""
        return States(self.peer).begin().end(seconds)

    def move(self, velocity):
        """Have the trajectory controller move all joints, and return at a velocity [rad/s]."""
        self.peer.wait_until(lambda: self._moves(velocity), "a motion")

    def _moves(self, velocity):
        """Publish a trajectory, and return whether the arm has its velocity after 1.2 s.

        It may be lost: for 20 s after a kill, subscriptions of the former manager count as well.
        """
        q = self.run(0.02).position[-1]
        points = [(time, q + velocity * (time - 0.5), np.full(6, velocity)) for time in (1.0, 4.0)]
        end = (5.0, points[-1][1] + 0.5 * velocity, np.zeros(6))
        self.targets.publish(trajectory([*points, end], NAMES))
        return np.abs(self.run(1.2).velocity[-1]).min() >= VELOCITY * (1.0 - ROUNDING)

    def push(self, torque):
        """Push until the reaction has switched to efforts."""

        def has_switched():
            self.pushes.publish(Float64MultiArray(data=torque))
            return self.state_of(EFFORTS) == "active"

        self.peer.wait_until(has_switched, "the reaction")


@pytest.fixture(scope="module")
def arm(peer, tmp_path_factory):
    arm = Arm(peer, tmp_path_factory.mktemp("ros2_control"))
    with arm.launched:
        arm.wait_until_told("holding gravity")  # before, the node does not know the manager yet
        arm.wait_until_told("mode damping")
        arm.first.end(1.0)
        arm.spawn(POSITIONS, "--inactive")
        yield arm


def test_the_launch_file(arm):
    """It activates the effort controller after the node; the arm stays where it is."""
    assert f"Holding gravity: controller '{EFFORTS}' is inactive" in arm.launched.output
    states = arm.first
    states.report("launch file")
    assert arm.state_of(EFFORTS) == "active"
    states.require_rest()


@pytest.mark.parametrize("mode", LAWS)
def test_a_switch(arm, mode):
    """From rest the arm only falls; in motion no joint becomes faster than it was by more."""
    arm.switch([POSITIONS], [EFFORTS])
    response = arm.peer.call(Trigger, f"{NODE}/mode/{mode}", Trigger.Request(), NODE)
    assert response.success, response.message
    states = States(arm.peer).begin()
    arm.switch([EFFORTS], [POSITIONS])
    states.end(1.0).report(f"{mode}, from rest")
    states.require_rest()
    arm.switch([POSITIONS], [EFFORTS])
    arm.move(VELOCITY if list(LAWS).index(mode) % 2 else -VELOCITY)
    states = States(arm.peer).begin()
    arm.switch([EFFORTS], [POSITIONS])
    states.end(1.0).report(f"{mode}, in motion")
    assert states.speed.max() <= VELOCITY * (1.0 + ROUNDING) + states.limit


def test_a_restart_and_a_reaction(arm):
    """controller_manager is killed and starts again, in the order of the documentation."""
    started = {process.name()[:12]: process for process in arm.launched.children()}
    started["ros2_control"].send_signal(signal.SIGKILL)
    arm.wait_until_told("ramping down")
    program = Path(PREFIX, "lib", "controller_manager", "ros2_control_node")
    arm.peer.clients.clear()  # of the former manager
    command = [*REAL_TIME.split(), program, "--ros-args", "--params-file", arm.file]
    with Process(command) as manager:
        arm.spawn("joint_state_broadcaster")
        arm.wait_until_told("choose a mode to go on", "holding gravity")
        arm.spawn(EFFORTS, "--inactive")
        key = "state of the effort controller"
        arm.reports.wait_for(lambda report: report.values.get(key) == "inactive", "the new manager")
        states = States(arm.peer).begin()
        arm.switch([EFFORTS], [])
        states.end(2.0).report("after a restart")
        states.require_rest()
        arm.spawn(POSITIONS, "--inactive")
        check_reaction(arm)
        manager.signal(signal.SIGKILL)  # at SIGINT it has ended by SIGSEGV
        manager.wait()


def check_reaction(arm):
    """A push in a motion switches to the effort controller, which brakes the arm."""
    arm.switch([POSITIONS], [EFFORTS])
    parameters = {
        "reaction.service": "controller_manager/switch_controller",
        "reaction.deactivate": f"[{POSITIONS}]",
        "reaction.activate": f"[{EFFORTS}]",
        "external_torque.gain": 50.0,
        "collision.threshold": '["*=8.0"]',
        "effort_scale": '["*=1.0"]',
        "effort_includes_gravity": '["*=true"]',
    }
    push = PUSH * (np.array(NAMES) == "elbow_joint")
    reports = Reports(arm.peer.node, arm.peer.wait_until, "/diag_dynamics")
    with node_process("monitor", **parameters):
        reports.wait_for(
            lambda report: report.entries["reaction"].message.endswith(": ready"), "reaction"
        )

        def judges(report):
            status = report.entries.get("external torque")
            return status and status.message == "no collision"

        reports.wait_for(judges, "a judgement")
        arm.move(VELOCITY)
        states = States(arm.peer).begin()
        arm.push(push)
        states.end(2.0)
        print(reports.wait_for(lambda report: report.values["calls"] == "1", "the call").values)
        states.report("reaction")
        assert np.abs(states.velocity[-1]).max() <= MAX_SPEED
