# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller beside other controllers of a manager, in lockstep with a plant."""

import numpy as np
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

import diag_dynamics as dd
from arm import pinocchio_command
from controlled import frictionless
from controller_managers import ControllerManager
from controllers import HOLDING, RAMPING_DOWN, START_AT, Controller, gravity_of
from diag_dynamics.control.loop import BRAKING
from diag_dynamics.nodes.support.statuses import LOG_PERIOD
from nodes import MS, UR5, S, joint_state, robot

NAMES = robot(UR5).names
PERIOD, DELAY = 2 * MS, 3
"""Of states, and of the activity behind a switch [cycles]."""
MAX_SPEED = 0.03
"""Maximum speed after a switch from rest [rad/s]."""
MODES = "gravity_compensation", "damping", "pose", "tracking", "regulation"
VELOCITY = np.array([0.3, -0.2, 0.25, 0.5, -0.4, 0.3])


class Switched(Controller):
    """A UR5 that a trajectory controller moves at a `velocity`, the node, or else brakes hold."""

    def __init__(self, peer, namespace, **parameters):
        self.now = 1000 * S
        self.velocity = np.zeros(6)
        self.plant = frictionless(dd.load_urdf(robot(UR5).path), START_AT, step=1e-9 * PERIOD)
        self.manager = ControllerManager(
            peer, namespace, trajectories="active", effort_controller="inactive"
        )
        self.clock = peer.publisher(Clock, f"{namespace}/clock")
        self.states = peer.publisher(JointState, f"{namespace}/joint_states")
        defaults = {"autostart": True, "use_sim_time": True, "controlled_link": "tool0"}
        defaults["following_energy"] = 0.0  # which would give set-points up
        defaults |= {"robot_description": robot(UR5).path, "robot_compensates_gravity": False}
        super().__init__(
            peer, namespace, "-r", f"/clock:={namespace}/clock", **(defaults | parameters)
        )

    def __exit__(self, *error):
        super().__exit__(*error)
        self.manager.leave()

    def pass_cycle(self, publishes=True):
        """Publish time and the state; let the active controller move the arm for a period."""
        self.now += PERIOD
        self.clock.publish(Clock(clock=joint_state(stamp=self.now).header.stamp))
        if publishes:
            self.states.publish(joint_state(NAMES, self.plant.q, self.plant.qd, stamp=self.now))
        self.peer.graph.spin()
        if self.manager.states.get("effort_controller") == "active":
            self.plant.advance(np.array(self.sent.messages[-1].data))
        else:
            moves = self.manager.states.get("trajectories") == "active"
            velocity = self.velocity * moves
            self.plant.reset(self.plant.q + 1e-9 * PERIOD * velocity, velocity)
        return np.abs(self.plant.qd).max()

    def run(self, seconds, publishes=True):
        """Return the largest speed [rad/s] of a time."""
        return max(self.pass_cycle(publishes) for _ in range(round(seconds * S / PERIOD)))

    def move(self, seconds):
        """Have the trajectory controller move the arm for a time, and stop it."""
        self.velocity = VELOCITY
        self.run(seconds)
        self.velocity = np.zeros(6)
        self.run(0.01)

    def activate(self, name, instead):
        """Switch controllers; the activity is late. Return the largest speed meanwhile."""
        publish, self.manager.publish = self.manager.publish, lambda: None
        self.manager.switch([instead], [name])
        speed = max(self.pass_cycle() for _ in range(DELAY))
        self.manager.publish = publish
        publish()
        return speed


@pytest.fixture(scope="module")
def shared(peer):
    with Switched(peer, "/switched") as arm:
        yield arm


@pytest.fixture
def arm(shared):
    """Return the arm at rest at its start, with the trajectory controller active."""
    if shared.manager.states["effort_controller"] == "active":
        shared.activate("trajectories", "effort_controller")
    shared.plant.reset(START_AT, np.zeros(6))
    shared.velocity = np.zeros(6)
    shared.run(0.02)  # a jump is accepted when three states agree
    return shared


def test_while_another_controller_moves_the_arm(arm):
    """The node sends gravity torque and damping, warns and rejects targets."""
    assert arm.ask("tracking").success
    arm.velocity = VELOCITY
    arm.run(0.05)
    status = arm.status.messages[-1]
    reason = "controller 'effort_controller' is inactive"
    assert (status.phase, status.mode, status.message) == (HOLDING, "tracking", reason)
    stamp = arm.status.messages[-1].header.stamp
    assert stamp.sec * S + stamp.nanosec == arm.now
    q = arm.plant.q - 1e-9 * PERIOD * VELOCITY  # the state of the command
    expected = pinocchio_command("damping_10", q, VELOCITY, None)
    np.testing.assert_allclose(arm.sent.messages[-1].data, expected, atol=1e-9)
    arm.wait_until_told("control", f"holding gravity: {reason}", b"\1")
    arm.refuses(lambda: arm.set_point.publish(joint_state(NAMES, START_AT)), reason)
    assert f"Holding gravity: {reason}." in arm.process.output


@pytest.mark.parametrize("mode", MODES)
def test_a_switch_from_rest(arm, mode):
    """The arm stays where it is, not where it was when the mode was chosen."""
    assert arm.ask(mode).success
    arm.run(0.1)  # a law in force would keep its set-point
    arm.move(0.4)
    assert max(arm.activate("effort_controller", "trajectories"), arm.run(0.4)) <= MAX_SPEED
    assert arm.status.messages[-1].mode == mode
    arm.wait_until_told("control", f"mode {mode}", b"\0")


@pytest.mark.parametrize("mode", MODES)
def test_a_switch_in_motion(arm, mode):
    """No joint becomes faster than the fastest one was, and the status reports the braking."""
    assert arm.ask(mode).success
    arm.velocity = VELOCITY
    before = arm.run(0.02)
    assert arm.activate("effort_controller", "trajectories") <= before * (1.0 + 1e-6)
    assert arm.run(0.02) <= before * (1.0 + 1e-6)
    assert arm.status.messages[-1].message == BRAKING
    assert arm.run(0.6) <= before * (1.0 + 1e-6)
    assert not arm.status.messages[-1].message


def test_a_command_at_the_activation(arm):
    """The effort controller has forgotten its command: the next one does not wait for a state."""
    arm.run(0.02)
    count = len(arm.sent.messages)
    arm.manager.switch(["trajectories"], ["effort_controller"])
    arm.peer.graph.spin()
    (command,) = arm.sent.messages[count:]
    np.testing.assert_allclose(command.data, arm.sent.messages[count - 1].data, atol=1e-9)


def test_a_law_starts_anew_with_its_controller(arm):
    """An earlier set-point, and efforts on the way to it, do not count."""
    assert arm.ask("tracking").success
    arm.activate("effort_controller", "trajectories")
    arm.run(0.1)
    arm.set_point.publish(joint_state(NAMES, arm.plant.q + 0.5))
    assert arm.run(0.3) > MAX_SPEED
    arm.activate("trajectories", "effort_controller")
    arm.move(0.1)
    assert max(arm.activate("effort_controller", "trajectories"), arm.run(0.4)) <= MAX_SPEED


def test_a_controller_that_is_loaded_and_activated_at_once(arm):
    """Another node may receive the commands before, so that the law is in force."""
    del arm.manager.states["effort_controller"]
    arm.manager.publish()
    assert arm.ask("tracking").success
    arm.run(0.2)
    arm.move(0.2)
    assert np.abs(arm.status.messages[-1].tracking_error).max() > 0.05
    arm.manager.states |= {"trajectories": "inactive", "effort_controller": "active"}
    arm.manager.publish()
    assert arm.run(0.4) <= MAX_SPEED


def test_a_hold_for_another_reason(arm):
    """Each reason has a line, the second one within ten seconds."""
    arm.activate("effort_controller", "trajectories")
    arm.run(0.1)
    arm.peer.pass_time(LOG_PERIOD)  # since a line about an equal hold
    begin = len(arm.process.output)
    arm.run(0.05, publishes=False)
    arm.manager.switch(["effort_controller"], ["trajectories"])
    arm.run(0.1)
    reason = "holding gravity: controller 'effort_controller' is inactive"
    arm.wait_until_told("control", reason)
    arm.peer.pass_time(LOG_PERIOD + 1.0)
    for line in ("Holding gravity: the state is too old", reason.capitalize()):
        assert line in arm.process.output[begin:]


def test_a_restart_of_the_manager(peer):
    """Hold, ramp, silence; then gravity torque at rest, before the controller is active again."""
    with Switched(peer, "/restarted", initial_mode="tracking") as arm:
        arm.run(0.01)
        arm.activate("effort_controller", "trajectories")
        assert arm.run(0.1) <= MAX_SPEED
        arm.manager.leave()
        arm.manager.states = {}
        arm.run(0.8, publishes=False)
        count = len(arm.sent.messages)
        arm.run(0.2, publishes=False)
        assert arm.status.messages[-1].phase == RAMPING_DOWN
        assert len(arm.sent.messages) == count and not any(arm.sent.messages[-1].data)
        key = "state of the effort controller"
        arm.wait_for_report(lambda report: report.values[key] == "unknown", "no manager")
        arm.manager = ControllerManager(peer, "/restarted")
        arm.run(0.1)
        for state in ("unconfigured", "inactive"):
            arm.manager.states["effort_controller"] = state
            arm.manager.publish()
            arm.run(0.02)
        np.testing.assert_allclose(arm.sent.messages[-1].data, gravity_of(START_AT), atol=1e-6)
        assert arm.activate("effort_controller", "trajectories") <= MAX_SPEED
        assert arm.run(0.5) <= MAX_SPEED
        arm.wait_until_told("control", "mode damping; choose a mode to go on after the ramp", b"\1")
        for line in ("Holding gravity: ", "Ramping down: "):
            assert line in arm.process.output
