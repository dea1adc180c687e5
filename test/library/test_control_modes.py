# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Modes of the control loop on a UR5: regulation, payloads, energies of joints, gains that the rate
of states allows.
"""

import re

import numpy as np
import pytest

import diag_dynamics as dd
from arm import Cycles, Q, control_loop, gravity_of
from controlled import frictionless
from described import UR5, robot
from diag_dynamics.control.modes import (
    DAMPING,
    GRAVITY_COMPENSATION,
    LAWS,
    POSE,
    REGULATION,
    TRACKING,
    RegulationMode,
)
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.controller import PARAMETERS


@pytest.fixture(scope="module")
def arm():
    """Return a UR5 that is strong enough for anything."""
    return dd.load_urdf(re.sub(r'effort="[^"]*"', 'effort="1e4"', robot(UR5).urdf))


class Closed(Cycles):
    """A loop that holds a simulated arm at Q, with efforts that change at once unless `values`
    limit them.
    """

    def __init__(self, arm, rate=500, **values):
        loop = control_loop(arm, **{"effort_rate": ["*=1e9"]} | values)
        super().__init__(loop, frictionless(arm, Q, step=1.0 / rate), rate)
        self.shares = np.zeros(6)
        self.loop.limits.reset(gravity_of(Q))

    def go(self, cycles, push=None):
        """Let it go on."""
        for _ in range(cycles):
            self.plant.advance(self.step().effort, f_ext=push)
            self.shares = np.maximum(self.shares, 0.5 * self.plant.nu**2)


def largest(error):
    """Return the largest gain that a text names."""
    return float(re.search(r"expected at most (\S+) ", str(error)).group(1))


@pytest.mark.parametrize("rate", [40, 125, 500, 1000])
@pytest.mark.parametrize(
    ("mode", "values", "key"),
    [
        (
            REGULATION,
            lambda x: {"regulation_stiffness": [f"*={x}"]},
            "stiffness of 'wrist_3_joint'",
        ),
        (DAMPING, lambda x: {"damping": [f"*={x}"]}, "gain of 'shoulder_pan_joint'"),
        (POSE, lambda x: {"orientation_stiffness": x}, "orientation_stiffness"),
    ],
)
def test_gains_that_the_rate_makes_unstable_are_refused(arm, mode, values, key, rate):
    """A switch is rejected with the largest gain; a loop that starts in the mode leaves it; the
    named gain is accepted. The law lasts for max_state_age, 20 ms, at most.
    """
    start = {"initial_mode": GRAVITY_COMPENSATION, "controlled_link": "tool0"}
    closed = Closed(arm, rate, **start, **values(1e6))
    closed.go(10)
    with pytest.raises(
        InputError,
        match=rf"^mode {mode} is unstable: .*{key}.* is .*; expected .* at {max(rate, 50)} Hz",
    ) as error:
        closed.loop.switch(mode)
    assert closed.loop.mode == GRAVITY_COMPENSATION
    begun = Closed(
        arm, rate, **start | {"initial_mode": mode}, **values(1.5 * largest(error.value))
    )
    begun.go(20)
    assert re.match(rf"mode {mode} is unstable: .*{key}", begun.lost[0])
    assert largest(begun.lost[0]) == pytest.approx(largest(error.value), rel=0.02)
    assert begun.loop.mode == (GRAVITY_COMPENSATION if mode == DAMPING else DAMPING)
    accepted = Closed(arm, rate, **start | {"initial_mode": mode}, **values(largest(error.value)))
    accepted.go(40)
    assert accepted.loop.mode == mode and not accepted.lost


def test_energies_of_joints_stay_below_their_limits(arm):
    """At 500 Hz, pushed, with an observer: 1 % above at most; without limits the same push gives
    some tenfold the energy.
    """
    names = arm.dof_names
    push = {"tool0": (20.0, 30.0, 20.0, 1.0, 1.0, 1.0)}
    limits = np.array([0.05, 0.05, 0.04, 0.02, 0.02, 0.01])
    peaks = []
    entries = [f"{name}={limit}" for name, limit in zip(names, limits, strict=True)]
    for entry in (entries, [""]):
        values = {"initial_mode": GRAVITY_COMPENSATION, "joint_energy_limit": entry}
        values |= {"observer_gain": 200.0, "energy_rate": 100.0}
        closed = Closed(arm, 500, limit_margin=0.0, **values)
        closed.go(50)
        closed.go(400, push)
        peaks.append((closed.shares / limits).max())
    assert 0.9 < peaks[0] < 1.01 and peaks[1] > 10.0


@pytest.mark.parametrize("is_switch", [False, True])
@pytest.mark.parametrize("mode", LAWS)
def test_a_mode_that_begins_in_motion(arm, mode, is_switch):
    """No joint becomes faster than the fastest one was, and the arm stands afterwards."""
    initial_mode = TRACKING if is_switch else mode
    closed = Closed(arm, rate=1000, initial_mode=initial_mode, controlled_link="tool0")
    if is_switch:
        closed.go(20)
    closed.plant.reset(Q, np.full(6, -0.3))
    closed.go(1)
    if is_switch:
        closed.loop.switch(mode)
    assert closed.loop.is_braking == (not is_switch or mode in (GRAVITY_COMPENSATION, POSE))
    if mode == POSE:
        with pytest.raises(InputError, match="target came while braking"):
            closed.loop.require("target")
    for _ in range(500):
        closed.go(1)
        assert np.abs(closed.plant.qd).max() <= 0.3
    assert np.abs(closed.plant.qd).max() <= 0.01
    assert not closed.loop.is_braking


def test_unstable_regulation_does_not_stop_an_arm(arm):
    """Damping does, also before the rate of states is measured."""
    options = {"initial_mode": GRAVITY_COMPENSATION, "regulation_stiffness": ["*=2000"]}
    closed = Closed(arm, 125, **options)
    closed.plant.reset(Q, np.full(6, -0.1))
    closed.go(1)  # the first command compensates gravity
    before = np.abs(closed.plant.qd).max()
    for _ in range(60):
        closed.go(1)
        assert np.abs(closed.plant.qd).max() <= before
    assert not closed.loop.is_braking and np.abs(closed.plant.qd).max() <= 0.01


@pytest.mark.parametrize("joints", [["joint1"], ["joint1", "joint3"], ["*"]])
def test_chosen_stiffnesses_leave_the_others_stable(joints):
    """A joint that is not coupled moves with others, whose inertia is smaller then."""
    dyn = dd.DiagonalDynamics(dd.load_robot("xarm7"))
    values = {name: spec.default for name, spec in PARAMETERS.items()}
    chosen = {"regulation_stiffness": [f"{joint}=1.0" for joint in joints]}
    mode = RegulationMode(dyn, values | chosen)
    for q in np.zeros(7), np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.3, 0.0]):
        mode.adapt(q, 8e-3)
        mode.law.require_stable(q, 8e-3)
    stiffness = np.diag(mode.law.stiffness)
    assert np.count_nonzero(stiffness == 1.0) == (7 if joints == ["*"] else len(joints))


def test_the_controller_has_few_parameters():
    """Parameters of removed modes, speeds and springs are gone."""
    assert len(PARAMETERS) <= 43
    gone = "payload_link", "pose_damping", "position_speed", "limit_stiffness", "contact.points"
    assert PARAMETERS.keys().isdisjoint(gone)
