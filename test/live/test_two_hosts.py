# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robot on one host, the monitor on another, and a wire between them that is cut, loses, delays and reorders."""

import contextlib
import itertools
import time

import numpy as np
import pytest
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from network import Network, Watch, random_state, unavailable, values
from nodes import BELIEVING, MANY, MAX_AGE, PANDA, START, TIMEOUT, UR5, Topic, joint_state, robot

pytestmark = [pytest.mark.full, pytest.mark.live, pytest.mark.root]

OK, WARN, ERROR, STALE = b"\x00", b"\x01", b"\x02", b"\x03"

LEASE = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="short lease" is_default_profile="true">
    <rtps><builtin><discovery_config>
      <leaseDuration><sec>5</sec></leaseDuration>
      <leaseAnnouncement><sec>0</sec><nanosec>500000000</nanosec></leaseAnnouncement>
    </discovery_config></builtin></rtps>
  </participant>
</profiles>
"""
"""Participants that are silent for 5 s are taken for gone, longer than any delay here; by default it is 20 s."""

PERIOD = 0.005
"""Time between two states of a driver [s]."""


@pytest.fixture(scope="module")
def network(ros_domain, tmp_path_factory):
    """Two hosts, on whose wire nothing happens to the frames."""
    if reason := unavailable():
        pytest.skip(f"no second host: {reason}")
    lease = tmp_path_factory.mktemp("dds") / "lease.xml"
    lease.write_text(LEASE)
    profiles = dict.fromkeys(("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"), str(lease))
    with Network(ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET", **profiles) as network:
        yield network


@pytest.fixture(autouse=True)
def mended(network):
    """Leave the wire as it was."""
    yield
    network.wire.treat()
    network.wire.restore()


# --- known states, with stamps of this machine's clock


class Driver:
    """Publishes states of a robot, each different, best effort, by one or two writers; and what a monitor makes of them.

    Of one writer, DDS drops what arrives late, of two it cannot know.
    """

    def __init__(self, network, namespace):
        self.network, self.robot, self.namespace = network, robot(UR5), namespace
        self.watch = Watch(network.monitor_node, network.wait_until, f"{namespace}/diag_dynamics")
        self._publish = [
            network.robot_node.publisher(JointState, f"{namespace}/joint_states", qos_profile_sensor_data)
            for _ in range(2)
        ]
        self._rng = np.random.default_rng(1)
        self.sent = {}

    def monitor(self, **parameters):
        """Start a monitor of its states on the other host."""
        parameters |= {"robot_description": self.robot.path, **BELIEVING}
        return self.network.monitor_host.process("monitor", "-r", f"__ns:={self.namespace}", **parameters)

    def run_until(self, condition, what, writers=2, timeout=TIMEOUT):
        """Publish a state after the other, the writers taking turns, until a condition holds."""
        deadline = time.monotonic() + timeout
        turns = itertools.cycle(self._publish[:writers])
        while not self.network.wait(condition, PERIOD):
            assert time.monotonic() < deadline, f"waited {timeout:g} s in vain for {what}"
            self._send(next(turns))

    def _send(self, publish):
        stamp = time.time_ns()
        self.sent[stamp] = state = random_state(self.robot, self._rng)
        publish(joint_state(self.robot.names, *state, stamp=stamp))

    def run_until_all_arrive(self, writers=2):
        """Publish until all of the latest states, but for those that may be on their way, have come out."""
        begin = len(self.sent)

        def arrived():
            latest = list(self.sent)[begin:][-35:-5]
            return len(latest) == 30 and all(map(self.watch.topics["state"].at, latest))

        self.run_until(arrived, "all states", writers, timeout=START)

    def check(self):
        """Everything that came out is right and has the stamp of a state that was sent."""
        return self.watch.check(self.robot, self.sent)

    def forget(self):
        """Drop all that was sent and heard so far, but for the last report."""
        self.sent.clear()
        self.watch.forget()

    def rest(self):
        """Publish until the last state of either writer has come out, so that nothing is under way; return a later report.

        What DDS has kept back comes out with the next state at the latest.
        """
        deadline = time.monotonic() + TIMEOUT
        self.network.wire.drain()
        while not self.network.wait(lambda: all(map(self.watch.topics["state"].at, list(self.sent)[-2:])), 0.5):
            assert time.monotonic() < deadline, "the last states never come out"
            for publish in self._publish:
                self._send(publish)
        self.watch.wait_for_report(lambda _: True, "anything")  # which may have been under way
        return self.watch.wait_for_report(lambda _: True, "anything")


@pytest.fixture(scope="module")
def running(network):
    """Start a monitor of known states once for the tests that treat it alike."""
    driver = Driver(network, "/known")
    with driver.monitor():
        yield driver


@pytest.fixture
def driver(running):
    """Return a driver all of whose states arrive, with nothing sent and nothing heard."""
    running.run_until_all_arrive()
    running.rest()
    running.forget()
    return running


def rejected(report):
    """Return how many joint states have been rejected, for whatever reason."""
    return sum(report.count(name) for name in report.values if name.startswith("rejected: "))


def outcomes(report):
    """Return how many joint states there are whose outcome is known."""
    names = "published", "incomplete", "foreign", "followers only", "before the model", "before odometry"
    return rejected(report) + report.count("awaiting velocity") + sum(map(report.count, names))


def judge_bad_wire(driver, writers, **treatment):
    """Send states over a bad wire; return how many were lost, and how many late, by the monitor's account.

    Output goes on, and is only ever right and newer than before. Every state that arrives has one outcome, every other one
    is lost, unless the monitor was too busy to take it. On a good wire everything comes again.
    """
    wire, states, before = driver.network.wire, driver.watch.topics["state"], driver.watch.reports[-1]
    frames_lost, frames_overtaken = wire.lost[0], wire.overtaken[0]
    wire.treat(**treatment)
    driver.run_until(lambda: len(driver.sent) >= 300 and len(states.stamps) >= 50, "states", writers)
    wire.treat()
    assert (wire.lost[0] > frames_lost) == (treatment["loss"] > 0.0)
    assert (wire.overtaken[0] > frames_overtaken) == ("jitter" in treatment)
    report = driver.rest()

    def counted(what):
        return report.count(what) - before.count(what)

    lost, received, published = (counted(what) for what in ("lost in transport", "received", "published"))
    heard = len(states.stamps)
    assert heard <= published
    assert outcomes(report) - outcomes(before) == received
    assert received + lost <= len(driver.sent)
    driver.run_until_all_arrive(writers)
    assert driver.check() >= heard
    return lost, counted("rejected: late")


def test_lost_states_are_counted(driver):
    """A fifth of all frames is lost: states that are missing from the sequence of their writer are counted."""
    lost, late = judge_bad_wire(driver, writers=1, loss=0.2)
    assert lost > 0
    assert late == 0


@pytest.mark.parametrize("loss", [0.0, 0.2], ids=["reordering", "loss and reordering"])
def test_bad_wire(driver, loss):
    """Frames overtake each other, and a fifth of them is lost: states that come after newer ones are counted as late."""
    _, late = judge_bad_wire(driver, writers=2, loss=loss, delay=0.01, jitter=0.05)
    assert late > 0


# --- the package's own robot


class Simulated:
    """A simulated Panda on the one host, its monitor on the other, and what either says, heard on its own host."""

    def __init__(self, network, stack):
        """Start them, the monitor without a robot: the description has to come over the wire."""
        self.network, self.robot = network, robot(PANDA)
        self.states = Topic(network.robot_node, JointState, "/sim/joint_states", MANY)
        self.watch = Watch(network.monitor_node, network.wait_until, "/sim/diag_dynamics")
        here = "-r", "__ns:=/sim"
        motion = {"robot_description": self.robot.path, "motion": "wave", "rate": 100.0}
        stack.enter_context(network.robot_host.process("simulator", *here, **motion))
        stack.enter_context(network.monitor_host.process("monitor", *here, max_age=MAX_AGE))
        self.wait(1, since=0, timeout=START)

    def wait(self, count, since, timeout=TIMEOUT):
        """Wait for so many states that are newer than a stamp."""
        self.watch.wait_for_states(count, since, self.states, timeout)

    def check(self):
        """All states that came out are right; return how many were compared.

        The observer on the robot's host may miss one that the monitor has got.
        """
        return self.watch.check(self.robot, values(self.robot, list(self.states.messages)), complete=False)


@pytest.fixture(scope="module")
def simulated(network):
    """Start robot and monitor once for the tests that treat them alike."""
    with contextlib.ExitStack() as stack:
        yield Simulated(network, stack)


def test_states_come_over_the_wire(network, simulated):
    """Description and states are taken from the other host, and all that is said of them is Pinocchio's."""
    before = network.wire.carried[0]
    simulated.wait(100, since=time.time_ns())
    assert network.wire.carried[0] - before >= 100
    assert simulated.check() >= 100
    simulated.watch.wait_for_report(lambda report: report.level == OK, "all being well")


@pytest.mark.parametrize("longer", [False, True], ids=["shorter than the lease", "longer than the lease"])
def test_cut_wire(network, simulated, longer):
    """The monitor says that nothing comes, ever longer, and publishes nothing; mended, all is as before without help.

    A cut that outlasts the lease makes the hosts forget each other, and find each other anew.
    """
    watch, wire = simulated.watch, network.wire
    simulated.wait(1, since=time.time_ns())
    wire.cut()
    since, carried, cut_off = time.time_ns(), wire.carried.copy(), wire.cut_off.copy()

    def silent(report):
        return report.level in (WARN, STALE) and "no joint states" in report.message

    ages = [float(watch.wait_for_report(silent, "silence").values["age of the last state [s]"])]
    if longer:
        network.wait_until(
            lambda: not network.monitor_node.count_publishers("/sim/joint_states"), "the robot to be forgotten"
        )
    report = watch.wait_for_report(silent, "silence")
    ages.append(float(report.values["age of the last state [s]"]))
    assert float(report.values["input rate [Hz]"]) == float(report.values["output rate [Hz]"]) == 0.0
    assert ages[1] > ages[0]
    assert wire.carried == carried and wire.cut_off[0] > cut_off[0]

    # The last one that the robot has said may be on its way to the wire yet.
    meanwhile = [stamp for stamp in list(simulated.states.stamps)[:-1] if stamp > since]
    wire.restore()
    mended = time.time_ns()
    simulated.wait(50, since=mended)
    watch.wait_for_report(lambda report: report.level == OK, "all being well")
    assert len(meanwhile) >= 20
    for topic in watch.topics.values():
        assert not [stamp for stamp in topic.stamps if since < stamp <= meanwhile[-1]]
    assert simulated.check() >= 50
