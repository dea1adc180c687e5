# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the inputs, injected into a monitor on a real graph: each counted, named, kept from the outputs, and over."""

import contextlib
import itertools
import math
import struct
from collections import Counter

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock

from coupling import Coupled
from diag_dynamics.nodes.support.diagnostics import steady
from diag_dynamics.parameters.monitor import PARAMETERS
from nodes import (
    BELIEVING,
    MAX_AGE,
    MS,
    OUTPUTS,
    PANDA,
    START,
    TIMEOUT,
    UR5,
    Monitor,
    S,
    Truth,
    assert_close,
    joint_state,
    nanoseconds,
    robot,
    tolerance,
)

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"

FINGER, MIMIC_FINGER = "panda_finger_joint1", "panda_finger_joint2"
JOINT = "panda_joint4"

ESTIMATED = ("total_joint_rates", "coriolis", "kinetic_energy", "joint_space_dynamics", "state")
"""Topics whose messages say whether velocities were estimated."""


@pytest.fixture(scope="module")
def running(peer):
    """Start one monitor, whose stamps are the test's own; each test leaves it able to go on."""
    with Monitor(peer, "/inputs", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


@pytest.fixture(scope="module")
def live(peer):
    """Start a monitor that judges stamps by its clock, as it does by default."""
    with Monitor(peer, "/live", live=True, robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


def arm(panda):
    """Return the joints without the gripper's."""
    return [name for name in panda.names if name != FINGER]


def after(monitor, begin, key, by=1):
    """Return the report, from number `begin` on, in which a counter has risen to what it was before and `by` more."""
    before = monitor.reports[begin - 1].count(key) if begin else 0
    report = monitor.wait_for_report(lambda report: report.count(key) >= before + by, key, begin)
    assert report.count(key) == before + by
    return report


def rising(monitor, begin, word):
    """Return the reports, from number `begin` on, in which counters have risen whose names begin with a word."""
    told = itertools.pairwise(monitor.reports[begin - 1 :])
    return [this for last, this in told if any(key.startswith(word) for key in this.since(last))]


# --- several publishers


def test_age_limits_of_single_joints(monitor, panda):
    """Arm at 20 Hz, gripper once in two seconds: `joint_timeouts` lets one be old and not the other, each by its limit."""
    (q0, qd0, tau0, _), (q1, qd1, tau1, _) = panda.samples[0], panda.samples[1]
    at_gripper = monitor.now
    moved = np.isin(panda.names, arm(panda))
    truth = Truth(panda, *(np.where(moved, new, old) for new, old in ((q1, q0), (qd1, qd0), (tau1, tau0))))
    with monitor.having(joint_timeouts=[f"{FINGER}=2.0", "*=0.1"]):
        for _ in range(10):
            stamp = monitor.tick(50 * MS)
            published = monitor.feed(panda.message(stamp, panda.samples[1], arm(panda)), ["state"])
            truth.check(published, stamp)
            assert nanoseconds(published["state"].oldest_stamp) == at_gripper
        monitor.forget()

        # the arm is older than its 0.1 s when the gripper speaks, which is not older than its 2 s
        begin = len(monitor.reports)
        monitor.feeder.publish(panda.message(monitor.tick(101 * MS), panda.samples[1], [FINGER]))
        report = after(monitor, begin, "rejected: stale joint")
        assert report.level == WARN
        assert f"joint '{arm(panda)[0]}' is older than 0.1 s" in report.values["last rejection"]
        # and then the gripper than its 2 s, while the arm goes on
        begin = len(monitor.reports)
        monitor.feeder.publish(panda.message(monitor.tick(2001 * MS), panda.samples[1], arm(panda)))
        report = after(monitor, begin, "rejected: stale joint")
        assert f"joint '{FINGER}' is older than 2 s" in report.values["last rejection"]
        assert not monitor.topics["state"].messages
        monitor.serves(panda, 2)


class Base:
    """A Panda on a floating base: its odometry, and what Pinocchio says of the two together."""

    def __init__(self, monitor, panda):
        self.monitor, self.panda = monitor, panda
        self.publisher = monitor.peer.publisher(Odometry, f"{monitor.name.rpartition('/')[0]}/odom")
        self.oracle = Coupled(panda.urdf, floating_base=True)

    def message(self, stamp, height=0.5, speed=0.3):
        """Return odometry of a base that is turned by (0.6, 0, 0, 0.8)."""
        message = Odometry(child_frame_id=self.panda.root)
        message.header.frame_id = "odom"
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
        message.pose.pose.position.z = height
        message.pose.pose.orientation.x, message.pose.pose.orientation.w = 0.6, 0.8
        message.twist.twist.linear.y, message.twist.twist.angular.x = speed, -0.2
        return message

    def check(self, state, sample, height=0.5, speed=0.3):
        """Compare a state with Pinocchio's free-flyer."""
        q, qd, tau, _ = sample
        base, rates = [0.0, 0.0, height, 0.6, 0.0, 0.0, 0.8], [0.0, speed, 0.0, -0.2, 0.0, 0.0]
        truth = self.oracle.at(np.r_[base, q], np.r_[rates, qd], np.r_[np.zeros(6), tau])
        assert tuple(state.dof_names[6:]) == self.panda.names
        for name in ("nu", "epsilon", "gravity"):
            assert_close(np.array(getattr(state, name)), getattr(truth, name), tolerance(truth))
        assert_close(np.array(state.coriolis), truth.coriolis, tolerance(truth), truth.coriolis_scale)

    def connect(self):
        """Wait until odometry and joint states arrive."""
        monitor, publishers = self.monitor, (self.publisher, self.monitor.feeder)
        monitor.peer.wait_until(lambda: all(p.get_subscription_count() for p in publishers), "its subscriptions", START)
        self.wait_for_state(self.panda.samples[0])

    def wait_for_state(self, sample):
        """Publish odometry and joints of one stamp until a state comes of both, and return it."""
        monitor, states, patience = self.monitor, self.monitor.topics["state"], 0.3

        def both():
            nonlocal patience
            patience *= 1.1  # it may be slow, too
            stamp = monitor.tick(100 * MS)
            self.publisher.publish(self.message(stamp))
            monitor.feeder.publish(self.panda.message(stamp, sample))
            with contextlib.suppress(AssertionError):  # the joints have overtaken odometry
                monitor.peer.wait_until(lambda: stamp in states.stamps, "a state", patience)
            found = states.messages[-1] if stamp in states.stamps else None
            return found if found and nanoseconds(found.oldest_stamp) == stamp else None

        return monitor.peer.wait_until(both, "a state of base and joints")


@pytest.fixture(scope="module")
def base(peer):
    """Start a monitor of a Panda that moves about, with age limits for the gripper, the arm, and the base."""
    panda = robot(PANDA)
    parameters = {"joint_timeouts": f'["{FINGER}=2.0"]', "odom_timeout": 0.2, "floating_base": True}
    with Monitor(peer, "/base", robot_description=panda.path, **parameters) as monitor:
        base = Base(monitor, panda)
        base.connect()
        yield base


def test_arm_gripper_and_base_at_their_own_rates(base, panda):
    """Each is as old as it is: the state bears the newest stamp and says which was the oldest."""
    monitor, states = base.monitor, base.monitor.topics["state"]
    sample = panda.samples[1]
    monitor.tick()
    at_gripper = monitor.now
    monitor.feeder.publish(panda.message(at_gripper, sample))
    compared = 0
    for k in range(12):  # arm every 50 ms, base every 150 ms and 20 ms behind, gripper never again
        stamp = monitor.tick(50 * MS)
        if k % 3 == 0:
            height, at_base = 1.0 + k, stamp - 20 * MS
            # The two topics may overtake each other, so the arm is repeated until odometry is in.
            base.publisher.publish(base.message(at_base, height))

        def answer(stamp=stamp, height=height):
            states.forget()
            monitor.feeder.publish(panda.message(stamp, sample, arm(panda)))
            monitor.peer.wait_until(lambda: states.messages, "a state")
            return states.messages[-1] if states.messages[-1].position[2] == height else None

        state = monitor.peer.wait_until(answer, "a state with the newest base")
        base.check(state, sample, height)
        assert nanoseconds(state.header.stamp) == stamp
        assert nanoseconds(state.oldest_stamp) == at_gripper
        compared += 1
    assert compared == 12


NO_ODOMETRY = [
    (lambda m: setattr(m.pose.pose.position, "x", math.nan), "malformed"),
    (lambda m: setattr(m.pose.pose.orientation, "w", math.inf), "malformed"),
    (lambda m: setattr(m, "child_frame_id", "panda_hand"), "malformed"),
    (lambda m: setattr(m.header.stamp, "sec", -3), "malformed stamp"),
    (lambda m: setattr(m.twist.twist.linear, "z", -1e5), "absurd value"),
]


def test_odometry_that_cannot_be(base, panda):
    """NaN, inf, of a link that moves, without a time, absurd: each is counted, and part of no state; the next one is."""
    monitor, before = base.monitor, base.monitor.next_report()
    for spoil, _ in NO_ODOMETRY:
        message = base.message(monitor.tick(), height=99.0)
        spoil(message)
        base.publisher.publish(message)
        monitor.forget()
        base.check(base.wait_for_state(panda.samples[2]), panda.samples[2])
        assert all(state.position[2] == 0.5 for state in monitor.topics["state"].messages)
    message = base.message(monitor.tick(), height=99.0)
    NO_ODOMETRY[-1][0](message)
    base.publisher.publish(message)
    expected = {"malformed": 3, "malformed stamp": 1, "absurd value": 2}
    report = monitor.wait_for_report(
        lambda report: report.since(before).get("odometry rejected: absurd value") == 2, "2"
    )
    assert {key: n for key, n in report.since(before).items() if key.startswith("odometry rejected")} == {
        f"odometry rejected: {cause}": n for cause, n in expected.items()
    }
    assert report.level == WARN
    assert report.values["last rejection"].startswith("odom: twist is [0.0, 0.3, -100000.0")


def test_odometry_that_stops(base, panda):
    """Joints go on without the base: nothing is published beyond `odom_timeout`, and the age is named."""
    monitor = base.monitor
    base.wait_for_state(panda.samples[0])
    monitor.forget()
    begin = len(monitor.reports)
    monitor.feeder.publish(panda.message(monitor.tick(250 * MS), panda.samples[0]))
    report = after(monitor, begin, "rejected: stale odometry")
    assert report.level == WARN
    assert "odom is 0.25" in report.values["last rejection"]
    assert not monitor.topics["state"].messages
    assert report.count("received") == report.outcomes()
    base.check(base.wait_for_state(panda.samples[1]), panda.samples[1])


def test_joints_before_odometry(base, panda):
    """Without a base there is no state; that is counted and said, and over with the first odometry."""
    monitor = base.monitor
    monitor.transition("deactivate", "activate")
    before = monitor.next_report()
    monitor.forget()
    monitor.peer.wait_until(monitor.feeder.get_subscription_count, "the subscription to joint_states")

    def waiting(report):
        monitor.feeder.publish(panda.message(monitor.tick(10 * MS), panda.samples[0]))
        return report.count("before odometry") > before.count("before odometry")

    report = monitor.wait_for_report(waiting, "joints that wait for odometry")
    assert report.level == WARN
    assert "no odometry yet" in report.message
    assert report.count("received") == report.outcomes()
    assert not monitor.topics["state"].messages
    base.connect()
    base.check(base.wait_for_state(panda.samples[2]), panda.samples[2])


# --- velocities that no one sends


@contextlib.contextmanager
def estimating(monitor, panda, **values):
    """Let the monitor estimate velocities; at the end it has some that were sent."""
    with monitor.having(missing_velocity="estimate", **values):
        try:
            yield
        finally:
            monitor.serves(panda)


def ramp(panda, sample, at):
    """Return the positions of a constant velocity after a time [s]."""
    return panda.samples[sample].q + at * panda.samples[sample].qd


@pytest.mark.parametrize("absent", ["empty", "NaN"])
def test_estimated_velocity(monitor, panda, absent):
    """A constant velocity is estimated exactly, flagged in every message that can say so, and named; then sent again."""
    _, qd, tau, _ = panda.samples[1]
    sent = [] if absent == "empty" else [math.nan] * len(qd)
    waiting = monitor.reports[-1].count("awaiting velocity") if monitor.reports else 0
    with estimating(monitor, panda):
        first = monitor.tick()
        monitor.feeder.publish(joint_state(panda.names, ramp(panda, 1, 0.0), sent, tau, first))
        for k in range(1, 6):
            stamp = monitor.tick(10 * MS)
            q = ramp(panda, 1, (stamp - first) * 1e-9)
            topics = OUTPUTS if k == 5 else ["state"]
            published = monitor.feed(joint_state(panda.names, q, sent, tau, stamp), topics)
            velocity = np.array(published["state"].velocity)
            assert_close(velocity, qd, 1e-12)
            Truth(panda, q, velocity, tau, estimated=True).check(published, stamp)
        assert set(ESTIMATED) == {topic for topic in published if hasattr(published[topic], "velocity_estimated")}
        report = monitor.wait_for_report(lambda report: report.count("awaiting velocity") > waiting, "an estimate")
        assert report.count("awaiting velocity") == waiting + 1
        assert report.values["joints with estimated velocity"] == f"8: {', '.join(panda.names)}"


def test_no_flag_where_nothing_is_estimated(monitor, panda):
    """The parameter goes back to `refuse` while velocities are estimated: those that are sent then are not flagged."""
    _, _, tau, _ = panda.samples[0]
    try:
        with monitor.having(missing_velocity="estimate"):
            for k in range(3):
                stamp = monitor.tick(20 * MS)
                monitor.feeder.publish(joint_state(panda.names, ramp(panda, 0, 0.02 * k), [], tau, stamp))
            assert monitor._all_at(stamp, ["state"])["state"].velocity_estimated
        monitor.serves(panda)
    finally:
        with estimating(monitor, panda):
            pass


def test_estimated_velocity_of_one_joint(monitor, panda):
    """The others' velocities are used as they are sent."""
    _, qd, tau, _ = panda.samples[0]
    k = panda.names.index(JOINT)
    moving, sent = np.zeros(len(qd)), qd.copy()
    moving[k], sent[k] = 2.0, math.nan
    with estimating(monitor, panda):
        for stamp in (monitor.tick(), monitor.tick(20 * MS)):
            q = panda.samples[0].q + (20e-3 * moving if stamp == monitor.now else 0.0)
            message = joint_state(panda.names, q, sent, tau, stamp)
            monitor.feeder.publish(message)
        published = monitor._all_at(stamp, OUTPUTS)
        velocity = np.array(published["state"].velocity)
        assert velocity[k] == pytest.approx(2.0, rel=1e-12)
        assert np.delete(velocity, k).tolist() == np.delete(qd, k).tolist()
        Truth(panda, q, velocity, tau, estimated=True).check(published, stamp)
        assert monitor.next_report().values["joints with estimated velocity"] == f"1: {JOINT}"


@pytest.mark.parametrize(("step", "time"), [(1 * MS, 0.004), (5 * MS, 0.005), (20 * MS, 0.002), (5 * MS, 0.0)])
def test_delay_of_the_estimate(monitor, panda, step, time):
    """A constant acceleration is seen later, by dt / 2 + dt / (exp(dt / T) − 1), which is dt / 2 without a filter."""
    q0, qd0, tau, qdd = panda.samples[0]
    dt = step * 1e-9
    delay = dt / 2 + (dt / math.expm1(dt / time) if time else 0.0)
    count = math.ceil(27 * time / dt) + 2  # what is left of the beginning: exp(−27), 2e-12
    first = monitor.tick()
    with estimating(monitor, panda, velocity_filter_time=time):
        for k in range(count):
            t = k * dt
            stamp = first + k * step
            q = q0 + t * qd0 + 0.5 * t**2 * qdd
            monitor.feeder.publish(joint_state(panda.names, q, [], tau, stamp))
            if k == count - 1 or (k % 4 == 3 and t > time):  # no more under way than the node's queue holds
                monitor._all_at(stamp, ["state"])
        monitor.now = stamp
        velocity = np.array(monitor.topics["state"].at(stamp).velocity)
    assert_close(velocity, qd0 + (t - delay) * qdd, 1e-8)


def test_estimate_is_not_handed_out_too_soon(monitor, panda):
    """Nothing is published before the filter time has passed, and that is said."""
    _, _, tau, _ = panda.samples[1]
    before = monitor.next_report()
    with estimating(monitor, panda, velocity_filter_time=0.1):
        first = monitor.tick()
        for k in range(3):
            q = ramp(panda, 1, 0.05 * k)
            monitor.feeder.publish(joint_state(panda.names, q, [], tau, first + 50 * k * MS))
        report = monitor.wait_for_report(lambda report: report.count("received") >= before.count("received") + 3, "3")
        assert report.since(before) == {"received": 3, "awaiting velocity": 2, "published": 1}
        monitor.now = first + 100 * MS
        assert monitor.topics["state"].stamps == [monitor.now]
        Truth(panda, q, monitor.topics["state"].messages[0].velocity, tau, estimated=True).check(
            {"state": monitor.topics["state"].messages[0]}, monitor.now
        )
    assert report.count("received") == report.outcomes()


# --- efforts that are not what they seem


def test_motor_currents(monitor, panda):
    """With `effort_scale`, currents are efforts; with all declared, nothing is left to be said."""
    q, qd, tau, _ = panda.samples[1]
    scale = {name: 0.5 + 0.25 * k for k, name in enumerate(panda.names)}
    current = tau / np.array(list(scale.values()))
    before = monitor.next_report()
    assert before.values["effort undeclared (taken as N m, with gravity)"] == f"8: {', '.join(panda.names)}"
    entries = [f"{name}={factor!r}" for name, factor in scale.items()]
    with monitor.having(effort_scale=entries, effort_includes_gravity=["*=true"]):
        stamp = monitor.tick()
        published = monitor.feed(joint_state(panda.names, q, qd, current, stamp))
        Truth(panda, q, qd, tau, computed=True).check(published, stamp)
        assert monitor.next_report().values["effort undeclared (taken as N m, with gravity)"] == "0"


@pytest.mark.parametrize("joints", ["all", "one"])
def test_efforts_without_gravity(monitor, panda, joints):
    """What holds the weight is added, for the joints that say so, under the gravity in force."""
    q, qd, tau, _ = panda.samples[0]
    gravity = (1.0, -2.0, 3.0)
    some = np.array([joints == "all" or name == JOINT for name in panda.names])
    g = panda.changed(gravity=gravity).oracle.gravity_torque(q)
    entry = "*=false" if joints == "all" else f"{JOINT}=false"
    with monitor.having(effort_includes_gravity=[entry], gravity=list(gravity)):
        stamp = monitor.tick()
        published = monitor.feed(joint_state(panda.names, q, qd, tau - np.where(some, g, 0.0), stamp))
        Truth(panda, q, qd, tau, gravity=gravity, computed=True).check(published, stamp)


def test_unavailable_effort(monitor, panda):
    """A joint without a torque sensor: epsilon, kappa and power are empty and flagged, and all else is there."""
    q, qd, _, _ = panda.samples[2]
    with monitor.having(effort_available=[f"{JOINT}=false"]):
        stamp = monitor.tick()
        published = monitor.feed(panda.message(stamp, panda.samples[2]))
        Truth(panda, q, qd, None).check(published, stamp)
        assert monitor.next_report().values["joints without effort"] == f"1: {JOINT}"


def test_absurd_effort(monitor, panda):
    """It is as unknown, counted and warned of; the state goes out without what needs it."""
    q, qd, tau, _ = panda.samples[0]
    begin = len(monitor.reports)
    for value in (-1.5e6, -math.inf):
        stamp = monitor.tick()
        effort = [value if name == JOINT else x for name, x in zip(panda.names, tau, strict=True)]
        published = monitor.feed(joint_state(panda.names, q, qd, effort, stamp))
        Truth(panda, q, qd, None).check(published, stamp)
    report = after(monitor, begin, "absurd effort", by=2)
    assert report.level == WARN
    assert report.values["joints without effort"] == f"1: {JOINT}"
    assert report.message == "efforts that cannot be: taken as unknown"


# --- what cannot be


def altered(panda, field=None, value=None, **stamp):
    """Return how to make a state in which one value of one joint, or the stamp, is wrong."""

    def make(now):
        message = panda.message(now, panda.samples[0])
        if field:
            getattr(message, field)[message.name.index(JOINT)] = value
        for part, number in stamp.items():
            setattr(message.header.stamp, part, number)
        return message

    return make


IMPOSSIBLE = [
    (altered(robot(PANDA), "position", 2.1e6), "absurd value", f"'{JOINT}': position"),
    (altered(robot(PANDA), "position", -9.5), "absurd value", f"'{JOINT}': position is -9.5"),
    (altered(robot(PANDA), "velocity", -1.1e4), "absurd value", f"'{JOINT}': velocity"),
    (altered(robot(PANDA), sec=-1), "malformed stamp", "-1 s"),
    (altered(robot(PANDA), nanosec=S), "malformed stamp", "1000000000 ns"),
]


def test_impossible(monitor, panda):
    """Values that no joint can have and stamps that no clock shows are rejected and counted, and go nowhere."""
    before, good, begin = monitor.next_report(), [], len(monitor.reports)
    for make, _, _ in IMPOSSIBLE:
        monitor.feeder.publish(make(monitor.tick()))
        monitor.serves(panda, 1)
        good.append(monitor.now)
    for topic in monitor.topics.values():
        assert topic.stamps == good
    count = 2 * len(IMPOSSIBLE)
    end = before.count("received") + count
    report = monitor.wait_for_report(lambda r: r.count("received") >= end, "all", begin)
    expected = Counter(f"rejected: {cause}" for _, cause, _ in IMPOSSIBLE)
    assert report.since(before) == expected | {"received": count, "published": len(good)}
    told = rising(monitor, begin, "rejected: ")
    for report in told:
        assert report.level == WARN
        assert steady(report.values["last rejection"]) in report.message
    assert IMPOSSIBLE[-1][2] in told[-1].values["last rejection"]


@pytest.mark.parametrize(("make", "cause", "named"), IMPOSSIBLE[:-1])
def test_impossible_by_name(monitor, panda, make, cause, named):
    """The rejection says what is wrong, of which joint."""
    begin = len(monitor.reports)
    monitor.feeder.publish(make(monitor.tick()))
    assert named in after(monitor, begin, f"rejected: {cause}").values["last rejection"]


def test_garbage_row(monitor, panda):
    """What a real arm sent once is refused, positions that jump are, too; where they stay they are believed."""
    q, qd, tau, _ = panda.samples[0]
    k, still = panda.names.index(JOINT), 0.0 * qd
    monitor.serves(panda, 0)
    usual = {name: PARAMETERS[name].default for name in BELIEVING}
    assert monitor.set_parameters(usual).successful
    for effort in (253.0, 47.0):  # four times 12 N m is 48
        message = joint_state(panda.names, q, still, still + effort, monitor.tick(8 * MS))
        published = monitor.feed(message, ["state"])
        assert published["state"].effort_valid == (effort == 47.0)
    begin = len(monitor.reports)
    monitor.feeder.publish(joint_state(panda.names, 0.0 * q, still + 30.0, still + 253.0, monitor.tick(8 * MS)))
    named = after(monitor, begin, "rejected: absurd value").values["last rejection"]
    assert "velocity is 30" in named and "absurd.beyond_velocity" in named
    elsewhere = q + 0.5 * (np.arange(len(q)) == k)
    begin = len(monitor.reports)
    for _ in range(2):
        monitor.feeder.publish(joint_state(panda.names, elsewhere, still, tau, monitor.tick(8 * MS)))
    assert f"'{JOINT}': position went from" in after(monitor, begin, "rejected: jump", by=2).values["last rejection"]
    begin, stamp = len(monitor.reports), monitor.tick(8 * MS)
    published = monitor.feed(joint_state(panda.names, elsewhere, still, tau, stamp), ["state", "kinetic_energy"])
    Truth(panda, elsewhere, still, tau).check(published, stamp)
    report = monitor.wait_for_report(lambda report: report.count("positions jumped"), "the jump", begin)
    assert report.level == WARN
    assert f"positions jumped, and stayed: joint '{JOINT}'" in report.entries["joint states"].message
    assert monitor.set_parameters(BELIEVING).successful
    monitor.serves(panda, 1)


def test_frozen_values(monitor, panda):
    """Old values under fresh stamps: told of, and refused if that is wanted; the next that moves is served."""
    q, qd, tau, _ = panda.samples[0]
    assert abs(qd[panda.names.index(JOINT)]) > 0.05
    begin = len(monitor.reports)

    def feed(moved=0.0):
        stamp = monitor.tick(100 * MS)
        monitor.feeder.publish(joint_state(panda.names, q + moved, qd, tau, stamp))
        return stamp

    def told():
        begun = monitor.reports[begin:]
        return next((report for report in begun if "frozen values" in report.entries["joint states"].message), None)

    with monitor.having(frozen_timeout=0.5):
        monitor.serves(panda, 0)
        for _ in range(4):
            feed()
        last = feed()
        monitor.peer.wait_until(lambda: monitor.topics["state"].at(last), "a state that is told of")
        assert monitor.peer.wait_until(told, "frozen values").level == WARN
        before = monitor.next_report()
        with monitor.having(frozen_values="refuse"):
            fed_at = 0

            def refused():
                nonlocal fed_at, last
                if len(monitor.reports) > fed_at:  # no more at a time than the node's queue holds
                    fed_at = len(monitor.reports)
                    for _ in range(4):
                        last = feed()
                report = monitor.reports[-1]
                return report.since(before).get("rejected: frozen") and report

            report = monitor.peer.wait_until(refused, "frozen values")
            assert "no bit of its position changes" in report.values["last rejection"]
            moving = feed(1e-3)
            monitor.peer.wait_until(lambda: monitor.topics["state"].at(moving), "a state that moves")
            assert not monitor.topics["state"].at(last)


def test_states_lost_between_stamps(monitor, panda):
    """Every eighth of a regular sequence never comes: as many are counted as are not there, and no outcome has them."""
    monitor.tick(10 * S)
    before = monitor.next_report()
    stamps = [monitor.tick(10 * MS) for _ in range(120)]
    sent = [stamp for k, stamp in enumerate(stamps) if k % 8 != 3]
    for stamp in sent[:97]:  # of which 96 intervals are judged
        monitor.feed(panda.message(stamp, panda.samples[0]), ["state"])
    report = monitor.wait_for_report(lambda r: r.count("published") >= before.count("published") + 97, "all")
    lost = report.count("lost by gaps in stamps") - before.count("lost by gaps in stamps")
    assert lost == (sent[96] - sent[0]) // (10 * MS) - 96 > 10
    assert report.since(before) == {"received": 97, "published": 97}


def test_bytes_that_are_no_message(monitor, panda):
    """They are rejected where this node reads them itself; rclpy lets them fall. Neither way is anything lost but them."""
    monitor.serves(panda, 1)
    before, begin = monitor.next_report(), len(monitor.reports)
    good = serialize_message(panda.message(monitor.tick(), panda.samples[0]))
    count = bytes([255] * 4)
    for bad in (good[: len(good) // 2], good[:20], good[:5], b"\x07\x77" + good[2:], good[:12] + count + good[16:]):
        monitor.feeder.publish(bad)
        monitor.serves(panda, 1)
    report = monitor.wait_for_report(
        lambda report: report.count("published") >= before.count("published") + 5, "what came after"
    )
    assert report.since(before) == {"received": 10, "published": 5, "rejected: malformed": 5}
    told = rising(monitor, begin, "rejected: ")
    assert told and all(report.level == WARN for report in told)
    assert "bytes that are no sensor_msgs/msg/JointState" in report.values["last rejection"]


def test_big_endian(monitor, panda):
    """A state from a machine of the other byte order is served as any other."""
    monitor.serves(panda, 1)
    q, qd, tau, _ = panda.samples[2]
    stamp = monitor.tick()
    monitor.feeder.publish(big_endian(panda.message(stamp, panda.samples[2])))
    Truth(panda, q, qd, tau).check(monitor._all_at(stamp, OUTPUTS), stamp)


def big_endian(message):
    """Serialize a JointState without a frame as such a machine does."""
    data = bytearray()

    def add(kind, *values):
        data.extend(bytes(-len(data) % struct.calcsize(kind)))
        data.extend(struct.pack(f">{len(values)}{kind}", *values))

    def add_text(text):
        add("I", len(text) + 1)
        data.extend(text.encode() + b"\0")

    add("i", message.header.stamp.sec)
    add("I", message.header.stamp.nanosec)
    add_text("")
    add("I", len(message.name))
    for name in message.name:
        add_text(name)
    for values in (message.position, message.velocity, message.effort):
        add("I", len(values))
        add("d", *values)
    return bytes(4) + data  # encapsulation 0: plain CDR, big-endian


def test_bounds_are_parameters(monitor, panda):
    """A robot that may go beyond is told so; 0 is no bound."""
    q, qd, tau, _ = panda.samples[0]
    k = panda.names.index(JOINT)
    far, fast = q.copy(), qd.copy()
    far[k], fast[k] = 50.0, 2e4
    bounds = {"absurd__beyond_limits": 0.0, "absurd__velocity": 1e5}
    with monitor.having(**bounds):
        stamp = monitor.tick()
        published = monitor.feed(joint_state(panda.names, far, fast, tau, stamp), ["state", "kinetic_energy"])
        Truth(panda, far, fast, tau).check(published, stamp)


def test_every_outcome_is_counted_once(monitor, panda):
    """A storm of all faults, and good states among them: each is counted as what it is, the good ones go out unharmed."""
    q, qd, tau, _ = panda.samples[0]
    names = list(panda.names)
    nan = [math.nan] * len(names)
    mistakes = {
        "rejected: no velocity": lambda at: joint_state(names, q, [], tau, at),
        "rejected: no position": lambda at: joint_state(names, nan, qd, tau, at),
        "rejected: wrong length": lambda at: joint_state(names, q[:3], qd, tau, at),
        "rejected: duplicate name": lambda at: joint_state([*names, JOINT], [*q, 0], [*qd, 0], [*tau, 0], at),
        "rejected: absurd value": altered(panda, "velocity", 1e300),
        "rejected: malformed stamp": altered(panda, sec=-(2**31)),
        "rejected: late": lambda at: panda.message(monitor.now - 100 * MS, panda.samples[0]),
        "rejected: stamp from the past": lambda at: panda.message(monitor.now - 500 * S, panda.samples[0]),
        "rejected: stale joint": lambda at: panda.message(at, panda.samples[0], [FINGER]),
        "foreign": lambda at: joint_state(["wheel"], [0.0], [0.0], [0.0], at),
        "followers only": lambda at: joint_state([MIMIC_FINGER], [q[names.index(FINGER)]], [], [], at),
    }
    before = monitor.next_report()
    expected, good = dict.fromkeys(mistakes, 0), []
    for round in range(3):
        for key, make in mistakes.items():
            monitor.feeder.publish(make(monitor.now + 600 * MS))
            expected[key] += 1
            monitor.serves(panda, round)  # one after the other: the node's queue is short
            good.append(monitor.now)
    for topic in monitor.topics.values():
        assert topic.stamps == good
    total = 2 * len(good)
    report = monitor.wait_for_report(lambda report: report.count("received") >= before.count("received") + total, "all")
    assert report.since(before) == expected | {"received": total, "published": len(good)}
    assert report.count("received") == report.outcomes()


# --- clocks


FAR_OFF = 10 * round(MAX_AGE) * S
"""Of a stamp that is not accepted, be the machine late [ns]."""


@pytest.mark.parametrize(("offset", "cause"), [(-FAR_OFF, "stamp from the past"), (FAR_OFF, "stamp from the future")])
def test_stamps_that_leave_the_clock(live, panda, offset, cause):
    """Stamps of now are served; one far off is rejected, with its distance, and the next of now is served again."""
    live.serves(panda)
    live.forget()
    begin = len(live.reports)
    live.feeder.publish(panda.message(live.tick() + offset, panda.samples[2]))
    live.serves(panda, 1)
    for topic in live.topics.values():
        assert topic.stamps == [live.now]
    report = after(live, begin, f"rejected: {cause}")
    assert report.level == WARN
    assert f"this node's clock, expected within max_age = {MAX_AGE:g} s" in report.values["last rejection"]
    assert report.count("received") == report.outcomes()


def test_latency_and_age(live, panda):
    """Stamps of 0.25 s ago: latency and age say at least so much, and no more than has gone by until they are read."""
    q, qd, tau, _ = panda.samples[0]
    live.next_report()  # the next one tells of this state alone
    begin, stamp = len(live.reports), live.tick() - 250 * MS
    published = live.feed(panda.message(stamp, panda.samples[0]))
    Truth(panda, q, qd, tau).check(published, stamp)
    report = live.wait_for_report(lambda report: "latency of input, mean [s]" in report.values, "a latency", begin)
    gone = (live.peer.now() - stamp) * 1e-9
    mean, largest = (float(report.values[f"latency of input, {which} [s]"]) for which in ("mean", "largest"))
    assert 0.0 < mean <= largest <= gone
    assert largest >= 0.25
    assert 0.25 <= float(report.values["age of the last state [s]"]) <= gone


def test_a_joint_falls_silent(live, panda):
    """While the arm goes on, the gripper is named as stale by the clock; it is back with its next message."""
    live.serves(panda)

    def silent(report):
        live.feeder.publish(panda.message(live.tick(), panda.samples[0], arm(panda)))
        return report.values["stale joints"] == f"1: {FINGER}" and report.count("rejected: stale joint")

    live.wait_for_report(silent, "the silence of the gripper")
    live.serves(panda, 1)


def anew(monitor, **parameters):
    """Let a monitor forget which clock its input goes by, as a restart would."""
    monitor.transition("deactivate", "cleanup")
    for name, value in parameters.items():
        monitor.set_parameter(name, value)
    monitor.transition("configure", "activate")


@pytest.fixture
def recording(live, panda):
    """Start a monitor without use_sim_time anew, and play it a recording of long ago, from second 1000 on."""
    anew(live)
    live.live, live.now = False, 1000 * S
    yield live.connect(panda)
    live.live = True
    anew(live)
    live.connect(panda).serves(panda)


def test_recording_without_simulated_time(recording, panda):
    """Right numbers, and a warning that names the distance; once stamps are of now, the recording is refused."""
    recording.serves(panda, 2)

    def warned(report):
        recording.serves(panda, 1)
        return report.level == WARN and "rejected" not in report.message  # of this recording alone

    report = recording.wait_for_report(warned, "foreign time")
    assert report.message.startswith("stamps of joint_states are behind this node's clock")
    assert float(report.values["clock less stamps of joint_states [s]"]) > 1e9
    told = "A recording is played with --clock"
    recording.process.wait_for_text(told)
    another = recording.wait_for_report(warned, "foreign time, as before")
    assert another.message == report.message and another.values != report.values
    assert recording.process.output.count(told) == 1
    replayed, recording.live = recording.now, True

    def well(report):
        recording.serves(panda)
        return report.level == OK

    assert recording.wait_for_report(well, "all being well with stamps of now").message == "publishing"
    recording.forget()
    begin = len(recording.reports)
    recording.feeder.publish(panda.message(replayed + 20 * MS, panda.samples[0]))
    recording.serves(panda, 1)
    assert recording.topics["state"].stamps == [recording.now]
    report = after(recording, begin, "rejected: stamp from the past")
    assert report.count("received") == report.outcomes()


def test_recording_in_a_loop(recording, panda):
    """At each new beginning one message is lost, and nothing of the end of the recording is mixed with its beginning."""
    before = recording.next_report()
    recording.forget()
    rounds, steps, good = 3, 5, []
    for round in range(rounds):
        start = 1100 * S
        for k in range(steps):
            stamp = start + 2 * k * S  # the stamps of one round are far enough apart for every topic
            if round and k == 0:
                recording.feeder.publish(panda.message(stamp, panda.samples[0]))  # suspected
                stamp += 5 * MS
                recording.feeder.publish(panda.message(stamp, panda.samples[1], arm(panda)))  # believed
                stamp += 5 * MS
                message = panda.message(stamp, panda.samples[1], [FINGER])
            else:
                message = panda.message(stamp, panda.samples[1])
            published = recording.feed(message, ["state"])
            Truth(panda, *panda.samples[1][:3]).check(published, stamp)
            good.append(stamp)
            recording.topics["state"].forget()
    total = rounds * steps + 2 * (rounds - 1)
    report = recording.wait_for_report(
        lambda report: report.count("received") >= before.count("received") + total, "all of it"
    )
    again = rounds - 1
    assert report.since(before) == {
        "received": total,
        "published": len(good),
        "time jumped back": again,
        "incomplete": again,
        "rejected: stamp from the past": again,
    }


def test_foreign_time_refused(live, panda):
    """With foreign_time = refuse, a recording is rejected from its first message on; stamps of now are served."""
    anew(live, foreign_time="refuse")
    live.forget()
    try:
        live.peer.wait_until(live.feeder.get_subscription_count, "the subscription to joint_states")
        before = live.next_report()
        stamps = iter(range(1000 * S, 2000 * S, 20 * MS))

        def refused(report):
            live.feeder.publish(panda.message(next(stamps), panda.samples[0]))
            return any(key.startswith("rejected: ") for key in report.since(before))

        report = live.wait_for_report(refused, "a refusal")
        live.connect(panda).serves(panda, 1)
        assert all(topic.stamps[0] > 2000 * S for topic in live.topics.values())
    finally:
        anew(live, foreign_time="warn")
        live.connect(panda)
    assert report.level == WARN
    assert "behind this node's clock" in report.values["last rejection"]
    assert set(report.since(before)) == {"received", "rejected: foreign time"}


def test_simulated_clock_stands_still(peer):
    """States that go on are refused where they are ahead of it by more than max_age; with /clock they are served again."""
    ur5 = robot(UR5)
    clock = peer.publisher(Clock, "/clock")

    def at(now):
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(now, S)
        clock.publish(message)

    with Monitor(peer, "/stopped", robot_description=ur5.path, use_sim_time=True, max_age=1.0) as monitor:
        peer.wait_until(clock.get_subscription_count, "the subscription to /clock", START)
        monitor.now = 700 * S
        states, last = monitor.topics["state"], 700 * S

        def served():
            nonlocal last
            last = monitor.tick(20 * MS)
            at(last)
            monitor.feeder.publish(ur5.message(last, ur5.samples[0]))
            return states.messages

        def in_step():  # a state may come before its clock does, and is one of another time then
            return served() and monitor.reports and monitor.reports[-1].values.get("stamps") == "of this node's clock"

        peer.wait_until(in_step, "states by /clock", START)
        monitor.now = max(monitor.now, last + 3 * S)

        def refused(report):
            monitor.feeder.publish(ur5.message(monitor.tick(20 * MS), ur5.samples[0]))
            ahead = report.level == WARN and "ahead of this node's clock" in report.message  # one may have been before
            return ahead and report.count("rejected: stamp from the future")

        monitor.wait_for_report(refused, "states ahead of /clock")
        assert max(states.stamps) <= last + S
        states.forget()
        peer.wait_until(served, "a state by the time that goes on")


def test_the_end_of_time(peer, panda):
    """Stamps count seconds in 32 bits: the last one is of January 2038. What is sent in 2100 wraps round, and is none."""
    with Monitor(peer, "/last", robot_description=panda.path) as monitor:
        monitor.connect(panda)
        stamp = (2**31 - 1) * S + 999 * MS
        published = monitor.feed(panda.message(stamp, panda.samples[0]), ["state", "kinetic_energy"])
        Truth(panda, *panda.samples[0][:3]).check(published, stamp)
        wrapped = panda.message(0, panda.samples[1])
        wrapped.header.stamp.sec = 4_102_444_800 - 2**32
        begin = len(monitor.reports)
        monitor.feeder.publish(wrapped)
        report = after(monitor, begin, "rejected: malformed stamp")
        assert report.level == WARN and not monitor.topics["state"].at(0)


def test_ten_megabytes(peer, panda):
    """A message of a quarter of a million joints that nobody knows goes nowhere, and what comes after it is served.

    It travels in 160 parts; the subscription is reliable, for of those that ask for none again few arrive whole.
    """
    names = [f"joint_of_nobody_{k:016d}" for k in range(250_000)]
    with Monitor(peer, "/huge", robot_description=panda.path) as monitor:
        monitor.connect(panda).serves(panda)
        huge = joint_state(names, np.zeros(len(names)), (), (), monitor.tick())
        assert len(serialize_message(huge)) > 1e7
        before = monitor.next_report()

        monitor.feeder.publish(huge)
        peer.wait_until(lambda: monitor.reports[-1].since(before).get("foreign"), "ten megabytes", START)
        assert monitor.reports[-1].since(before)["received"] == 1
        monitor.serves(panda, 1)


def test_simulated_clock_jumps_back(peer):
    """A simulation is reset: states of the new time are served at once, and none of before is part of them."""
    ur5 = robot(UR5)
    q, qd, tau, _ = ur5.samples[0]
    clock = peer.publisher(Clock, "/clock")

    def set_clock(now):
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(now, S)
        clock.publish(message)

    with Monitor(peer, "/reset", robot_description=ur5.path, use_sim_time=True, max_age=1.0) as monitor:
        peer.wait_until(clock.get_subscription_count, "the subscription to /clock", START)
        monitor.connect(ur5)
        states = monitor.topics["state"]

        def unstamped():
            have = len(states.messages)
            set_clock(5000 * S)
            monitor.feeder.publish(joint_state(ur5.names, q, qd, tau, 0))
            peer.wait_until(lambda: len(states.messages) > have, "a state")
            return nanoseconds(states.messages[-1].header.stamp)

        peer.wait_until(lambda: unstamped() == 5000 * S, "the time of /clock")
        before = monitor.wait_for_report(lambda _: True, "anything")

        def jumped(report):
            set_clock(100 * S)
            return report.count("clock jumped back") == before.count("clock jumped back") + 1

        monitor.wait_for_report(jumped, "the jump")
        monitor.forget()
        first, second = 100 * S + 10 * MS, 100 * S + 20 * MS
        monitor.feeder.publish(ur5.message(first, ur5.samples[1], ur5.names[:3]))
        published = monitor.feed(ur5.message(second, ur5.samples[1], ur5.names[3:]), ["state"])
        assert states.stamps == [second]
        Truth(ur5, *ur5.samples[1][:3]).check(published, second)
        assert nanoseconds(published["state"].oldest_stamp) == first
        # what the clock has not reached yet is rejected
        begin = len(monitor.reports)
        monitor.feeder.publish(ur5.message(5000 * S, ur5.samples[1]))
        report = after(monitor, begin, "rejected: stamp from the future")
        monitor.now = 99 * S + 100 * MS
        monitor.serves(ur5)
        assert report.count("received") == report.outcomes()
        assert report.since(before)["incomplete"] == 1


def test_simulated_time_is_switched_on_and_off(peer):
    """At run time: what has no stamp gets that of the clock in force."""
    ur5 = robot(UR5)
    q, qd, tau, _ = ur5.samples[0]
    clock = peer.publisher(Clock, "/clock")
    simulated = Clock()
    simulated.clock.sec = 7000
    with Monitor(peer, "/switched", robot_description=ur5.path) as monitor:
        monitor.connect(ur5)
        states = monitor.topics["state"]

        def now():
            """Return the newest stamp, 0 without any: a state may come before its clock does."""
            clock.publish(simulated)
            monitor.feeder.publish(joint_state(ur5.names, q, qd, tau, 0))
            return states.stamps[-1] if states.stamps else 0

        def simulated_time():
            return now() == 7000 * S

        def time_of_day():
            return abs(now() - peer.now()) < TIMEOUT * S

        for simulates, expected in ((False, time_of_day), (True, simulated_time), (False, time_of_day)):
            monitor.set_parameter("use_sim_time", simulates)
            states.forget()
            peer.wait_until(expected, f"stamps with use_sim_time {simulates}")
