# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Watch of energies: thresholds, power balance, last minute; and the numerical health of a state."""

from types import SimpleNamespace

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics import sweeps
from diag_dynamics.exceptions import InputError
from diag_dynamics.inspection import inspect_robot
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.nodes.monitor.described import MonitoredRobot, model_status
from diag_dynamics.nodes.monitor.energy_watch import EnergyWatch, numerical_health
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN, counted
from diag_dynamics.parameters.monitor import Settings, Thresholds
from diag_dynamics.parameters.robots import model_of
from diag_dynamics.recordings.balance import Balance, WindowSums
from joint_state_messages import MS, S
from joint_state_readers import DEFAULTS
from joint_state_readers import model as robot_model
from robots import TwoLinkArm

CLOCK = 1000 * S


class FakeModel:
    """The part of a model that a watch reads."""

    joint_names = dof_names = ("shoulder", "elbow")
    nv, has_friction = 2, False


def at_energy(*shares, power=None):
    """Return what stands for an Evaluation with these shares of the kinetic energy, and a power [W]."""
    nu = np.sqrt(2.0 * np.array(shares, dtype=float))
    rows = np.zeros((sweeps.ROWS, len(shares)))
    rows[sweeps.NU] = nu
    share = 0.5 * nu * nu
    return SimpleNamespace(effort_power=power, kinetic_energy=share.sum(), energy_share=share, rows=rows)


def watching(**thresholds):
    """Return a watch on two joints."""
    return EnergyWatch(FakeModel(), Thresholds(**thresholds))


def reported(watch):
    """Return level, message and values of a report."""
    _, level, message, values = watch.report()
    return level, message, dict(values)


# --- thresholds


@pytest.mark.parametrize(
    ("thresholds", "shares", "level", "named"),
    [
        ({}, (1e9, 0), OK, "within thresholds"),
        ({"warn": 3.0, "error": 5.0}, (1, 2), OK, "within thresholds"),
        ({"warn": 3.0, "error": 5.0}, (1, 2.1), WARN, "kinetic energy > warn_energy = 3 J"),
        ({"warn": 3.0, "error": 5.0}, (3, 2), WARN, "kinetic energy > warn_energy = 3 J"),
        ({"warn": 3.0, "error": 5.0}, (3, 2.1), ERROR, "kinetic energy > error_energy = 5 J"),
        ({"error": 5.0}, (3, 2), OK, ""),
        ({"error": 5.0}, (3, 2.1), ERROR, "error_energy"),
        ({"warn_share": {"elbow": 2.0}}, (9, 2), OK, ""),
        ({"warn_share": {"elbow": 2.0}}, (9, 2.5), WARN, "'elbow' > warn_energy_share = 2 J"),
        ({"error_share": {"elbow": 2.0}}, (9, 2.5), ERROR, "'elbow' > error_energy_share = 2 J"),
        ({"warn_share": {"*": 2.0}, "error_share": {"*": 4.0}}, (1, 3), WARN, "'elbow' > warn_energy_share"),
        ({"warn_share": {"*": 2.0}, "error_share": {"*": 4.0}}, (5, 3), ERROR, "'shoulder' > error_energy_share"),
        ({"warn_share": {"*": 2.0, "elbow": 0.0}}, (1, 3), OK, ""),
        ({"warn": 1.0, "error_share": {"shoulder": 2.0}}, (3, 0), ERROR, "'shoulder' > error_energy_share"),
        ({"error": 1.0, "warn_share": {"shoulder": 2.0}}, (3, 0), ERROR, "error_energy"),
    ],
)
def test_thresholds(thresholds, shares, level, named):
    """Of all energy and of single joints' shares; a value at a threshold is within, and 0 is none."""
    watch = watching(**thresholds)
    assert watch.take(CLOCK, at_energy(*shares)) == (level > OK)
    reported_level, message, values = reported(watch)
    assert reported_level == level and named in message
    assert values["largest kinetic energy [J]"] == f"{sum(shares):.6g}"
    for name, share in zip(FakeModel.joint_names, shares, strict=True):
        assert values.get(f"largest energy share of '{name}' [J]", f"{share:.6g}") == f"{share:.6g}"
    assert any("largest energy share" in key for key in values) or "share" not in message


def test_shares_of_a_floating_base():
    """The joints' shares come after the base's six."""
    watch = EnergyWatch(robot_model("floating"), Thresholds(warn_share={"shoulder": 1.0}))
    assert not watch.take(CLOCK, at_energy(9, 9, 9, 9, 9, 9, 0.9))
    assert watch.take(CLOCK + MS, at_energy(0, 0, 0, 0, 0, 0, 1.1))
    _, message, values = reported(watch)
    assert "'shoulder' > warn_energy_share" in message
    assert values["largest energy share of 'shoulder' [J]"] == "1.1"


def test_threshold_of_an_unknown_joint():
    """It is refused by parameter and name, and the thresholds in force stay."""
    watch = watching(warn=1.0)
    watch.take(CLOCK, at_energy(0.5, 0.0, power=0.0))
    with pytest.raises(InputError, match="'error_energy_share' names 'knee'"):
        watch.configure(FakeModel(), Thresholds(error_share={"knee": 1.0}))
    assert watch.take(CLOCK + 100 * MS, at_energy(2.0, 0.0, power=0.0))
    level, _, values = reported(watch)
    assert level == WARN and float(values["power-balance residual [W]"]) == pytest.approx(15.0)


def test_alarm_only_where_it_is_worse_than_reported():
    """A worse state is reported at once, others at the next report."""
    watch = watching(warn=1.0, error=2.0)
    low, high, highest = at_energy(0.5, 0), at_energy(1.5, 0), at_energy(2.5, 0)
    stamps = iter(range(CLOCK, CLOCK + S, MS))
    for states, alarms, level in (
        ((low, high, high, low), (False, True, True, True), WARN),
        ((high, low, highest), (False, False, True), ERROR),
        ((highest, high), (False, False), ERROR),
        ((high,), (False,), WARN),
        ((highest,), (True,), ERROR),
        ((low,), (False,), OK),
        ((high,), (True,), WARN),
    ):
        assert tuple(watch.take(next(stamps), state) for state in states) == alarms
        assert reported(watch)[0] == level


def test_largest_since_the_last_report():
    """Of all states between two reports; that of the last one stands beside it."""
    watch = watching()
    for k, energy in enumerate((1.0, 4.0, 2.0)):
        watch.take(CLOCK + k * MS, at_energy(energy, 0))
    values = reported(watch)[2]
    assert values["largest kinetic energy [J]"] == "4" and values["kinetic energy [J]"] == "2"
    watch.take(CLOCK + 3 * MS, at_energy(3.0, 0))
    assert reported(watch)[2]["largest kinetic energy [J]"] == "3"


def test_report_without_states():
    """The last message stays, and its level is STALE."""
    watch = watching(warn=1.0)
    assert reported(watch) == (STALE, "no state since: within thresholds", {})
    watch.take(CLOCK, at_energy(2.0, 0))
    _, alarm, _ = reported(watch)
    for _ in range(2):
        assert reported(watch) == (STALE, f"no state since: {alarm}", {})
    assert not watch.take(CLOCK + MS, at_energy(2.0, 0))
    assert reported(watch)[0] == WARN


# --- power balance


def residual(watch):
    """Return the power-balance residual of a report [W], None if there is none."""
    value = reported(watch)[2].get("power-balance residual [W]")
    return None if value is None else float(value)


def test_residual_of_given_powers():
    """Change of K less the trapezoid of the powers, per second, from report to report."""
    watch = watching()
    assert residual(watch) is None
    watch.take(CLOCK, at_energy(1.0, 0, power=2.0))
    assert residual(watch) is None
    watch.take(CLOCK + 100 * MS, at_energy(1.5, 0, power=4.0))
    watch.take(CLOCK + 300 * MS, at_energy(1.5, 0.5, power=-2.0))
    assert residual(watch) == pytest.approx((1.0 - 0.3 - 0.2) / 0.3, rel=1e-5)
    assert residual(watch) is None
    watch.take(CLOCK + 400 * MS, at_energy(1.0, 0.5, power=0.0))
    assert residual(watch) == pytest.approx((-0.5 + 0.1) / 0.1, rel=1e-5)


@pytest.mark.parametrize(("gap", "integrated"), [(500 * MS, True), (500 * MS + 1, False), (60 * S, False), (-S, False)])
def test_gaps_are_not_integrated(gap, integrated):
    """Beyond half a second, or back in time, no change of energy is a power."""
    watch = watching()
    watch.take(CLOCK, at_energy(1.0, 0, power=0.0))
    watch.take(CLOCK + gap, at_energy(3.0, 0, power=0.0))
    assert residual(watch) == (4.0 if integrated else None)
    watch.take(CLOCK + gap + 100 * MS, at_energy(4.0, 0, power=0.0))
    assert residual(watch) == pytest.approx(10.0)


def test_states_without_effort():
    """Their energies count; between them and others no change of energy is a power."""
    watch = watching(warn=2.0)
    watch.take(CLOCK, at_energy(1.0, 0, power=0.0))
    watch.take(CLOCK + 100 * MS, at_energy(1.5, 0, power=0.0))
    assert watch.take(CLOCK + 200 * MS, at_energy(9.0, 0))
    level, _, values = reported(watch)
    assert level == WARN and values["largest kinetic energy [J]"] == "9"
    assert "power [W]" not in values and values["power-balance residual [W]"] == "5"
    watch.take(CLOCK + 300 * MS, at_energy(1.0, 0, power=3.0))
    values = reported(watch)[2]
    assert values["power [W]"] == "3" and "power-balance residual [W]" not in values
    watch.take(CLOCK + 400 * MS, at_energy(2.0, 0, power=3.0))
    assert residual(watch) == pytest.approx(7.0)


@pytest.mark.parametrize("change", [EnergyWatch.forget, lambda watch: watch.configure(FakeModel(), Thresholds())])
def test_first_state_after_a_reset(change):
    """The next state is the first one, after another model, too."""
    watch = watching()
    watch.take(CLOCK, at_energy(1.0, 0, power=0.0))
    change(watch)
    watch.report()
    watch.take(CLOCK + 100 * MS, at_energy(5.0, 0, power=0.0))
    assert residual(watch) is None
    watch.take(CLOCK + 200 * MS, at_energy(6.0, 0, power=0.0))
    assert residual(watch) == pytest.approx(10.0)


def test_last_state_of_one_stamp_counts():
    """A robot that comes in pieces has a state after each."""
    watch = watching()
    for k in range(4):
        stamp = CLOCK + k * 100 * MS
        watch.take(stamp, at_energy(1.0 + k, 77.0, power=5.0))
        watch.take(stamp, at_energy(1.0 + k, 0.0, power=2.0))
    values = reported(watch)[2]
    assert values["kinetic energy [J]"] == "4" and values["power [W]"] == "2"
    assert float(values["power-balance residual [W]"]) == pytest.approx(10.0 - 2.0)


@pytest.fixture(scope="module")
def arm():
    """Return the planar arm, hanging in a field of gravity in its plane."""
    return dd.load_urdf(TwoLinkArm(I1=0.02).urdf, gravity=(1.0, -9.81, 0.0))


def test_reports_in_between_lose_nothing(arm):
    """The mean of the residuals of four quarters is that of the whole: the power that damping takes, negative."""
    damping, dt = np.array([0.3, 0.1]), 5e-4
    simulation = dd.Simulation(arm, [0.4, 0.9], [0.5, -1.0], step=dt, damping=damping, limits=False)
    whole, quarters = (EnergyWatch(arm, Thresholds()) for _ in range(2))
    residuals, lost = [], []
    for k in range(2001):
        state = simulation.evaluate([1.5, -0.8])
        for watch in (whole, quarters):
            watch.take(CLOCK + k * round(dt * S), state)
        if k and k % 500 == 0:
            residuals.append(residual(quarters))
        lost.append(damping @ simulation.qd**2)
        simulation.advance([1.5, -0.8])
    total = residual(whole)
    assert np.mean(residuals) == pytest.approx(total, rel=1e-4)
    assert total == pytest.approx(-np.trapezoid(lost, dx=dt), rel=1e-3)


# --- the last minute


SHARE, RMS = "explained share of dK/dt (last minute)", "power-balance residual, rms (last minute) [W]"


@pytest.fixture(scope="module")
def damped():
    """Return the arm with damping and Coulomb friction."""
    resistance = '<dynamics damping="0.3" friction="0.2"/></joint>'
    return dd.load_urdf(TwoLinkArm(I1=0.02).urdf.replace("</joint>", resistance), gravity=(1.0, -9.81, 0.0))


class Motion:
    """Motion of an arm by prescribed positions, with the efforts that it takes times a scale, seen by a watch."""

    def __init__(self, model, moving=None, *, seconds=4.0, friction=True, offset=0.0, scale=1.0):
        moving, dynamics = dd.DiagonalDynamics(moving or model), dd.DiagonalDynamics(model)
        watch, rows, self.model = EnergyWatch(model, Thresholds()), [], model
        w, size = np.array([3.0, 5.0]), np.array([0.8, 0.6])
        for k in range(round(seconds * 250)):
            t = 4e-3 * k
            q, qd, qdd = size * np.sin(w * t), size * w * np.cos(w * t), -size * w * w * np.sin(w * t)
            tau = scale * moving.inverse_dynamics(q, qd, qdd, friction=friction)
            qd = qd + offset
            s = dynamics.evaluate(q, qd, tau)
            watch.take(CLOCK + 4 * k * MS, s, s.nu @ s.gravity, qd @ dynamics.friction_torque(qd))
            rows.append((CLOCK + 4 * k * MS, q, qd, tau))
            if k % 250 == 249:
                self.level, _, self.values = reported(watch)
        self.columns = [np.array(column) for column in zip(*rows, strict=True)]

    @property
    def share(self):
        """Explained share of dK/dt."""
        return float(self.values[SHARE])

    def recorded(self):
        """Return the balance of the same states in a recording."""
        stamps, q, qd, tau = self.columns
        balance, sums = Balance(self.model.dof_names), WindowSums(self.model.nv, friction=True)
        flags = {"effort_known": np.ones(len(stamps), bool), "jumped": np.zeros(len(stamps), bool)}
        batch = dd.DiagonalDynamics(self.model).evaluate_batch(q, qd, tau, friction=True)
        balance.add_windows(sums.integrate_states(SimpleNamespace(stamp=stamps, **flags), batch))
        return balance


@pytest.mark.parametrize("name", ["arm", "damped"])
def test_the_right_model_explains_its_motion(request, name):
    """With friction, too, where the URDF has it."""
    model = request.getfixturevalue(name)
    motion = Motion(model)
    assert motion.level == OK and motion.share > 0.98
    if name == "damped":
        assert Motion(model, friction=False).share < motion.share - 0.02


def test_what_the_model_does_not_know_lowers_the_share(arm):
    """A payload, and efforts of another unit; the level does not change."""
    right = Motion(arm)
    for options in ({"moving": arm.with_payload(arm.link_names[-1], 1.5, (0.3, 0.0, 0.0))}, {"scale": 0.3}):
        motion = Motion(arm, **options)
        assert motion.level == OK
        assert motion.share < 0.8 < right.share
        assert float(motion.values[RMS]) > 10.0 * float(right.values[RMS])


@pytest.mark.parametrize("options", [{}, {"scale": 0.7}, {"scale": -1.0}, {"offset": 0.2}], ids=str)
def test_last_minute_equals_a_recording(damped, options):
    """Share and residual are those of the same states in a recording."""
    motion = Motion(damped, **options)
    balance = motion.recorded()
    assert motion.values[SHARE] == f"{balance.explained:.4g}"
    assert motion.values[RMS] == f"{balance.residual_power:.4g}"


def feed(watch, begin, seconds, change, period=10):
    """Feed states whose K changes by a power times `change`; return the time after the last one [s]."""
    for k in range(round(seconds * 1000 / period)):
        t = begin + 1e-3 * period * k
        watch.take(
            CLOCK + round(t * 1000) * MS, at_energy(2.0 - np.cos(3.0 * t), 0.0, power=change * 3.0 * np.sin(3.0 * t))
        )
    return begin + seconds


def test_no_balance_too_soon_or_at_rest():
    """Of less than two seconds, of a robot that stands still, and of states that come too seldom."""
    for seconds, energy, period in ((1.9, 1.0, 10), (5.0, 0.0, 10), (50.0, 1.0, 101)):
        watch = watching()
        for k in range(round(seconds * 1000 / period)):
            watch.take(CLOCK + k * period * MS, at_energy(1e-6 + energy * (k % 7), 0.0, power=1e-4 + energy))
        assert SHARE not in reported(watch)[2]


def test_only_the_last_minute_counts():
    """What was wrong before is forgotten, and all is with another model; a jump of time ends nothing else."""
    watch = watching()
    end = feed(watch, 0.0, 60.0, -1.0)
    assert float(reported(watch)[2][SHARE]) < -2.0
    end = feed(watch, end, 30.0, 1.0)
    assert float(reported(watch)[2][SHARE]) < 0.0
    end = feed(watch, end, 30.5, 1.0)
    assert float(reported(watch)[2][SHARE]) > 0.99
    watch.take(CLOCK + 300 * S, at_energy(1.0, 0.0))  # without effort
    assert SHARE not in reported(watch)[2]
    end = feed(watch, 301.0, 5.0, 1.0)
    watch.forget()
    watch.take(CLOCK + round(end * 1000) * MS, at_energy(77.0, 0.0, power=0.0))
    assert float(reported(watch)[2][SHARE]) > 0.99
    watch.configure(FakeModel(), Thresholds())
    watch.take(CLOCK + 310 * S, at_energy(1.0, 0.0, power=0.0))
    assert SHARE not in reported(watch)[2]


# --- model and numerical health


@pytest.mark.parametrize(("armature", "named"), [([""], True), (["shoulder=10.0", "elbow=10.0"], False)])
def test_joints_without_rotor_inertia(armature, named):
    """They are named by D and effort limit, as `inspect` names them; no more with the rotors' inertia."""
    limited = TwoLinkArm(I1=0.02).urdf.replace('effort="100" velocity="100"', 'effort="20000" velocity="3"')
    values = DEFAULTS | {"armature": armature}
    robot = MonitoredRobot(limited, model_of(limited, values), Settings.of(values), 1)
    expected = {name for f in inspect_robot(limited).findings if f.check == "rotor_inertia" for name in f.joints}
    assert expected and set(robot.without_rotors) == (expected if named else set())
    status = model_status(robot, 1, None, None)
    assert status.level == OK and status.values["joints without rotor inertia"] == counted(robot.without_rotors)


def test_numerical_health(arm):
    """ν·C is zero, and the smallest D is that of its joint; before any state nothing is reported."""
    status = numerical_health(object(), None)
    assert (status.level, status.message) == (STALE, "no state")
    dynamics = dd.DiagonalDynamics(arm)
    state = RobotState(np.array([0.3, 0.4]), np.array([1.0, -2.0]), None, CLOCK, CLOCK, False)
    status = numerical_health(dynamics, state)
    assert status.level == OK
    assert float(status.values["|nu.C| / (|nu| |C|)"]) < 1e-12
    D = dynamics.factors(state.position).D
    assert float(status.values["smallest D [kg m^2, kg]"]) == pytest.approx(D.min(), rel=1e-5)
    assert status.values["its joint"] == arm.dof_names[int(np.argmin(D))]
    assert numerical_health(dynamics, state._replace(velocity=np.zeros(2))).level == OK
