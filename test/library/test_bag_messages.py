# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of bags: encodings, names of types, topics, and names of joints.

Files are written by the libraries mcap and rosbags.
"""

import re
import shlex
import sqlite3

import numpy as np
import pytest
from mcap.writer import Writer

import diag_dynamics as dd
from bags import (
    JAZZY,
    JOINT_STATE,
    LZ4,
    NO_INDEX,
    NOETIC,
    ODOMETRY,
    PLAIN,
    ZSTD,
    Message,
    arm,
    description,
    file_of,
    numbered,
    odometry,
    of_ros1,
    read,
    refused,
    serialized,
    unread,
    urdf_of,
    write_mcap,
    write_ros1,
    write_rosbag2,
)
from commands import quiet_compiler  # noqa: F401 (a fixture of all tests here)
from hostile import MS, START


def assert_same_states(found, expected):
    """Assert that two recordings have the same states to the last bit."""
    for ours, theirs in zip(found.states.columns(), expected.states.columns(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


# --- Encodings ---


IN_ROS1 = {"encoding": "ros1", "schema": "ros1msg"}
MD5 = NOETIC.generate_msgdef(JOINT_STATE, ros_version=1)[1]


@pytest.mark.parametrize(
    ("compression", "md5", "options"),
    [
        (ZSTD, None, {}),
        (LZ4, MD5, {"index_types": NO_INDEX}),
        (PLAIN, "*", {"use_chunking": False}),
    ],
)
def test_ros1_in_mcap(tmp_path, compression, md5, options):
    """`mcap convert` keeps messages and types of a ROS 1 bag; MD5 sums may be unknown."""
    options |= IN_ROS1 | {"metadata": {"md5sum": md5} if md5 else {}}
    messages = of_ros1(numbered(60, topics=("/a", "/b")))
    path = write_mcap(tmp_path / "x.mcap", messages, compression, **options)
    for k, topic in enumerate(("/a", "/b")):
        assert read(path, topic) == (list(range(k, 60, 2)), [])


def test_a_robot_of_ros1_in_mcap(tmp_path):
    """Its description and its odometry are read; the states are those of the same messages of ROS
    2.
    """
    stamps = [START + k * MS for k in range(20)]
    inertial = (
        '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        "</inertial>"
    )
    sent = [
        description(
            urdf_of("a").replace('<link name="base"/>', f'<link name="base">{inertial}</link>')
        )
    ]
    for k, stamp in enumerate(stamps):
        pose = [0.1 * k, 0, 0, 0, 0, 0, 1]
        twist = [0.1, 0, 0, 0, 0, 0.2]
        sent.append(Message("/odom", stamp, odometry(stamp, "base", pose, twist), ODOMETRY))
        sent.append(
            Message("/joint_states", stamp, serialized(stamp, ["a"], [0.01 * k], [0.1], [2.0]))
        )
    new = write_mcap(tmp_path / "new.mcap", sent)
    old = write_mcap(tmp_path / "old.mcap", of_ros1(sent), **IN_ROS1)
    expected, result = (
        dd.read_recording(path, parameters={"floating_base": True}) for path in (new, old)
    )
    assert len(expected) > 15 and result.findings == expected.findings
    assert_same_states(result, expected)


NOT_UNDERSTOOD = [
    (
        b"short",
        {},
        "sensor_msgs/JointState",
        "40 of '/joint_states' are damaged, or not of the type",
    ),
    (
        None,
        {"md5sum": "1" * 32},
        "sensor_msgs/JointState",
        "40 of '/joint_states' are damaged, or not of the type",
    ),
    (
        None,
        {},
        "my_msgs/JointState",
        r"has no joint states: it has /joint_states .my_msgs/msg/JointState, encoded",
    ),
]


@pytest.mark.parametrize(("data", "metadata", "type", "what"), NOT_UNDERSTOOD)
def test_ros1_in_mcap_that_is_not_understood(tmp_path, data, metadata, type, what):
    messages = [
        message._replace(data=data or message.data, type=type) for message in of_ros1(numbered(40))
    ]
    options = {"encoding": "ros1", "metadata": metadata, "definitions": {}}
    path = write_mcap(tmp_path / "x.mcap", messages, chunk_size=10**6, **options)
    try:
        text = " ".join(
            unread(
                [
                    (message.cause, message.text)
                    for message in dd.read_recording(path, arm("a")).findings
                ]
            )
        )
    except dd.InputError as error:
        text = str(error)
    assert re.search(what, text)


@pytest.mark.parametrize("name", ["sensor_msgs/JointState", "sensor_msgs::msg::dds_::JointState_"])
@pytest.mark.parametrize("kind", ["mcap", "db3"])
def test_names_of_types(tmp_path, kind, name):
    """Releases and vendors write them without ``/msg/``, or as DDS has them."""
    messages = numbered(40)
    path = tmp_path / f"x.{kind}"
    if kind == "mcap":
        write_mcap(path, [message._replace(type=name) for message in messages])
    else:
        file_of(write_rosbag2(tmp_path / "bag", messages)).rename(path)
        with sqlite3.connect(path) as database:
            database.execute("UPDATE topics SET type = ?", [name])
        database.close()
    assert read(path) == (list(range(40)), [])


@pytest.mark.parametrize(
    ("encoding", "type"), [("json", JOINT_STATE), ("protobuf", "foxglove.JointStates"), ("", "")]
)
def test_encodings_that_are_not_read_are_named(tmp_path, encoding, type):
    """With the topic; a second topic that can be read is read."""
    odd = [
        message._replace(topic="/odd/joint_states", type=type, data=b"{}")
        for message in numbered(20)
    ]
    path = write_mcap(tmp_path / "odd.mcap", odd, encoding=encoding)
    for topic in (None, "/odd/joint_states"):
        what = rf"/odd/joint_states.* encoded as '{encoding}'.* 'cdr' of ROS 2 or 'ros1'"
        refused(what, path, arm("a"), topic=topic)
    with open(tmp_path / "both.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        channels = [
            writer.register_channel(topic, form, writer.register_schema(kind, "ros2msg", b""))
            for topic, form, kind in (
                ("/odd/joint_states", encoding, type),
                ("/a", "cdr", JOINT_STATE),
            )
        ]
        for message, other in zip(odd, numbered(20), strict=True):
            writer.add_message(channels[0], message.log_time, message.data, message.log_time)
            writer.add_message(channels[1], message.log_time, other.data, message.log_time)
        writer.finish()
    numbers, findings = read(tmp_path / "both.mcap")
    assert numbers == list(range(20)) and unread(findings) == []


# --- Several topics of one robot ---


def arm_and_gripper(topics):
    """Return messages of an arm (joints a, b) and its gripper (c) on two topics; some have the same
    log time.
    """
    sent = []
    for k in range(60):
        names, topic = (["c"], topics[1]) if k % 3 == 2 else (["b", "a"], topics[0])
        stamp = START + 2 * k * MS
        values = (
            [0.01 * k + place for place in range(len(names))],
            [0.1] * len(names),
            [1.0 * k] * len(names),
        )
        sent.append(
            Message(topic, stamp - (k % 30 == 29) * 2 * MS, serialized(stamp, names, *values))
        )
    return sent


WRITERS = {
    "mcap": lambda folder, sent: write_mcap(folder / "x.mcap", sent),
    "db3": lambda folder, sent: write_rosbag2(folder / "bag", sent),
    "ROS 1": lambda folder, sent: write_ros1(folder / "x.bag", sent),
    "ROS 1 in MCAP": lambda folder, sent: write_mcap(folder / "x.mcap", of_ros1(sent), **IN_ROS1),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_topics_of_one_robot_are_merged(tmp_path, kind):
    """States, counts and findings are those of one topic with the same messages, whatever the order
    of the names.
    """
    robot = arm("a", "b", "c")
    two = "/arm/joint_states", "/gripper/joint_states"
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    message = WRITERS[kind](tmp_path / "one", arm_and_gripper(["/joint_states"] * 2))
    path = WRITERS[kind](tmp_path / "two", arm_and_gripper(two))
    expected = dd.read_recording(message, robot)
    assert len(expected) == 58 and np.isfinite(expected.tau).all()
    for topics in (two, list(reversed(two)), [*two, two[0]]):
        result = dd.read_recording(path, robot, topic=topics)
        assert result.counts == expected.counts and result.findings == expected.findings
        assert_same_states(result, expected)
    refused(rf"{two[0]}, {two[1]}\. .* --topic {two[0]} --topic {two[1]}", path, robot)
    refused(rf"no topic '/gripper' .*{two[0]} .*{two[1]} ", path, robot, topic=[two[0], "/gripper"])


def test_topics_that_are_not_read_are_named(tmp_path):
    """One topic has the usual name, others have another name or another type."""
    sent = [*arm_and_gripper(("/joint_states", "/gripper")), description(urdf_of("a"))]
    path = write_mcap(tmp_path / "x.mcap", sent)
    notes = [
        finding.text
        for finding in dd.read_recording(path, arm("a", "b")).findings
        if finding.cause == "note"
    ]
    what = "joint states of /joint_states are read, not those of /gripper (--topic reads several)."
    assert notes == [f"'{path}': {what}"]
    what = (
        r"no topic '/robot_description' of sensor_msgs/msg/JointState: .*/robot_description "
        r"\(std_msgs/msg/String, encoded as 'cdr'\)"
    )
    refused(what, path, arm("a"), topic=["/joint_states", "/robot_description"])


def test_robots_of_several_namespaces(tmp_path):
    """The description is that in the namespace of the topics."""
    sent = [
        message._replace(topic=f"/{side}/joint_states")
        for side in ("left", "right")
        for message in numbered(10)
    ]
    sent += [
        description(urdf_of(*names))._replace(topic=f"/{side}/robot_description")
        for side, names in SIDES.items()
    ]
    path = write_mcap(tmp_path / "x.mcap", sorted(sent, key=lambda message: message.log_time))
    for side, names in SIDES.items():
        assert dd.read_recording(path, topic=f"/{side}/joint_states").model.joint_names == names
    refused(r"several topics of std_msgs/msg/String: .*\. Give the robot: --urdf", path)


SIDES = {"left": ("a",), "right": ("a", "b")}


# --- Names of joints ---


def write_table(folder, sent):
    """Write messages of two joints, all of one order, as CSV; return its path."""
    messages = [JAZZY.deserialize_cdr(entry.data, JOINT_STATE) for entry in sent]
    quantities = {"q": "position", "qd": "velocity", "tau": "effort"}
    header = ["t", *(f"{short}_{name}" for short in quantities for name in messages[0].name)]
    rows = [
        [
            1e-9 * entry.log_time,
            *(number for field in quantities.values() for number in getattr(message, field)),
        ]
        for entry, message in zip(sent, messages, strict=True)
    ]
    np.savetxt(
        folder / "x.csv", rows, fmt="%.17g", delimiter=",", header=",".join(header), comments=""
    )
    return folder / "x.csv"


def moving(*names, count=12):
    """Return joint states with these names and with different values of each joint."""
    sent = []
    for k in range(count):
        position = [0.001 * k + n for n in range(len(names))]
        effort = [0.1 * k - n for n in range(len(names))]
        data = serialized(START + k * MS, names, position, [1.0] * len(names), effort)
        sent.append(Message("/joint_states", START + k * MS, data))
    return sent


MAPS = {
    "exchanged": (("panda_b", "panda_a"), {"panda_a": "panda_b", "panda_b": "panda_a"}),
    "prefix": (("fer_a", "fer_b"), {"fer_*": "panda_*"}),
    "the longer prefix": (("fer_a", "fer_x_b"), {"fer_*": "panda_*", "fer_x_*": "panda_*"}),
    "one joint": (("panda_a", "tool"), {"tool": "panda_b"}),
}


@pytest.mark.parametrize(
    ("kind", "case"),
    [
        *((kind, "prefix") for kind in WRITERS),
        *((kind, case) for kind in ("mcap", "csv") for case in MAPS),
    ],
)
def test_joint_names(tmp_path, kind, case):
    """States and findings are those of a recording with the robot's names. Options are by the
    robot's names.
    """
    names, mapping = MAPS[case]
    robot = arm("panda_a", "panda_b")
    options = {"parameters": {"effort_scale": ["panda_b=2.0"]}}
    write = WRITERS.get(kind, write_table)
    recordings = []
    for folder, written in (("own", ("panda_a", "panda_b")), ("other", names)):
        (tmp_path / folder).mkdir()
        recordings.append(write(tmp_path / folder, moving(*written)))
    expected = dd.read_recording(recordings[0], robot, **options)
    assert len(expected) == 12 and np.isfinite(expected.tau).all()
    recording = dd.read_recording(recordings[1], robot, joint_names=mapping, **options)
    assert recording.counts == expected.counts
    assert [finding for finding in recording.findings if finding.cause != "note"] == []
    assert_same_states(recording, expected)


def test_joint_names_of_later_messages(tmp_path):
    """Names of every message count: those of a gripper that comes late, of a locked joint, and of a
    part of the file.
    """
    arm_alone = moving("fer_a", count=30)
    gripper = moving("fer_b", count=30)[20:]
    path = write_mcap(
        tmp_path / "x.mcap", sorted([*arm_alone, *gripper], key=lambda message: message.log_time)
    )
    mapping = {"fer_a": "panda_a", "fer_b": "panda_b"}
    locked = {"parameters": {"locked_joints": ["panda_b=0.0"]}}
    assert (
        len(dd.read_recording(path, urdf_of("panda_a", "panda_b"), joint_names=mapping, **locked))
        == 30
    )
    assert len(dd.read_recording(path, arm("panda_a", "panda_b"), joint_names=mapping)) == 1 + 2 * 9
    pieces = dd.stream_recording(
        path, urdf_of("panda_a", "panda_b"), joint_names=mapping, end=0.01, size=4, **locked
    )
    assert sum(map(len, pieces)) == 10


def test_joint_names_of_a_message_that_has_both(tmp_path):
    """A name that is mapped to a joint, and the joint's own, are named, be it in one message or in
    two. Two names of another robot's joint in two messages are not.
    """
    message = moving("fer_a", "panda_a", "panda_b")
    two = sorted(
        [*moving("fer_a"), *moving("panda_a", "panda_b")], key=lambda message: message.log_time
    )
    for sent in (message, two):
        path = write_mcap(tmp_path / "x.mcap", sent)
        what = "maps both 'fer_a' and 'panda_a' to joint 'panda_a'"
        refused(what, path, arm("panda_a", "panda_b"), joint_names={"fer_a": "panda_a"})
    assert len(dd.read_recording(path, arm("panda_b"), joint_names={"fer_a": "panda_a"}))


WRONG_MAPS = {
    "two by a prefix": (
        {"fer_*": "panda_*", "fer_b": "panda_a"},
        r"both 'fer_.' and 'fer_.' to joint 'panda_a'",
    ),
    "one star": (
        {"fer_*": "panda_a"},
        r"maps 'fer_\*' to 'panda_a'; expected one \* in both names or in neither",
    ),
    "a list": (["fer_a"], r"joint_names is \['fer_a'\]; expected a mapping of names"),
}


@pytest.mark.parametrize("case", WRONG_MAPS)
@pytest.mark.parametrize("kind", ["mcap", "csv"])
def test_joint_names_that_are_wrong(tmp_path, kind, case):
    mapping, what = WRONG_MAPS[case]
    path = WRITERS.get(kind, write_table)(tmp_path, moving("fer_a", "fer_b"))
    refused(what, path, arm("panda_a", "panda_b"), joint_names=mapping)


def test_column_maps_are_of_tables(tmp_path):
    """A bag has none; a star at the begin of a YAML text is taken for an alias."""
    path = write_mcap(tmp_path / "x.mcap", moving("a", "b"))
    robot = arm("a", "b")
    what = "is a bag; expected no column map"
    refused(what, path, robot, columns={"effort": None})
    (tmp_path / "map.yaml").write_text("scale: {time: *}")
    refused("is no YAML: .*alias", path, robot, columns=tmp_path / "map.yaml")


PROPOSALS = {
    "prefix": (
        ["fer_a", "fer_b"],
        ["panda_a", "panda_b"],
        ["--joint-names 'fer*=panda*' (joint_names)."],
    ),
    "number": (
        ["J1", "J2", "J3"],
        ["joint_1", "joint_2", "joint_3"],
        ["--joint-names 'J*=joint_*'"],
    ),
    "two arms": (
        ["l_a", "l_b", "r_a", "r_b"],
        ["a", "b"],
        ["map names by --joint-names NAME=JOINT"],
    ),
    "nothing alike": (["x", "y"], ["a", "b"], ["map names by --joint-names NAME=JOINT"]),
    "many": (
        [f"other_{k}" for k in range(30)],
        [f"joint_{k}" for k in range(20)],
        [
            "joint_7 and 12 more. The recording has",
            "other_7 and 22 more; map names by",
            "--joint-names 'other*=joint*'",
        ],
    ),
    "one is there": (["a", "fer_b"], ["a", "panda_b"], ["--joint-names fer_b=panda_b"]),
}


@pytest.mark.parametrize("case", PROPOSALS)
def test_names_that_came_and_a_map_for_them(tmp_path, case):
    """Without a complete state, a finding has the joints that came, those that did not, and a map
    that explains them.
    """
    came, names_there, expected = PROPOSALS[case]
    recording = dd.read_recording(write_mcap(tmp_path / "x.mcap", moving(*came)), arm(*names_there))
    (finding,) = recording.findings
    if case == "one is there":
        assert "missing: panda_b. The recording has fer_b; " in finding.text
    elif case != "many":
        assert (
            f"messages of other joints: {', '.join(came)}; the robot has {', '.join(names_there)}; "
            in finding.text
        )
    assert len(recording) == 0 and all(text in finding.text for text in expected)


FOLLOWED = [
    (["j1", "j2", "j3"], ["joint1", "joint2", "joint3"]),
    (["j1", "j2", "j3", "j4"], ["joint1", "joint2", "joint3"]),
    (["base_j1", "base_j2", "j3"], ["joint1", "joint2", "joint3"]),
    (["left_a", "left_b", "left_c"], ["a", "b", "left_c"]),
]


@pytest.mark.parametrize(("own", "came"), FOLLOWED)
def test_proposed_options_are_accepted(tmp_path, own, came):
    """The options of a finding make states, as a shell passes them."""
    path = write_mcap(tmp_path / "x.mcap", moving(*came))
    urdf = urdf_of(*own)
    (finding,) = dd.read_recording(path, urdf).findings
    options = re.search(r"--joint-names (.*?) \(joint_names\)", finding.text)
    entries = [word.split("=") for word in shlex.split(options[1])]
    locked = re.findall(r"--set locked_joints=(\S+)", finding.text)
    parameters = {"locked_joints": locked[0].split(",")} if locked else {}
    options = {"joint_names": dict(entries), "parameters": parameters}
    assert len(dd.read_recording(path, urdf, **options)) > 0


def test_proposed_options_contain_those_that_are_there(tmp_path):
    path = write_mcap(tmp_path / "x.mcap", moving("joint1", "joint2", "joint3"))
    urdf = urdf_of("base_j1", "base_j2", "j3")
    (finding,) = dd.read_recording(path, urdf, joint_names={"joint*": "base_j*"}).findings
    assert "--joint-names 'joint*=base_j*' joint3=j3 " in finding.text


def test_followers_are_the_robots(tmp_path):
    """A name that the map leads to a mimic joint counts."""
    mimic = '<joint name="b" type="continuous"><mimic joint="a"/>'
    robot = urdf_of("a", "b").replace('<joint name="b" type="continuous">', mimic)
    recording = dd.read_recording(
        write_mcap(tmp_path / "x.mcap", moving("left_a", "left_b")), robot
    )
    (finding,) = recording.findings
    assert finding.text.endswith("map names by --joint-names 'left_*=*' (joint_names).")
    assert len(dd.read_recording(recording.path, robot, joint_names={"left_*": "*"})) == 12


def test_joints_without_data_are_locked_by_one_list(tmp_path):
    recording = dd.read_recording(write_mcap(tmp_path / "x.mcap", moving("a")), arm("a", "b", "c"))
    assert recording.findings[0].text.endswith("--set locked_joints=b=0,c=0")
