# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller by itself, with the clock in the test's hands: what it refuses, when it stops, and
what it sends then.
"""

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

import diag_dynamics as dd
from controllers import (
    ACTIVE,
    GAINS,
    HOLDING,
    RAMPING_DOWN,
    START_AT,
    Controller,
    effort_controller,
    gravity_of,
    pinocchio_command,
    pose_message,
    trajectory,
    untouched,
)
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.controller.lifecycle import SUCCESS
from diag_dynamics.nodes.support.statuses import LOG_PERIOD
from nodes import LATCHED, MS, PANDA, UR5, S, description, joint_state, nanoseconds, robot

Q, REST = np.array(START_AT), np.zeros(6)
NAMES = robot(UR5).names
MOVING = np.array([0.4, -0.3, 0.5, 0.2, -0.6, 0.3])
PERIOD, LOOK = 2 * MS, 5 * MS
"""Of states, and of looking whether one has come."""
MOST = 500
"""States until efforts have gone anywhere at their rate, and more."""
EFFORT_RATE = 800.0
HOLD = 0.4
GAIN = 20.0
"""Of the tracking gains here: enough for efforts at their limits."""


class Fed(Controller):
    """A controller whose joint states and clock are the test's: it acts on nothing else, however
    late the machine is.
    """

    def __init__(self, peer, namespace, id=UR5, **parameters):
        """Start it."""
        self.now = 1000 * S
        self.clock = peer.publisher(Clock, f"{namespace}/clock")
        self.states = peer.publisher(JointState, f"{namespace}/joint_states")
        self.descriptions = peer.publisher(String, f"{namespace}/robot_description", LATCHED)
        self.descriptions.publish(description(robot(id).urdf))
        defaults = {
            "autostart": True,
            "use_sim_time": True,
            "hold_time": HOLD,
            "effort_rate": [f"*={EFFORT_RATE}"],
            "damping": GAINS["damping"],
            "tracking_gain": [f"*={20.0 * GAIN}", f"wrist_1_joint={30.0 * GAIN}"],
            "controlled_link": "tool0",
            "set_point_speed": 1.0,
            "following_energy": 0.0,  # the arm that is fed does not move
        }
        super().__init__(
            peer, namespace, "-r", f"/clock:={namespace}/clock", **(defaults | parameters)
        )

    def connect(self):
        """Wait until it answers states."""
        self.peer.wait_until(self.listens, f"{self.name} to listen")
        self.peer.wait_until(self.clock.get_subscription_count, "its clock")
        self.peer.become_known(self.name)
        self.step()
        return self

    def tick(self, step=PERIOD):
        """Let time go on."""
        self.now += step
        self.clock.publish(Clock(clock=joint_state(stamp=self.now).header.stamp))

    def publish(self, q=Q, qd=REST, names=NAMES, stamp=None):
        """Publish a joint state."""
        self.states.publish(joint_state(names, q, qd, stamp=self.now if stamp is None else stamp))

    def answered(self, publish, condition, what):
        """Publish until a status fulfils a condition, and return that."""
        for _ in range(MOST):
            at = len(self.status.messages)
            publish()
            self.peer.graph.spin()
            if status := next(filter(condition, self.status.messages[at:]), None):
                return status
        raise AssertionError(f"{what} did not come in {MOST} messages")

    def step(self, q=Q, qd=REST):
        """Feed one state, and return the status of the law's command for it."""

        def publish():
            self.tick()
            self.publish(q, qd)

        def is_now(s):
            return s.phase == ACTIVE and nanoseconds(s.header.stamp) == self.now

        return self.answered(publish, is_now, "its answer")

    def settle(self, q=Q, qd=REST):
        """Feed the same state until efforts have come to what the law asks for."""
        return next(s for s in (self.step(q, qd) for _ in range(MOST)) if not s.saturated_dofs)

    def arrive(self, q=Q, qd=REST):
        """Feed the same state until the set-point is where the law aims."""
        status = self.step(q, qd)
        last = np.inf
        while np.abs(np.array(status.tracking_error) - last).max() > 1e-13:
            status, last = self.step(q, qd), np.array(status.tracking_error)
        return status

    def silence(self, phase):
        """Let time go on without states until a phase begins."""
        self.tick(20 * MS)
        return self.answered(lambda: self.tick(LOOK), lambda s: s.phase == phase, f"phase {phase}")

    def take_up(self, mode, q=Q, qd=REST):
        """Publish valid states again, and then choose a mode, which is rejected before."""
        assert not self.ask(mode).success
        assert self.step(q, qd).mode == "damping"
        ramp = "mode damping; choose a mode to go on after the ramp: "
        self.wait_until_told("control", ramp, b"\1")
        return self.law(mode)

    def take(self, publisher, message):
        """Publish a target and wait until it is taken."""
        topic = publisher.topic_name.rpartition("/")[2]
        key = f"{topic} accepted"
        self.peer.become_known(self.name)
        before = int(self.wait_for_report(lambda r: True, "a report").values.get(key, 0))
        publisher.publish(message)
        self.wait_for_report(
            lambda r: int(r.values.get(key, 0)) > before, f"{topic} to be accepted"
        )

    def law(self, mode):
        """Put a law in force; returns the first status after that."""
        answer = self.ask(mode)
        assert answer.success, answer.message
        status = self.step()
        assert status.mode == mode
        return status


class ByTheWall(Fed):
    """The same by system time, as a real robot's."""

    def connect(self):
        """Wait until it answers states."""
        self.peer.wait_until(self.listens, f"{self.name} to listen")
        self.step()
        return self

    def tick(self, step=PERIOD):
        """Let time go on."""
        self.peer.pass_time(step / S)
        self.now = self.peer.now()


@pytest.fixture(scope="module", params=[False, True], ids=["robot", "robot that carries itself"])
def fed(peer, request):
    """A controller of a UR5, and of one that adds what carries it."""
    namespace = "/carried" if request.param else "/fed"
    with Fed(peer, namespace, robot_compensates_gravity=request.param) as controller:
        controller.compensated = request.param
        yield controller.connect()


ONE = pytest.mark.parametrize("fed", [False], indirect=True, ids=["robot"])
"""For what has nothing to do with efforts."""


@pytest.fixture
def damped(fed):
    """The same while it damps, having come to the efforts of a UR5 in motion."""
    fed.law("damping")
    fed.settle(Q, MOVING)
    fed.status.forget()
    fed.sent.forget()
    return fed


def sent_for(fed, effort):
    """What is to be sent for efforts that carry the robot, too."""
    return effort - fed.compensated * gravity_of(Q)


def wait_for_command(fed, expected):
    """Wait until the last command that has come is this one: it may be later than what is told of
    it.
    """
    atol = 1e-9 * max(1.0, np.abs(expected).max())
    sent = fed.sent.messages
    fed.peer.wait_until(
        lambda: sent and np.allclose(sent[-1].data, expected, rtol=1e-7, atol=atol),
        f"the command {expected}",
    )


def close(actual, expected):
    np.testing.assert_allclose(actual, expected, atol=1e-9 * max(1.0, np.abs(expected).max()))


# --- without a valid state


def check_the_end(fed, since, published=lambda: None):
    """From the status `since` on: gravity and no damping, for hold_time, and then zero, at the
    effort rate all the time.
    """
    gravity = sent_for(fed, gravity_of(Q))

    def without():
        fed.tick(LOOK)
        published()

    fed.answered(without, lambda s: s.phase == RAMPING_DOWN, "the end of the hold")
    last = fed.answered(without, lambda s: not any(s.effort_command), "zero")
    assert last.phase == RAMPING_DOWN and last.message
    count = len(fed.sent.messages)
    fed.answered(without, lambda s: s is not last, "a status without a command")
    assert len(fed.sent.messages) == count
    for line in ("Holding gravity: ", "Ramping down: "):
        fed.process.wait_for_text(line)
    statuses = fed.status.messages[fed.status.messages.index(since) :]
    holding = [s for s in statuses if s.phase == HOLDING]
    ramped = statuses[len(holding) :]
    assert all(s.phase == RAMPING_DOWN for s in ramped) and ramped
    close(holding[-1].effort_command, gravity)
    ages = np.array([s.state_age for s in statuses])
    assert HOLD - 0.02 < ages[len(holding) - 1] - ages[0] <= HOLD
    efforts = np.array([s.effort_command for s in statuses])
    assert (
        np.abs(np.diff(efforts, axis=0)).max(axis=1) <= EFFORT_RATE * np.diff(ages) + 1e-9
    ).all()
    assert (np.diff(np.abs(efforts[len(holding) :]), axis=0) <= 1e-12).all()
    assert not any(s.lyapunov_valid for s in statuses)
    fed.wait_until_told("control", "ramping down: ", b"\2")
    fed.take_up("damping", Q, MOVING)


def test_late_states(damped):
    """States end: the last gravity torque for hold_time, then zero; it is said why. A mode that is
    chosen then goes on.
    """
    first = damped.silence(HOLDING)
    assert first.state_age > 0.02 and "s; expected at most max_state_age = 0.02 s" in first.message
    damped.wait_until_told("control", "holding gravity: the state is", b"\1")
    check_the_end(damped, first)
    status = damped.settle(Q, MOVING)
    close(status.effort_command, sent_for(damped, pinocchio_command("damping", Q, MOVING, None)))
    damped.settle()  # at rest: the law is in force again
    damped.wait_until_told("control", "mode damping", b"\0")


WRONG = {
    "NaN": (
        NAMES,
        [*START_AT[:3], np.nan, *START_AT[4:]],
        REST,
        "'wrist_1_joint': position is nan",
    ),
    "no velocities": (NAMES, Q, (), "velocity is nan"),
    "far beyond limits": (NAMES, [*START_AT[:2], 40.0, *START_AT[3:]], REST, "'elbow_joint'"),
    "too fast": (NAMES, Q, [*REST[:2], 20.0, *REST[3:]], "'elbow_joint'"),
    "of another robot": (NAMES, REST, REST, "position jumped"),
}


@ONE
@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_wrong_states(damped, wrong):
    """What is wrong is named at once, and gravity held; good states put the law in force again."""
    names, q, qd, text = wrong

    def publish():
        damped.tick()
        damped.publish(q, qd, names)

    status = damped.answered(publish, lambda s: s.phase != ACTIVE, "the hold")
    assert status.phase == HOLDING and text in status.message and not status.lyapunov_valid
    assert np.isfinite(status.effort_command).all()
    status = damped.step(Q, MOVING)
    assert damped.settle(Q, MOVING).phase == ACTIVE


def test_another_arm_in_turns(damped):
    """It never takes the place of this one, which rests while the other moves."""
    damped.settle(Q, REST)
    for k in range(6):
        damped.tick()
        damped.publish(np.full(6, 0.01 * k), np.full(6, 2.0))
        before = damped.now
        damped.step(Q, REST)
        assert damped.now - before == PERIOD


def test_wrong_states_only(damped):
    """Nothing but NaN: after hold_time the efforts go to zero though messages come."""
    wrong = [np.nan, *START_AT[1:]]
    first = damped.answered(
        lambda: (damped.tick(), damped.publish(wrong)), lambda s: s.phase == HOLDING, "the hold"
    )
    check_the_end(damped, first, lambda: damped.publish(wrong))
    damped.refuses(lambda: damped.publish(wrong), "'shoulder_pan_joint': position is nan")


def test_joints_that_are_not_there(damped):
    """A message without one joint leaves that one to get old, by name; joints of others are not
    listened to.
    """
    status = damped.answered(
        lambda: (damped.tick(), damped.publish(Q[1:], MOVING[1:], NAMES[1:])),
        lambda s: s.phase == HOLDING,
        "the hold",
    )
    assert f"joint '{NAMES[0]}' is older than 0.02 s" in status.message
    damped.settle(Q, MOVING)
    status = damped.answered(
        lambda: (damped.tick(), damped.publish([1.0], [9.0], ["wing_joint"])),
        lambda s: s.phase == HOLDING,
        "the hold",
    )
    assert "s; expected at most max_state_age" in status.message
    damped.settle(Q, MOVING)


def test_silence_of_a_robot_with_mimic_joints(peer):
    """The state is named as too old: no single joint is."""
    panda = robot(PANDA)
    q = np.array([0.0, -0.8, 0.0, -2.3, 0.0, 1.5, 0.8, 0.02])
    parameters = {"damping": ["*=1.0"], "tracking_gain": ["*=1.0"], "controlled_link": "panda_hand"}
    parameters["robot_compensates_gravity"] = False
    with Fed(peer, "/with_mimic", PANDA, **parameters) as fed:
        peer.wait_until(fed.listens, "the controller to listen")

        def publish():
            fed.tick()
            fed.publish(q, 0 * q, panda.names)

        fed.answered(publish, lambda status: status.phase == ACTIVE, "its answer")
        status = fed.silence(HOLDING)
        assert "s; expected at most max_state_age" in status.message


@ONE
@pytest.mark.parametrize("ahead", [0.1, 0.8, 5.0], ids="{} s".format)
def test_a_state_from_the_future(damped, ahead):
    """It is refused by name, and does not make late ones of those that come after it."""
    begin = len(damped.reports)

    def publish():
        damped.tick()
        damped.publish(stamp=damped.now + round(ahead * S))

    status = damped.answered(publish, lambda s: s.phase == HOLDING, "the hold")
    assert (
        f"stamp {ahead:g} s ahead of this node's clock; expected within max_state_age = 0.02 s"
        in status.message
    )
    before = damped.now
    damped.step(Q, MOVING)
    assert damped.now - before == PERIOD
    damped.peer.wait_until(
        lambda: any(
            "rejected: foreign time" in r.values or "rejected: stamp from the future" in r.values
            for r in damped.reports[begin:]
        ),
        "the count",
    )
    damped.settle(Q, MOVING)


@pytest.mark.parametrize("jump", [100.0, 0.9, 0.3], ids="{} s".format)
def test_a_clock_that_goes_back(damped, jump):
    """Targets are void, efforts go on at their rate, and the law is in force again by itself, and
    at once.
    """
    damped.law("tracking")
    damped.take(damped.set_point, joint_state(NAMES, Q + 0.1))
    assert any(damped.step().tracking_error) or any(damped.step().tracking_error)
    damped.status.forget()
    begin = damped.now - round(jump * S)
    damped.now = begin
    status = damped.step()
    assert damped.now - begin < 0.1 * S
    assert not any(status.tracking_error)
    assert "the robot's position replaced the target" in damped.process.output
    efforts = np.array([s.effort_command for s in damped.status.messages])
    assert np.isfinite(efforts).all()
    assert np.abs(np.diff(efforts, axis=0)).max(initial=0) <= 0.02 * EFFORT_RATE + 1e-9
    close(damped.settle().effort_command, sent_for(damped, gravity_of(Q)))


# --- limits


@ONE
def test_efforts_are_limited(fed):
    """By the URDF's limits; the status names the joint."""
    limit = dd.load_urdf(robot(UR5).path).effort_limit
    fed.law("tracking")
    fed.settle()
    fed.take(fed.set_point, joint_state(NAMES, Q + np.array([0.5, -0.6, 0.4, 0.5, -0.5, 0.3])))
    status = fed.arrive()
    (joint,) = status.saturated_dofs
    usage = np.abs(status.effort_command) / limit
    assert usage.max() == usage[NAMES.index(joint)] == pytest.approx(1.0)


# --- targets


@ONE
def test_a_target_that_is_not_reached(fed):
    """Status and diagnostics name the joint, from two seconds after the target has come to rest."""
    fed.law("tracking")
    fed.settle()
    fed.take(fed.set_point, joint_state(NAMES, Q + 0.05 * np.eye(6)[2]))
    fed.arrive()
    for _ in range(1001):
        status = fed.step()
    assert status.message == "joint 'elbow_joint' is 0.05 rad from its target"
    text = "mode tracking; target not reached: joint 'elbow_joint'"
    assert fed.wait_until_told("control", text, b"\1").values["reason"] == status.message


def test_targets_change_and_are_lost(fed):
    """The last one counts; a sender that is gone leaves it in force; the law is Pinocchio's for it
    to 1e-9.
    """
    fed.law("tracking")
    fed.settle()
    sender = fed.peer.publisher(JointState, f"{fed.namespace}/set_point")
    fed.peer.wait_until(sender.get_subscription_count, "the new sender's subscription")
    fed.take(fed.set_point, joint_state(NAMES, Q - 0.002))
    fed.take(sender, joint_state(NAMES, Q + 0.001))
    fed.peer.node.destroy_publisher(sender)
    status = fed.arrive(Q, 0.01 * MOVING)
    assert untouched(status)
    np.testing.assert_allclose(status.tracking_error, np.full(6, 0.001), atol=1e-11)
    close(
        status.effort_command,
        sent_for(fed, pinocchio_command("tracking", Q, 0.01 * MOVING, Q + 0.001, GAIN)),
    )


@ONE
def test_targets_that_make_no_sense(fed):
    """They are refused by name, the last one stays in force, and the node lives."""
    fed.law("tracking")
    fed.take(fed.set_point, joint_state(NAMES, Q + 0.01))
    nan = np.nan
    for publisher, message, text in (
        (fed.set_point, joint_state(NAMES, [nan, *Q[1:]]), "'shoulder_pan_joint' is nan"),
        (fed.trajectory, trajectory([(1.0, Q)], NAMES, stamp=S), "over"),
    ):
        fed.refuses(lambda p=publisher, m=message: p.publish(m), text)
    np.testing.assert_allclose(fed.arrive().tracking_error, np.full(6, 0.01), atol=1e-11)
    fed.law("pose")
    for message, text in (
        (pose_message("base_link", [nan, 0, 0]), "target.pose.position is [nan"),
        (pose_message("", [0, 0, 0]), "''; expected"),
    ):
        fed.refuses(lambda m=message: fed.target.publish(m), text)
    assert fed.step().pose_error_valid


# --- lifecycle


def test_deactivation_leaves_the_gravity_torque(damped):
    """It is the last command, and the only one; targets that come meanwhile are none when it is
    active again.
    """
    assert damped.peer.transition(damped.name, "deactivate")
    damped.wait_until_told("control", "inactive; no commands", b"\1")
    wait_for_command(damped, sent_for(damped, gravity_of(Q)))
    count = len(damped.sent.messages)
    refused = damped.ask("damping")
    assert not refused.success and "inactive" in refused.message
    damped.set_point.publish(joint_state(NAMES, Q + 0.3))
    damped.tick()
    damped.publish()
    damped.wait_until_told("control", "inactive; no commands")
    assert len(damped.sent.messages) == count
    assert damped.peer.transition(damped.name, "activate")
    damped.connect()
    status = damped.step()
    assert status.mode == "tracking" and not any(status.tracking_error)


@ONE
def test_every_hold_has_lines(fed):
    """A second hold within 10 s for another reason ends with a line, too; one for the same reason
    has no lines while it is short, and diagnostics log it when it lasts.
    """
    fed.settle()
    fed.peer.pass_time(LOG_PERIOD)
    begin = len(fed.process.output)

    def hold(names):
        def publish():
            fed.tick()
            fed.publish(names=names)

        fed.answered(publish, lambda s: s.phase == HOLDING, f"a hold by {names}")

    def count(text):
        return fed.process.output[begin:].count(text)

    for k, names in enumerate((["a", *NAMES[1:]], [*NAMES[:5], "b"]), 1):
        hold(names)
        assert count("Holding gravity: ") == k
        fed.step()
        assert count("Resumed: mode ") == k
    hold(["a", *NAMES[1:]])
    assert count("Holding gravity: ") == 2
    fed.wait_until_told("control", "holding gravity: ", b"\1")
    fed.process.wait_for_text("control: holding gravity: ")
    fed.step()


@ONE
def test_another_robot(fed):
    """While active, the controller rejects another description and reports it; deactivated, it
    loads it.
    """
    panda = robot(PANDA)
    fed.settle()
    fed.descriptions.publish(description(panda.urdf))
    fed.wait_until_told(
        "control", "the controller is active. Deactivate it before another robot is loaded.", b"\2"
    )
    fed.wait_until_told("control", "mode ", b"\2")  # which is said all the same
    fed.peer.pass_time(LOG_PERIOD)  # since a line about the same hold
    begin = len(fed.process.output)
    fed.silence(HOLDING)
    fed.wait_until_told("control", "holding gravity: ", b"\2")
    fed.law("damping")  # still the same one
    lines = fed.process.output[begin:].splitlines()
    assert ["Holding gravity: the state" in line for line in lines].count(True) == 1
    assert ["Resumed: mode " in line for line in lines].count(True) == 1
    assert ["[WARN] " in line for line in lines if "Mode damping, by service." in line] == [True]
    fed.descriptions.publish(description(robot(UR5).urdf))
    fed.wait_until_told("control", "mode damping", b"\0")
    fed.descriptions.publish(description(panda.urdf))
    fed.wait_until_told("control", "another robot", b"\2")
    assert fed.peer.transition(fed.name, "deactivate")
    assert not fed.peer.transition(fed.name, "activate")
    fed.wait_until_told("control", "parameter 'damping' names 'elbow_joint'", b"\2")
    heavy = robot(UR5).changed(
        robot(UR5).urdf.replace('<mass value="2.275"/>', '<mass value="4.0"/>')
    )
    fed.descriptions.publish(description(heavy.urdf))
    fed.wait_until_told("control", "inactive")
    assert fed.peer.transition(fed.name, "activate")
    fed.connect()
    expected = heavy.oracle.gravity_torque(Q)
    assert np.abs(expected - gravity_of(Q)).max() > 1.0
    standing = np.array(fed.sent.messages[-1].data)
    count = len(fed.sent.messages)
    assert np.abs(standing).max() > 10.0
    fed.step()
    fed.peer.wait_until(lambda: len(fed.sent.messages) > count, "a command")
    first = np.array(fed.sent.messages[count].data)
    assert np.abs(first - standing).max() <= EFFORT_RATE * 0.02 + 1e-9  # of the longest cycle
    status = fed.settle()
    close(status.effort_command, expected)
    fed.descriptions.publish(description(robot(UR5).urdf))
    fed.wait_until_told("control", "another robot", b"\2")
    assert fed.peer.transition(fed.name, "deactivate")
    assert fed.peer.transition(fed.name, "activate")
    fed.connect()


@ONE
def test_who_else_is_there(fed):
    """Others who send commands are told, and that nobody takes them."""
    topic = fed.sent.subscription.topic_name
    other = fed.peer.publisher(Float64MultiArray, topic)
    fed.wait_until_told("commands", f"other nodes publish {topic}", b"\1")
    fed.peer.node.destroy_publisher(other)
    fed.peer.node.destroy_subscription(fed.sent.subscription)
    fed.wait_until_told("commands", f"{topic} has no subscriber", b"\1")
    fed.sent = fed.peer.topic(Float64MultiArray, topic)
    fed.wait_until_told("commands", "no gaps", b"\0")


def test_late_states_by_the_clock_of_the_machine(peer):
    """Hold, ramp and zero come by themselves where there is no /clock; how late is the machine's
    business.
    """
    parameters = {
        "use_sim_time": False,
        "robot_compensates_gravity": False,
        "initial_mode": "gravity_compensation",
    }
    parameters |= {"max_state_age": 0.2}
    with ByTheWall(peer, "/wall", **parameters) as wall:
        wall.connect().settle()
        wall.status.forget()
        wall.wait_for(lambda s: not any(s.effort_command), "zero")
        phases = [s.phase for s in wall.status.messages]
        assert phases == sorted(phases) and {HOLDING, RAMPING_DOWN} <= set(phases)
        holding = [s for s in wall.status.messages if s.phase == HOLDING]
        close(holding[-1].effort_command, gravity_of(Q))
        wall.wait_until_told("control", "ramping down", b"\2")
        wall.settle()


def test_it_does_not_start_on_a_guess(peer):
    """Without robot_compensates_gravity it is not configured; with joints in another order than
    theirs not activated.
    """
    model = robot(UR5)
    swapped = [model.names[1], model.names[0], *model.names[2:]]
    with effort_controller(peer, "/bare", swapped) as other:  # noqa: SIM117 (before the node)
        with Controller(
            peer, "/bare", robot_description=model.path, payloads="[]", energy_limt=1
        ) as controller:
            name = controller.name
            peer.wait_until(lambda: controller.reports, "a report")
            to_do = f"ros2 lifecycle set {name} configure"
            controller.process.wait_for_text(f"Waiting to be configured: {to_do}")
            wrong = "Unknown parameter 'energy_limt' ignored. Did you mean 'energy_limit'?"
            controller.process.wait_for_text(wrong)
            settings = {"max_state_age": 0.02, "payloads": [""]}
            assert peer.get_parameters(name, settings) == settings
            assert not peer.transition(name, "configure")
            controller.wait_until_told(
                "control",
                "parameter 'robot_compensates_gravity' is not set and has no default",
                b"\2",
            )
            assert peer.set_parameter(name, "robot_compensates_gravity", False).successful
            assert peer.transition(name, "configure")
            result = peer.set_parameter(name, "robot_compensates_gravity", True)
            assert not result.successful
            assert "read-only while the node is configured" in result.reason
            assert not peer.transition(name, "activate")
            controller.wait_until_told("control", f"joints of {other} are", b"\2")
            assert peer.set_parameter(other, "joints", list(model.names)).successful
            assert peer.transition(name, "activate")
            report = controller.wait_until_told("control", "no valid state yet", b"\1")
            assert report.values["order of joints"] == f"that of {other}"
            again = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
            assert not peer.call(
                ChangeState, f"{name}/change_state", again
            ).success  # at which rclpy raises
            assert not controller.sent.messages
    with pytest.raises(InputError, match="robot_compensates_gravity"):
        peer.start("controller", robot_description=model.path, autostart=True)


def test_activation_by_others_while_it_loads(peer):
    """A manager of lifecycles may be faster than autostart; both together activate it once."""
    with Controller(peer, "/eager", robot_compensates_gravity=False, autostart=True) as controller:
        peer.publisher(String, "/eager/robot_description", LATCHED).publish(
            description(robot(UR5).urdf)
        )
        node = controller.process.node
        while node._loader.loading is None:
            peer.graph.serve_next()
        assert node.phase == "inactive"
        assert node.trigger_activate() == SUCCESS
        assert (node.phase, node.failure) == ("active", "")
