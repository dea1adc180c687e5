# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values of the monitor's parameters: entries by name, payloads, bounds, thresholds, and their
meaning for a robot.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diag_dynamics.entries import assignments, by_name
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.assembler import StateAssembler
from diag_dynamics.joint_states.robot_joints import joints_of
from diag_dynamics.model import Payload
from diag_dynamics.parameters.monitor import PARAMETERS, EnergyThresholds, Settings
from diag_dynamics.parameters.shared import payload_entry, payloads_of
from examples import examples
from joint_state_messages import INF, NAMES, NAN
from joint_state_readers import DEFAULTS, model, settings

# --- entries by name


@pytest.mark.parametrize(
    ("entries", "kind", "values"),
    [
        (["a=1", "b=-2.5e-3", "", "*=0"], float, {"a": 1.0, "b": -0.0025, "*": 0.0}),
        ([" a = 1 ", "b c=2", "a=b=1"], float, {"a": 1.0, "b c": 2.0, "a=b": 1.0}),
        (["a=true", "b=False", "*=TRUE"], bool, {"a": True, "b": False, "*": True}),
        (["a=1 2 = 3", "b="], str, {"a=1 2": "3", "b": ""}),
    ],
)
def test_assignments(entries, kind, values):
    assert assignments("armature", entries, kind) == values


def test_by_name():
    """The asterisk stands for all names without an entry of their own."""
    assert by_name("armature", {"b": 2.0}, ("a", "b")) == {"b": 2.0}
    assert by_name("armature", {"b": 2.0, "*": 1.0}, ("a", "b", "c")) == {
        "a": 1.0,
        "b": 2.0,
        "c": 1.0,
    }


@examples(100)
@given(
    st.lists(st.floats(-1e9, 1e9), min_size=10, max_size=10),
    st.text("abc_/-. 0", min_size=1).map(str.strip).filter(bool),
)
def test_payloads_round_trip(numbers, name):
    """The entry of a payload has all of it, bit for bit; a mass alone, or with its place, is a
    payload, too.
    """
    mass, *com, xx, yy, zz, xy, xz, yz = abs(numbers[0]), *numbers[1:]
    payload = Payload(mass, tuple(com), ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    arrays = Payload(np.float64(mass), np.array(com), np.array(payload.inertia))
    assert (
        payloads_of([payload_entry(name, payload)])
        == payloads_of([payload_entry(name, arrays)])
        == {name: payload}
    )
    assert payloads_of(["tip=2", "", "hand=1.5 0.1 -0.2 0.3"])["hand"] == Payload(
        1.5, (0.1, -0.2, 0.3)
    )


# --- Values that are refused

OF_NAMES = (
    "external_torque.covariance_joints",
    "joint_names",
    "reaction.activate",
    "reaction.deactivate",
)
WITH_DEFAULTS = "joint_timeout", "max_rate"
LISTS = [name for name, spec in PARAMETERS.items() if spec.default == [""] and name not in OF_NAMES]
LISTS += WITH_DEFAULTS
NUMBERS = [name for name, spec in PARAMETERS.items() if isinstance(spec.default, float)]
CHOICES = [name for name, spec in PARAMETERS.items() if spec.choices]
MASSES = (
    "tip=",
    "tip=a",
    "tip=1 2",
    "tip=1 2 3",
    "tip=1,2,3,4",
    "tip=nan",
    "tip=1 0 0 inf",
    "tip=-1",
    "tip=" + "1 " * 11,
)
BY_JOINT = "joint_timeout", "effort_available", "effort_scale", "effort_includes_gravity"


@pytest.mark.parametrize(
    ("names", "values", "expected"),
    [
        (NUMBERS, (NAN, INF, -INF), "finite"),
        (CHOICES, ("", "sometimes"), "one of"),
        (LISTS, (["elbow"], ["=1"], ["elbow=1 2"]), "expected"),
        (["armature"], (["a="], ["a=one"], ["a=nan"], ["a=-inf"]), "name=number"),
        (["payloads"], [[text] for text in MASSES], "1, 4 or 10 finite numbers"),
        (["gravity"], ([0.0, 0.0], []), "3 numbers"),
        (["gravity"], ([0.0, 0.0, NAN],), "finite"),
        (
            ["joint_timeout", "energy.warn", "energy.error"],
            (["elbow=-1"], ["*=-1"]),
            "no less than 0",
        ),
        (
            ["effort_available", "effort_includes_gravity"],
            (["elbow=1"], ["elbow=no"]),
            "name=true or name=false",
        ),
        (
            ["joint_timeout", "armature", "collision.threshold"],
            (["elbow=1", " elbow =1"],),
            "two entries for 'elbow'",
        ),
        (["effort_scale"], (["elbow=0"], ["elbow=nan"]), "Set effort_available to false"),
        (BY_JOINT[:1] + BY_JOINT[2:3], (["knee=2"],), "names 'knee'"),
        (BY_JOINT[1:2] + BY_JOINT[3:], (["knee=true"],), "names 'knee'"),
        (
            ["effort_includes_gravity"],
            (["heel=false"],),
            "names 'heel'",
        ),  # a mimic joint: its source joint has the effort
    ],
    ids=str,
)
def test_wrong_values(names, values, expected):
    """The error has the parameter and what was expected."""
    for name in names:
        for value in values:
            with pytest.raises(InputError) as error:
                assembler(**{name: value})
            assert name in str(error.value) and expected in str(error.value)


# --- Thresholds of energy

THRESHOLDS = [
    # warning and error; text of the error, None: accepted
    ("total=2", "total=2", None),
    ("total=2", "", None),
    ("total=2", "total=1", "of 'total' is 1 J; expected at least 2 J (energy.warn)"),
    ("total=2", "*=1", None),
    ("*=2", "total=1", None),
    ("elbow=2", "wrist=1", None),
    ("elbow=2", "elbow=1", "'elbow'"),
    ("*=2", "*=1", "'*'"),
    ("elbow=2", "*=1", "'elbow'"),
    ("*=2", "*=5 elbow=1", "'elbow'"),
    ("*=2 elbow=0", "elbow=1", None),
    ("elbow=2", "*=1 elbow=0", None),
]


@pytest.mark.parametrize(("warn", "error", "expected"), THRESHOLDS)
def test_thresholds(warn, error, expected):
    """An error below its warning is rejected with both numbers; 0 is no threshold."""
    values = {"energy.warn": warn.split() or [""], "energy.error": error.split() or [""]}
    if expected is None:
        Settings.of(DEFAULTS | values)
        return
    with pytest.raises(InputError) as refusal:
        Settings.of(DEFAULTS | values)
    assert all(text in str(refusal.value) for text in (expected, "2 J", "1 J"))


def test_thresholds_of_collision_and_contact():
    """Both share release, hold-off, standing and stiction; without a gain they are rejected."""
    values = {"external_torque.gain": 25.0, "collision.threshold": ["norm=4", "elbow=2"]}
    values |= {"contact.threshold": ["total=3", "elbow=0"], "collision.release": 0.75}
    values |= {"collision.standing": 0.0, "collision.stiction": 0.25}
    observation = Settings.of(DEFAULTS | values).observation
    collision = observation.collision
    contact = observation.contact
    assert collision.of_names(["elbow", "wrist"]).tolist() == [2.0, INF, INF, 4.0]
    assert contact.of_names(["elbow", "wrist"]).tolist() == [INF, INF, 3.0, INF]
    for thresholds in (collision, contact):
        options = thresholds.release, thresholds.hold_off, thresholds.standing, thresholds.stiction
        assert options == (0.75, 1.0, INF, 0.25)
    with pytest.raises(InputError, match="gain is 0"):
        Settings.of(DEFAULTS | values | {"external_torque.gain": 0.0})


def test_energy_thresholds_by_joint():
    """Of the total, then by joint; infinite where there is none. An asterisk is no total."""
    thresholds = EnergyThresholds({"elbow": 2.0, "*": 1.0}, {"wrist": 3.0, "total": 4.0})
    limits = thresholds.by_joint(NAMES)
    assert limits["energy.warn"].tolist() == [INF, 1.0, 2.0, 1.0]
    assert limits["energy.error"].tolist() == [4.0, INF, INF, 3.0]
    for kind in ("warn", "error"):
        with pytest.raises(InputError, match=f"'energy.{kind}' names 'knee'"):
            EnergyThresholds(**{kind: {"knee": 1.0}}).by_joint(NAMES)


# --- meaning for a robot


def assembler(**parameters):
    """Return the assembler of the arm."""
    return StateAssembler(joints_of(model("arm")), settings(parameters).inputs)


@pytest.mark.parametrize(
    ("gravity", "mask"),
    [
        ([], None),
        (["elbow=true", "*=true"], None),
        (["elbow=false"], [0, 1, 0]),
        (["*=false"], [1, 1, 1]),
        (["*=false", "shoulder=true"], [0, 1, 1]),
    ],
)
def test_efforts_without_gravity(gravity, mask):
    """1 for each joint whose effort lacks gravity; the asterisk does not stand for mimic joints."""
    without = assembler(effort_includes_gravity=gravity).efforts.without_gravity
    assert (None if without is None else without.tolist()) == mask


@pytest.mark.parametrize(
    ("options", "undeclared"),
    [
        ({}, NAMES),
        ({"effort_scale": ["*=1"]}, NAMES),
        ({"effort_scale": ["*=1"], "effort_includes_gravity": ["*=true"]}, ()),
        (
            {"effort_scale": ["*=1"], "effort_includes_gravity": ["elbow=true"]},
            ("shoulder", "wrist"),
        ),
        ({"effort_available": ["shoulder=false"]}, ("elbow", "wrist")),
    ],
)
def test_undeclared_efforts(options, undeclared):
    """Joints whose efforts count although scale or gravity is a guess."""
    assert assembler(**options).efforts.undeclared == undeclared


def test_refused_options_leave_those_in_force():
    running = assembler(joint_timeout=["*=1.5"])
    others = {
        "joint_timeout": ["*=9"],
        "mimic_tolerance": 9.0,
        "max_age": 9.0,
        "effort_scale": ["knee=2"],
    }
    with pytest.raises(InputError, match="'effort_scale' names 'knee'"):
        running.configure(settings(others).inputs)
    running.accept_values(NAMES, 1, 0, [np.zeros(3), np.zeros(3), np.zeros(0)], 10**12)
    assert running.stale(2_500_000_000) == [] and running.stale(2_500_000_001) == list(NAMES)
