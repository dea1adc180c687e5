# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller in lockstep with the simulator: what it sends, and what becomes of the robot."""

import numpy as np
import pytest

from controllers import (
    GAINS,
    START_AT,
    begin_at_rest,
    lockstep_arm,
    record,
    trajectory,
)
from nodes import UR5, joint_state, nanoseconds, robot

RATE = 250
"""Of joint states [Hz]."""
BOUND = 0.5
"""Of the kinetic energy [J]."""
EFFORT_RATE = 5000.0


@pytest.fixture(scope="module")
def arm(peer):
    """A UR5 in lockstep with its controller, commands in another order than joint states, K bounded."""
    own = {"controlled_link": "tool0", "energy_limit": BOUND, "observer_gain": 60.0, **GAINS}
    order = list(robot(UR5).names[::-1])
    with lockstep_arm(peer, "/arm", order, effort_rate=[f"*={EFFORT_RATE}"], **own) as controller:
        yield controller


@pytest.fixture(autouse=True)
def from_the_start(arm):
    """Every test begins with the arm at rest."""
    begin_at_rest(arm)


def wait_for_rest(arm, goal):
    """Wait until the arm rests at a joint target, by its own word and the simulator's."""

    def settled(status):
        state = arm.simulator.states.repeated(nanoseconds(status.header.stamp))
        there = state is not None and np.abs(np.array(state.position) - goal).max() < 2e-4
        return there and status.energy < 1e-8 and np.abs(status.tracking_error).max() < 1e-4

    arm.wait_for(settled, f"rest at {goal}")


def test_tracking_arrives(arm):
    """A set-point, then a trajectory which is followed closely all along; joints that are not controlled are refused."""
    names, goal = arm.simulator.robot.names, np.array(START_AT) + 0.15
    arm.set_point.publish(joint_state(names[::-1], goal[::-1]))
    wait_for_rest(arm, goal)
    record(arm)
    points = [
        (1.5, np.array(START_AT) - 0.1, [0.1] * 6, [0] * 6),
        (3.0, START_AT, [0] * 6, [0] * 6),
    ]
    arm.trajectory.publish(trajectory(points, names))
    wait_for_rest(arm, START_AT)
    followed = [s for s in arm.status.messages if not s.energy_limited]
    assert len(followed) > 2 * RATE and max(np.abs(s.tracking_error).max() for s in followed) < 0.01
