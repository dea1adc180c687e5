# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that contradict each other: the node ends before it loads a robot."""

import pytest

from diag_dynamics.exceptions import InputError

SETTINGS = {"robot_compensates_gravity": False}
CONTRADICTIONS = [
    ("controller", {"max_state_age": 0.5}, "hold_time"),
    ("controller", {"initial_mode": "pose"}, "controlled_link"),
    ("controller", {"effort_rate": ["fast"]}, "effort_rate"),
    ("controller", {"contact_limits.file": "/nowhere.yaml"}, "contact_limits.file"),
    ("controller", {"locked_joints": ["*"]}, "locked_joints"),
    ("monitor", {"locked_joints": ["*"]}, "locked_joints"),
    ("monitor", {"load.link": "tool0"}, "load.link"),
    ("monitor", {"energy.error": ["total=1"], "energy.warn": ["total=2"]}, "energy.error"),
    ("simulator", {"lockstep": True, "motion": "wave"}, "lockstep"),
    ("simulator", {"real_time_factor": 1e-4}, "real_time_factor"),
]


@pytest.mark.parametrize(("node", "values", "named"), CONTRADICTIONS)
def test_contradictory_parameters_end_the_node(peer, node, values, named):
    """Before a robot is known; the error names a parameter and never the description."""
    values = values | (SETTINGS if node == "controller" else {})
    if node == "simulator":
        values["robot_description"] = "/nowhere.urdf"
    with pytest.raises(InputError, match=named) as raised, peer.start(node, **values):
        pass
    assert "robot_description" not in str(raised.value)
