# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint names in the data of tables: in rows, comments and metadata. The joints are those that the data name."""

import json

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

import diag_dynamics as dd
from bags import arm

JOINTS = ("shoulder", "elbow", "wrist")
"""Of the robot, from the base to the tip."""
ALPHABETICAL = tuple(sorted(JOINTS))
ROWS = 6
LOOSE = {"joint_timeout": 0.0, "frozen_timeout": 0.0, "absurd.jump": 0.0, "absurd.position": 0.0}
FIELDS = ("position", "velocity", "effort")


def value(field, joint, row):
    """Return a number that tells its quantity, joint and row."""
    return FIELDS.index(field) + 0.1 * JOINTS.index(joint) + 0.001 * row if joint in JOINTS else 9.0


def time(row):
    """Return the time of a row [ns]."""
    return 1_660_000_000_000_000_000 + 10_000_000 * row


def expected(field):
    """Return the numbers of all rows by the robot's joints."""
    return np.array([[value(field, joint, row) for joint in JOINTS] for row in range(ROWS)])


def fixed(row):
    """Return joints in alphabetical order, as drivers send them."""
    return ALPHABETICAL


def changing(row):
    """Return joints in an order that changes from row to row."""
    return tuple(np.roll(ALPHABETICAL, row))


def with_others(row):
    """Return joints among joints of another robot, in a changing order."""
    return ("gripper", *changing(row), "lamp") if row % 2 else (*changing(row), "lamp", "gripper")


ORDERS = [fixed, changing, with_others]


# --- Writers: each makes the content of a file of the joints of each row ---


def rostopic(order, separator=",", ending="\n", name="field.{}{}", decimal=".", quote="", echo=True):
    """Return what `rostopic echo -p` writes; with other options, what others make of it."""
    width = max(len(order(row)) for row in range(ROWS))
    begin = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"] if echo else ["Time"]
    lines = [[*begin, *(name.format(field, k) for field in ("name", *FIELDS) for k in range(width))]]
    for row in range(ROWS):
        joints = order(row)
        line = [str(time(row) + 77), str(row), str(time(row)), ""] if echo else [f"{time(row) * 1e-9:.9f}"]
        lacking = [""] * (width - len(joints))
        line += [*(f"{quote}{joint}{quote}" for joint in joints), *lacking]
        for field in FIELDS:
            line += [*(f"{value(field, joint, row):.4f}" for joint in joints), *lacking]
        lines.append([one.replace(".", decimal) if one and one[-1].isdigit() else one for one in line])
        if decimal != ".":
            lines[0] = [one.replace(",", ".") for one in lines[0]]
    return "".join(separator.join(line) + ending for line in lines)


def bagpy(order, numbers="({})", names="['{}']", between="', '", comma=", ", separator=","):
    """Return what bagpy writes where lists stay together."""
    lines = [separator.join(["Time", "header.seq", "header.frame_id", "name", *FIELDS])]
    for row in range(ROWS):
        lists = [numbers.format(comma.join(f"{value(field, j, row):.4f}" for j in order(row))) for field in FIELDS]
        cells = [names.format(between.join(order(row))), *lists]
        lines.append(separator.join([f"{time(row) * 1e-9:.9f}", str(row), "base", *(f'"{one}"' for one in cells)]))
    return "\n".join(lines) + "\n"


def bagpy_flat(order):
    """Return what bagpy writes of tuples: a column for each number, one for all names."""
    count = len(order(0))
    lines = [",".join(["Time", "name", *(f"{field}_{k}" for field in FIELDS for k in range(count))])]
    for row in range(ROWS):
        numbers = [f"{value(field, joint, row):.4f}" for field in FIELDS for joint in order(row)]
        lines.append(",".join([f"{time(row) * 1e-9:.9f}", f'"{list(order(row))}"', *numbers]))
    return "\n".join(lines)


def long_table(order, header="time,joint,position,velocity,effort"):
    """Return a row for each joint and time."""
    rows = [
        ",".join([f"{time(row) * 1e-9:.9f}", joint, *(f"{value(field, joint, row):.4f}" for field in FIELDS)])
        for row in range(ROWS)
        for joint in order(row)
    ]
    return "\n".join([header, *rows]) + "\n"


def echoed(order):
    """Return what `ros2 topic echo --csv` writes."""
    lines = []
    for row in range(ROWS):
        numbers = [f"{value(field, joint, row):.4f}" for field in FIELDS for joint in order(row)]
        lines.append(",".join([*map(str, divmod(time(row), 10**9)), "base", *order(row), *numbers]))
    return "\n".join(lines)


def lists_in_parquet(order, kind=None):
    """Return a table of lists, as messages have them."""
    names = pa.array([list(order(row)) for row in range(ROWS)], pa.list_(kind or pa.string()))
    lists = {field: [[value(field, joint, row) for joint in order(row)] for row in range(ROWS)] for field in FIELDS}
    return pa.table({"stamp": pa.array(map(time, range(ROWS)), pa.timestamp("ns")), "name": names, **lists})


def columns_in_parquet(order, kind=None):
    """Return a table with a column for each name and number."""
    columns = {"stamp": pa.array(map(time, range(ROWS)), pa.timestamp("ns"))}
    for k in range(len(order(0))):
        columns[f"name_{k}"] = pa.array([order(row)[k] for row in range(ROWS)], kind or pa.string())
        for field in FIELDS:
            columns[f"{field}_{k}"] = [value(field, order(row)[k], row) for row in range(ROWS)]
    return pa.table(columns)


def arrays(order, kind=str):
    """Return arrays with a row of names for each time."""
    names = np.array([order(row) for row in range(ROWS)], kind)
    numbers = {
        field: np.array([[value(field, joint, row) for joint in order(row)] for row in range(ROWS)]) for field in FIELDS
    }
    return {"time": np.array([time(row) for row in range(ROWS)], "M8[ns]"), "names": names} | numbers


WRITERS = {
    "rostopic": rostopic,
    "rostopic with CR LF": lambda order: rostopic(order, ending="\r\n"),
    "rostopic with a BOM": lambda order: "\ufeff" + rostopic(order),
    "rostopic in capitals": lambda order: rostopic(order, name="FIELD.{}{}").replace("field.name", "FIELD.NAME"),
    "rostopic with semicolons": lambda order: rostopic(order, separator=";"),
    "rostopic with tabs": lambda order: rostopic(order, separator="\t"),
    "rostopic with quotes": lambda order: rostopic(order, quote='"'),
    "rostopic with single quotes": lambda order: rostopic(order, quote="'"),
    "brackets": lambda order: rostopic(order, name="/joint_states/{}[{}]", echo=False),
    "dots": lambda order: rostopic(order, name="joint_states.{}.{}", echo=False),
    "bagpy": bagpy,
    "bagpy of numbers": bagpy_flat,
    "bagpy with semicolons": lambda order: bagpy(order, separator=";"),
    "arrays of ROS 2": lambda order: bagpy(order, numbers="array('d', [{}])"),
    "arrays of numpy": lambda order: bagpy(order, "[{}]", "['{}']", "' '", " "),
    "names with commas": lambda order: bagpy(order, "[{}]", "{}", ","),
    "names with blanks": lambda order: bagpy(order, "[{}]", "{}", " "),
    "long": long_table,
    "long with other headers": lambda order: long_table(order, "Stamp,Joint Name,Pos [rad],Vel [rad/s],Tau [Nm]"),
    "long by content": lambda order: long_table(order, "t,axis,q,qd,tau"),
    "ros2 topic echo --csv": echoed,
    "lists in Parquet": lists_in_parquet,
    "large lists in Parquet": lambda order: lists_in_parquet(order, pa.large_string()),
    "columns in Parquet": columns_in_parquet,
    "dictionaries in Parquet": lambda order: columns_in_parquet(order, pa.dictionary(pa.int8(), pa.string())),
    "npz": arrays,
    "bytes in npz": lambda order: arrays(order, bytes),
}


@pytest.fixture
def read(tmp_path):
    """Write a content and read it; return the recording."""

    def run(content, columns=None, joints=JOINTS, parameters=LOOSE):
        path = tmp_path / "table.csv"
        if isinstance(content, dict):
            path = tmp_path / "table.npz"
            np.savez(path, **content)
        elif isinstance(content, pa.Table):
            path = tmp_path / "table.parquet"
            parquet.write_table(content, path, row_group_size=4)
        else:
            path.write_bytes(content.encode())
        return dd.read_recording(path, arm(*joints), columns, parameters=parameters)

    return run


def require_expected(recording):
    """Require the numbers of all rows, each at its joint."""
    assert [one.text for one in recording.findings if one.cause != "note"] == []
    for field, values in (("position", recording.q), ("velocity", recording.qd), ("effort", recording.tau)):
        np.testing.assert_allclose(values, expected(field), rtol=0, atol=1e-12)
    assert np.diff(recording.stamp).tolist() == pytest.approx([10_000_000] * (ROWS - 1), abs=300)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("writer", WRITERS)
def test_rows_name_their_joints(read, writer, order):
    require_expected(read(WRITERS[writer](order)))


def test_decimal_commas(read):
    require_expected(read(rostopic(changing, separator=";", decimal=","), {"decimal": ","}))


@pytest.mark.parametrize("writer", ["rostopic", "bagpy", "long", "lists in Parquet"])
def test_joints_in_messages_of_their_own(read, writer):
    """Rows of fewer joints are messages of fewer joints: a state is there when all have come."""

    def one_or_two(row):
        return ("wrist",) if row % 2 else ("elbow", "shoulder")

    recording = read(WRITERS[writer](one_or_two))
    assert recording.counts["incomplete"] == 1 and len(recording) == ROWS - 1
    odd = np.arange(1, ROWS) % 2 == 1
    by_name = dict(zip(JOINTS, recording.q.T, strict=True))
    for joint, own in (("wrist", odd), ("elbow", ~odd), ("shoulder", ~odd)):
        rows = [row if is_own else row - 1 for row, is_own in zip(range(1, ROWS), own, strict=True)]
        np.testing.assert_allclose(by_name[joint], [value("position", joint, row) for row in rows], atol=1e-12)


# --- Comments and metadata ---

PLAIN = "t,q1,q2,q3\n" + "".join(f"{row},{row}.1,{row}.2,{row}.3\n" for row in range(ROWS))
COMMENTS = [
    "# joints: elbow, shoulder, wrist",
    "# Joint names = [elbow, shoulder, wrist]",
    "#joint_names: ['elbow', 'shoulder', 'wrist']",
    "% joint order (as sent): elbow shoulder wrist",
    "# order of the joints: elbow; shoulder; wrist",
    "# names: elbow | shoulder | wrist",
    "# elbow shoulder wrist",
    "# elbow, shoulder, wrist",
    '# {"robot": "arm", "joint_names": ["elbow", "shoulder", "wrist"], "rate": 100}',
    "# robot=arm joints=elbow,shoulder,wrist rate=100",
    "# q1 = elbow, q2 = shoulder, q3 = wrist",
    "# 0: elbow, 1: shoulder, 2: wrist (recorded at 12:30)",
    "# joint 1: elbow\n# joint 3: wrist\n# joint 2: shoulder",
    "# q[0] -> elbow\n# q[1] -> shoulder\n# q[2] -> wrist",
    "# joints:\n#   - elbow\n#   - shoulder\n#   - wrist\n# recorded by hand",
    "# arm: 3\n# joints:\n# elbow, shoulder, wrist",
    "# columns: t, elbow, shoulder, wrist",
    "# motors: elbow, shoulder, wrist",
    "# DoFs: elbow shoulder wrist",
    "# [0] elbow [1] shoulder [2] wrist",
    "# [1] shoulder [0] elbow [2] wrist",
    "# 0 elbow\n# 1 shoulder\n# 2 wrist",
    "# | 1 | shoulder |\n# | 0 | elbow |\n# | 2 | wrist |",
    "# positions of elbow, shoulder and wrist",
    "# t elbow_pos shoulder_pos wrist_pos",
    "# shoulder: 1, elbow: 0, wrist: 2",
    "# joint 1 is shoulder, joint 0 is elbow, joint 2 is wrist",
    "# shoulder is column 2, elbow is column 1, wrist is column 3",
    "# elbow (rad), shoulder (rad), wrist (rad)",
    "# elbow/shoulder/wrist",
    "# axes: elbow,\n#       shoulder,\n#       wrist\n# recorded on Monday",
    "# motors:\n# - elbow\n# - shoulder\n# - wrist",
    "# joints: elbow, shoulder, wrist\n# limits: wrist 2.0, shoulder 3.1, elbow 5",
]
NUMBERS = {"t": np.arange(ROWS) * 1.0, "q": np.arange(ROWS)[:, None] + [0.1, 0.2, 0.3]}
LIST = list(ALPHABETICAL)


def in_parquet(**metadata):
    table = pa.table({"t": NUMBERS["t"], "q": NUMBERS["q"].tolist()})
    return table.replace_schema_metadata({key: json.dumps(one) for key, one in metadata.items()})


STATED = {
    **{comment: f"{comment}\n{PLAIN}" for comment in COMMENTS},
    "comment below the header": PLAIN.replace("\n", f"\n{COMMENTS[0]}\n", 1),
    "names below the header": PLAIN.replace("\n", "\n,elbow,shoulder,wrist\n", 1),
    "names below one quantity": PLAIN.replace("t,q1,q2,q3\n", "t,q,q,q\ns,elbow,shoulder,wrist\n", 1),
    "names above the header": PLAIN.replace("t,q1,q2,q3\n", ",elbow,shoulder,wrist\nt,q,q,q\n", 1),
    "metadata": in_parquet(joint_names=LIST),
    "metadata as text": in_parquet(joints="elbow, shoulder, wrist"),
    "metadata of motors": in_parquet(motors=LIST),
    "metadata by index": in_parquet(order={"shoulder": 1, "elbow": 0, "wrist": 2}),
    "attributes of pandas": in_parquet(PANDAS_ATTRS={"joint_names": LIST}),
    "array": NUMBERS | {"joint_names": np.array(LIST)},
    "two arrays": NUMBERS | {"joint_names": np.array(LIST), "dofs": np.array(LIST)},
    "array of bytes": NUMBERS | {"names": np.array(LIST, bytes)},
    "array of one text": NUMBERS | {"joints": np.array("elbow, shoulder, wrist")},
    "array of each joint": {
        "t": NUMBERS["t"],
        **{f"q{k}": NUMBERS["q"][:, k] for k in range(3)},
        "joint_names": np.array(LIST),
    },
}


HEADERS = [
    "q0 ({0}),q1 ({1}),q2 ({2})",
    "q0_{0},q1_{1},q2_{2}",
    "q0 ({0}) [rad],q1 ({1}) [rad],q2 ({2}) [rad]",
    "q[0] {0},q[1] {1},q[2] {2}",
    "{0} (q0),{1} (q1),{2} (q2)",
    "j1/{0}/position,j2/{1}/position,j3/{2}/position",
]
"""Headers with index and joint."""

TEXT_HEADERS = [
    "first_joint,second_joint,third_joint",
    "name_x,name_y,name_z",
    "a,b,c",
    "name0,name1,last",
    "q1_name,q2_name,q3_name",
]

ESTIMATED = LOOSE | {"missing_velocity": "estimate"}


def require_alphabetical(recording):
    """Require that the columns of NUMBERS are those of the joints in alphabetical order."""
    np.testing.assert_allclose(recording.q[-1] - np.floor(recording.q[-1]), [0.2, 0.1, 0.3], rtol=0, atol=1e-9)


def test_merged_cells_above_the_header(read):
    """A name stands above the first of its columns."""
    lines = [",elbow,,,shoulder,,,wrist,,", "time,q,qd,tau,q,qd,tau,q,qd,tau"]
    for row in range(ROWS):
        numbers = [f"{value(field, joint, row):.4f}" for joint in ALPHABETICAL for field in FIELDS]
        lines.append(",".join([f"{time(row) * 1e-9:.9f}", *numbers]))
    require_expected(read("\n".join(lines)))


@pytest.mark.parametrize("swapped", [False, True])
def test_columns_of_pandas_with_two_levels(tmp_path, swapped):
    """Quantities above joints or below them; the name of the index has a line of its own."""
    columns = {(field, joint): expected(field)[:, JOINTS.index(joint)] for field in FIELDS for joint in ALPHABETICAL}
    index = pd.Index([time(row) * 1e-9 for row in range(ROWS)], name="time")
    frame = pd.DataFrame(columns, index)
    path = tmp_path / "levels.csv"
    (frame.swaplevel(axis=1) if swapped else frame).to_csv(path)
    require_expected(dd.read_recording(path, arm(*JOINTS), parameters=LOOSE))


def test_names_in_lines_that_a_map_skips(read):
    require_alphabetical(read(f"joints: elbow, shoulder, wrist\n{PLAIN}", {"skip": 1}, parameters=ESTIMATED))


STAMPS = {
    "bagpy": ("Time,header.seq,header.stamp.secs,header.stamp.nsecs", "{second}.9,{row},{second},{rest}"),
    "bag2csv": ("rosbagTimestamp,header,seq,stamp,secs,nsecs", "{stamp},,{row},,{second},{rest}"),
    "ROS 2": ("time,header.stamp.sec,header.stamp.nanosec", "{second}.9,{second},{rest}"),
    "PlotJuggler": (
        "__time,/imu/header/stamp,/js/header/stamp,/other/header/stamp",
        "{second}.9,,{second}.{rest:09},5",
    ),
}


@pytest.mark.parametrize("kind", STAMPS)
def test_stamps_of_messages_come_before_other_times(read, kind):
    """What bagpy, bag2csv and PlotJuggler write beside the stamps of joint states."""
    header, begin = STAMPS[kind]
    lists = "name,position,velocity,effort"
    if kind == "PlotJuggler":
        lists = ",".join(f"/js/{one}" for one in lists.split(","))
    lines = [f"{header},{lists}"]
    for row in range(ROWS):
        second, rest = divmod(time(row), 10**9)
        numbers = [", ".join(f"{value(field, joint, row):.4f}" for joint in changing(row)) for field in FIELDS]
        names, first = ", ".join(changing(row)), begin.format(second=second, rest=rest, row=row, stamp=time(row) + 7)
        lines.append(",".join([first, *(f'"[{one}]"' for one in (names, *numbers))]))
    recording = read("\n".join(lines))
    require_expected(recording)
    assert recording.stamp.tolist() == [time(row) for row in range(ROWS)]


@pytest.mark.parametrize("kind", STATED)
def test_comments_and_metadata_name_joints(read, kind):
    require_alphabetical(read(STATED[kind], parameters=ESTIMATED))


@pytest.mark.parametrize("header", HEADERS)
def test_headers_with_index_and_name(read, header):
    require_alphabetical(read(PLAIN.replace("q1,q2,q3", header.format(*ALPHABETICAL)), parameters=ESTIMATED))


@pytest.mark.parametrize("header", TEXT_HEADERS)
@pytest.mark.parametrize("order", [fixed, changing])
def test_columns_of_names_with_other_headers(read, header, order):
    """Texts that are joints name the places in their order, whatever the header."""
    lines = [f"t,{header},{','.join(f'{one}{k}' for one in ('q', 'qd', 'tau') for k in range(3))}"]
    for row in range(ROWS):
        numbers = [f"{value(field, joint, row):.4f}" for field in FIELDS for joint in order(row)]
        lines.append(",".join([f"{time(row) * 1e-9:.9f}", *order(row), *numbers]))
    require_expected(read("\n".join(lines)))


def test_an_array_whose_names_are_used_is_read(read):
    recording = read(NUMBERS | {"joint_names": np.array(LIST), "limits": np.ones(3)}, parameters=ESTIMATED)
    (note,) = [one.text for one in recording.findings if one.text.startswith("not read")]
    assert note == "not read: limits."


UNRELATED = {
    "prose": f"# elbow: greased, then: shoulder\n{PLAIN}",
    "a name": f"# name: run_17\n{PLAIN}",
    "prose about an order": f"# order: first elbow then wrist\n{PLAIN}",
    "the joint that moves": PLAIN.replace("\n", ",elbow\n").replace("q3,elbow", "q3,joint", 1),
    "joints that move": PLAIN.replace("\n", ',"elbow, wrist"\n').replace('q3,"elbow, wrist"', "q3,moving", 1),
    "prose with names": f"# shoulder and elbow were cold, wrist = warm\n{PLAIN}",
    "units below the header": PLAIN.replace("\n", "\ns,rad,rad,rad\n", 1),
    "a number of joints": f"# joints: 3\n{PLAIN}",
    **{
        comment: f"# {comment}\n{PLAIN}"
        for comment in (
            "joint units: rad, rad, rad",
            "joint types: revolute, revolute, prismatic",
            "joints: all three measured",
            "joints: rad, rad, rad",
            "joints: left arm only",
            "joints: calibrated, homed, enabled",
            "joints were measured: yes, yes, no",
            "joints: shoulder to wrist",
            "joint names: see the URDF",
            "joint: elbow",
            "joint moved: elbow",
            "moved joints: elbow, wrist",
            "operator: hip, knee, toe",
            "limits: wrist 2.0, elbow 3.1, shoulder 5",
            "torque limits: wrist=28, elbow=150, shoulder=150",
            'home: {"wrist": 0.3, "elbow": -0.2, "shoulder": 1.0}',
            "wrist and elbow were cold, shoulder = warm",
            "elbow was greased before shoulder and wrist",
            "elbow: greased\n# wrist: cold\n# shoulder: new",
        )
    },
    "metadata of a run": in_parquet(name="run one two"),
    "metadata of types": in_parquet(joint_names=["revolute", "revolute", "prismatic"]),
    "array of a run": NUMBERS | {"name": np.array("run one two")},
    "text of a trial": PLAIN.replace("t,", "name,t,", 1).replace("\n", "\ntrial one two,")[: -len("trial one two,")],
    "joints twice in a row": PLAIN.replace("t,", "a,b,c,t,", 1).replace("\n", "\nelbow,elbow,wrist,")[
        : -len("elbow,elbow,wrist,")
    ],
    "names of something else": PLAIN.replace("t,", "name,t,", 1).replace("\n", "\nrun_17,")[: -len("run_17,")],
}


def by_joint(text):
    """Return the lines of a long table in the order of joints."""
    header, *lines = text.splitlines()
    return "\n".join([header, *sorted(lines, key=lambda line: line.split(",")[1])])


CONTRADICTIONS = {
    "comment and header": (
        "# joints: elbow, shoulder, hip\nt,q_shoulder,q_elbow,q_wrist\n0,1,2,3\n",
        "headers name the joints shoulder, elbow, wrist, but the comment in line 1 names elbow, shoulder, hip: wrist",
    ),
    "comment and rows": (
        "# joints: shoulder, elbow, wrist\n" + rostopic(fixed),
        "comment in line 1 names the joints shoulder, elbow, wrist, but 'field.name.*' names elbow, shoulder, wrist",
    ),
    "rows and header": (
        't,name,q_shoulder,q_elbow,q_wrist\n0,"[shoulder, elbow, wrist_2]",1,2,3\n',
        "headers name the joints shoulder, elbow, wrist, but 'name' names shoulder, elbow, wrist_2: wrist is not",
    ),
    "names twice": (f"# joints: elbow, elbow, wrist\n{PLAIN}", "comment in line 1 names the joint 'elbow' twice"),
    "too few names": (f"# joints: elbow, wrist\n{PLAIN}", "has 3 columns, but the comment in line 1 names 2 joints"),
    "two comments": (
        f"# columns: t, elbow, shoulder, wrist\n# motors: shoulder, elbow, wrist\n{PLAIN}",
        r"line 1 \('columns: t, elbow, shoulder, wrist'\) has the joints elbow, shoulder, wrist, but the comment in line 2 "
        r"\('motors: shoulder, elbow, wrist'\) has shoulder, elbow, wrist. Say which by `joints`",
    ),
    "two arrays": (
        NUMBERS | {"joint_names": np.array(LIST), "order": np.array(JOINTS)},
        r"array 'joint_names' \(.*\) has the joints elbow, shoulder, wrist, but array 'order' ",
    ),
    "two metadata": (in_parquet(joints=LIST, order=list(JOINTS)), "metadata 'joints' .* but metadata 'order' "),
    "two columns of names": (
        "t,a,b,q1,q2,q3\n0,elbow,wrist,1,2,3\n",
        "'q{joint}' has 3 columns, but 2 columns name joints: a, b. Say which",
    ),
    "identifiers of other joints": (
        f"# joint names: left_j1 left_j2 left_j3\n{PLAIN}",
        "names 3 joints: left_j1, left_j2, left_j3, none",
    ),
    "other names": (
        f"# joints: hip, knee, toe\n{PLAIN}",
        "names 3 joints: hip, knee, toe, none of which is among the joints of the model: shoulder, elbow, wrist",
    ),
    "other names in rows": (
        rostopic(lambda row: ("hip", "knee", "toe")),
        "rows name hip, knee, toe, none of which the robot has. Its joints are shoulder, elbow, wrist",
    ),
    "names twice in rows": (rostopic(lambda row: ("elbow", "elbow", "wrist")), "'elbow' is listed twice"),
    "objects": (NUMBERS | {"joint_names": np.array(LIST, object)}, "'joint_names' holds Python objects"),
    "metadata": (
        in_parquet(joint_names=["hip", "knee", "toe"]),
        "'joint_names' names 3 joints: hip, knee, toe, none",
    ),
    "numbers without names": (
        rostopic(fixed).replace("field.position2", "field.position7"),
        r"has the numbers 0, 1, 7, but the joints' names are in 'field.name.*' with the numbers 0, 1, 2",
    ),
    "numbers in place of names": (
        "t,joint,position,velocity\n0,0,1,1\n0,1,1,1\n0,2,1,1\n",
        "'joint' numbers the joints of rows. Write their names in its place",
    ),
    "two of three fields": (
        "1660000000,0,base,shoulder,elbow,wrist,1,2,3,4,5,6\n",
        "no header and two numbers for each of 3 names: position, and velocity or effort",
    ),
    "names below a header with names": (
        "# joints: hip, elbow\nt,q_shoulder,q_elbow,q_wrist\n0,1,2,3\n",
        "headers name the joints shoulder, elbow, wrist, but the comment in line 1 names hip, elbow: shoulder, wrist",
    ),
    "order of joints": (
        by_joint(long_table(fixed)),
        "in the order of joints, 'elbow' before 'shoulder'; .* Sort the rows",
    ),
}


@pytest.mark.parametrize("kind", CONTRADICTIONS)
def test_contradictions_are_errors(tmp_path, read, kind):
    content, message = CONTRADICTIONS[kind]
    with pytest.raises(dd.InputError, match=message):
        if not len(read(content)):
            raise dd.InputError("; ".join(map(str, read(content).findings)))


@pytest.mark.parametrize("kind", UNRELATED)
def test_what_names_no_joints_is_ignored(read, kind):
    recording = read(UNRELATED[kind], parameters=ESTIMATED)
    np.testing.assert_allclose(recording.q[-1] - np.floor(recording.q[-1]), [0.1, 0.2, 0.3], rtol=0, atol=1e-9)


def test_texts_beside_headers_with_names(read):
    """A column that has the name of one joint contradicts no header."""
    text = "t,worst joint,q_shoulder,q_elbow,q_wrist\n" + "".join(f"{k},elbow,{k},1,2\n" for k in range(ROWS))
    recording = read(text, parameters=ESTIMATED)
    assert recording.q[-1].tolist() == [ROWS - 1, 1, 2]
    for name in ("name", "label"):
        text = f"t,{name},q1\n" + "".join(f"{k},run,{k}\n" for k in range(ROWS))
        assert len(read(text, joints=("shoulder",), parameters=ESTIMATED)) == ROWS - 1


def test_a_map_has_priority_and_says_so(read):
    """The order of a map stands, whatever the data name; a map that gives no order leaves names to the data."""
    listed = {"joints": ["wrist", "elbow", "shoulder"]}
    for content, where in (
        (
            rostopic(changing),
            r"'field.name\*' names elbow, shoulder, wrist in the first row. Names in rows are not used",
        ),
        (f"{COMMENTS[0]}\n{PLAIN}", "the comment in line 1 names elbow, shoulder, wrist and is not used"),
    ):
        recording = read(content, listed, parameters=ESTIMATED)
        (note,) = [one.text for one in recording.findings if one.text.startswith("joints: ")]
        assert (
            note.startswith("joints: the map of columns gives wrist, elbow, shoulder; ")
            and where.replace("\\", "") in note
        )
    text = "t,q_shoulder,q_elbow,q_wrist\n" + "".join(f"{k},{k},1,2\n" for k in range(ROWS))
    recording = read(text, {"time": "t", "position": ["q_elbow", "q_shoulder", "q_wrist"]}, parameters=ESTIMATED)
    assert recording.q[-1].tolist() == [1, ROWS - 1, 2]
    note = (
        "joints: the map of columns gives 'q_elbow' to shoulder, 'q_shoulder' to elbow, though the headers name others."
    )
    assert note in [one.text for one in recording.findings]
    first = [value("position", joint, 5) for joint in changing(5)]
    recording = read(rostopic(changing), listed)
    np.testing.assert_allclose(recording.q[-1], first[::-1], atol=1e-12)
    columns = {"position": [7, 8, 9], "velocity": [10, 11, 12], "time": "field.header.stamp"}
    np.testing.assert_allclose(read(rostopic(changing), columns).q[-1], first, atol=1e-12)
    pattern = {field: f"field.{field}{{joint}}" for field in FIELDS} | {"time": "field.header.stamp"}
    require_expected(read(rostopic(changing), pattern))


def test_a_scale_by_joint_follows_the_names_in_rows(read):
    recording = read(rostopic(changing), {"scale": {"effort": {"elbow": 2, "*": 0.5}, "velocity": 3}})
    np.testing.assert_allclose(recording.tau, expected("effort") * [0.5, 2, 0.5], atol=1e-12)
    np.testing.assert_allclose(recording.qd, expected("velocity") * 3, atol=1e-12)
    with pytest.raises(dd.InputError, match="scale: effort has nothing for 'shoulder', which rows name"):
        read(rostopic(changing), {"scale": {"effort": {"elbow": 2}}})


def test_values_without_a_name_are_counted(read):
    text = rostopic(fixed).replace("elbow", "", 1)
    recording = read(text)
    assert "line 2: values without the name of a joint (position 0.1): 3 values left out" in recording.findings[0].text
    assert recording.counts["incomplete"] == 1 and len(recording) == ROWS - 1


@pytest.mark.parametrize("writer", ["rostopic", "bagpy", "long", "ros2 topic echo --csv", "npz", "lists in Parquet"])
def test_a_map_of_names_applies_to_names_in_rows(tmp_path, read, writer):
    """Names of the table are mapped to those of the robot; without a map the error has both, and proposes one."""

    def prefixed(row):
        return tuple(f"left_{joint}" for joint in changing(row))

    def own(row):
        return changing(row)

    content = WRITERS[writer](own)
    if isinstance(content, str):
        for joint in JOINTS:
            content = content.replace(joint, f"left_{joint}")
    elif isinstance(content, dict):
        content["names"] = np.array([prefixed(row) for row in range(ROWS)])
    else:
        names = pa.array([list(prefixed(row)) for row in range(ROWS)])
        content = content.set_column(content.schema.get_field_index("name"), "name", names)
    with pytest.raises(
        dd.InputError, match=r"rows name left_.*none of which the robot has.*--joint-names 'left_\*=\*'"
    ):
        read(content)
    (path,) = tmp_path.iterdir()
    require_expected(dd.read_recording(path, arm(*JOINTS), parameters=LOOSE, joint_names={"left_*": "*"}))
