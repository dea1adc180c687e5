# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator under command: efforts, wrenches, services, lockstep, and what is wrong with
them.
"""

import numpy as np
import pytest
from diag_dynamics.srv import SetState
from geometry_msgs.msg import Pose, Twist
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

import diag_dynamics as dd
from diag_dynamics.simulation import EnergyAudit
from nodes import MS, PANDA, UR5, S, joint_state, nanoseconds, robot
from simulators import Simulator

PERIOD = 2 * MS


def said(report, entry):
    """Return the message of one entry of a report."""
    return report.entries[entry].message


def number(report, key):
    """Return a counter of a report."""
    return int(report.values.get(key, 0))


def audit(report):
    """Return the energy audit of a report."""
    names = EnergyAudit._fields
    return EnergyAudit(*(float(report.values[f"energy audit: {name} [J]"]) for name in names))


@pytest.fixture(scope="module")
def arm(peer):
    """A UR5 whose drives carry its weight, brake without commands, and know the joints in another
    order.
    """
    order = robot(UR5).names[::-1]
    parameters = {
        "compensates_gravity": True,
        "command_timeout": 0.3,
        "without_command": "brake",
        "rate": 250.0,
    }
    with Simulator(peer, "/arm", UR5, command_joints=list(order), **parameters) as simulator:
        yield simulator


def rates(message):
    """Return velocities of a joint state."""
    return np.array(message.velocity)


# --- commands


def test_silence_then_a_command(arm):
    """Brakes hold the arm; a command opens them and moves the joint that it is for; silence closes
    them again.
    """
    assert not rates(arm.next_state()).any()
    still = arm.next_state().position
    assert arm.next_state().position == still
    before = arm.wait_for_report(lambda r: True, "a report")
    assert before.values["brakes"] == "closed"
    last = len(arm.robot.names) - 1
    moved = []

    def driven():
        arm.command(5.0, *[0.0] * last)  # the first entry is the last joint's
        moved.append(rates(arm.next_state()))
        return abs(moved[-1][last]) > 0.1

    arm.peer.wait_until(driven, "the last joint to turn")
    assert np.abs(moved[-1][: last - 2]).max() < 0.2 * abs(moved[-1][last])
    report = arm.wait_for_report(
        lambda r: "no command for command_timeout = 0.3 s" in said(r, "commands"), "the time-out"
    )
    assert number(report, "commands timed out") > number(before, "commands timed out")
    arm.peer.wait_until(lambda: not rates(arm.next_state()).any(), "the brakes to hold")


@pytest.mark.parametrize(
    ("data", "named"),
    [
        ((1.0, 2.0), "data has 2 entries; expected 6"),
        ((0.0, np.nan, 0.0, 0.0, 0.0, 0.0), "is nan; expected a finite number"),
    ],
    ids=["wrong length", "NaN"],
)
def test_bad_command(arm, data, named):
    """A bad command is rejected by name and counted; the last good one stays in force."""
    before = arm.reports.next()
    begin = len(arm.reports)
    arm.command(*data)
    report = arm.wait_for_report(lambda r: "rejected" in said(r, "commands"), "the refusal", begin)
    assert named in report.values["last rejected command"]
    assert report.entries["commands"].level == b"\1"
    rejected = [key for key in report.values if key.startswith("commands rejected: ")]
    assert sum(number(report, key) - number(before, key) for key in rejected) == 1
    good = 0.25

    def drive():
        arm.command(*[good] * 6)
        arm.command(*data)
        return arm.next_state()

    for _ in range(10):
        state = drive()
    reference = np.array(state.effort) - robot(UR5).oracle.gravity_torque(np.array(state.position))
    np.testing.assert_allclose(reference, good, atol=0.02)


# --- wrenches


def test_push(arm):
    """A wrench on the tool moves the arm, its work is in the audit, and it ends by itself; an
    unknown link is refused.
    """
    arm.push("nowhere", 1, 0, 0, 0, 0, 0)
    arm.wait_for_report(
        lambda r: "'nowhere' is no link of this robot" in said(r, "commands"), "the refusal"
    )
    before = audit(arm.reports.next())

    def moved():
        arm.command(*[0.0] * 6)
        arm.push("tool0", 0, 0, 60, 0, 0, 0)
        return np.abs(rates(arm.next_state())).max() > 0.3

    arm.peer.wait_until(moved, "the arm to give way")
    arm.wait_for_report(lambda r: audit(r).work > before.work + 1e-3, "work of the push")
    arm.peer.wait_until(lambda: not rates(arm.next_state()).any(), "the brakes to hold")


# --- services


def assert_stamp_is_the_time(arm):
    """The stamp of the last state is at most a period behind the clock."""
    arm.next_state()
    assert 0 <= arm.peer.now() - arm.states.stamps[-1] <= 4 * MS


def test_pause_reset_and_set_state(arm):
    """Paused, time stands still; the robot can be put anywhere, and back to where it began."""
    assert arm.call(SetBool, "pause", data=True).success
    assert said(arm.reports.next(), "simulation") == "paused"

    names = arm.robot.names
    q = 0.1 * np.arange(1, 7)
    answer = arm.call(SetState, "set_state", state=joint_state(names[::-1], q[::-1], ()))
    assert answer.success, answer.message
    arm.peer.wait_until(lambda: list(arm.states.messages[-1].position) == q.tolist(), "the state")
    wrong = arm.call(SetState, "set_state", state=joint_state(names[1:], q[1:], ()))
    assert not wrong.success and names[0] in wrong.message
    assert arm.call(Trigger, "reset").success
    arm.peer.wait_until(lambda: not np.any(arm.states.messages[-1].position), "where it began")
    assert (np.diff(arm.states.stamps) >= 0).all()
    assert arm.call(SetBool, "pause", data=False).success
    stamp = arm.states.stamps[-1]
    arm.peer.wait_until(lambda: arm.states.stamps[-1] > stamp + 20 * MS, "time to go on")
    assert_stamp_is_the_time(arm)


def test_payload_at_run_time(arm):
    """Another payload changes the mass and keeps the state; a wrong one, or another fixed
    parameter, is refused by name.
    """
    arm.peer.wait_until(lambda: arm.truth.messages, "the truth")
    revision = arm.truth.messages[-1].model_revision
    assert arm.peer.set_parameter(arm.name, "payloads", ["tool0=3.0 0 0 0.1"]).successful
    arm.peer.wait_until(
        lambda: arm.truth.messages[-1].model_revision == revision + 1, "another model"
    )
    for name, value, named in (
        ("payloads", ["wing=1.0"], "wing"),
        ("gravity", [0.0, np.nan, 0.0], "gravity"),
        ("step", 0.01, "read-only"),
    ):
        result = arm.peer.set_parameter(arm.name, name, value)
        assert not result.successful and named in result.reason
    assert arm.peer.set_parameter(arm.name, "payloads", [""]).successful


# --- pace


def test_stall(arm):
    """A stalled process reports overruns and drops the lag; stamps keep to the clock."""
    before = arm.wait_for_report(lambda r: True, "a report")
    arm.states.forget()
    arm.peer.graph.skip(0.5)
    report = arm.wait_for_report(  # the next one may be of before
        lambda r: float(r.values.get("lateness, maximum [s]", 0.0)) > 0.3, "the stall"
    )
    assert "ticks skipped" in said(report, "pace")
    assert number(report, "overruns") >= number(before, "overruns") + 50
    assert float(report.values["dropped lag [s]"]) > float(before.values["dropped lag [s]"]) + 0.2
    gaps = np.diff(arm.states.stamps)
    assert np.abs(gaps - MS * np.round(gaps / MS)).max() <= 2
    assert_stamp_is_the_time(arm)


# --- lockstep


def test_lockstep(peer, tmp_path):
    """Each command takes the robot one state further, to the last bit where the library's own
    simulation gets.

    That one is compared with Pinocchio elsewhere. Sensors err by seed; the truth does not.
    use_sim_time, as a launch gives it to all of its nodes, does not stop the one that makes time.
    """
    noise = [1e-3, 1e-2, 0.0]
    path = tmp_path / "arm.yaml"
    spring = {"stiffness": 900.0, "rotor_inertia": 1e-2, "position": "link"}
    dd.Parameters.from_dict({"flexible_joints": {"panda_joint2": spring}}).save(path)
    parameters = {
        "parameters_file": str(path),
        "lockstep": True,
        "rate": 500.0,
        "sensor_noise": noise,
        "use_sim_time": True,
    }
    clock = peer.topic(Clock, "/clock")
    with Simulator(peer, "/lockstep", PANDA, **parameters) as simulator:
        reference = dd.Simulation(simulator.model.with_parameters(path), step=1e-3)
        rng = np.random.default_rng(1)
        begin = nanoseconds(simulator.states.messages[-1].header.stamp)
        for k in range(1, 201):
            effort = rng.normal(size=8)
            stamp = begin + k * PERIOD
            simulator.command(*effort)
            peer.wait_until(
                lambda stamp=stamp: simulator.truth.at(stamp) and simulator.states.at(stamp),
                f"state {k}",
            )
            reference.advance(effort, steps=2)
            truth = simulator.truth.at(stamp)
            state = simulator.states.at(stamp)
            assert list(truth.position) == reference.q.tolist()
            assert list(truth.velocity) == reference.qd.tolist()
            expected = reference.with_spring_torques(reference.effort)
            assert list(truth.effort) == expected.tolist()
            error = np.abs(np.array(state.position[:8]) - reference.q)
            assert 0.0 < error.max() < 6.0 * noise[0]
        peer.wait_until(lambda: nanoseconds(clock.messages[-1].clock) == stamp, "its time")
        # Nobody commands: time stands still, and diagnostics say why.
        report = simulator.wait_for_report(
            lambda r: "waiting for a command" in said(r, "pace"), "the wait"
        )
        assert report.entries["pace"].level == b"\1"
        assert report.entries["pace"].hardware_id == simulator.model.name
        assert nanoseconds(clock.messages[-1].clock) == stamp


def test_lockstep_goes_on(peer):
    """After a pause, rejected commands, resets, rest, and another commander time goes on by
    itself.
    """
    wrong = []

    def commander():
        node = peer.extra_node("commander", "/on")
        commands = node.create_publisher(Float64MultiArray, "effort_controller/commands", 10)

        def answer(state):
            effort = wrong.pop() if wrong else 0.0
            commands.publish(Float64MultiArray(data=[effort] * len(state.name)))

        node.create_subscription(JointState, "joint_states", answer, 10)
        return node

    with Simulator(peer, "/on", UR5, lockstep=True, rate=200.0) as simulator:
        first = commander()

        def goes_on(what):
            stamp = simulator.states.stamps[-1]
            peer.wait_until(
                lambda: simulator.states.stamps[-1] > stamp + S // 10, f"time to go on after {what}"
            )

        goes_on("the start")
        for pause in (True, False):
            assert simulator.call(SetBool, "pause", data=pause).success
        goes_on("a pause")
        peer.pass_time(
            3.0
        )  # until the commander is no newcomer, for which states are repeated anyway
        wrong.append(np.nan)
        goes_on("a rejected command")
        for _ in range(3):
            assert simulator.call(Trigger, "reset").success
            assert simulator.call(Trigger, "reset").success
            goes_on("two resets")
        peer.drop_node(first)
        commander()
        goes_on("the commander's restart")


# --- a floating base


def test_floating_base(peer):
    """A free base is put wherever it is asked to be; odometry goes with its joint state."""
    parameters = {"floating_base": True, "rate": 100.0, "gravity": [0.0, 0.0, 0.0]}
    with Simulator(peer, "/floating", UR5, **parameters) as simulator:
        base = Pose()
        turning = Twist()
        base.position.x = 2.0
        base.orientation.z = 0.6
        base.orientation.w = 0.8
        turning.angular.z = 0.5
        still = joint_state(simulator.robot.names, [0.3] * 6, ())
        answer = simulator.call(
            SetState, "set_state", state=still, base_pose=base, base_twist=turning
        )
        assert answer.success, answer.message

        def put():
            return [m for m in simulator.odometry.messages if m.pose.pose.position.x > 1.0]

        first = peer.wait_until(put, "the base where it was put")[0]
        at = nanoseconds(first.header.stamp)
        o = first.pose.pose.orientation
        peer.wait_until(lambda: simulator.truth.at(at), "the truth")
        np.testing.assert_allclose(
            [o.x, o.y, o.z, o.w], simulator.truth.at(at).position[3:7], atol=1e-12
        )
        assert first.twist.twist.angular.z == pytest.approx(0.5, abs=1e-3)
        peer.wait_until(lambda: simulator.states.stamps[-1] > at + S, "joint states")
        stamps = {stamp for stamp in simulator.states.stamps if stamp > at}
        assert len(stamps) > 90 and stamps <= set(simulator.odometry.stamps)
