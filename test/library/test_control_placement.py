# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the library has the links of a robot, against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
import robots
from coupling import Coupled
from diag_dynamics.exceptions import InputError

RANDOM = {robot.id: robot for robot in robots.random_robots()}
ROBOTS = (
    robots.robot("panda_description/urdf/panda.urdf"),
    robots.robot("ur_description/urdf/ur5_robot.urdf"),
    RANDOM["geared_tree_10"],
    RANDOM["mobile_tree_20"],
    RANDOM["mobile_tree_21"],
    RANDOM["random_tree_0"].floating,
)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.id)
def test_placement(robot):
    """Every link is where Pinocchio has it: mimic, planar and floating joints included."""
    model = dd.load_urdf(robot.source, **robot.options)
    o, dyn = Coupled(robot.urdf, model.dof_names, **robot.options), dd.DiagonalDynamics(model)
    for sample in robots.samples(robot.id, o):
        full = o.full
        pin.framesForwardKinematics(full.model, full.data, full.configuration(o.q_full(sample.q)))
        for link in model.link_names:
            expected = full.data.oMf[full.model.getFrameId(link, pin.FrameType.BODY)].homogeneous
            np.testing.assert_allclose(dyn.placement(sample.q, link), expected, rtol=0, atol=1e-12)
    with pytest.raises(InputError, match="'nowhere' is not a link of robot"):
        dyn.placement(model.neutral, "nowhere")
