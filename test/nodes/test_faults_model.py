# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions, payloads, gravity and all other parameters, changed and mistaken while a monitor runs."""

import math

import numpy as np
import pytest
from diag_dynamics.srv import SetPayload
from geometry_msgs.msg import Inertia
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, ListParameters
from std_msgs.msg import String

from nodes import LATCHED, MS, PANDA, UR5, Monitor, Truth, description, nanoseconds, robot

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"

FINGER = "panda_finger_joint1"
HAND = "panda_hand"
LOAD = (2.0, (0.0, 0.1, 0.2), np.diag([0.01, 0.02, 0.025]))
LOAD_ENTRY = f"{HAND}=2.0 0 0.1 0.2 0.01 0.02 0.025 0 0 0"


@pytest.fixture(scope="module")
def tool():
    """Return the Panda with another hand, under another name: its joints have the same names."""
    panda = robot(PANDA)
    before, hand, rest = panda.urdf.partition(f'<link name="{HAND}">')
    changed = before.replace('<robot name="panda"', '<robot name="panda_with_tool"') + hand
    mass = panda.oracle.xml.find(f"link[@name='{HAND}']/inertial/mass").get("value")
    changed += rest.replace(f'<mass value="{mass}"', '<mass value="3.5"', 1)
    assert changed.count('value="3.5"') == 1 and "panda_with_tool" in changed
    return panda.changed(changed)


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor that has its robot from a parameter."""
    with Monitor(peer, "/model", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


@pytest.fixture(scope="module")
def by_topic(peer):
    """Start a monitor that has its robot from the topic."""
    descriptions = peer.publisher(String, "/topic/robot_description", LATCHED)
    descriptions.publish(description(robot(PANDA).urdf))
    with Monitor(peer, "/topic") as monitor:
        monitor.describe = lambda text: descriptions.publish(description(text))
        yield monitor.connect(robot(PANDA))


def model_report(monitor, condition, what):
    """Wait for a report whose entry on the model fulfils a condition; return the report and that entry."""
    report = monitor.wait_for_report(
        lambda report: "model" in report.entries and condition(report.entries["model"]), what
    )
    return report, report.entries["model"]


def values(status):
    """Return the values of an entry by key."""
    return {pair.key: pair.value for pair in status.values}


def only_new_joints_count(monitor, new):
    """Feed the arm alone, then the finger: nothing of before the replacement may stand for it."""
    arm = [name for name in new.names if name != FINGER]
    first = monitor.tick(MS)
    monitor.feeder.publish(new.message(first, new.samples[1], arm))
    published = monitor.feed(new.message(monitor.tick(MS), new.samples[1], [FINGER]), ["state"])
    Truth(new, *new.samples[1][:3]).check(published, monitor.now)
    assert nanoseconds(published["state"].oldest_stamp) == first
    assert monitor.topics["state"].stamps == [monitor.now]
    monitor.serves(new, 2)


# --- another description


def test_replaced_by_topic(by_topic, panda, tool):
    """A tool change: the same joints on another robot have to arrive anew, and the numbers are the new robot's."""
    before = by_topic.serves(panda)["state"].model_revision
    by_topic.forget()
    by_topic.describe(tool.urdf)
    report, model = model_report(by_topic, lambda m: values(m).get("robot") == "panda_with_tool", "the tool")
    assert (model.level, model.message) == (OK, "robot 'panda_with_tool'")
    assert values(model)["total mass [kg]"] == f"{tool.oracle.mass + base_mass(tool):.6g}"
    assert report.values["missing joints"] == f"8: {', '.join(panda.names)}"
    only_new_joints_count(by_topic, tool)
    assert by_topic.topics["state"].messages[-1].model_revision > before
    by_topic.describe(panda.urdf)
    model_report(by_topic, lambda m: values(m).get("robot") == "panda", "the Panda")
    by_topic.serves(panda)


def base_mass(found):
    """Return the mass of the root link, which does not move."""
    return float(found.oracle.xml.find(f"link[@name='{found.root}']/inertial/mass").get("value"))


def test_replaced_by_parameter(monitor, panda, tool, tmp_path):
    """The parameter takes a path as it takes text, at run time; what is wrong with one is said, and the old one stays."""
    path = tmp_path / "tool.urdf"
    path.write_text(tool.urdf)
    for value in (str(path), tool.urdf):
        monitor.forget()
        with monitor.having(robot_description=value):
            only_new_joints_count(monitor, tool)
        monitor.forget()
        only_new_joints_count(monitor, panda)
    with monitor.having(robot_description=str(robot(UR5).path)):
        monitor.serves(robot(UR5), 1)
        monitor.feeder.publish(panda.message(monitor.tick(), panda.samples[0]))  # of a robot that is gone
        monitor.serves(robot(UR5), 2)


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("/nowhere/robot.urdf", "/nowhere/robot.urdf"),
        ("<robot name='r'><link name='a'/>", "not well-formed"),
        ("<robot name='r'/>", "link"),
    ],
    ids=["no file", "malformed", "no link"],
)
def test_description_refused(monitor, panda, value, reason):
    """An invalid one is refused with the reason; the robot of before goes on undisturbed."""
    result = monitor.set_parameters({"robot_description": value})
    assert not result.successful
    assert reason in result.reason
    # not a joint has been forgotten
    arm = [name for name in panda.names if name != FINGER]
    assert monitor.feed(panda.message(monitor.tick(100 * MS), panda.samples[1], arm), ["state"])
    monitor.serves(panda)
    assert monitor.next_report().values["robot"] == "panda"


def test_refused_description_is_named(monitor):
    """As with any other parameter, the reason says which one is wrong."""
    assert "robot_description" in monitor.set_parameters({"robot_description": "<robot/>"}).reason


def test_description_by_parameter_where_a_topic_brings_it(by_topic, panda):
    """There is one source of the robot, which only an unconfigured node changes."""
    result = by_topic.set_parameters({"robot_description": str(robot(UR5).path)})
    assert not result.successful
    assert "clean the node up first" in result.reason
    by_topic.serves(panda)


# --- payloads and gravity


def test_payload_and_gravity_together(monitor, panda):
    """Set atomically, they hold from the same state on, and not one before."""
    gravity = (1.0, -2.0, 3.0)
    revision = monitor.serves(panda)["state"].model_revision
    q, qd, tau, _ = panda.samples[2]
    with monitor.having(payloads=[LOAD_ENTRY], gravity=list(gravity)):
        loaded = panda.changed(payloads={HAND: LOAD})
        published = monitor.serves(loaded, 2, Truth(loaded, q, qd, tau, gravity=gravity))
        assert published["state"].model_revision == revision + 1
        report = monitor.next_report()
        assert report.values["payloads"] == f"1: {HAND}"
        mass = sum(float(m.get("value")) for m in panda.oracle.xml.findall("link/inertial/mass")) + LOAD[0]
        assert float(report.values["total mass [kg]"]) == pytest.approx(mass, rel=1e-5)
    monitor.serves(panda, 2)
    assert monitor.next_report().values["payloads"] == "0"


def test_payload_outlives_a_description(by_topic, panda, tool):
    """On a robot that has the link it goes on, on another it is named as not applied, and is back with the link."""
    load = SetPayload.Request(link=HAND, inertia=Inertia(m=LOAD[0], ixx=0.01, iyy=0.02, izz=0.025))
    load.inertia.com.y, load.inertia.com.z = LOAD[1][1:]
    response = by_topic.call(SetPayload, "set_payload", load)
    assert response.success, response.message
    ur5 = robot(UR5)
    try:
        for found, applied in ((tool, True), (ur5, False), (panda, True)):
            by_topic.describe(found.urdf)
            name = found.oracle.xml.get("name")
            _, model = model_report(by_topic, lambda m, name=name: values(m).get("robot") == name, name)
            loaded = found.changed(payloads={HAND: LOAD}) if applied else found
            by_topic.serves(loaded, 1)
            assert values(model)["payloads"] == (f"1: {HAND}" if applied else "0")
            assert model.level == (OK if applied else WARN)
            if not applied:
                assert model.message == f"payloads on links that are not there: {HAND}"
    finally:
        by_topic.call(SetPayload, "set_payload", SetPayload.Request(link=HAND))
    by_topic.serves(panda)
    assert by_topic.next_report().entries["model"].level == OK


# --- parameters as such


EXPECTED = {
    "autostart",
    "robot_description",
    "mimic",
    "massless",
    "locked_joints",
    "armature",
    "parameters_file",
    "gravity",
    "payloads",
    "max_joints",
    "max_coupled",
    "floating_base",
    "serialization",
    "odom_twist_frame",
    "odom_timeout",
    "joint_timeout",
    "joint_timeouts",
    "max_age",
    "foreign_time",
    "missing_velocity",
    "velocity_filter_time",
    "effort_available",
    "effort_scale",
    "effort_includes_gravity",
    "absurd.position",
    "absurd.velocity",
    "absurd.effort",
    "absurd.beyond_limits",
    "absurd.beyond_velocity",
    "absurd.beyond_effort",
    "absurd.jump",
    "frozen_timeout",
    "frozen_values",
    "mimic_tolerance",
    "warn_energy",
    "error_energy",
    "warn_energy_share",
    "error_energy_share",
    "external_torque.gain",
    "external_torque.threshold",
    "external_torque.release_threshold",
    "external_torque.friction",
    "external_torque.max_gap",
    "alarm.joints",
    "contact.limits_file",
    "contact.geometry",
    "contact.links",
    "contact.points",
    "contact.worst_by",
    "contact.warn_at",
    "contact.release",
    "alarm.external_torque",
    "alarm.norm",
    "alarm.release",
    "alarm.hold_off",
    "alarm.standing",
    "publish_inverse_factor",
    "friction_velocity",
    "publish_friction",
    "max_rate.mass_matrix_factors",
    "max_rate.joint_space_dynamics",
    "max_rate.state",
    "max_rate.kinetic_energy",
    "max_rate.total_joint_rates",
    "max_rate.working_moments",
    "max_rate.coriolis",
    "max_rate.named",
    "max_rate.markers",
    "markers.link",
    "max_rate.external_torque",
    "max_rate.contact",
}


def test_every_parameter_is_described(monitor):
    """Each says what it is, of which type, and, a number, between which bounds; a choice says among what."""
    listed = monitor.call(ListParameters, "list_parameters", ListParameters.Request()).result.names
    own = {name for name in listed if not name.startswith(("qos_overrides.", "use_sim_time", "start_type_description"))}
    assert own == EXPECTED
    names = sorted(EXPECTED)
    described = monitor.call(DescribeParameters, "describe_parameters", DescribeParameters.Request(names=names))
    now = monitor.peer.get_parameters(monitor.name, names)
    kinds = {
        bool: ParameterType.PARAMETER_BOOL,
        int: ParameterType.PARAMETER_INTEGER,
        float: ParameterType.PARAMETER_DOUBLE,
        str: ParameterType.PARAMETER_STRING,
    }
    for name, parameter in zip(names, described.descriptors, strict=True):
        assert parameter.name == name
        assert len(parameter.description) > 20
        assert not parameter.dynamic_typing
        value = now[name]
        if isinstance(value, list):
            numbers = name == "gravity"
            array = ParameterType.PARAMETER_DOUBLE_ARRAY if numbers else ParameterType.PARAMETER_STRING_ARRAY
            assert parameter.type == array
        else:
            assert parameter.type == kinds[type(value)]
        if isinstance(value, float):
            (bounds,) = parameter.floating_point_range
            assert bounds.from_value <= value <= bounds.to_value
        assert parameter.read_only == (name == "autostart")
    by_name = dict(zip(names, described.descriptors, strict=True))
    for name, choices in (
        ("mimic", ("embed", "free", "lock")),
        ("massless", ("error", "lock")),
        ("odom_twist_frame", ("child", "header")),
        ("foreign_time", ("warn", "refuse")),
        ("missing_velocity", ("refuse", "estimate")),
    ):
        assert all(choice in by_name[name].additional_constraints for choice in choices)


REFUSED = {
    "absurd.position": [(-1.0, "absurd.position"), (math.nan, "absurd.position"), (1e13, "absurd.position")],
    "absurd.velocity": [(-1.0, "absurd.velocity")],
    "absurd.effort": [(-1.0, "absurd.effort")],
    "absurd.beyond_limits": [(-0.1, "absurd.beyond_limits")],
    "absurd.beyond_velocity": [(-1.0, "absurd.beyond_velocity")],
    "absurd.beyond_effort": [(-1.0, "absurd.beyond_effort")],
    "absurd.jump": [(-1.0, "absurd.jump")],
    "effort_available": [
        ([f"{FINGER}=yes"], "true or"),
        (["elbow=true"], "elbow"),
        ([f"{FINGER}=true", f"{FINGER}=false"], "two entries"),
    ],
    "effort_includes_gravity": [(["elbow=true"], "elbow"), (["panda_finger_joint2=false"], "panda_finger_joint2")],
    "effort_scale": [
        (["panda_joint1"], "panda_joint1"),
        (["panda_joint1=nan"], "nan"),
        (["panda_joint1=inf"], "inf"),
        (["*=1e300"], "1e+09"),
    ],
    "error_energy": [(-1.0, "error_energy"), (math.inf, "error_energy")],
    "error_energy_share": [(["panda_joint1=-1"], "panda_joint1=-1"), (["elbow=1"], "elbow")],
    "foreign_time": [("maybe", "warn, refuse")],
    "gravity": [
        ([0.0], "3 numbers"),
        ([0.0, 0.0, math.nan], "finite"),
        ([0.0, 0.0, -1e305], "within ±1000"),
        ([0.0, 9810.0, 0.0], "within ±1000"),
    ],
    "joint_timeout": [(-0.1, "joint_timeout"), (2e9, "joint_timeout")],
    "joint_timeouts": [
        (["panda_joint1=-1"], "no less than 0"),
        (["elbow=1"], "elbow"),
        (["panda_joint1=soon"], "number"),
    ],
    "max_age": [(-1.0, "max_age"), (math.nan, "max_age")],
    "max_rate.coriolis": [(-1.0, "max_rate.coriolis"), (math.nan, "max_rate.coriolis")],
    "mimic_tolerance": [(-1.0, "mimic_tolerance")],
    "missing_velocity": [("guess", "refuse, estimate")],
    "odom_timeout": [(-1.0, "odom_timeout"), (math.nan, "odom_timeout")],
    "serialization": [("json", "template, rclpy")],
    "payloads": [
        (["tool=1"], "tool"),
        ([f"{HAND}=-1"], "-1"),
        ([f"{HAND}=nan"], "nan"),
        ([f"{HAND}=1e300"], "within ±1e+09"),
        ([f"{HAND}=1 0 1e200 0"], "within ±1e+09"),
        ([f"{HAND}=1 2"], "1, 4 or 10"),
        ([f"{HAND}=heavy"], "heavy"),
        ([f"{HAND}=1 0 0 0 1 1 5 0 0 0"], "triangle"),
    ],
    "velocity_filter_time": [(-0.1, "velocity_filter_time"), (11.0, "velocity_filter_time")],
    "contact.limits_file": [("/nowhere/limits.yaml", "parameter 'contact.limits_file'")],
    "contact.geometry": [("pictures", "contact.geometry")],
    "contact.links": [(["nowhere"], "'nowhere', which is no link")],
    "contact.points": [(["tip=panda_hand 1 2"], "contact.points"), (["tip=nowhere 0 0 0"], "'nowhere' is not a link")],
    "contact.worst_by": [("luck", "contact.worst_by")],
    "contact.warn_at": [(2.0, "contact.warn_at")],
    "contact.release": [(0.0, "contact.release")],
    "external_torque.gain": [(-1.0, "external_torque.gain"), (math.nan, "external_torque.gain")],
    "external_torque.threshold": [(-1.0, "external_torque.threshold")],
    "external_torque.release_threshold": [(-1.0, "external_torque.release_threshold")],
    "external_torque.max_gap": [(0.0, "external_torque.max_gap"), (math.inf, "external_torque.max_gap")],
    "alarm.external_torque": [(-1.0, "alarm.external_torque"), (5.0, "external_torque.gain is 0")],
    "alarm.joints": [
        (["elbow=1"], "gain is 0"),
        (["panda_joint1=-1"], "no less than 0"),
        (["panda_joint1"], "name=number"),
    ],
    "alarm.norm": [(-1.0, "alarm.norm")],
    "alarm.release": [(0.0, "alarm.release"), (1.5, "alarm.release")],
    "alarm.hold_off": [(-1.0, "alarm.hold_off")],
    "alarm.standing": [(-1.0, "alarm.standing")],
    "warn_energy": [(-1.0, "warn_energy"), (math.nan, "warn_energy")],
    "warn_energy_share": [(["elbow=1"], "elbow")],
    **{
        name: [(value, "read-only while the node is configured: clean it up first")]
        for name, value in (
            ("mimic", "free"),
            ("massless", "lock"),
            ("locked_joints", ["panda_joint1=0.5"]),
            ("armature", ["panda_joint1=0.5"]),
            ("floating_base", True),
            ("serialization", "rclpy"),
            ("odom_twist_frame", "header"),
        )
    },
}


def test_wrong_values_are_refused(monitor, panda):
    """Each with a reason that names it; each together with a right one, which is then not applied either."""
    before = monitor.peer.get_parameters(monitor.name, sorted(EXPECTED))
    wrong = []
    for name, cases in REFUSED.items():
        for value, reason in cases:
            other = {"publish_inverse_factor": True} if name != "publish_inverse_factor" else {}
            result = monitor.set_parameters({**other, name: value})
            if result.successful or reason not in result.reason:
                wrong.append((name, value, result.successful, result.reason))
    assert not wrong
    assert monitor.peer.get_parameters(monitor.name, sorted(EXPECTED)) == before
    monitor.serves(panda, 2)


def test_judged_together(monitor, panda):
    """Thresholds that are right one by one but not together are refused together, and may move together."""
    names = ("warn_energy", "error_energy", "warn_energy_share", "error_energy_share", "gravity", "joint_timeout")
    before = monitor.peer.get_parameters(monitor.name, names)
    for pair, named in (
        ({"warn_energy": 10.0, "error_energy": 5.0}, "warn_energy is 10"),
        ({"error_energy": 5.0, "warn_energy": 10.0}, "error_energy 5"),
        ({"warn_energy_share": ["panda_joint1=2"], "error_energy_share": ["panda_joint1=1"]}, "panda_joint1"),
        ({"gravity": [0.0, 0.0, 0.0], "joint_timeout": -1.0}, "joint_timeout"),
        ({"joint_timeout": 9.0, "payloads": ["tool=1"], "gravity": [0.0, 0.0, 0.0]}, "tool"),
    ):
        result = monitor.set_parameters(pair)
        assert not result.successful, pair
        assert named in result.reason
    assert monitor.peer.get_parameters(monitor.name, names) == before
    monitor.serves(panda, 2)  # under the gravity of before
    with monitor.having(warn_energy=1000.0, error_energy=2000.0):
        result = monitor.peer.set_parameter(monitor.name, "error_energy", 500.0)  # alone, below its warning
        assert not result.successful
        with monitor.having(warn_energy=3000.0, error_energy=4000.0):
            monitor.serves(panda)


def test_star_is_judged_for_every_joint(monitor):
    """A warning of all others that is beyond the error of one joint is refused as if it were written for that joint."""
    shares = {"warn_energy_share": ["*=2"], "error_energy_share": ["panda_joint1=1"]}
    try:
        result = monitor.set_parameters(shares)
    finally:
        monitor.set_parameters({name: [""] for name in shares})
    assert not result.successful
    assert "panda_joint1" in result.reason
