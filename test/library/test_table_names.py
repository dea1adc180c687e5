# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint names in the data of tables: in rows, comments and metadata. The joints are those that the data name."""

import json
from functools import cache

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import diag_dynamics as dd
from bags import arm

JOINTS = ("shoulder", "elbow", "wrist")
"""Of the robot, from the base to the tip."""
LIST = sorted(JOINTS)
ROWS = 6
FIELDS = ("position", "velocity", "effort")
LOOSE = {
    "joint_timeout": 0.0,
    "stuck_timeout": 0.0,
    "plausibility.jump": 0.0,
    "plausibility.position": 0.0,
}
ESTIMATED = LOOSE | {"missing_velocity": "estimate"}
robot = cache(arm)


def value(field, joint, row):
    """Return a number that tells its quantity, joint and row."""
    return FIELDS.index(field) + 0.1 * JOINTS.index(joint) + 0.001 * row if joint in JOINTS else 9.0


def time(row):
    """Return the time of a row [ns]."""
    return 1_660_000_000_000_000_000 + 10_000_000 * row


def expected(field):
    """Return the numbers of all rows by the robot's joints."""
    return np.array([[value(field, joint, row) for joint in JOINTS] for row in range(ROWS)])


ORDERS = {
    "alphabetical": lambda row: tuple(LIST),
    "changing": lambda row: tuple(np.roll(LIST, row).tolist()),
    "with joints of another robot": lambda row: ("gripper", *np.roll(LIST, row).tolist(), "lamp")[
        :: 1 - row % 2 * 2
    ],
}
FIXED, CHANGING, _ = ORDERS.values()

# --- Writers: each makes the content of a file of the joints of each row ---


def rows_of(order):
    """Return time, names, and the numbers by quantity as texts of each row."""
    rows = [(row, order(row)) for row in range(ROWS)]
    return [
        (
            time(row),
            names,
            [[f"{value(field, joint, row):.4f}" for joint in names] for field in FIELDS],
        )
        for row, names in rows
    ]


def in_lines(header, rows, separator=","):
    """Return the text of a table."""
    return "".join(separator.join(map(str, line)) + "\n" for line in (header.split(","), *rows))


BEGINS = {
    "%time,field.header.seq,field.header.stamp,field.header.frame_id": lambda stamp: [
        stamp + 77,
        5,
        stamp,
        "",
    ],
    "Time": lambda stamp: [f"{stamp * 1e-9:.9f}"],
    "sec,nanosec,frame_id": lambda stamp: [*divmod(stamp, 10**9), "base"],
}
ECHO = next(iter(BEGINS))


def rostopic(order, separator=",", name="field.{}{}", quote="", begin=ECHO, listed=False):
    """Return what `rostopic echo -p` writes; with other options, what others make of it."""
    width, lines = max(len(names) for _, names, _ in rows_of(order)), []
    for stamp, names, numbers in rows_of(order):
        names = [f'"{list(names)}"'] if listed else [f"{quote}{joint}{quote}" for joint in names]
        lines.append(BEGINS[begin](stamp) + names + [""] * (0 if listed else width - len(names)))
        for cells in numbers:
            lines[-1] += [*cells, *[""] * (width - len(cells))]
    header = ["name"] if listed else [name.format("name", k) for k in range(width)]
    header += [name.format(field, k) for field in FIELDS for k in range(width)]
    return in_lines(",".join([begin, *header]), lines, separator)


def bagpy(order, numbers="({})", names="['{}']", between="', '", comma=", ", separator=","):
    """Return what bagpy writes where lists stay together."""
    lines = []
    for stamp, joints, values in rows_of(order):
        cells = [
            names.format(between.join(joints)),
            *(numbers.format(comma.join(one)) for one in values),
        ]
        lines.append([f"{stamp * 1e-9:.9f}", "base", *(f'"{one}"' for one in cells)])
    return in_lines("Time,header.frame_id,name,position,velocity,effort", lines, separator)


def long_table(order, header="time,joint,position,velocity,effort", by_joint=False):
    """Return a row for each joint and time."""
    rows = [
        [f"{stamp * 1e-9:.9f}", *one]
        for stamp, names, numbers in rows_of(order)
        for one in zip(names, *numbers, strict=True)
    ]
    return in_lines(header, sorted(rows, key=lambda row: row[1]) if by_joint else rows)


def arrays(order, kind=str):
    """Return arrays with a row of names for each time."""
    lists = {
        field: [[value(field, j, row) for j in order(row)] for row in range(ROWS)]
        for field in FIELDS
    }
    names = np.array([order(row) for row in range(ROWS)], kind)
    return {"time": np.array([time(row) for row in range(ROWS)], "M8[ns]"), "names": names} | lists


def in_parquet(order):
    """Return a table of lists, as messages have them."""
    content = arrays(order)
    return pa.table(content | {"names": content["names"].tolist()})


def in_columns_of_parquet(order, kind):
    """Return a table with a column for each name and number."""
    content = arrays(order)
    table = {"stamp": content["time"]}
    for k, texts in enumerate(content["names"].T.tolist()):
        table[f"name_{k}"] = pa.array(texts, kind)
        table |= {f"{field}_{k}": [one[k] for one in content[field]] for field in FIELDS}
    return pa.table(table)


WRITERS = {
    "rostopic": rostopic,
    "rostopic with CR LF": lambda order: rostopic(order).replace("\n", "\r\n"),
    "rostopic in capitals": lambda order: rostopic(order, name="FIELD.{}{}").replace(
        "field.name", "FIELD.NAME"
    ),
    "rostopic with single quotes": lambda order: rostopic(order, quote="'"),
    "brackets": lambda order: rostopic(order, name="/joint_states/{}[{}]", begin="Time"),
    "bagpy": bagpy,
    "bagpy of numbers": lambda order: rostopic(order, name="{}_{}", begin="Time", listed=True),
    "arrays of ROS 2": lambda order: bagpy(order, numbers="array('d', [{}])"),
    "arrays of numpy": lambda order: bagpy(order, "[{}]", "['{}']", "' '", " "),
    "names with commas": lambda order: bagpy(order, "[{}]", "{}", ","),
    "names with blanks": lambda order: bagpy(order, "[{}]", "{}", " "),
    "long": long_table,
    "long with other headers": lambda order: long_table(
        order, "Stamp,Joint Name,Pos [rad],Vel [rad/s],Tau [Nm]"
    ),
    "long by content": lambda order: long_table(order, "t,axis,q,qd,tau"),
    "ros2 topic echo --csv": lambda order: rostopic(order, begin="sec,nanosec,frame_id").partition(
        "\n"
    )[2],
    "lists in Parquet": in_parquet,
    "columns in Parquet": lambda order: in_columns_of_parquet(order, pa.string()),
    "npz": arrays,
    "bytes in npz": lambda order: arrays(order, bytes),
}


@pytest.fixture
def read(tmp_path):
    """Write a content and read it; return the recording."""

    def run(content, columns=None, joints=JOINTS, parameters=LOOSE, **options):
        path = tmp_path / "table"
        if isinstance(content, dict):
            with open(path, "wb") as file:
                np.savez(file, **content)
        elif isinstance(content, pa.Table):
            parquet.write_table(content, path, row_group_size=4)
        else:
            path.write_bytes(content.encode())
        return dd.read_recording(path, robot(*joints), columns, parameters=parameters, **options)

    return run


def texts_of(recording):
    """Return the texts of all findings."""
    return [one.text for one in recording.findings]


def require_expected(recording):
    """Require the numbers of all rows, each at its joint."""
    assert [one.text for one in recording.findings if one.cause != "note"] == []
    for field, values in (
        ("position", recording.q),
        ("velocity", recording.qd),
        ("effort", recording.tau),
    ):
        np.testing.assert_allclose(values, expected(field), rtol=0, atol=1e-12)
    assert np.diff(recording.stamp).tolist() == pytest.approx([10_000_000] * (ROWS - 1), abs=300)


def require_digits(recording, *digits):
    """Require the first decimal of each joint's last position."""
    np.testing.assert_allclose(
        recording.q[-1] - np.floor(recording.q[-1]), np.array(digits) / 10, rtol=0, atol=1e-9
    )


# --- Rows ---


@pytest.mark.parametrize("order", ORDERS.values(), ids=ORDERS)
@pytest.mark.parametrize("writer", WRITERS)
def test_rows_name_their_joints(read, writer, order):
    require_expected(read(WRITERS[writer](order)))


@pytest.mark.parametrize("writer", [rostopic, bagpy, long_table])
def test_joints_in_messages_of_their_own(read, writer):
    """Rows of fewer joints are messages of fewer joints: a state is there when all have come."""
    recording = read(writer(lambda row: ("wrist",) if row % 2 else ("elbow", "shoulder")))
    assert recording.counts["incomplete"] == 1 and len(recording) == ROWS - 1
    last = {"wrist": [1, 1, 3, 3, 5], "elbow": [0, 2, 2, 4, 4], "shoulder": [0, 2, 2, 4, 4]}
    for joint, positions in zip(JOINTS, recording.q.T, strict=True):
        np.testing.assert_allclose(
            positions, [value("position", joint, row) for row in last[joint]], atol=1e-12
        )


def test_a_joint_twice_at_one_time_is_rejected(read):
    lines = long_table(FIXED).splitlines()
    content = "\n".join([lines[0], *(f"0{line[line.index(',') :]}" for line in lines[1:])])
    assert "'elbow' is listed twice" in " ".join(texts_of(read(content)))


@pytest.mark.parametrize("order", [FIXED, CHANGING])
@pytest.mark.parametrize(
    "header",
    [
        "first_joint,second_joint,third_joint",
        "a,b,c",
        "name0,name1,last",
        "q1_name,q2_name,q3_name",
    ],
)
def test_columns_of_names_with_other_headers(read, header, order):
    """Texts that are joints name the places in their order, whatever the header."""
    lines = [
        [f"{stamp * 1e-9:.9f}", *names, *np.ravel(numbers)]
        for stamp, names, numbers in rows_of(order)
    ]
    columns = ",".join(f"{one}{k}" for one in ("q", "qd", "tau") for k in range(3))
    require_expected(read(in_lines(f"t,{header},{columns}", lines)))


STAMPS = {
    "bagpy": (
        "Time,header.seq,header.stamp.secs,header.stamp.nsecs",
        "{second}.9,{row},{second},{rest}",
    ),
    "bag2csv": ("rosbagTimestamp,header,seq,stamp,secs,nsecs", "{row}7,,{row},,{second},{rest}"),
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
    prefix, lines = "/js/" if kind == "PlotJuggler" else "", []
    for row, (stamp, names, numbers) in enumerate(rows_of(CHANGING)):
        first = begin.format(second=stamp // 10**9, rest=stamp % 10**9, row=row)
        lines.append([first, *(f'"[{", ".join(one)}]"' for one in (names, *numbers))])
    recording = read(
        in_lines(",".join([header, *(f"{prefix}{one}" for one in ("name", *FIELDS))]), lines)
    )
    require_expected(recording)
    assert recording.stamp.tolist() == [time(row) for row in range(ROWS)]


def test_values_without_a_name_are_counted(read):
    recording = read(rostopic(FIXED).replace("elbow", "", 1))
    assert (
        "line 2: values without the name of a joint (position 0.1): 3 values omitted"
        in texts_of(recording)[0]
    )
    assert recording.counts["incomplete"] == 1 and len(recording) == ROWS - 1


def test_velocities_of_some_joints_have_the_numbers_of_positions(read):
    text = "t,q1,q2,q3,qd3,qd1\n" + "".join(f"{k},0,0,0,7,5\n" for k in range(ROWS))
    recording = read(text, parameters=ESTIMATED)
    assert recording.qd[-1].tolist() == [5, 0, 7]
    assert "velocity: 'qd{joint}' of 3 joints, none for elbow." in texts_of(recording)


# --- Comments, metadata and headers ---

PLAIN = "t,q1,q2,q3\n" + "".join(f"{row},{row}.1,{row}.2,{row}.3\n" for row in range(ROWS))
NUMBERS = {"t": np.arange(ROWS) * 1.0, "q": np.arange(ROWS)[:, None] + [0.1, 0.2, 0.3]}
COMMENTS = [
    "# joints: elbow, shoulder, wrist",
    "% joint order (as sent): elbow shoulder wrist",
    '# {"robot": "arm", "joint_names": ["elbow", "shoulder", "wrist"], "rate": 100}',
    "# robot=arm joints=elbow,shoulder,wrist rate=100",
    "# q1 = elbow, q2 = shoulder, q3 = wrist",
    "# 0: elbow, 1: shoulder, 2: wrist (recorded at 12:30)",
    "# joint 1: elbow\n# joint 3: wrist\n# joint 2: shoulder",
    "# q[0] -> elbow\n# q[1] -> shoulder\n# q[2] -> wrist",
    "# joints:\n#   - elbow\n#   - shoulder\n#   - wrist\n# recorded by hand",
    "# arm: 3\n# joints:\n# elbow, shoulder, wrist",
    "# columns: t, elbow, shoulder, wrist",
    "# [1] shoulder [0] elbow [2] wrist",
    "# (1) elbow (5) wrist (2) shoulder",
    "# positions of elbow, shoulder and wrist",
    "# t elbow_pos shoulder_pos wrist_pos",
    "# joint 1 is shoulder, joint 0 is elbow, joint 2 is wrist",
    "# shoulder is column 2, elbow is column 1, wrist is column 3",
    "# joints: elbow, shoulder, wrist\n# limits: wrist 2.0, shoulder 3.1, elbow 5",
]
HEADS = [
    "q0 ({0}),q1 ({1}),q2 ({2})",
    "q0_{0},q1_{1},q2_{2}",
    "q0 ({0}) [rad],q1 ({1}) [rad],q2 ({2}) [rad]",
    "j1/{0}/position,j2/{1}/position,j3/{2}/position",
]


def with_metadata(**metadata):
    """Return a table with metadata in its schema."""
    table = pa.table({"t": NUMBERS["t"], "q": NUMBERS["q"].tolist()})
    return table.replace_schema_metadata({key: json.dumps(one) for key, one in metadata.items()})


def with_column(name, text):
    """Return the plain table with a column of the same text in each row."""
    header, *lines = PLAIN.splitlines()
    return "\n".join([f"{name},{header}", *(f'"{text}",{line}' for line in lines)])


STATED = {
    **{comment: f"{comment}\n{PLAIN}" for comment in COMMENTS},
    **{header: PLAIN.replace("q1,q2,q3", header.format(*LIST)) for header in HEADS},
    "comment below the header": PLAIN.replace("\n", f"\n{COMMENTS[0]}\n", 1),
    "names below the header": PLAIN.replace("\n", "\n,elbow,shoulder,wrist\n", 1),
    "metadata": with_metadata(joint_names=LIST),
    "metadata as text": with_metadata(joints="elbow, shoulder, wrist"),
    "metadata by index": with_metadata(order={"shoulder": 1, "elbow": 0, "wrist": 2}),
    "attributes of pandas": with_metadata(PANDAS_ATTRS={"joint_names": LIST}),
    "two arrays": NUMBERS | {"joint_names": np.array(LIST), "dofs": np.array(LIST)},
    "array of bytes": NUMBERS | {"names": np.array(LIST, bytes)},
    "array of one text": NUMBERS | {"joints": np.array("elbow, shoulder, wrist")},
}
SENTENCES = [
    *(
        "elbow: greased, then: shoulder",
        "name: run_17",
        "order: first elbow then wrist",
        "joints: 3",
    ),
    *(
        "shoulder and elbow were cold, wrist = warm",
        "joints: rad, rad, rad",
        "joints: all three measured",
    ),
    *(
        "joint types: revolute, revolute, prismatic",
        "joints: calibrated, homed, enabled",
        "joint: elbow",
    ),
    *(
        "joint names: see the URDF",
        "moved joints: elbow, wrist",
        "limits: wrist 2.0, elbow 3.1, shoulder 5",
    ),
    *(
        "torque limits: wrist=28, elbow=150, shoulder=150",
        "elbow was greased before shoulder and wrist",
    ),
    *(
        'home: {"wrist": 0.3, "elbow": -0.2, "shoulder": 1.0}',
        "elbow: greased\n# wrist: cold\n# shoulder: new",
    ),
]
UNRELATED = {
    "joints that move": with_column("moving", "elbow, wrist"),
    "the joint that moves": with_column("joint", "elbow"),
    "units below the header": PLAIN.replace("\n", "\ns,rad,rad,rad\n", 1),
    "metadata of types": with_metadata(
        name="run one two", joint_names=["revolute", "revolute", "prismatic"]
    ),
    "array of a run": NUMBERS | {"name": np.array("run one two")},
    "text of a trial": with_column("name", "trial one two"),
    "joints twice in a row": with_column("a,b,c", 'elbow","elbow","wrist'),
    **{sentence: f"# {sentence}\n{PLAIN}" for sentence in SENTENCES},
}


@pytest.mark.parametrize("kind", STATED)
def test_comments_metadata_and_headers_name_joints(read, kind):
    require_digits(read(STATED[kind], parameters=ESTIMATED), 2, 1, 3)


@pytest.mark.parametrize("kind", UNRELATED)
def test_what_names_no_joints_is_ignored(read, kind):
    require_digits(read(UNRELATED[kind], parameters=ESTIMATED), 1, 2, 3)


def test_a_column_that_has_the_name_of_one_joint_contradicts_no_header(read):
    text = "t,worst joint,q_shoulder,q_elbow,q_wrist\n" + "".join(
        f"{k},elbow,{k},1,2\n" for k in range(ROWS)
    )
    assert read(text, parameters=ESTIMATED).q[-1].tolist() == [ROWS - 1, 1, 2]


# --- Contradictions ---

TWO = "# columns: t, elbow, shoulder, wrist\n# motors: shoulder, elbow, wrist\n"
HIP = ["hip", "knee", "toe"]
CONTRADICTIONS = [
    *(
        (
            f"# joints: {names}\n{PLAIN}",
            f"line 1 names . joints: {names}; expected a different one for each of 3 columns",
        )
        for names in ("elbow, elbow, wrist", "elbow, wrist")
    ),
    (TWO + PLAIN, r"line 1 has the joints elbow, .* line 2 has the joints shoulder, elbow"),
    (
        with_metadata(joints=LIST, order=list(JOINTS)),
        "metadata 'joints' has .* but metadata 'order' has .*`joints`",
    ),
    ("t,a,b,q1,q2,q3\n0,elbow,wrist,1,2,3\n", "has 3 columns, but 2 columns name joints: a, b"),
    (
        f"# joint names: left_j1 left_j2 left_j3\n{PLAIN}",
        "left_j1, left_j2, left_j3, none of which is among",
    ),
    (
        f"# joints:\n# - hip\n# - knee\n# - toe\n{PLAIN}",
        "hip, knee, toe, none of which .* the model: shoulder, elbow",
    ),
    (with_metadata(joint_names=HIP), "'joint_names' names 3 joints: hip, knee, toe, none"),
    (rostopic(lambda row: HIP), "rows name hip, knee, toe; expected joints of the robot: shoulder"),
    (rostopic(lambda row: ("elbow", "elbow", "wrist")), "'elbow' is listed twice"),
    (
        NUMBERS | {"joint_names": np.array(LIST, object)},
        r"'joint_names' cannot be read: .* dtype=str\)",
    ),
    (
        rostopic(FIXED).replace("position2", "position7"),
        "has the numbers 0, 1, 7, but 'field.name.' 0, 1, 2",
    ),
    ("t,joint,position\n0,0,1\n0,1,1\n0,2,1\n", "has 1 columns, but there are 3 joints"),
    (long_table(FIXED, by_joint=True), "in the order of joints, 'elbow' before 'shoulder'. Sort"),
]


@pytest.mark.parametrize(("content", "message"), CONTRADICTIONS, ids=lambda one: str(one)[:40])
def test_contradictions_are_errors(read, content, message):
    with pytest.raises(dd.InputError, match=message):
        if not len(read(content)):
            raise dd.InputError("; ".join(texts_of(read(content))))


# --- Maps ---


@pytest.mark.parametrize(
    ("content", "where"),
    [(rostopic(CHANGING), "'field.name*' in the first row"), (f"{COMMENTS[0]}\n{PLAIN}", "line 1")],
)
def test_joints_of_a_map_have_priority_with_a_note(read, content, where):
    recording = read(content, {"joints": ["wrist", "elbow", "shoulder"]}, parameters=ESTIMATED)
    assert f"joints: those of the column map, not elbow, shoulder, wrist of {where}." in texts_of(
        recording
    )
    assert any("of wrist, elbow, shoulder" in text for text in texts_of(recording))
    first = (
        [0.3, 0.2, 0.1]
        if content.startswith("#")
        else [value("position", joint, 5) for joint in CHANGING(5)][::-1]
    )
    np.testing.assert_allclose(recording.q[-1] % 1, first, atol=1e-9)


def test_columns_of_a_map_have_priority(read):
    """A map that gives no order leaves names to the data."""
    text = "t,q_shoulder,q_elbow,q_wrist\n" + "".join(f"{k},{k},1,2\n" for k in range(ROWS))
    recording = read(
        text, {"time": "t", "position": ["q_elbow", "q_shoulder", "q_wrist"]}, parameters=ESTIMATED
    )
    assert recording.q[-1].tolist() == [1, ROWS - 1, 2]
    assert "position: the list q_elbow, q_shoulder, q_wrist of shoulder, elbow, wrist." in texts_of(
        recording
    )
    columns = {"position": [7, 8, 9], "velocity": [10, 11, 12], "time": "field.header.stamp"}
    first = [value("position", joint, 5) for joint in CHANGING(5)]
    np.testing.assert_allclose(read(rostopic(CHANGING), columns).q[-1], first, atol=1e-12)
    pattern = {field: f"field.{field}{{joint}}" for field in FIELDS} | {
        "time": "field.header.stamp"
    }
    require_expected(read(rostopic(CHANGING), pattern))
    header, _, lines = rostopic(CHANGING, separator=";").partition("\n")
    require_expected(read(f"{header}\n{lines.replace('.', ',')}", {"decimal": ","}))
    require_digits(
        read(f"joints: elbow, shoulder, wrist\n{PLAIN}", {"skip": 1}, parameters=ESTIMATED), 2, 1, 3
    )


def test_a_scale_of_rows_that_name_joints_is_one_number(read):
    recording = read(rostopic(CHANGING), {"scale": {"velocity": 3}})
    np.testing.assert_allclose(recording.qd, expected("velocity") * 3, atol=1e-12)
    for scale in ({"elbow": 2, "*": 1}, [1, 2, 3]):
        with pytest.raises(dd.InputError, match=r"scale: effort is .*; expected one number"):
            read(rostopic(CHANGING), {"scale": {"effort": scale}})


@pytest.mark.parametrize("writer", ["rostopic", "bagpy", "long", "ros2 topic echo --csv", "npz"])
def test_a_map_of_names_applies_to_names_in_rows(read, writer):
    """Names of the table are mapped to those of the robot; without a map the error has both, and proposes one."""
    content = WRITERS[writer](CHANGING)
    if isinstance(content, str):
        for joint in JOINTS:
            content = content.replace(joint, f"left_{joint}")
    else:
        content["names"] = np.char.add("left_", content["names"])
    with pytest.raises(
        dd.InputError, match=r"name left_.*expected joints of the robot.*--joint-names 'left_\*=\*'"
    ):
        read(content)
    require_expected(read(content, joint_names={"left_*": "*"}))
    require_expected(read(content, columns={"joints": {"left_*": "*"}}))
    with pytest.raises(
        dd.InputError, match="has joint_names and a mapping joints; expected one of them"
    ):
        read(content, columns={"joints": {"left_*": "*"}, "joint_names": {"a": "b"}})
