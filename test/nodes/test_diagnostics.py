# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Diagnostics of the monitor: every value is Pinocchio's, alarms of energy come at once, power is
balanced.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.monitor.monitored_robot import MonitoredRobot
from diag_dynamics.nodes.monitor.watch import Moment, Watch
from diag_dynamics.nodes.monitor.watches import WATCHES, EnergyWatch
from diag_dynamics.nodes.support.statuses import ERROR, OK, STALE, WARN, Status
from diag_dynamics.parameters.monitor import EnergyThresholds, Settings
from diag_dynamics.parameters.robot_models import model_of
from joint_state_readers import DEFAULTS
from nodes import MS, PANDA, Monitor, S, Truth, robot
from robots import TwoLinkArm

KEYS = {
    "joint states": {
        "input rate [Hz]",
        "output rate [Hz]",
        "age of the last state [s]",
        "stamps",
        "stale joints",
        "publishers of /reports/joint_states",
    },
    "joints": {"missing joints", "unknown names"},
    "efforts": set(),
    "model": {"robot", "degrees of freedom", "total mass [kg]", "mimic joints", "locked joints"},
    "stuck sensors": set(),
    "energy": {"kinetic energy [J]", "largest kinetic energy [J]", "power [W]"},
}


@pytest.fixture(scope="module")
def running(peer):
    """Start the monitor of this file."""
    with Monitor(
        peer, "/reports", outputs=["state"], robot_description=robot(PANDA).path
    ) as monitor:
        yield monitor.connect(robot(PANDA))


def values_of(report, name):
    """Return the values of one entry by key."""
    return {pair.key: pair.value for pair in report.entries[name].values}


@pytest.mark.parametrize("sample", range(3))
def test_every_entry(monitor, panda, sample):
    """All keys are there; energies are Pinocchio's, the model's numbers the robot's."""
    truth = Truth(panda, *panda.samples[sample][:3]).state
    monitor.next_report()
    monitor.serves(panda, sample)
    report = monitor.next_report()
    assert set(report.entries) == set(KEYS)
    assert report.level == OK
    for name, keys in KEYS.items():
        assert keys <= set(values_of(report, name)), name
    energy = values_of(report, "energy")
    for key in ("kinetic energy [J]", "largest kinetic energy [J]"):
        assert float(energy[key]) == pytest.approx(truth.kinetic_energy, rel=1e-5)
    assert float(energy["power [W]"]) == pytest.approx(truth.power, rel=1e-4)
    model = values_of(report, "model")
    assert (model["robot"], model["degrees of freedom"]) == ("panda", "8")
    assert (model["mimic joints"], model["locked joints"]) == ("1: panda_finger_joint2", "0")
    mass = sum(
        float(result.get("value")) for result in panda.oracle.xml.findall("link/inertial/mass")
    )
    assert float(model["total mass [kg]"]) == pytest.approx(mass, rel=1e-5)
    assert int(model["model revision"]) == monitor.topics["state"].messages[-1].model_revision
    assert (
        report.values["stale joints"] == "0"
    )  # stamps of another time say nothing about their age
    report = monitor.next_report()
    assert (report.level, report.message) == (WARN, "no joint states")


# --- energies


CLOCK = 1000 * S
MODEL = SimpleNamespace(joint_names=("shoulder", "elbow"), dof_names=("shoulder", "elbow"), nv=2)


def at_energy(*shares, power=None):
    """Return what stands for an Evaluation with these shares of the kinetic energy, and a power
    [W].
    """
    share = np.array(shares, dtype=float)
    return SimpleNamespace(effort_power=power, kinetic_energy=share.sum(), energy_share=share)


class Watching:
    """An EnergyWatch of a model, without a node; `friction` is the power of friction [W]."""

    def __init__(self, model=MODEL, **thresholds):
        self.watch = EnergyWatch(self, None)
        self._model = model
        self.friction = 0.0
        self.configure(**thresholds)

    def configure(self, **thresholds):
        settings = SimpleNamespace(thresholds=EnergyThresholds(**thresholds))
        self.watch.configure(SimpleNamespace(model=self._model), settings)

    def friction_power(self, _):
        return self.friction

    def accept(self, stamp, s):
        """Return whether a state has an alarm."""
        return bool(self.watch.accept(Moment(s, SimpleNamespace(newest=stamp), 0.0)))

    def report(self):
        (status,) = self.watch.report()
        return status


@pytest.mark.parametrize(
    ("thresholds", "shares", "level", "named"),
    [
        ({"warn": {"total": 3.0}, "error": {"total": 5.0}}, (1, 2), OK, "within thresholds"),
        (
            {"warn": {"total": 3.0}, "error": {"total": 5.0}},
            (3, 2.1),
            ERROR,
            "kinetic energy > energy.error = 5 J",
        ),
        ({"warn": {"elbow": 2.0}}, (9, 2), OK, ""),
        (
            {"warn": {"*": 2.0}, "error": {"*": 4.0}},
            (1, 3),
            WARN,
            "energy share of joint 'elbow' > energy.warn = 2 J",
        ),
        ({"warn": {"*": 2.0, "elbow": 0.0}}, (1, 3), OK, ""),
        (
            {"warn": {"total": 1.0}, "error": {"shoulder": 2.0}},
            (3, 0),
            ERROR,
            "'shoulder' > energy.error",
        ),
    ],
)
def test_thresholds(thresholds, shares, level, named):
    """Of all energy and of single joints' shares; a value at a threshold is within, and 0 is
    none.
    """
    watch = Watching(**thresholds)
    assert watch.accept(CLOCK, at_energy(*shares)) == (level > OK)
    watch.accept(CLOCK + MS, at_energy(0, 0))
    status = watch.report()
    assert status.level == level and named in status.message
    assert status.values["largest kinetic energy [J]"] == f"{sum(shares):g}"
    with pytest.raises(InputError, match=r"'energy\.error' names 'knee'"):
        watch.configure(error={"knee": 1.0})


def test_alarm_where_it_is_worse_than_reported():
    """A worse state is reported at once, others at the next report; without states nothing
    improves.
    """
    watch = Watching(warn={"total": 1.0}, error={"total": 2.0})
    low = at_energy(0.5, 0)
    high = at_energy(1.5, 0)
    highest = at_energy(2.5, 0)
    stamps = iter(range(CLOCK, CLOCK + S, MS))
    for states, alarms, level in (
        ((low, high, high, low), (False, True, False, False), WARN),
        ((high, low, highest), (False, False, True), ERROR),
        ((), (), STALE),
        ((highest, high), (False, False), ERROR),
        ((low,), (False,), OK),
        ((high,), (True,), WARN),
    ):
        assert tuple(watch.accept(next(stamps), state) for state in states) == alarms
        assert watch.report().level == level


def residual(watch):
    """Return the power-balance residual of a report [W], None if there is none."""
    value = watch.report().values.get("power-balance residual [W]")
    return None if value is None else float(value)


@pytest.mark.parametrize(
    ("gap", "integrated"), [(500 * MS, True), (500 * MS + 1, False), (-S, False)]
)
def test_residual(gap, integrated):
    """ΔK less the trapezoid of powers, per second since the last report; not over a gap or back in
    time.
    """
    watch = Watching()
    watch.friction = 9.0  # the audit has friction as a loss of its own
    watch.accept(CLOCK, at_energy(1.0, 0, power=2.0))
    assert residual(watch) is None
    watch.accept(CLOCK + 100 * MS, at_energy(1.5, 0, power=4.0))
    watch.accept(
        CLOCK + 100 * MS, at_energy(99, 0, power=99.0)
    )  # of one stamp the first one counts
    watch.accept(CLOCK + 300 * MS, at_energy(1.5, 0.5, power=-2.0))
    assert residual(watch) == pytest.approx((1.0 - 0.3 - 0.2) / 0.3, rel=1e-5)
    watch.accept(CLOCK + 300 * MS + gap, at_energy(4.0, 0, power=-2.0))
    assert residual(watch) == (pytest.approx(6.0) if integrated else None)


def share_of(watch):
    """Return the explained share of a report, None if there is none."""
    status = watch.report()
    assert status.level == OK
    share = status.values.get("variance explained of dK/dt (last minute)")
    return None if share is None else float(share)


def feed(watch, begin, seconds, change, size=1.0):
    """Feed states at 50 Hz whose K changes by a power, times `change`; return the time after the
    last one [s].
    """
    for t in np.arange(begin, begin + seconds, 0.02):
        watch.friction = size * (1.0 + np.sin(5.0 * t))
        power = change * 3.0 * size * np.sin(3.0 * t) + watch.friction
        state = at_energy(2.0 - size * np.cos(3.0 * t), 0.0, power=power)
        watch.accept(CLOCK + round(t * 1000) * MS, state)
    return begin + seconds


def test_only_the_last_minute_counts():
    """Not less than two seconds, no robot at rest; what was wrong more than a minute ago is
    dropped.
    """
    watch = Watching()
    feed(watch, 0.0, 1.9, 1.0)
    assert share_of(watch) is None
    feed(watch, 100.0, 5.0, 1.0, size=1e-5)
    assert share_of(watch) is None
    end = feed(watch, 200.0, 60.0, -1.0)
    assert share_of(watch) < -2.0
    end = feed(watch, end, 30.0, 1.0)
    assert share_of(watch) < 0.0
    feed(watch, end, 30.5, 1.0)
    assert share_of(watch) > 0.99


# --- watches


class Counting(Watch):
    """A watch of a test: every state is an alarm."""

    _count = 0

    def accept(self, _):
        self._count += 1
        return [Status("counting", ERROR, "a state")]

    def report(self):
        return [Status("counting", OK, f"states: {self._count}")]


def test_another_watch(peer, panda, monkeypatch):
    """A class in the list is a watch: its alarm comes at once and alone, its status once a
    second.
    """
    name = "diag_dynamics.nodes.monitor.monitored_robot.WATCHES"
    monkeypatch.setattr(name, (*WATCHES, Counting))
    with Monitor(peer, "/counted", outputs=[], robot_description=panda.path) as monitor:
        monitor.next_report()
        count = len(monitor.reports)
        monitor.publish(panda.message(monitor.tick(), panda.samples[0]))
        (report,) = monitor.reports[count:]
        assert [entry.message for entry in report.entries.values()] == ["a state"]
        assert monitor.next_report().entries["counting"].message == "states: 1"


def test_settings_that_a_later_watch_rejects():
    """They change nothing, not even the watches before it."""
    urdf = TwoLinkArm(I1=0.02).urdf
    values = DEFAULTS | {"external_torque.gain": 25.0}
    settings = Settings.of(values)
    robot = MonitoredRobot(urdf, model_of(urdf, values), settings, 1)
    wrong = Settings.of(values | {"external_torque.gain": 30.0, "energy.warn": ["knee=1"]})
    with pytest.raises(InputError, match=r"'energy\.warn' names 'knee'"):
        robot.use(robot.model, wrong, 2)
    assert robot.settings is settings and robot.revision == 1
    assert (robot.torque.observer.gain == 25.0).all()
