# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What recordings, identification, alarms, inspection and plots must keep, and the tests by public calls that hold it."""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]

ITEMS = {
    "states, counts and causes are those of the monitor": """
        library/test_recordings.py::test_states_and_counts_are_the_monitors
        nodes/test_monitor_recording.py::test_a_recording_is_what_the_monitor_publishes
        library/test_joint_states.py::test_table""",
    "every kind of bag, by content": """
        library/test_bags.py::test_mcap library/test_bags.py::test_rosbag2 library/test_bags.py::test_ros1
        library/test_bags.py::test_kinds_are_known_by_content""",
    "damage is named and everything else is read": """
        library/test_bags.py::test_mcap_that_is_cut_or_has_a_flipped_bit
        library/test_bags.py::test_garbage_in_the_middle library/test_bags.py::test_damaged_sqlite
        library/test_table_files.py::test_damaged_anywhere""",
    "what a killed recorder left": "library/test_bags.py::test_the_journal_of_a_killed_recorder",
    "robot and topics of a bag": """
        library/test_recordings.py::test_the_robot_of_the_bag
        library/test_bag_messages.py::test_robots_of_several_namespaces""",
    "several publishers, floating base, gravity, missing joints": """
        library/test_joint_states.py::test_table library/test_joint_states.py::test_efforts_without_gravity
        library/test_bag_messages.py::test_names_that_came_and_a_map_for_them""",
    "start and end": "library/test_recordings.py::test_part_of_a_recording",
    "tables": """
        library/test_table_files.py::test_columns_by_their_names library/test_table_files.py::test_maps
        library/test_table_files.py::test_what_is_not_sure_is_an_error
        library/test_table_files.py::test_times_to_the_nanosecond library/test_table_files.py::test_packed
        library/test_table_names.py::test_rows_name_their_joints""",
    "tables that were written are read again": "library/test_report.py::test_columns_of_tables",
    "balance of power and its causes": """
        library/test_analysis.py::test_explained_share_is_that_of_windows_by_numpy
        library/test_analysis.py::test_balance_names_the_likely_cause""",
    "quality of the data": """
        library/test_analysis.py::test_units_that_do_not_agree_are_named
        library/test_analysis.py::test_gaps_repeats_and_bounds""",
    "the observer in columns": "library/test_analysis.py::test_observer_is_that_of_single_states",
    "limits of contact": "library/test_analysis.py::test_time_above_limits_of_contact_and_worst_moments",
    "figures of the summary": "library/test_analysis.py::test_figures_are_the_largest_and_the_means",
    "outputs are whole or absent": """
        library/test_analyse_command.py::test_pipes_and_links
        library/test_analyse_command.py::test_a_full_disk_leaves_nothing""",
    "exit status": "library/test_analyse_command.py::test_what_makes_the_exit_status_1",
    "Parquet and MCAP for others": """
        library/test_analyse_command.py::test_mcap_has_every_field
        library/test_analyse_command.py::test_others_read_the_mcap library/test_report.py::test_columns_of_tables""",
    "report": """
        library/test_report.py::test_no_peak_is_missing_from_the_overview
        library/test_report.py::test_all_states_around_contacts_are_kept""",
    "fleet": "library/test_fleet.py::test_a_fleet_is_its_recordings library/test_fleet.py::test_restart",
    "thresholds by the rate of false alarms": """
        library/test_alarms.py::test_the_rate_that_was_asked_for
        library/test_alarms.py::test_one_jerk_is_one_alarm""",
    "alarms state by state and in columns": """
        library/test_alarms.py::test_states_one_by_one_have_the_alarms_of_columns
        library/test_alarms.py::test_a_push_upon_a_standing_torque_is_an_alarm""",
    "real arms": "library/test_identification_recordings.py::test_second_half_by_the_first",
    "exact and physical": """
        library/test_identification_parts.py::test_every_solution_is_physical
        library/test_identification_parts.py::test_parameters_are_pinocchios""",
    "steps by data held out": "library/test_identification.py::test_a_step_that_a_larger_error_hides_is_tried_again",
    "wrong data are rejected by joint and unit": "library/test_identification.py::test_units_are_judged_first",
    "identified models are read everywhere": "library/test_identification.py::test_a_file_gives_the_same_model",
    "excitation": "library/test_excite.py::test_within_limits_from_rest_to_rest",
    "every planted mistake": "library/test_inspection.py::test_mistakes library/test_inspection.py::test_real_robots",
    "peaks and gaps in plots": """
        library/test_plots.py::test_peaks_are_drawn library/test_plots.py::test_gaps_have_no_line""",
}


@pytest.mark.parametrize("item", ITEMS)
def test_is_held_by_tests(item):
    """The tests of an item exist, in the tier that their marks say."""
    for test in ITEMS[item].split():
        path, name = test.split("::")
        tree = ast.parse((TESTS / path).read_text(encoding="utf-8"))
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, test
