# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Watch of energies: thresholds, power balance, last minute; the model's rotors and numerical health."""

from types import SimpleNamespace

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.exceptions import InputError
from diag_dynamics.inspection import inspect_robot
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.nodes.monitor.described import MonitoredRobot
from diag_dynamics.nodes.monitor.energy import EnergyWatch, numerical_health
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN
from diag_dynamics.parameters.monitor import Settings, Thresholds
from diag_dynamics.parameters.robots import model_of
from joint_state_messages import MS, S
from joint_state_readers import DEFAULTS
from robots import TwoLinkArm

CLOCK = 1000 * S
MODEL = SimpleNamespace(joint_names=("shoulder", "elbow"), dof_names=("shoulder", "elbow"), nv=2)


def at_energy(*shares, power=None):
    """Return what stands for an Evaluation with these shares of the kinetic energy, and a power [W]."""
    share = np.array(shares, dtype=float)
    return SimpleNamespace(effort_power=power, kinetic_energy=share.sum(), energy_share=share)


def watching(**thresholds):
    """Return a watch on two joints."""
    return EnergyWatch(MODEL, Thresholds(**thresholds))


def residual(watch):
    """Return the power-balance residual of a report [W], None if there is none."""
    value = watch.report().values.get("power-balance residual [W]")
    return None if value is None else float(value)


# --- thresholds


@pytest.mark.parametrize(
    ("thresholds", "shares", "level", "named"),
    [
        ({}, (1e9, 0), OK, "within thresholds"),
        ({"warn": 3.0, "error": 5.0}, (1, 2), OK, "within thresholds"),
        ({"warn": 3.0, "error": 5.0}, (3, 2), WARN, "kinetic energy > warn_energy = 3 J"),
        ({"warn": 3.0, "error": 5.0}, (3, 2.1), ERROR, "kinetic energy > error_energy = 5 J"),
        ({"warn_share": {"elbow": 2.0}}, (9, 2), OK, ""),
        ({"error_share": {"elbow": 2.0}}, (9, 2.5), ERROR, "'elbow' > error_energy_share = 2 J"),
        ({"warn_share": {"*": 2.0}, "error_share": {"*": 4.0}}, (1, 3), WARN, "'elbow' > warn_energy_share"),
        ({"warn_share": {"*": 2.0, "elbow": 0.0}}, (1, 3), OK, ""),
        ({"warn": 1.0, "error_share": {"shoulder": 2.0}}, (3, 0), ERROR, "'shoulder' > error_energy_share"),
        ({"error": 1.0, "warn_share": {"shoulder": 2.0}}, (3, 0), ERROR, "error_energy"),
    ],
)
def test_thresholds(thresholds, shares, level, named):
    """Of all energy and of single joints' shares; a value at a threshold is within, and 0 is none."""
    watch = watching(**thresholds)
    assert watch.accept_state(CLOCK, at_energy(*shares)) == (level > OK)
    status = watch.report()
    assert status.level == level and named in status.message
    assert status.values["largest kinetic energy [J]"] == f"{sum(shares):.6g}"


def test_threshold_of_an_unknown_joint():
    """It is rejected by parameter and name, and the thresholds in force stay."""
    watch = watching(warn=1.0)
    with pytest.raises(InputError, match="'error_energy_share' names 'knee'"):
        watch.configure(MODEL, Thresholds(error_share={"knee": 1.0}))
    assert watch.accept_state(CLOCK, at_energy(2.0, 0.0))


def test_alarm_where_it_is_worse_than_reported():
    """A worse state is reported at once, others at the next report; without states nothing improves."""
    watch = watching(warn=1.0, error=2.0)
    low, high, highest = at_energy(0.5, 0), at_energy(1.5, 0), at_energy(2.5, 0)
    stamps = iter(range(CLOCK, CLOCK + S, MS))
    for states, alarms, level in (
        ((low, high, high, low), (False, True, True, True), WARN),
        ((high, low, highest), (False, False, True), ERROR),
        ((), (), STALE),
        ((highest, high), (False, False), ERROR),
        ((high,), (False,), WARN),
        ((low,), (False,), OK),
        ((high,), (True,), WARN),
    ):
        assert tuple(watch.accept_state(next(stamps), state) for state in states) == alarms
        assert watch.report().level == level


# --- power balance


@pytest.mark.parametrize(("gap", "integrated"), [(500 * MS, True), (500 * MS + 1, False), (-S, False)])
def test_residual(gap, integrated):
    """ΔK less the trapezoid of powers, per second since the last report; not over a gap or back in time."""
    watch = watching()
    watch.accept_state(CLOCK, at_energy(1.0, 0, power=2.0))
    assert residual(watch) is None
    watch.accept_state(CLOCK + 100 * MS, at_energy(1.5, 0, power=4.0))
    watch.accept_state(CLOCK + 300 * MS, at_energy(1.5, 0.5, power=-2.0))
    assert residual(watch) == pytest.approx((1.0 - 0.3 - 0.2) / 0.3, rel=1e-5)
    watch.accept_state(CLOCK + 300 * MS + gap, at_energy(4.0, 0, power=-2.0))
    assert residual(watch) == (pytest.approx(6.0) if integrated else None)


def test_where_the_balance_begins_anew():
    """After a state without effort, after a jump of time and with another model; energies count throughout."""
    for interrupt in (
        lambda watch: watch.accept_state(CLOCK + 200 * MS, at_energy(9.0, 0)),
        EnergyWatch.forget,
        lambda watch: watch.configure(MODEL, Thresholds()),
    ):
        watch = watching()
        watch.accept_state(CLOCK, at_energy(1.0, 0, power=0.0))
        interrupt(watch)
        watch.accept_state(CLOCK + 300 * MS, at_energy(5.0, 0, power=0.0))
        assert residual(watch) is None
        watch.accept_state(CLOCK + 400 * MS, at_energy(6.0, 0, power=0.0))
        assert residual(watch) == pytest.approx(10.0)


@pytest.fixture(scope="module")
def arm():
    """Return the planar arm, hanging in a field of gravity in its plane."""
    return dd.load_urdf(TwoLinkArm(I1=0.02).urdf, gravity=(1.0, -9.81, 0.0))


def test_reports_in_between_lose_nothing(arm):
    """The mean of the residuals of four quarters is that of the whole: the power that damping takes, negative."""
    damping, dt = np.array([0.3, 0.1]), 1e-3
    simulation = dd.Simulation(arm, [0.4, 0.9], [0.5, -1.0], step=dt, damping=damping, limits=False)
    whole, quarters = (EnergyWatch(arm, Thresholds()) for _ in range(2))
    residuals, lost = [], []
    for k in range(1001):
        state = simulation.evaluate([1.5, -0.8])
        for watch in (whole, quarters):
            watch.accept_state(CLOCK + k * round(dt * S), state)
            watch.accept_state(CLOCK + k * round(dt * S), at_energy(9.0, 9.0, power=9.0))  # the first one counts
        if k and k % 250 == 0:
            residuals.append(residual(quarters))
        lost.append(damping @ simulation.qd**2)
        simulation.advance([1.5, -0.8])
    total = residual(whole)
    assert np.mean(residuals) == pytest.approx(total, rel=1e-4)
    assert total == pytest.approx(-np.trapezoid(lost, dx=dt), rel=1e-3)


# --- the last minute


def share_of(watch):
    """Return the explained share of a report, None if there is none."""
    status = watch.report()
    assert status.level == OK
    share = status.values.get("explained share of dK/dt (last minute)")
    return None if share is None else float(share)


def moved(model, moving, scale=1.0, friction=True):
    """Return the explained share of a motion with the efforts, times a scale, of another model."""
    moving, dynamics = dd.DiagonalDynamics(moving), dd.DiagonalDynamics(model)
    watch = EnergyWatch(model, Thresholds())
    w, size = np.array([3.0, 5.0]), np.array([0.8, 0.6])
    for k in range(1000):
        t = 4e-3 * k
        q, qd, qdd = size * np.sin(w * t), size * w * np.cos(w * t), -size * w * w * np.sin(w * t)
        s = dynamics.evaluate(q, qd, scale * moving.inverse_dynamics(q, qd, qdd, friction=friction))
        watch.accept_state(CLOCK + 4 * k * MS, s, qd @ dynamics.friction_torque(qd))
    return share_of(watch)


def test_explained_share(arm):
    """Near 1 with the right model and its friction; lower without friction, with a payload, and in another unit."""
    resistance = '<dynamics damping="0.3" friction="0.2"/></joint>'
    damped = dd.load_urdf(TwoLinkArm(I1=0.02).urdf.replace("</joint>", resistance), gravity=(1.0, -9.81, 0.0))
    assert moved(arm, arm) > 0.98 and moved(damped, damped) > 0.98
    assert moved(damped, damped, friction=False) < moved(damped, damped) - 0.02
    payload = arm.with_payload(arm.link_names[-1], 1.5, (0.3, 0.0, 0.0))
    assert moved(arm, payload) < 0.8 and moved(arm, arm, scale=0.3) < 0.8


def feed(watch, begin, seconds, change, size=1.0):
    """Feed states at 50 Hz whose K changes by a power, times `change`; return the time after the last one [s]."""
    for t in np.arange(begin, begin + seconds, 0.02):
        state = at_energy(2.0 - size * np.cos(3.0 * t), 0.0, power=change * 3.0 * size * np.sin(3.0 * t))
        watch.accept_state(CLOCK + round(t * 1000) * MS, state)
    return begin + seconds


def test_only_the_last_minute_counts():
    """Not less than two seconds, no robot at rest; what was wrong more than a minute ago is dropped."""
    watch = watching()
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


# --- model and numerical health


@pytest.mark.parametrize(("armature", "named"), [([""], True), (["shoulder=10.0", "elbow=10.0"], False)])
def test_joints_without_rotor_inertia(armature, named):
    """They are named by D and effort limit, as `inspect` names them; no more with the rotors' inertia."""
    limited = TwoLinkArm(I1=0.02).urdf.replace('effort="100" velocity="100"', 'effort="20000" velocity="3"')
    values = DEFAULTS | {"armature": armature}
    robot = MonitoredRobot(limited, model_of(limited, values), Settings.of(values), 1)
    expected = {name for f in inspect_robot(limited).findings if f.check == "rotor_inertia" for name in f.joints}
    assert expected and set(robot.without_rotors) == (expected if named else set())


def test_numerical_health(arm):
    """ν·C is zero, and the smallest D is that of its joint; before any state nothing is reported."""
    assert numerical_health(object(), None).level == STALE
    dynamics = dd.DiagonalDynamics(arm)
    state = RobotState(np.array([0.3, 0.4]), np.array([1.0, -2.0]), None, CLOCK, CLOCK, False)
    status = numerical_health(dynamics, state)
    assert status.level == OK and float(status.values["|nu.C| / (|nu| |C|)"]) < 1e-12
    D = dynamics.factors(state.position).D
    assert float(status.values["smallest D [kg m^2, kg]"]) == pytest.approx(D.min(), rel=1e-5)
    assert status.values["its joint"] == arm.dof_names[int(np.argmin(D))]
    assert numerical_health(dynamics, state._replace(velocity=np.zeros(2))).level == OK
