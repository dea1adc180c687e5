# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What /diagnostics say: every key with its right value, energies that are too high at once, and counters that add up."""

import itertools

import numpy as np
import pytest

from nodes import MS, PANDA, Monitor, S, Truth, joint_state, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

OK, WARN, ERROR, STALE = b"\x00", b"\x01", b"\x02", b"\x03"

KEYS = {
    "joint states": {
        "input rate [Hz]",
        "output rate [Hz]",
        "age of the last state [s]",
        "received",
        "published",
        "missing joints",
        "stale joints",
        "joints without effort",
        "effort undeclared (taken as N m, with gravity)",
        "joints with estimated velocity",
        "publishers of /told/joint_states",
    },
    "model": {
        "robot",
        "degrees of freedom",
        "total mass [kg]",
        "mimic joints",
        "locked joints",
        "payloads",
        "model revision",
        "lifecycle",
        "serialization",
    },
    "numerical health": {"|nu.C| / (|nu| |C|)", "|K - qd.M.qd / 2| / K", "smallest D [kg m^2, kg]", "its joint"},
    "energy": {"kinetic energy [J]", "largest kinetic energy [J]", "power [W]"},
}


@pytest.fixture(scope="module")
def running(peer):
    """Start the monitor of this file."""
    with Monitor(peer, "/told", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


def values(report, name):
    """Return the values of one entry by key."""
    return {pair.key: pair.value for pair in report.entries[name].values}


def at_rest(panda, sample=0):
    """Return a sample of the robot without its motion."""
    q, qd, tau, qdd = panda.samples[sample]
    return type(panda.samples[sample])(q, np.zeros(len(qd)), tau, qdd)


@pytest.mark.parametrize("sample", range(3))
def test_every_entry(monitor, panda, sample):
    """All keys are there; health, smallest D and energies are Pinocchio's, the model's numbers the robot's."""
    q, qd, tau, _ = panda.samples[sample]
    truth = Truth(panda, q, qd, tau)
    monitor.next_report()  # of all states before this one
    begin = len(monitor.reports)
    monitor.serves(panda, sample)
    report = monitor.wait_for_report(lambda report: report.level == OK, "a state", begin)
    assert set(report.entries) == set(KEYS)
    for name, keys in KEYS.items():
        assert keys <= set(values(report, name)), name
        assert report.entries[name].level == OK
    at_once = int(report.values.get("joint states read by template", 0))
    assert at_once > 0
    assert values(report, "model")["serialization"] == "template"
    health = values(report, "numerical health")
    assert float(health["|nu.C| / (|nu| |C|)"]) < 1e-9
    assert float(health["|K - qd.M.qd / 2| / K"]) < 1e-9
    D = truth.state.D
    assert health["its joint"] == panda.names[int(np.argmin(D))]
    assert float(health["smallest D [kg m^2, kg]"]) == pytest.approx(D.min(), rel=1e-5)
    energy = values(report, "energy")
    assert float(energy["kinetic energy [J]"]) == pytest.approx(truth.state.kinetic_energy, rel=1e-5)
    assert float(energy["largest kinetic energy [J]"]) == pytest.approx(truth.state.kinetic_energy, rel=1e-5)
    assert float(energy["power [W]"]) == pytest.approx(truth.state.power, rel=1e-4)
    joints = values(report, "joint states")
    assert joints["missing joints"] == joints["joints without effort"] == "0"
    assert float(joints["age of the last state [s]"]) > 0.0
    model = values(report, "model")
    assert (model["robot"], model["degrees of freedom"], model["lifecycle"]) == ("panda", "8", "active")
    assert int(model["model revision"]) == monitor.topics["state"].messages[-1].model_revision


def test_rates_add_up(monitor, panda):
    """Counters are what was sent and what came out, and there are rates where they have grown."""
    before = monitor.next_report()
    begin = len(monitor.reports)
    count = 40
    for k in range(count):
        monitor.feed(panda.message(monitor.tick(), panda.samples[k % 3]), ["state"])
        if k % 4 == 0:
            monitor.feeder.publish(joint_state(panda.names, panda.samples[0].q, [], [], monitor.now + MS))
    total = count + count // 4
    report = monitor.wait_for_report(lambda report: report.count("received") >= before.count("received") + total, "all")
    for last, this in itertools.pairwise(monitor.reports[begin - 1 :]):
        for rate, counter in (("input rate [Hz]", "received"), ("output rate [Hz]", "published")):
            assert (float(this.values[rate]) > 0.0) == (this.count(counter) > last.count(counter))
    assert report.since(before) == {"received": total, "published": count, "rejected: no velocity": count // 4}
    assert report.count("received") == report.outcomes()


def test_whose_time_the_stamps_are(monitor):
    """Whether stamps are in step with the clock is a value of its own, which says so also where all is well."""
    assert any(key.startswith("stamps") for key in values(monitor.next_report(), "joint states"))


def test_joints_of_another_time_are_not_stale(monitor, panda):
    """Stamps are not judged by the clock here, so it says nothing about their age: what is published is not stale."""

    def told(report):
        monitor.serves(panda)
        return report.level == OK

    assert values(monitor.wait_for_report(told, "states"), "joint states")["stale joints"] == "0"


# --- energies


def alarm(monitor, panda, sample, level):
    """Rest, then move beyond a threshold; return the report of it, which is one between two that come by the second.

    Three reports span two periods when they come by the second alone, and no more than one when the one in the middle is
    out of turn. A machine that stalls for longer may hide that, so there are several attempts.
    """
    for _ in range(5):
        begin = len(monitor.reports)
        rest(monitor, panda)
        quiet = monitor.wait_for_report(lambda report: report.entries["energy"].level == OK, "rest", begin)
        assert quiet.entries["energy"].message == "within thresholds"
        begin = len(monitor.reports)
        monitor.serves(panda, sample)
        at = first_at(monitor, begin, level)
        monitor.peer.wait_until(lambda at=at: len(monitor.reports) > at + 1, "the report after that")
        first, report, third = monitor.reports[at - 1 : at + 2]
        if third.stamp - first.stamp < 1.5 * S:
            return report
    raise AssertionError("no report came before its second was over")


def first_at(monitor, begin, level):
    """Wait for a report on energy of this level; return the place of the first one from `begin` on.

    It may be there already, and so may those by the second that follow it, which tell of no state.
    """

    def found():
        levels = [report.entries["energy"].level for report in monitor.reports[begin:]]
        return level in levels and begin + levels.index(level)

    return monitor.peer.wait_until(found, f"a report of level {level}")


def rest(monitor, panda):
    """Feed a state at rest."""
    stamp = monitor.tick()
    monitor.feed(panda.message(stamp, at_rest(panda)), ["state"])


@pytest.mark.parametrize(("word", "level"), [("warn", WARN), ("error", ERROR)])
def test_energy_too_high(monitor, panda, word, level):
    """The level rises at once, says energy and threshold, and is back to OK when the energy is."""
    K = Truth(panda, *panda.samples[2][:3]).state.kinetic_energy
    slow = Truth(panda, *panda.samples[1][:3]).state.kinetic_energy
    most = round(0.5 * (K + slow), 2)
    assert slow < most < K
    with monitor.having(**{f"{word}_energy": most}):
        report = alarm(monitor, panda, 2, level)
        energy = report.entries["energy"]
        assert energy.message == f"kinetic energy > {word}_energy = {most:g} J"
        assert float(values(report, "energy")["largest kinetic energy [J]"]) == pytest.approx(K, rel=1e-5)
        begin = len(monitor.reports)
        monitor.serves(panda, 1)  # below the threshold, if not at rest
        over = monitor.wait_for_report(lambda report: report.entries["energy"].level == OK, "its end", begin)
        assert over.entries["energy"].message == "within thresholds"


@pytest.mark.parametrize(("word", "level", "by"), [("warn", WARN, "its own"), ("error", ERROR, "that of all others")])
def test_energy_share_too_high(monitor, panda, word, level, by):
    """The joint is named whose share it is, be the threshold its own or that of all others."""
    share = 0.5 * Truth(panda, *panda.samples[2][:3]).state.nu ** 2
    k = int(np.argsort(share)[-2])
    name, most = panda.names[k], float(f"{0.5 * share[k]:.3g}")
    entries = [f"{name}={most}", "*=1e9"]
    if by != "its own":
        entries = [f"*={most}", *(f"{other}=1e9" for other in panda.names if other != name)]
    with monitor.having(**{f"{word}_energy_share": entries}):
        report = alarm(monitor, panda, 2, level)
        message = report.entries["energy"].message
        assert message == f"energy share of joint '{name}' > {word}_energy_share = {most:g} J"
        assert values(report, "energy")[f"largest energy share of '{name}' [J]"] == f"{share[k]:.6g}"
        begin = len(monitor.reports)
        rest(monitor, panda)
        monitor.wait_for_report(lambda report: report.entries["energy"].level == OK, "its end", begin)


def test_warning_becomes_error(monitor, panda):
    """An error is reported at once where a warning has been reported already."""
    slow, fast = (Truth(panda, *panda.samples[k][:3]).state.kinetic_energy for k in (1, 2))
    with monitor.having(warn_energy=round(0.5 * slow, 4), error_energy=round(0.5 * (slow + fast), 4)):
        begin = len(monitor.reports)
        rest(monitor, panda)
        monitor.wait_for_report(lambda report: report.entries["energy"].level == OK, "rest", begin)
        for sample, level, word in ((1, WARN, "warn_energy"), (2, ERROR, "error_energy")):
            begin = len(monitor.reports)
            monitor.serves(panda, sample)
            report = monitor.reports[first_at(monitor, begin, level)]
            assert word in report.entries["energy"].message


# --- the balance of power


def residual(monitor, panda, motion):
    """Feed a motion (q, q̇, τ of time) at 500 Hz by its stamps over two reports or more, and return what is told then.

    A report that comes right after another one, as after a stall, has nothing to tell.
    """
    key = "power-balance residual [W]"
    first, begin, k = monitor.tick(), len(monitor.reports), 0
    while not any(key in values(report, "energy") for report in monitor.reports[begin + 1 :]):
        monitor.now = first + 2 * k * MS
        monitor.feeder.publish(joint_state(panda.names, *motion(2e-3 * k), stamp=monitor.now))
        if k % 4 == 3:  # no more under way than the node's queue holds
            monitor._all_at(monitor.now, ["state"])
        k += 1
    told = [values(report, "energy") for report in monitor.reports[begin + 1 :]]
    return next(float(entry[key]) for entry in told if key in entry)


def swing(panda, torque):
    """Return a motion in which K and power change all the time; `torque` adds to the efforts that it takes."""
    q0, oracle = panda.samples[1].q, panda.oracle
    size = 0.3 * np.cos(np.arange(len(q0)))
    w = 4.0

    def motion(t):
        q, qd, qdd = q0 + size * np.sin(w * t), size * w * np.cos(w * t), -size * w**2 * np.sin(w * t)
        return q, qd, oracle.inverse_dynamics(q, qd, qdd) + torque(qd)

    return motion


def test_power_balance_of_a_consistent_motion(monitor, panda):
    """Efforts that explain the motion leave nothing over, but for the trapezoids of 2 ms."""
    motion = swing(panda, lambda qd: 0.0)
    power = max(abs(Truth(panda, *motion(t)).state.power) for t in np.arange(0.0, 1.6, 0.05))
    assert power > 1.0
    assert abs(residual(monitor, panda, motion)) < 1e-4 * power


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_balance_of_the_last_minute(monitor, panda, scale):
    """Right efforts explain all of it, half of them do not, and the words say so; neither is a warning."""
    motion = swing(panda, lambda qd: 0.0)
    monitor.tick(100 * S)
    before, begin, count = monitor.next_report(), len(monitor.reports), 1250
    for k in range(count):
        monitor.now += 2 * MS
        q, qd, tau = motion(2e-3 * k)
        monitor.feeder.publish(joint_state(panda.names, q, qd, scale * tau, monitor.now))
        if k % 4 == 3:  # no more under way than the node's queue holds
            monitor._all_at(monitor.now, ["state"])
    end = before.count("received") + count
    report = monitor.wait_for_report(lambda r: r.count("received") >= end, "all of it", begin)
    assert report.entries["energy"].level == OK
    share = float(values(report, "energy")["explained share of dK/dt (last minute)"])
    words = values(report, "energy")["balance of power (last minute)"]
    assert (share > 0.99) == (words == "the efforts explain 100% of the change of kinetic energy") == (scale == 1.0)
    assert (share < 0.8) == ("check the unit of efforts" in words) == (scale == 0.5)


def test_power_balance_with_friction(monitor, panda):
    """Efforts that overcome friction put in more than K gains: the residual is what friction takes, and negative."""
    q0, qd = panda.samples[0].q, 0.5 * np.cos(np.arange(len(panda.names)))
    damping = np.linspace(1.0, 3.0, len(panda.names))
    lost = float(damping @ qd**2)  # [W], all the time the same at constant rates
    zero = np.zeros(len(qd))

    def motion(t):
        q = q0 + t * qd
        return q, qd, panda.oracle.inverse_dynamics(q, qd, zero) + damping * qd

    assert residual(monitor, panda, motion) == pytest.approx(-lost, rel=1e-3)
