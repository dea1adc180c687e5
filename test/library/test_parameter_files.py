# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a monitor without a monitor: files that a node would take are taken, and what is not known is refused."""

import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.parameters.files import parameters_of

GAIN = {"external_torque": {"gain": 30.0}}


def written(folder, sections):
    """The path of a file with parameters by section."""
    path = folder / "monitor.yaml"
    path.write_text(
        yaml.safe_dump({name: {"ros__parameters": own} for name, own in sections.items()}), encoding="utf-8"
    )
    return path


@pytest.mark.parametrize(
    "every",
    [
        {"qos_overrides": {"/joint_states": {"subscription": {"depth": 50, "reliability": "reliable"}}}},
        {"qos_overrides./joint_states.subscription.depth": 50},
        {"use_sim_time": True, "start_type_description_service": False},
    ],
    ids=["nested", "flat", "clock"],
)
@pytest.mark.parametrize("section", ["/**", "diag_dynamics", "/robot1/diag_dynamics"])
def test_what_every_node_has_is_passed_over(tmp_path, section, every):
    """How a node is connected, and what its clock is, changes nothing of a recording."""
    assert parameters_of([written(tmp_path, {section: GAIN | every})]) == {"external_torque.gain": 30.0}


def test_assignments_pass_over_the_same():
    assignments = ["qos_overrides./joint_states.subscription.depth=50", "external_torque.gain=30"]
    assert parameters_of((), assignments) == {"external_torque.gain": 30.0}


def test_sections_that_nodes_share(tmp_path):
    """What only another node has is passed over in a section that may be its, and refused in the monitor's own."""
    others = {"robot_compensates_gravity": False, "tracking_gain": ["*=20.0"], "motion": "wave", "port": 8421}
    assert parameters_of([written(tmp_path, {"/**": GAIN | others})]) == {"external_torque.gain": 30.0}
    with pytest.raises(dd.InputError, match="no parameter 'motion'"):
        parameters_of([written(tmp_path, {"diag_dynamics": {"motion": "wave"}})])


@pytest.mark.parametrize("section", ["/**", "diag_dynamics"])
@pytest.mark.parametrize(
    "name", ["qos_override./joint_states.subscription.depth", "external_torque.gian", "use_sim_tim"]
)
def test_what_nobody_has_is_refused(tmp_path, section, name):
    with pytest.raises(dd.InputError, match=f"no parameter '{name}'"):
        parameters_of([written(tmp_path, {section: {name: 1}})])
