# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator: its joint states obey Pinocchio's dynamics."""

import itertools

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState
from rclpy.exceptions import ParameterException
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

import robots
from diag_dynamics import DiagonalDynamics, load_urdf
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.parameters.monitor import PARAMETERS
from launches import launched
from nodes import BELIEVING, LATCHED, MS, PANDA, START, UR5, Monitor, S, Truth, nanoseconds, robot

STEP = 2 * MS


class Simulator:
    """A simulator and its joint states."""

    def __init__(self, peer, namespace, robot, **parameters):
        """Start it; a context at whose end it ends."""
        self.peer, self.robot = peer, robot
        self.namespace = namespace
        self.states = peer.topic(JointState, f"{namespace}/joint_states")
        self.process = peer.start("simulator", "-r", f"__ns:={namespace}", robot_description=robot.path, **parameters)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.__exit__(*error)

    def collect(self, count):
        """Receive so many joint states from now on and return them."""
        self.states.forget()
        self.peer.wait_until(lambda: len(self.states.messages) >= count, f"{count} joint states", START)
        return self.states.messages[:count]


@pytest.fixture(scope="module")
def wave(peer):
    """Start a Panda on its wave: a step of the integrator for each state, unless the machine is late."""
    with Simulator(peer, "/wave", robot(PANDA), motion="wave", rate=1e9 / STEP, step=STEP / 1e9) as simulator:
        simulator.recorded = simulator.collect(500)
        yield simulator


@pytest.fixture(scope="module")
def falling(peer):
    """Start a UR5 that falls from its zero pose, stretched out, without friction; ten steps for each state."""
    with Simulator(peer, "/falling", robot(UR5), rate=100.0) as simulator:
        simulator.recorded = simulator.collect(150)
        yield simulator


@pytest.fixture(params=["wave", "falling"])
def simulator(request):
    """Return each of them in turn."""
    return request.getfixturevalue(request.param)


def vectors(simulator, message):
    """Position, velocity and effort of the independent joints, in the order of the oracle's dofs."""
    names = list(message.name)
    at = [names.index(name) for name in simulator.robot.names]
    return tuple(np.array(values)[at] for values in (message.position, message.velocity, message.effort))


def damping(robot):
    """Joint damping of the URDF, that of followers reflected, in the order of the oracle's dofs."""
    by_name = {
        joint.get("name"): float(joint.find("dynamics").get("damping", 0))
        for joint in robot.oracle.xml.findall("joint")
        if joint.find("dynamics") is not None
    }
    return np.array([by_name.get(name, 0.0) for name in robot.oracle.full.dof_names]) @ robot.oracle.G**2


def integrate(oracle, q, qd, tau, damping, span, steps):
    """Classical Runge–Kutta on aba with damping, the effort being held."""

    def rates(x):
        return np.array([x[1], oracle.forward_dynamics(x[0], x[1], tau - damping * x[1])])

    x, h = np.array([q, qd]), span / steps
    for _ in range(steps):
        k1 = rates(x)
        k2 = rates(x + h / 2 * k1)
        k3 = rates(x + h / 2 * k2)
        k4 = rates(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


# --- what it publishes


def test_joint_states(simulator):
    """All joints, followers last, with positions, velocities and efforts that are numbers."""
    robot = simulator.robot
    for message in simulator.recorded:
        assert tuple(message.name[: len(robot.names)]) == robot.names
        assert sorted(message.name) == sorted(robot.oracle.full.dof_names)
        for values in (message.position, message.velocity, message.effort):
            assert len(values) == len(message.name)
            assert np.isfinite(values).all()


def test_stamps(simulator):
    """Stamps increase by whole steps of the integrator, at the rate of the parameter."""
    step, period = (STEP, STEP) if simulator.namespace == "/wave" else (MS, 10 * MS)
    stamps = np.array([nanoseconds(message.header.stamp) for message in simulator.recorded])
    gaps = np.diff(stamps)
    assert np.abs(gaps - step * np.round(gaps / step)).max() <= 2  # [ns] from rounding a time in seconds
    assert np.abs(stamps - stamps[0] - period * np.arange(len(stamps))).max() <= step + 2


def test_stamps_are_the_time(falling):
    """The newest joint state is not from the future, and its stamp goes on with the clock."""
    first = falling.collect(1)[0]
    begin = falling.peer.now()
    last = falling.collect(100)[-1]
    assert nanoseconds(first.header.stamp) <= begin
    assert nanoseconds(first.header.stamp) < nanoseconds(last.header.stamp) <= falling.peer.now()


def test_description(simulator):
    """Who comes late gets the URDF all the same, text and not path."""
    topic = simulator.peer.topic(String, f"{simulator.namespace}/robot_description", LATCHED)
    simulator.peer.wait_until(lambda: topic.messages, "the description")
    text = topic.messages[0].data
    assert text.startswith("<")
    assert simulator.robot.urdf.endswith(text)  # what is cut off is the XML declaration, which is for files
    assert len(text) > 0.9 * len(simulator.robot.urdf)


def test_description_of_a_xacro_file(peer, tmp_path):
    """The simulator publishes the URDF that xacro makes of the file and its arguments."""
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(
        '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base"/><link name="tip"><inertial>'
        '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="$(arg side)_turn" type="continuous"><parent link="base"/><child link="tip"/></joint></robot>'
    )
    topic = peer.topic(String, "/expanded/robot_description", LATCHED)
    with peer.start("simulator", "-r", "__ns:=/expanded", robot_description=f"{path} side:=left"):
        peer.wait_until(lambda: topic.messages, "a description", START)
    assert load_urdf(topic.messages[-1].data).dof_names == ("left_turn",)
    with pytest.raises(DiagDynamicsError, match="argument 'side' has no value"):
        peer.start("simulator", robot_description=str(path))


def test_followers(wave):
    """The second finger is where the first one is, moves with it, and has no effort of its own."""
    leader, follower = (wave.recorded[0].name.index(f"panda_finger_joint{k}") for k in (1, 2))
    for message in wave.recorded:
        assert message.position[follower] == message.position[leader]
        assert message.velocity[follower] == message.velocity[leader]
        assert message.effort[follower] == 0.0


# --- how it moves


def test_wave_moves_all_joints(wave):
    """In a second every joint has moved, within its limits, under efforts that differ."""
    q, _, tau = (np.array(values) for values in zip(*(vectors(wave, m) for m in wave.recorded), strict=True))
    assert (np.ptp(q, axis=0) > 1e-3).all()
    assert (np.ptp(tau, axis=0) > 1e-3).all()
    for k, name in enumerate(wave.robot.names):
        limit = wave.robot.oracle.xml.find(f"joint[@name='{name}']/limit")
        assert float(limit.get("lower")) < q[:, k].min()
        assert q[:, k].max() < float(limit.get("upper"))


def predictions(simulator, damping, pairs):
    """Follow aba from the earlier state of each pair, with the effort of the later one.

    Errors of q and q̇ against the later states, shape (2, nv), relative to the joint's largest change within a pair.
    """
    errors, changes = [], []
    for before, after in pairs:
        (q0, qd0, _), (q1, qd1, tau) = vectors(simulator, before), vectors(simulator, after)
        span = (nanoseconds(after.header.stamp) - nanoseconds(before.header.stamp)) / S
        steps = max(8, round(span / 2.5e-4))
        errors.append(integrate(simulator.robot.oracle, q0, qd0, tau, damping, span, steps) - [q1, qd1])
        changes.append([q1 - q0, qd1 - qd0])
    return np.abs(errors).max(axis=0) / np.abs(changes).max(axis=0)


def test_wave_obeys_the_dynamics(wave):
    """From one state to the next, aba leads there with the effort of the later one and the URDF's damping.

    Without the damping, every joint would be off by a hundred times the tolerance and more.
    """
    pairs = list(itertools.pairwise(wave.recorded[:101]))
    # Fourth order at 2 ms against the fastest time constants, those of the fingers (0.015 kg, 0.3 N s/m: 50 ms): 1e-7.
    assert predictions(wave, damping(wave.robot), pairs).max() < 1e-6
    assert predictions(wave, 0.0, pairs)[1].min() > 1e-4


def test_falling_obeys_the_dynamics(falling):
    """Without effort and friction, whatever the number of steps between two states, as long as no limit is near."""
    assert not damping(falling.robot).any()
    assert not any(any(message.effort) for message in falling.recorded)
    pairs = [
        (before, after)
        for before, after in itertools.pairwise(falling.recorded)
        if max(map(abs, (*before.position, *after.position))) < 6.0  # the limits are at 2π
    ]
    assert len(pairs) >= 20
    # The integrator takes steps of 1 ms here, and the arm whips round in some 100 ms.
    assert predictions(falling, 0.0, pairs).max() < 1e-5


# --- with a monitor


def test_monitor_of_a_simulator(wave):
    """The monitor takes description and states from the graph; all it says of them is Pinocchio's, stamp by stamp."""
    with Monitor(wave.peer, "/wave") as monitor:
        wave.states.forget()
        topics = monitor.topics
        energies, states = topics["kinetic_energy"].stamps, wave.states.stamps
        # States came before the monitor was there, and may be waiting in this process, which may miss some.
        wave.peer.wait_until(lambda: len(set(energies).intersection(states)) >= 200, "kinetic energies", START)
        wave.peer.wait_until(lambda: all(topic.messages for topic in topics.values()), "all topics")
        stamps = set(wave.states.stamps)
        compared = 0
        for stamp in topics["kinetic_energy"].stamps:
            if stamp not in stamps:
                continue
            truth = Truth(wave.robot, *vectors(wave, wave.states.at(stamp)))
            published = {name: topic.at(stamp) for name, topic in topics.items() if topic.at(stamp)}
            truth.check(published, stamp)
            compared += 1
        assert compared >= 200
        report = monitor.next_report()
        assert report.values["mimic joints"] == "1: panda_finger_joint2"
        assert not report.count("mimic disagreement")
        factors = topics["mass_matrix_factors"].stamps  # at 50 Hz, or at what a busy machine simulates, if that is less
        assert len(factors) - 1.05 <= (factors[-1] - factors[0]) / (20 * MS)


def test_monitor_accepts_the_robot_of_the_demo(peer):
    """By default the demo's launch file drives a UR5 along sine waves, of which the monitor rejects nothing."""
    parameters = {executable: node.parameters for executable, node in launched("demo").items()}
    rules = {name: PARAMETERS[name].default for name in BELIEVING}
    with (
        Simulator(peer, "/demo", robot(UR5), rate=100.0, **parameters["simulator"]) as simulator,
        Monitor(peer, "/demo", **rules, **parameters["monitor"]) as monitor,
    ):
        simulator.collect(300)
        report = monitor.next_report()
    assert report.count("published") > 200
    assert [name for name in report.counts() if "rejected" in name] == []
    moved = np.ptp([message.position for message in simulator.states.messages], axis=0)
    assert (moved > 0.1).all()


def test_simulated_time(peer):
    """With use_sim_time the robot moves by /clock, and rests while that stands still."""
    clock = peer.publisher(Clock, "/clock")
    with Simulator(peer, "/clocked", robot(UR5), rate=100.0, use_sim_time=True) as simulator:
        peer.wait_until(clock.get_subscription_count, "the subscription to /clock", START)
        now = 0

        def tick():
            nonlocal now
            now += 10 * MS
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(now, S)
            clock.publish(message)
            return len(simulator.states.messages) >= 50

        peer.wait_until(tick, "states in simulated time")
        stamps = simulator.states.stamps
        assert stamps[0] > 0
        assert stamps[-1] <= now
        assert (np.diff(stamps) > 0).all()


# --- what it cannot start with


PANDA_PATH = robots.robot_path(PANDA)

WRONG = {
    "no robot": ({}, "parameter 'robot_description' is empty"),
    "no such file": ({"robot_description": f"{PANDA_PATH}.none"}, "panda.urdf.none"),
    "singular": (
        {"robot_description": robots.robot_path("romeo_description/urdf/romeo_laas_small.urdf")},
        "robot 'RomeoH37' has 2 joint\\(s\\) that move no inertia",
    ),
    "two components": ({"robot_description": PANDA_PATH, "gravity": [0.0, -9.81]}, "gravity"),
    "no such motion": ({"robot_description": PANDA_PATH, "motion": "dance"}, "motion"),
    "two types": ({"gravity": "[0, 0.0, -9.81]"}, "Sequence should be of same type"),  # so says rcl
    "rate of 0": ({"robot_description": PANDA_PATH, "rate": 0.0}, "rate"),
    "order and base": ({"robot_description": PANDA_PATH, "order": 1, "floating_base": True}, "parameter 'order' is 1"),
    "no such joint": (
        {"robot_description": PANDA_PATH, "command_joints": "[elbow]"},
        "parameter 'command_joints' names 'elbow'",
    ),
    "seed": (
        {"robot_description": PANDA_PATH, "inertia_error": 0.3, "inertia_error_seed": -1},
        "seed is -1",
    ),
    "inertia error": ({"robot_description": PANDA_PATH, "inertia_error": 0.95}, "inertia_error"),
}


@pytest.mark.parametrize(("parameters", "said"), WRONG.values(), ids=WRONG)
def test_bad_parameters(peer, parameters, said):
    """The constructor raises what an executable prints in one line, and the message names the parameter."""
    with pytest.raises((DiagDynamicsError, ParameterException, RuntimeError), match=said):
        peer.start("simulator", **parameters)


# --- errors that are declared


def test_inertias_that_are_off_from_the_description(peer):
    """It moves as that perturbed robot does, and publishes the URDF that nothing is known of it from."""
    parameters = {"inertia_error": 0.3, "inertia_error_seed": 5, "rate": 100.0}
    truth = peer.topic(DiagonalizedState, "/off/diag_dynamics_simulator/ground_truth")
    described = peer.topic(String, "/off/robot_description", LATCHED)
    with Simulator(peer, "/off", robot(UR5), **parameters) as simulator:
        peer.wait_until(lambda: len(truth.messages) >= 50 and described.messages, "the truth", START)
        model = load_urdf(robot(UR5).path)
        assert load_urdf(described.messages[0].data).links["mass"].tolist() == model.links["mass"].tolist()
        told, real = DiagonalDynamics(model), DiagonalDynamics(model.perturbed(0.3, 5))
        apart = []
        for message in truth.messages[10:]:
            q, qd = np.array(message.position), np.array(message.velocity)
            K = message.kinetic_energy
            assert K > 0.0 and pytest.approx(real.evaluate(q, qd).kinetic_energy, rel=1e-9) == K
            apart.append(abs(told.evaluate(q, qd).kinetic_energy / K - 1.0))
        assert max(apart) > 0.05
        simulator.process.wait_for_text("Inertias differ from the description by up to 30%")
