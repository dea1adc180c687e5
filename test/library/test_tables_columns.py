# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which columns of a table hold what: by a map, by the rules for names, or not at all. Nothing is guessed."""

import sys
from decimal import Decimal
from math import pi
from pathlib import Path

import numpy as np
import pytest

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables import headers
from diag_dynamics.tables.opening import open_table
from diag_dynamics.tables.times import LIMIT, of_floats, of_integers, of_texts
from diag_dynamics.tables.units import UNITS, word_of_unit

ROOT = Path(__file__).parents[2]

ARM = ("shoulder", "elbow", "wrist")


@pytest.fixture
def written(tmp_path):
    """Writes a text and returns its path."""

    def write(text, name="table.csv"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def table(written):
    """Opens a table of one row, in which each number is the index of its column, by its header."""

    def opened(header, columns=None, joints=(), delimiter=","):
        row = delimiter.join(str(k) for k in range(header.count(delimiter) + 1))
        return open_table(written(f"{header}\n{row}\n"), columns, joints)

    return opened


def found(reader):
    """Joints, and the only row: time, position, velocity, effort."""
    (piece,) = reader.pieces()
    assert reader.unread == []
    values = [one if one is None else one[0].tolist() for one in (piece.position, piece.velocity, piece.effort)]
    return reader.joints, piece.time[0], *values


# --- By their names ---

BY_NAME = {
    "t,q1,q2,q3,qd1,qd2,qd3,tau1,tau2,tau3": (0, [1, 2, 3], [4, 5, 6], [7, 8, 9]),
    "time,q_shoulder,q_elbow,q_wrist": (0, [1, 2, 3], None, None),
    "time,q_wrist,q_elbow,q_shoulder": (0, [3, 2, 1], None, None),
    "wrist_position,elbow_position,shoulder_position,Time": (3, [2, 1, 0], None, None),
    "timestamp,position.shoulder,position.elbow,position.wrist": (0, [1, 2, 3], None, None),
    "timestamp,position[shoulder],position[elbow],position[wrist]": (0, [1, 2, 3], None, None),
    "stamp,pos[0],pos[1],pos[2],vel[0],vel[1],vel[2]": (0, [1, 2, 3], [4, 5, 6], None),
    "sec,joint_states.position[0],joint_states.position[1],joint_states.position[2]": (0, [1, 2, 3], None, None),
    "__time,/joint_states/elbow/position,/joint_states/shoulder/position,/joint_states/wrist/position,"
    "/joint_states/wrist/effort,/joint_states/elbow/effort,/joint_states/shoulder/effort": (
        *(0, [2, 1, 3], None, [6, 5, 4]),
    ),
    "timestamp,target_q_0,target_q_1,target_q_2,actual_q_0,actual_q_1,actual_q_2": (0, [4, 5, 6], None, None),
    "t,q[0],q[1],q[2],q_d[0],q_d[1],q_d[2],tau_J[0],tau_J[1],tau_J[2],tau_ext[0],tau_ext[1],tau_ext[2]": (
        *(0, [1, 2, 3], None, [7, 8, 9]),
    ),
    "t,joint1_velocity,joint2_velocity,joint3_velocity,J1 angle,J2 angle,J3 angle": (0, [4, 5, 6], [1, 2, 3], None),
    "Elapsed,POS_1,POS_2,POS_3,name": (0, [1, 2, 3], None, None),
    "t,q0,q1,q2,tau1,tau2,tau3": (0, [1, 2, 3], None, [4, 5, 6]),
    "t,q3,q2,q1": (0, [3, 2, 1], None, None),
    "t,q1,q2,q3,position.x,position.y,position.z,q_w,q_x,q_y,q_z": (0, [1, 2, 3], None, None),
    "t,q_shoulder,q_elbow,q_wrist,q_gripper,current_tool,seq,temperature_1": (0, [1, 2, 3], None, None),
    "t,__time,q1,q2,q3": (0, [2, 3, 4], None, None),
    ",t,q1,q2,q3": (1, [2, 3, 4], None, None),
}


@pytest.mark.parametrize("header", BY_NAME)
def test_columns_are_known_by_their_names(table, header):
    assert found(table(header, joints=ARM)) == (ARM, *BY_NAME[header])


def test_what_was_read_and_what_not_is_said(table):
    reader = table("t,q_elbow [deg],q_wrist,temperature,tau_wrist", joints=ARM)
    assert reader.notes == (
        "time: t.",
        "position: 'q_{joint}' of 2 joints, times 0.0174533, 1 for rad or m.",
        "effort: 'tau_{joint}' of 2 joints, none for elbow.",
        "not read: temperature.",
    )
    joints, _, position, velocity, effort = found(reader)
    assert joints == ("elbow", "wrist") and position == [pi / 180, 2.0] and velocity is None
    assert np.isnan(effort[0]) and effort[1] == 4


def test_without_a_model_names_are_those_in_the_file(table):
    assert found(table("t,q_b,q_a,tau_a")) == (("b", "a"), 0, [1, 2], None, [pytest.approx(np.nan, nan_ok=True), 3])
    assert found(table("t,q0,q1"))[0] == ("joint0", "joint1")
    assert found(table("t,/arm/joint_states/a/position,/arm/joint_states/b/position"))[0] == ("a", "b")
    assert found(table("t,q,qd,tau"))[0] == ("joint1",)


AMBIGUOUS = {
    "t,q1,q2,q3,pos1,pos2,pos3": r"may be the position: say which by `position: …`, 'q\{joint\}' or 'pos\{joint\}'",
    "t,q_shoulder,q_elbow,q_wrist,q1,q2,q3": r"'q_\{joint\}' or 'q\{joint\}'",
    "t,left/q_elbow,right/q_elbow": r"'left/q_\{joint\}' or 'right/q_\{joint\}'",
    "t,q1,q2,q3,tau1,tau2,tau3,effort1,effort2,effort3": "may be the effort",
    "t,time,q1,q2,q3": "several columns may be the times: name it by `time: …` in the map of columns, one of t, time",
    "t,q1 [deg],q1 [rad],q2,q3": r"'q1 \[deg\]' \(column 1\) and 'q1 \[rad\]' \(column 2\) are both 'q\{joint\}' of '1'",
    "t,q1,q1,q2,q3": r"'q1' \(column 1\) and 'q1' \(column 2\) are both",
    "t,q1,q2,q3,q4": r"has the numbers 1, 2, 3, 4, but there are 3 joints of the model \(shoulder, elbow, wrist\)",
    "t,q1,q2": "has the numbers 1, 2, but there are 3 joints of the model",
    "t,q1,q2,q4": "has the numbers 1, 2, 4",
    "t,q_hip,q_knee": "has hip, knee, none of which is among the joints of the model: shoulder, elbow, wrist",
    "t,shoulder,elbow,wrist": "no column is known as a position, of t, shoulder, elbow, wrist",
    "t,q1,q2,q3,qd1,qd2 [ticks],qd3": r"column 'qd2 \[ticks\]' is in 'ticks'.*`scale: \{velocity: …\}`.*or `velocity: null`",
    "t,q_deg_1,q_deg_2,q_deg_3,current_1,current_2,current_3": "column 'current_1' is in 'A', from which the effort",
    "t,q1,q2,q3,effort1 [A],effort2 [A],effort3 [A]": r"'effort1 \[A\]' is in 'A'",
    "x,q1,q2,q3": "no column is known as that of the times: name it .* which of x, q1, q2, q3",
    "t [furlongs],q1,q2,q3": r"column 't \[furlongs\]' is in 'furlongs'",
}


@pytest.mark.parametrize("header", AMBIGUOUS)
def test_what_is_not_sure_is_an_error(table, header):
    with pytest.raises(InputError, match=AMBIGUOUS[header]):
        table(header, joints=ARM)


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        ("q1 [deg]", pi / 180),
        ("q1[°]", pi / 180),
        ("q1 °", pi / 180),
        ("q_deg_1", pi / 180),
        ("q1_degrees", pi / 180),
        ("q1 (rad)", 1.0),
        ("pos_mm_1", 1e-3),
    ],
)
def test_units_of_positions(table, header, factor):
    assert found(table(f"t,{header}"))[2] == [factor]


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        ("qd1 [deg/s]", pi / 180),
        ("qd1 (deg/sec)", pi / 180),
        ("qd1 [°/s]", pi / 180),
        ("qd1 [deg·s^-1]", pi / 180),
        ("vel_deg_per_s_1", pi / 180),
        ("velocity_rpm_1", 2 * pi / 60),
        ("qd1 [1/min]", 2 * pi / 60),
        ("vel_rad_s_1", 1.0),
        ("qd1 [rad/s]", 1.0),
    ],
)
def test_units_of_velocities(table, header, factor):
    assert found(table(f"t,q1,{header}"))[3] == [pytest.approx(2 * factor, rel=1e-15)]


@pytest.mark.parametrize(
    ("header", "factor"), [("tau1 [N m]", 1.0), ("tau1 [N·m]", 1.0), ("tau1 [mNm]", 1e-3), ("tau_nm_1", 1.0)]
)
def test_units_of_efforts(table, header, factor):
    assert found(table(f"t,q1,{header}"))[4] == [2 * factor]


@pytest.mark.parametrize(
    ("header", "seconds"),
    [
        ("t", 5.0),
        ("t_ms", 5e-3),
        ("Time [ms]", 5e-3),
        ("timestamp_us", 5e-6),
        ("time (µs)", 5e-6),
        ("t_ns", 5e-9),
        ("%time", 5e-9),
    ],
)
def test_units_of_times(written, header, seconds):
    (piece,) = open_table(written(f"{header},q1\n5,1\n")).pieces()
    assert piece.time[0] == seconds and piece.stamp[0] == round(seconds * 1e9)


def test_a_line_of_units_below_the_header(written):
    reader = open_table(written("t,q1,qd1,tau1\n[ms],[deg],deg/s,-\n5,180,90,7\n"))
    (piece,) = reader.pieces()
    assert (piece.time, piece.position, piece.velocity, piece.effort) == (5e-3, pi, pi / 2, 7) and piece.rows == 0
    with pytest.raises(InputError, match="column 'tau1' is in 'A'"):
        open_table(written("t,q1,tau1\ns,rad,A\n5,180,90\n"))


def test_every_unit_of_a_word_is_known():
    """What counts as a unit in a name has a factor, or is refused for want of one."""
    for text in (
        "deg_s",
        "degps",
        "deg_per_sec",
        "rad/s",
        "dps",
        "rpm",
        "mm_s",
        "revps",
        "turns",
        "mnm",
        "mrad",
        "°/s",
    ):
        _, unit = word_of_unit(f"q_{text}_1")
        assert any(unit in known for known in UNITS.values()), text


# --- By a map ---

MAPS = {
    "pattern": {"time": "t", "position": "a_{joint}", "velocity": "b_{joint}", "effort": "c_{joint}"},
    "names": {"time": "t", "position": ["a_s", "a_e"], "velocity": ["b_s", "b_e"], "effort": ["c_s", "c_e"]},
    "numbers": {"time": 0, "position": [1, 2], "velocity": [3, 4], "effort": [5, 6]},
    "by joint": {"time": [0], "position": {"s": "a_s", "e": 2}, "velocity": {"e": "b_e", "s": "b_s"}, "effort": [5, 6]},
}


@pytest.mark.parametrize("kind", MAPS)
@pytest.mark.parametrize("joints", [None, ["s", "e"]])
def test_maps(table, kind, joints):
    columns = MAPS[kind] | ({"joints": joints} if joints else {})
    reader = table("t,a_s,a_e,b_s,b_e,c_s,c_e", columns, () if joints or kind == "by joint" else ("s", "e"))
    assert found(reader) == (("s", "e"), 0, [1, 2], [3, 4], [5, 6])


def test_a_map_in_a_file(table, written):
    text = """
    time: stamp   # [ns]
    position: "p {joint}"
    effort: [5, 3]
    joints: [b, a]
    scale:
      time: 1e-9
      position: {b: deg, "*": 2}
      effort: [0.5, -1]
    """
    path = written(text, "map.yaml")
    header = "stamp,p a,p b,i a,x,i b"
    assert found(table(header, path)) == (("b", "a"), 0, [2 * pi / 180, 2], None, [2.5, -3])
    assert found(table(header, str(path)))[0] == ("b", "a")


def test_what_a_map_does_not_name_follows_from_names(table):
    header = "t,time,q1,q2,qd1,qd2,current1,current2"
    assert found(table(header, {"time": "t", "scale": {"effort": 0.1}}))[1:] == (
        *(0, [2, 3], [4, 5]),
        [pytest.approx(0.6), pytest.approx(0.7)],
    )
    assert found(table(header, {"time": "t", "effort": None}))[4] is None
    # With positions in it, it is complete but for the time: velocities that nobody asked for are left alone.
    assert found(table("t,q1,qd1", {"position": ["q1"]}))[2:] == ([1], None, None)
    assert table("t,q1,qd1", {"position": ["q1"]}).notes[-1] == "not read: qd1."


def test_a_scale_replaces_what_names_say(table):
    assert found(table("t [ms],q1 [deg]", {"scale": {"position": 10, "time": 1}}))[1:3] == (0, [10])
    assert found(table("t,q1 [ticks]", {"scale": {"position": "rev"}}))[2] == [2 * pi]


def test_a_pattern_matches_with_or_without_units(table):
    for pattern in ("{joint} [deg]", "{joint}"):
        assert found(table("t [s],a [deg],b [deg]", {"time": "t", "position": pattern}, ("a", "b")))[2][0] == pi / 180


def test_numbers_in_a_pattern_are_joints_in_their_order(table):
    wide = "t," + ",".join(f"a{k}" for k in range(1, 12))
    joints = tuple("abcdefghijk")
    assert found(table(wide, {"position": "a{joint}"}, joints)) == (joints, 0, list(range(1, 12)), None, None)
    assert found(table(wide, {"position": "a{joint}", "joints": list(joints)}))[0] == joints


def test_seconds_and_nanoseconds(written):
    text = "sec,nanosec,q1\n1700000000,123456789,1\n"
    for columns in (None, {"time": ["sec", "nanosec"]}, {"time": [0, 1]}):
        (piece,) = open_table(written(text), columns).pieces()
        assert piece.stamp[0] == 1_700_000_000_123_456_789
    (piece,) = open_table(written(text.split("\n", 1)[1]), {"time": [0, 1], "position": [2]}).pieces()
    assert piece.stamp[0] == 1_700_000_000_123_456_789


WRONG_MAPS = [
    ({"tiem": "t"}, "columns has 'tiem', expected 'time'"),
    ({"position": "a_{joint}", "time": "tt"}, "time: there is no column 'tt' .did you mean 't'"),
    ({"position": ["a_s", "a_x"]}, "position: there is no column 'a_x' .did you mean 'a_"),
    ({"position": "A_{joint}"}, r"position: no column is like 'A_\{joint\}'"),
    ({"position": "a_{joint}", "joints": ["s", "eh"]}, r"no column 'a_\{joint\}' for eh .did you mean 'e'"),
    ({"position": "{joint}_{joint}"}, r"expected \{joint\} once"),
    ({"position": [1, 2, 3], "joints": ["s", "e"]}, "has 3 columns, but there are 2 joints that the map names: s, e"),
    ({"position": [1, 1]}, "position has column 1 for two joints"),
    ({"position": [1, "a_s"]}, "position has a column for two joints"),
    ({"position": [1, 17]}, "position is column 17, but there are 7, from 0"),
    ({"position": [1, -2]}, "position is -2, expected a whole number from 0"),
    ({"position": [1, True]}, "position is True, expected a column's name, or its number"),
    ({"position": []}, r"position is \[\], expected a column's name, a pattern such as q_\{joint\}, or a list"),
    ({"position": None}, "position is null"),
    ({"position": {"s": 1}, "effort": {"e": 2}}, "effort is by joint, but not for the same joints as the rest: e, s"),
    ({"position": [1], "time": [1, 2, 3]}, "expected one column, or two: seconds and nanoseconds"),
    ({"joints": "s"}, "joints is 's', expected a list"),
    ({"joints": ["s", "s"]}, "joints has 's' twice"),
    ({"joints": [1, 2]}, r"joints is \[1, 2\], expected a list of the joints' names"),
    ({"scale": 2}, "scale is 2, expected a number or a unit for each of time, position, velocity or effort"),
    ({"scale": {"efort": 2}}, "scale has 'efort', expected 'effort'"),
    ({"scale": {"effort": 0}}, "scale: effort is 0, expected a finite number other than 0"),
    ({"scale": {"effort": "nan"}}, "expected a finite number"),
    ({"scale": {"effort": True}}, "expected a finite number"),
    ({"scale": {"position": "grad"}}, "scale: position is 'grad', expected a number or a unit such as rad"),
    ({"position": [1, 2], "scale": {"position": [1, 2, 3]}}, "scale: position has 3 numbers, but there are 2 joints"),
    ({"position": "a_{joint}", "scale": {"position": {"x": 1}}}, "'x', which is none of the joints s, e"),
    ({"position": "a_{joint}", "scale": {"position": {"s": 1}}}, "nothing for 'e', of the joints s, e"),
    ({"position": "a_{joint}", "scale": {"effort": 1}}, "there is a scale of effort, but no column of it"),
    ({"header": "no"}, "header is 'no', expected true or false"),
    ({"delimiter": ", "}, "delimiter is ', ', expected one character"),
    ({"delimiter": 5}, "delimiter is 5"),
    ({"decimal": ";"}, "decimal is ';', expected '.' or ','"),
    ({"decimal": ",", "delimiter": ","}, "decimal and delimiter are both ','"),
    ({"skip": -1}, "skip is -1, expected a whole number"),
    ([1], r"columns is \[1\], expected the path of a YAML file or a dict with time, position"),
]


@pytest.mark.parametrize(("columns", "message"), WRONG_MAPS)
def test_wrong_maps_are_named(table, columns, message):
    with pytest.raises(InputError, match=message):
        table("t,a_s,a_e,b_s,b_e,c_s,c_e", columns)


def test_wrong_files_of_maps_are_named(table, written, monkeypatch):
    for text, message in (
        ("- 1", r"map\.yaml' is \[1\], expected"),
        ("time: [", r"map\.yaml' is no YAML: .*line 1"),
        ("time: 2024-13-01\n", "is no YAML"),
        ("time: t\npositoin: q", r"map\.yaml' has 'positoin', expected 'position'"),
    ):
        with pytest.raises(InputError, match=message):
            table("t,q1", written(text, "map.yaml"))
    with pytest.raises(InputError, match="The map of columns '/nowhere/map' cannot be read: No such file"):
        table("t,q1", "/nowhere/map")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "yaml", None)
        with pytest.raises(InputError, match="is YAML, and PyYAML is not installed: pip install"):
            table("t,q1", written("time: t", "map.yaml"))
    assert found(table("t,q1", written("# nothing yet\n", "map.yaml")))[2] == [1]


# --- Times ---


def test_texts_are_exact_to_the_nanosecond():
    texts = ["1700000000.123456789", "1700000000", "0.000000001", "-3.5", " 1e-9 ", "1.7e9", "nan", "x", "", "1_0"]
    time, stamp = of_texts(texts, 1.0)
    assert stamp.tolist()[:6] == [1_700_000_000_123_456_789, 17 * 10**17, 1, -3_500_000_000, 1, 17 * 10**17]
    assert time.tolist()[:6] == [float(text) for text in texts[:6]] and np.isnan(time[6:]).all()
    assert of_texts(["1700000000123456789"], 1e-9)[1].tolist() == [1_700_000_000_123_456_789]
    assert of_texts(["1700000000123456789", "x"], 1e-9)[1].tolist()[:1] == [1_700_000_000_123_456_789]
    assert of_texts(["1700000000123.456789"], 1e-3)[1].tolist() == [1_700_000_000_123_456_789]


def test_dates():
    time, stamp = of_texts(
        [
            "2023-11-14T22:13:20.123456789Z",
            "2023-11-14 22:13:20.123456789",
            "2023-11-15T00:13:20,123456789+02:00",
            "2023-02-30 00:00:00",
        ],
        1.0,
    )
    assert stamp.tolist()[:3] == [1_700_000_000_123_456_789] * 3 and np.isnan(time[3])


def test_times_that_are_none_are_cut():
    values = ["1e297", "-1e297", "inf", "-inf", "1e999999999999", "9" * 5000, "5e-324"]
    time, stamp = of_texts(values, 1.0)
    assert stamp.tolist() == [LIMIT, -LIMIT, LIMIT, -LIMIT, LIMIT, LIMIT, 0]
    assert time.tolist()[:4] == [1e297, -1e297, np.inf, -np.inf]
    assert of_floats(np.array([1e297, -np.inf]), 1.0)[1].tolist() == [LIMIT, -LIMIT]
    for kind in (np.int64, np.uint64):
        extreme = np.array([np.iinfo(kind).min, np.iinfo(kind).max, 3], kind)
        stamp = of_integers(extreme, 1.0)[1].tolist()
        assert stamp == [-LIMIT if kind is np.int64 else 0, LIMIT, 3_000_000_000]


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e-6, 1e-9, 60.0, 1 / 3])
def test_stamps_of_integers_and_floats(scale):
    """Exactly what Decimal says of the number and the scale, up to what a double holds."""
    values = np.array([0, 1, 7, 1_234, -123_456])
    exact = [round(Decimal(repr(scale)) * int(value) * 10**9) for value in values]
    assert of_integers(values, scale)[1].tolist() == exact
    assert of_floats(values.astype(float), scale)[1].tolist() == exact
    np.testing.assert_allclose(of_integers(values, scale)[0], values * scale, rtol=3e-16)


@pytest.mark.parametrize(("unit", "scale"), [("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
def test_times_in_doubt_are_an_error(written, unit, scale):
    first = 1_700_000_000 * scale
    text = f"time,q1\n{first},1\n{first + 1},2\n"
    with pytest.raises(InputError, match=rf"`scale: \{{time: {unit}\}}`"):
        list(open_table(written(text)).pieces())
    (piece,) = open_table(written(text), {"scale": {"time": unit}}).pieces()
    assert piece.stamp.tolist() == [17 * 10**17, 17 * 10**17 + 10**9 // scale]
    garbage = "time,q1\n1e297,1\n0.5,2\n0.6,3\n"  # a row of it is no reason to doubt the rest
    (piece,) = open_table(written(garbage)).pieces()
    assert piece.time.tolist() == [1e297, 0.5, 0.6]


# --- The page ---


def test_the_page_has_the_rules():
    """docs/recordings.md has them word for word."""
    page = " ".join((ROOT / "docs" / "recordings.md").read_text(encoding="utf-8").split())
    assert " ".join(headers.RULES.split()) in page
