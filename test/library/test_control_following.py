# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tolerances and outcomes of trajectories: a decision table, the conventions of the message, and
the loop.
"""

from types import SimpleNamespace

import numpy as np
import pytest

import diag_dynamics as dd
from arm import Closed, Q, state_at, waypoints
from described import MS, UR5, S, robot
from diag_dynamics.control.following import Following, Tolerances
from diag_dynamics.control.modes import TRACKING
from diag_dynamics.control.references import Desired
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.controller import received

NAMES = ("shoulder", "elbow")
END = 10 * S
INF = np.inf
TOLERANCES = Tolerances(
    np.array([[0.1, 0.2], [INF, 1.0]]), np.array([[0.01, 0.02], [0.05, 0.06]]), 0.5
)


def following(tolerances=TOLERANCES, continuous=(False, False)):
    trajectory = SimpleNamespace(start=8 * S, end=END)
    return Following(NAMES, trajectory, tolerances, np.array(continuous))


def check(followed, time, position=(0.0, 0.0), velocity=(0.0, 0.0)):
    """Check a robot that is ahead of its desired motion by these errors."""
    desired = Desired(*np.zeros((3, 2)))  # errors without rounding
    return followed.check(
        state_at(time, desired.position + position, desired.velocity + velocity), desired
    )


NONE = 0.0, 0.0
TABLE = [  # time, errors of position and of velocity, code of the outcome or None, its joint
    (END - 1, (0.1, -0.2), (9.0, 1.0), None, None),
    (
        END - 1,
        (0.101, 0.0),
        NONE,
        -4,
        "position error of joint 'shoulder' on the trajectory is 0.101",
    ),
    (END - 1, (0.0, -0.201), NONE, -4, "position error of joint 'elbow'"),
    (END - 1, NONE, (0.0, -1.01), -4, "velocity error of joint 'elbow'"),
    (END - 1, (np.nan, 0.0), NONE, -4, "position error of joint 'shoulder'"),
    (END, (0.01, -0.02), (-0.05, 0.06), 0, ""),
    (END, (0.011, 0.0), NONE, None, None),
    (END, NONE, (0.0, -0.061), None, None),
    (END, (0.5, 0.0), NONE, None, None),  # no path any more
    (END + S // 2, (0.0, 0.021), NONE, None, None),
    (
        END + S // 2 + 1,
        (0.0, 0.021),
        NONE,
        -5,
        "position error of joint 'elbow' 0.5 s after the end",
    ),
    (END + S // 2 + 1, NONE, (-0.051, 0.0), -5, "velocity error of joint 'shoulder'"),
    (END + 9 * S, NONE, NONE, 0, ""),
]


@pytest.mark.parametrize(("time", "position", "velocity", "code", "reason"), TABLE)
def test_decisions(time, position, velocity, code, reason):
    followed = following()
    printed = check(followed, time, position, velocity)
    assert (followed.outcome and followed.outcome.code) == code
    if code is None:
        assert printed == ""
    else:
        assert printed == followed.outcome.reason and followed.outcome.reason.startswith(reason)
        assert bool(printed) == (code != 0)
        check(followed, END, (9.0, 9.0))
        assert followed.outcome.code == code


def test_continuous_joints_and_no_tolerances():
    """A whole turn is no error of a continuous joint; without tolerances the end succeeds, and no
    goal time fails.
    """
    turn = (2.0 * np.pi, 0.0)
    followed = following(continuous=(True, False))
    check(followed, END, turn)
    assert followed.outcome.code == 0
    np.testing.assert_allclose(followed.error, 0.0, atol=1e-12)
    followed = following()
    check(followed, END - 1, turn)
    assert followed.outcome.code == -4
    followed = following(TOLERANCES._replace(time=INF))
    check(followed, END + 1000 * S, turn)
    assert followed.outcome is None
    free = np.full((2, 2), INF)
    followed = following(Tolerances(free, free, 1.0))
    check(followed, END - 1, (99.0, 0.0))
    assert followed.outcome is None
    check(followed, END, (99.0, 0.0))
    assert followed.outcome.code == 0


def tolerance(name="elbow", position=0.0, velocity=0.0, acceleration=0.0):
    return SimpleNamespace(
        name=name, position=position, velocity=velocity, acceleration=acceleration
    )


def goal(path=(), end=(), sec=0, nanosec=0, **more):
    duration = SimpleNamespace(sec=sec, nanosec=nanosec)
    return SimpleNamespace(
        path_tolerance=path, goal_tolerance=end, goal_time_tolerance=duration, **more
    )


def test_conventions_of_the_message():
    """0 keeps the default, -1 removes it."""
    tolerances = received.tolerances(goal([tolerance()], [tolerance()]), NAMES, TOLERANCES)
    for entry, default in zip(tolerances, TOLERANCES, strict=True):
        np.testing.assert_array_equal(entry, default)
    changed = [tolerance(position=0.7, velocity=-1.0)], [tolerance("shoulder", -1.0, 0.8)]
    result = received.tolerances(goal(*changed, sec=2, nanosec=S // 4), NAMES, TOLERANCES)
    np.testing.assert_array_equal(result.path, [[0.1, 0.7], [INF, INF]])
    np.testing.assert_array_equal(result.goal, [[INF, 0.02], [0.8, 0.06]])
    assert result.time == 2.25
    assert received.tolerances(goal(sec=-1), NAMES, TOLERANCES).time == INF
    assert TOLERANCES.path[0, 1] == 0.2


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        (goal([tolerance("wing")]), r"^path_tolerance has 'wing'"),
        (
            goal(end=[tolerance(position=-0.5)]),
            r"^goal_tolerance\.position of joint 'elbow' is -0\.5",
        ),
        (goal([tolerance(velocity=np.nan)]), r"^path_tolerance\.velocity of joint 'elbow' is nan"),
        (goal([tolerance(acceleration=1.0)]), r"^path_tolerance\.acceleration of joint 'elbow'"),
        (goal(sec=-2), r"^goal_time_tolerance is -2"),
        (goal(component_path_tolerance=[tolerance()]), "^component_path_tolerance is set"),
        (
            goal(multi_dof_trajectory=SimpleNamespace(joint_names=["base"])),
            "^multi_dof_trajectory is set",
        ),
    ],
)
def test_wrong_tolerances(wrong, key):
    with pytest.raises(InputError, match=key):
        received.tolerances(wrong, NAMES, TOLERANCES)


# --- The loop


@pytest.fixture(scope="module")
def arm():
    """Return a UR5."""
    return dd.load_urdf(robot(UR5).path)


@pytest.fixture
def closed(arm):
    """A UR5 half-way along a trajectory of one second to Q + 0.2."""
    moving = Closed(arm, Q).go(0.1)
    follow(moving, Q + 0.2)
    return moving.go(0.5)


def follow(closed, goal, **options):
    closed.loop.take_trajectory(waypoints([(1.0, goal, np.zeros(6))]), 0, closed.stamp, **options)


ENDS = {
    "cancel": (
        lambda c: c.loop.stop_trajectory("canceled by request", canceled=True),
        "canceled by request",
    ),
    "switch": (lambda c: c.loop.switch("damping"), "mode damping was requested"),
    "trajectory": (lambda c: follow(c, c.plant.q), "a newer trajectory"),
    "set-point": (lambda c: c.loop.take_set_point(c.plant.q), "a set-point"),
    "invalid state": (
        lambda c: c.loop.without_state(c.stamp, "joint 'elbow_joint' is nan"),
        "'elbow_joint' is nan",
    ),
    "gains": (
        lambda c: setattr(
            c.loop, "_unstable", lambda mode: "is unstable" * (mode.name == TRACKING)
        ),
        "is unstable",
    ),
    "stall": (lambda c: setattr(c, "stamp", c.stamp + 600 * MS), "hold_time"),
}


@pytest.mark.parametrize(("end", "reason"), ENDS.values(), ids=ENDS)
def test_ends(closed, end, reason):
    """The robot stays near the place where it was."""
    first = closed.loop.following
    place = closed.plant.q.copy()
    end(closed)
    closed.go(0.01)
    assert first.outcome.code == -1 and reason in first.outcome.reason
    assert first.outcome.canceled == (end in (ENDS["cancel"][0], ENDS["trajectory"][0]))
    closed.go(1.0)
    assert np.abs(closed.plant.q - place).max() < 0.05 and np.abs(closed.plant.qd).max() < 0.02
