# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Diagnostics of the monitor: every value is Pinocchio's, alarms of energy come at once, power is balanced."""

from types import SimpleNamespace

import numpy as np
import pytest

from diag_dynamics.joint_states.assembler import StateAssembler
from diag_dynamics.joint_states.joints import Joints, Options
from diag_dynamics.model.mimic import Mimic
from diag_dynamics.nodes.monitor.traffic import Traffic
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN
from nodes import MS, PANDA, Monitor, S, Truth, joint_state, robot

KEYS = {
    "joint states": {
        "input rate [Hz]",
        "output rate [Hz]",
        "age of the last state [s]",
        "stamps",
        "stale joints",
        "publishers of /reports/joint_states",
    },
    "model": {"robot", "degrees of freedom", "total mass [kg]", "mimic joints", "locked joints"},
    "numerical health": {"|nu.C| / (|nu| |C|)", "|K - qd.M.qd / 2| / K", "smallest D [kg m^2, kg]", "its joint"},
    "energy": {"kinetic energy [J]", "largest kinetic energy [J]", "power [W]"},
}


@pytest.fixture(scope="module")
def running(peer):
    """Start the monitor of this file."""
    with Monitor(peer, "/reports", outputs=["state"], robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


def values(report, name):
    """Return the values of one entry by key."""
    return {pair.key: pair.value for pair in report.entries[name].values}


@pytest.mark.parametrize("sample", range(3))
def test_every_entry(monitor, panda, sample):
    """All keys are there; health, smallest D and energies are Pinocchio's, the model's numbers the robot's."""
    truth = Truth(panda, *panda.samples[sample][:3]).state
    monitor.next_report()
    monitor.serves(panda, sample)
    report = monitor.next_report()
    assert set(report.entries) == set(KEYS)
    assert report.level == OK
    for name, keys in KEYS.items():
        assert keys <= set(values(report, name)), name
    health, energy = values(report, "numerical health"), values(report, "energy")
    assert float(health["|nu.C| / (|nu| |C|)"]) < 1e-9
    assert float(health["|K - qd.M.qd / 2| / K"]) < 1e-9
    assert health["its joint"] == panda.names[int(np.argmin(truth.D))]
    assert float(health["smallest D [kg m^2, kg]"]) == pytest.approx(truth.D.min(), rel=1e-5)
    for key in ("kinetic energy [J]", "largest kinetic energy [J]"):
        assert float(energy[key]) == pytest.approx(truth.kinetic_energy, rel=1e-5)
    assert float(energy["power [W]"]) == pytest.approx(truth.power, rel=1e-4)
    model = values(report, "model")
    assert (model["robot"], model["degrees of freedom"]) == ("panda", "8")
    assert (model["mimic joints"], model["locked joints"]) == ("1: panda_finger_joint2", "0")
    mass = sum(float(found.get("value")) for found in panda.oracle.xml.findall("link/inertial/mass"))
    assert float(model["total mass [kg]"]) == pytest.approx(mass, rel=1e-5)
    assert int(model["model revision"]) == monitor.topics["state"].messages[-1].model_revision
    assert report.values["stale joints"] == "0"  # stamps of another time say nothing about their age
    report = monitor.next_report()
    assert (report.level, report.message) == (STALE, "no joint states")


def test_rates_add_up(monitor, panda):
    """Counters are what was sent and what came out, rates their growth in a second."""
    before = monitor.next_report()
    for k in range(20):
        monitor.publish(panda.message(monitor.tick(), panda.samples[k % 3]))
        if k % 4 == 0:
            monitor.publish(joint_state(panda.names, panda.samples[0].q, [], [], monitor.now + MS))
    report = monitor.next_report()
    assert report.since(before) == {"received": 25, "published": 20, "rejected: no velocity": 5}
    assert report.count("received") == report.outcomes()
    assert (report.values["input rate [Hz]"], report.values["output rate [Hz]"]) == ("25", "20")


def test_replaced_robot():
    """What the messages of a robot did since the last report is in the next one, whether it is still there or not."""
    joints = Joints(("wrist",), {"thumb": Mimic("wrist", 2.0, 0.0)})
    robots = [
        SimpleNamespace(base=None, assembler=StateAssembler(joints, Options(jump=0.1, mimic_tolerance=0.1)))
        for _ in range(2)
    ]
    names = ["wrist", "thumb"]
    for position, stamp in (([1, 2], 1), ([1, 5], 2), ([3, 6], 3), ([3, 6], 4), ([3, 6], 5), ([4, 8], 5)):
        robots[0].assembler.accept(joint_state(names, position, [0, 0], [], S + stamp * MS), 2 * S)
    expected = ["mimic joints astray: position of joint 'thumb'", "positions jumped, and stayed: joint 'wrist'"]
    for robot_then in (robots[1], None):
        traffic = Traffic(lambda: 0.0)
        traffic.keep(robots[0])
        message = traffic.status(robot_then, 2 * S, {}).message
        assert all(text in message for text in expected), message


# --- energies


def energy_report(monitor, panda, sample, level):
    """Publish a state that raises the level; return the entry on energy, which is published at once and alone."""
    count = len(monitor.reports)
    monitor.publish(panda.message(monitor.tick(), panda.samples[sample]))
    monitor.peer.graph.spin()
    (report,) = monitor.reports[count:]
    assert report.entries["energy"].level == level
    return report


def rest(monitor, panda):
    """Publish a state at rest, and return the entry on energy."""
    sample = panda.samples[0]
    monitor.publish(joint_state(panda.names, sample.q, 0 * sample.qd, sample.tau, monitor.tick()))
    return monitor.next_report().entries["energy"]


@pytest.mark.parametrize(("word", "level"), [("warn", WARN), ("error", ERROR)])
def test_energy_too_high(monitor, panda, word, level):
    """The level rises at once, the message names the threshold, and all is well below it."""
    slow, fast = (Truth(panda, *panda.samples[k][:3]).state.kinetic_energy for k in (1, 2))
    maximum = round(0.5 * (slow + fast), 2)
    with monitor.having(**{f"{word}_energy": maximum}):
        assert rest(monitor, panda).message == "within thresholds"
        report = energy_report(monitor, panda, 2, level)
        assert report.entries["energy"].message == f"kinetic energy > {word}_energy = {maximum:g} J"
        assert float(values(report, "energy")["largest kinetic energy [J]"]) == pytest.approx(fast, rel=1e-5)
        monitor.next_report()
        monitor.serves(panda, 1)
        assert monitor.next_report().entries["energy"].message == "within thresholds"


@pytest.mark.parametrize(("word", "level"), [("warn", WARN), ("error", ERROR)])
def test_energy_share_too_high(monitor, panda, word, level):
    """The joint is named whose share it is."""
    share = 0.5 * Truth(panda, *panda.samples[2][:3]).state.nu ** 2
    k = int(np.argsort(share)[-2])
    name, maximum = panda.names[k], float(f"{0.5 * share[k]:.3g}")
    with monitor.having(**{f"{word}_energy_share": [f"{name}={maximum}", "*=1e9"]}):
        rest(monitor, panda)
        report = energy_report(monitor, panda, 2, level)
        message = f"energy share of joint '{name}' > {word}_energy_share = {maximum:g} J"
        assert report.entries["energy"].message == message
        assert values(report, "energy")[f"largest energy share of '{name}' [J]"] == f"{share[k]:.6g}"
        monitor.next_report()
        assert rest(monitor, panda).level == OK


# --- the balance of power


def balance(monitor, panda, motion, count):
    """Publish a motion (q, q̇, τ of time) at 500 Hz by its stamps, and return the values on energy."""
    monitor.tick(100 * S)
    monitor.next_report()
    for k in range(count):
        stamp = monitor.tick(2 * MS)
        monitor.publish(joint_state(panda.names, *motion(2e-3 * k), stamp))
    report = monitor.next_report()
    assert report.entries["energy"].level == OK
    return values(report, "energy")


def swing(panda, scale=1.0):
    """Return a motion in which K and power change all the time, with a multiple of the efforts that it takes."""
    q0, oracle, w = panda.samples[1].q, panda.oracle, 4.0
    size = 0.3 * np.cos(np.arange(len(q0)))

    def motion(t):
        q, qd, qdd = q0 + size * np.sin(w * t), size * w * np.cos(w * t), -size * w**2 * np.sin(w * t)
        return q, qd, scale * oracle.inverse_dynamics(q, qd, qdd)

    return motion


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_power_balance(monitor, panda, scale):
    """Right efforts explain the change of kinetic energy but for trapezoids of 2 ms; half of them do not."""
    motion = swing(panda, scale)
    found = balance(monitor, panda, motion, 1250)
    share = float(found["explained share of dK/dt (last minute)"])
    assert share > 0.99 if scale == 1.0 else share < 0.8
    power = max(abs(Truth(panda, *motion(t)).state.power) for t in np.arange(0.0, 2.5, 0.1))
    assert power > 1.0
    assert (abs(float(found["power-balance residual [W]"])) < 1e-4 * power) == (scale == 1.0)


def test_power_balance_with_friction(monitor, panda):
    """The residual is the power that friction takes, and negative."""
    q0, qd = panda.samples[0].q, 0.5 * np.cos(np.arange(len(panda.names)))
    damping = np.linspace(1.0, 3.0, len(panda.names))

    def motion(t):
        q = q0 + t * qd
        return q, qd, panda.oracle.inverse_dynamics(q, qd, 0 * qd) + damping * qd

    found = balance(monitor, panda, motion, 300)
    assert float(found["power-balance residual [W]"]) == pytest.approx(-float(damping @ qd**2), rel=1e-3)
