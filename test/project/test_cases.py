# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of others on which an earlier version failed: the folders of ../shared/cases.

Where DIAG_DYNAMICS_CASES names the folder, as in .ci/run, a missing case fails. Elsewhere the test
says that it is absent.
"""

import os
import re
import warnings
from pathlib import Path

import pytest

import diag_dynamics as dd
from diag_dynamics.cli.main import main

ROOT = Path(__file__).parents[2]
GIVEN = os.environ.get("DIAG_DYNAMICS_CASES")
CASES = Path(GIVEN or ROOT.parent / "shared" / "cases")

ROBOTS = {  # degrees of freedom, and a word of the warning if there is one
    "02_xacro_property_left_in_urdf/prop.urdf": (1, ""),
    "03_double_hyphen_in_comment/dashes.urdf": (2, ""),
    "04_other_encodings/gb2312.urdf": (2, ""),
    "04_other_encodings/latin1.urdf": (2, ""),
    "24_silent_attributes/axis.urdf": (2, "has no xyz"),
    "24_silent_attributes/degrees.urdf": (2, "Is it in degrees"),
    "25_mjcf_target_marker/target.xml": (2, "mocap body"),
    "26_mjcf_springs_tendons_gravcomp/gravcomp.xml": (2, "gravity compensation"),
    "26_mjcf_springs_tendons_gravcomp/spring.xml": (2, "spring"),
    "81_ball_joint_in_a_loop/ball.xml": (3, ""),
    "82_joint_held_by_an_equality/held.xml": (3, ""),
    "82_joint_held_by_an_equality/off.xml": (4, ""),
    "83_loop_in_a_simulator_plugin/detachable.urdf": (3, "is not modelled"),
    "91_camera_on_the_base/arm4cam.urdf": (4, ""),
}
REFUSED = {
    "13_xacro_needs_arguments_on_the_command_line/a.urdf.xacro": "Give DEBUG:=VALUE",
    "22_not_a_urdf/lfs.urdf": "a pointer of Git LFS",
    "22_not_a_urdf/m.sdf": "an SDF of Gazebo",
    "22_not_a_urdf/page.urdf": "HTML, a page of the web",
    "22_not_a_urdf/s.srdf": "an SRDF of MoveIt",
    "84_two_parents/two.urdf": "Describe a loop by <loop_joint>",
    "90_xacro_of_macros_alone/m.urdf.xacro": "defines macros and calls none",
}
TOPICS = {"topic": ["/a/joint_states", "/b/joint_states"]}
RECORDINGS = {  # options, number of states
    "31_joint_state_publisher_beside_the_driver/bag": ({}, 800),
    "41_arm_and_gripper_on_two_topics/bag": (TOPICS, 1599),
    "43_renamed_bag_file/renamed": ({}, 800),
    "44_mcap_of_ros1/ros1.mcap": ({}, 800),
    "55_libfranka_log/new.csv": ({}, 800),
    "58_iso_times_in_parquet/iso.parquet": ({}, 800),
    "61_plotjuggler_export/pj.csv": ({}, 800),
    "89_bag_cut_within_a_chunk/half.mcap": ({}, 430),
}
ANALYSED = {  # a word of the problems
    "49_rostopic_echo_csv/rostopic.csv": "no columns are recognized as positions",
    "53_days/days.csv": "times seem to be days",
    "67_two_joints_exchanged/swapped.csv": "seem to be exchanged",
    "86_wrong_unit_or_no_gravity/w3.csv": "seem to have another unit",
    "86_wrong_unit_or_no_gravity/ng25.csv": "gravity seems to be missing",
}
ELSEWHERE = {  # cases without an input that a line can read: the test that has it
    "85_wrench_on_a_regular_pose": "test_without_covariance",
    "87_start_values_of_loops": "test_start_values_count_in_all_loops",
    "88_prefixed_and_empty_joint_states": "test_joints_without_data",
    "92_limiters_in_a_sampled_loop": "test_a_sampled_loop_keeps_the_limit",
}
FILES = [*ROBOTS, *REFUSED, *RECORDINGS, *ANALYSED, *ELSEWHERE]


@pytest.mark.parametrize("name", FILES)
def test_case(name, capsys):
    path = CASES / name
    if not GIVEN and not path.exists():
        pytest.skip(f"{path} is absent")
    assert path.exists(), f"{path} is absent; expected the cases in DIAG_DYNAMICS_CASES"
    arm = CASES / "arm3.urdf"
    if name in ROBOTS:
        dofs, word = ROBOTS[name]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            load = dd.load_mjcf if path.suffix == ".xml" else dd.load_urdf
            assert load(path).nv == dofs
        assert word in " ".join(str(warning.message) for warning in caught)
    elif name in REFUSED:
        with pytest.raises(dd.UrdfError, match=re.escape(REFUSED[name])):
            dd.load_urdf(path)
    elif name in RECORDINGS:
        options, count = RECORDINGS[name]
        assert len(dd.read_recording(path, str(arm), **options)) == count
    elif name in ANALYSED:
        assert main(["analyse", str(path), "--urdf", str(arm)]) != 0
        output = capsys.readouterr()
        assert ANALYSED[name] in " ".join((output.out + output.err).split())
    else:
        tests = (file.read_text(encoding="utf-8") for file in (ROOT / "test").rglob("test_*.py"))
        assert any(f"def {ELSEWHERE[name]}(" in text for text in tests)


def test_no_case_is_missing():
    """Each folder has a line here."""
    if not GIVEN and not CASES.exists():
        pytest.skip(f"{CASES} is absent")
    folders = {path.name for path in CASES.iterdir() if path.is_dir()}
    assert folders <= {name.partition("/")[0] for name in FILES}
