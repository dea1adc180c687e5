# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Diagnostics of the monitor: every value is Pinocchio's, alarms of energy come at once, power is balanced."""

import numpy as np
import pytest

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


def values_of(report, name):
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
        assert keys <= set(values_of(report, name)), name
    health, energy = values_of(report, "numerical health"), values_of(report, "energy")
    assert float(health["|nu.C| / (|nu| |C|)"]) < 1e-9
    assert float(health["|K - qd.M.qd / 2| / K"]) < 1e-9
    assert health["its joint"] == panda.names[int(np.argmin(truth.D))]
    assert float(health["smallest D [kg m^2, kg]"]) == pytest.approx(truth.D.min(), rel=1e-5)
    for key in ("kinetic energy [J]", "largest kinetic energy [J]"):
        assert float(energy[key]) == pytest.approx(truth.kinetic_energy, rel=1e-5)
    assert float(energy["power [W]"]) == pytest.approx(truth.power, rel=1e-4)
    model = values_of(report, "model")
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


# --- energies


def energy_report(monitor, panda, sample, level):
    """Publish a state that raises the level; return the entry on energy, which is published at once and alone."""
    count = len(monitor.reports)
    monitor.publish(panda.message(monitor.tick(), panda.samples[sample]))
    monitor.peer.graph.spin()
    (report,) = monitor.reports[count:]
    assert report.entries["energy"].level == level
    return report


@pytest.mark.parametrize(("word", "level"), [("warn", WARN), ("error", ERROR)])
def test_energy_too_high(monitor, panda, word, level):
    """The level rises at once, the message names the threshold, and the joint of a share; below it all is well."""
    slow, fast = (Truth(panda, *panda.samples[k][:3]).state for k in (1, 2))
    maximum = round(0.5 * (slow.kinetic_energy + fast.kinetic_energy), 2)
    share = 0.5 * fast.nu**2
    k = int(np.argsort(share)[-2])
    most = float(f"{0.5 * share[k]:.3g}")
    joint = f"energy share of joint '{panda.names[k]}' > {word}_energy_share = {most:g} J"
    for values, message in (
        ({f"{word}_energy": maximum}, f"kinetic energy > {word}_energy = {maximum:g} J"),
        ({f"{word}_energy_share": [f"{panda.names[k]}={most}", "*=1e9"]}, joint),
    ):
        with monitor.having(**values):
            monitor.serves(panda, 1)
            assert monitor.next_report().entries["energy"].message == "within thresholds"
            report = energy_report(monitor, panda, 2, level)
            assert report.entries["energy"].message == message
            largest = float(values_of(report, "energy")["largest kinetic energy [J]"])
            assert largest == pytest.approx(fast.kinetic_energy, rel=1e-5)
            monitor.next_report()


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
    return values_of(report, "energy")


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
