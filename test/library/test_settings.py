# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values of the monitor's parameters: entries by name, payloads, bounds, thresholds, and their meaning for a robot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diag_dynamics.entries import assignments, by_name
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.assembler import StateAssembler
from diag_dynamics.joint_states.joints import joints_of
from diag_dynamics.joint_states.limits import EffortMeaning
from diag_dynamics.model import Payload
from diag_dynamics.parameters.monitor import PARAMETERS, Settings, Thresholds, share_thresholds
from diag_dynamics.parameters.shared import payload_entry, payloads_of
from examples import examples
from joint_state_messages import INF, NAMES, NAN
from joint_state_readers import DEFAULTS, model, settings

# --- entries by name


@pytest.mark.parametrize(
    ("entries", "kind", "values"),
    [
        ([""], float, {}),
        ([], bool, {}),
        (["a=1", "b=-2.5e-3", "*=0"], float, {"a": 1.0, "b": -0.0025, "*": 0.0}),
        ([" a = 1 ", "", "b c=2"], float, {"a": 1.0, "b c": 2.0}),
        (["a=b=1"], float, {"a=b": 1.0}),
        (["a=true", "b=False", "*=TRUE"], bool, {"a": True, "b": False, "*": True}),
        (["a=1 2 = 3", "b="], str, {"a=1 2": "3", "b": ""}),
    ],
)
def test_assignments(entries, kind, values):
    """Name and value, whatever the spaces."""
    assert assignments("armature", entries, kind) == values


@pytest.mark.parametrize(
    ("entry", "kind", "expected"),
    [
        *((entry, float, "name=number") for entry in ("a", "=1", " ", "a=", "a=one", "a=nan", "a=-inf")),
        *((entry, bool, "name=true or name=false") for entry in ("a=yes", "a=1")),
        *((entry, str, "name=") for entry in ("a", "=a")),
        ("a=-0.1", float, "no less than 0"),
        (" b =2", float, "two entries for 'b'"),
    ],
)
def test_bad_assignments(entry, kind, expected):
    """The error names parameter and entry, and says what was expected."""
    with pytest.raises(InputError, match="'armature'") as error:
        assignments(
            "armature", ["b=1" if kind is float else "b=true", entry], kind, minimum=0.0 if kind is float else None
        )
    assert expected in str(error.value)
    assert entry in str(error.value) or "two entries" in expected


def test_by_name():
    """The asterisk stands for all names without an entry of their own; an unknown name is refused."""
    assert by_name("armature", {"b": 2.0}, ("a", "b")) == {"b": 2.0}
    assert by_name("armature", {"b": 2.0, "*": 1.0}, ("a", "b", "c")) == {"a": 1.0, "b": 2.0, "c": 1.0}
    with pytest.raises(InputError, match="'armature' names 'knee'"):
        by_name("armature", {"*": 1.0, "knee": 1.0}, ("a", "b"))


# --- payloads


def test_payloads():
    """Mass alone, with its place, or with its inertia: ixx iyy izz ixy ixz iyz."""
    assert payloads_of(["tip=2", "", "hand=1.5 0.1 -0.2 0.3", "foot = 1 0 0 0  1 2 3 0.4 0.5 0.6"]) == {
        "tip": Payload(2.0),
        "hand": Payload(1.5, (0.1, -0.2, 0.3)),
        "foot": Payload(1.0, (0.0, 0.0, 0.0), ((1.0, 0.4, 0.5), (0.4, 2.0, 0.6), (0.5, 0.6, 3.0))),
    }


@pytest.mark.parametrize(
    "value", ["", "a", "1 2", "1 2 3", "1,2,3,4", "nan", "1 0 0 inf", "-1", "-0.1 0 0 0", "1 " * 11]
)
def test_bad_payloads(value):
    """The error names parameter and entry, and says what was expected."""
    with pytest.raises(InputError, match=r"'payloads'.*tip=.*expected.*1, 4 or 10 finite numbers"):
        payloads_of(["hand=1", f"tip={value}"])


@examples(100)
@given(
    st.lists(st.floats(-1e9, 1e9), min_size=10, max_size=10),
    st.text("abc_/-. 0", min_size=1).map(str.strip).filter(bool),
)
def test_payloads_round_trip(numbers, name):
    """The entry of a payload holds all of it, bit for bit."""
    mass, *com, xx, yy, zz, xy, xz, yz = abs(numbers[0]), *numbers[1:]
    payload = Payload(mass, tuple(com), ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    arrays = Payload(np.float64(mass), np.array(com), np.array(payload.inertia))
    assert payloads_of([payload_entry(name, payload)]) == payloads_of([payload_entry(name, arrays)]) == {name: payload}


# --- single values and thresholds

LISTS = [name for name, spec in PARAMETERS.items() if spec.default == [""] and name != "contact.links"]
NUMBERS = [name for name, spec in PARAMETERS.items() if isinstance(spec.default, float)]
CHOICES = [name for name, spec in PARAMETERS.items() if spec.choices]


@pytest.mark.parametrize(
    ("names", "values", "expected"),
    [
        (NUMBERS, (NAN, INF, -INF), "finite"),
        (CHOICES, ("", "sometimes"), "one of"),
        (LISTS, (["elbow"], ["elbow=1 2"]), "expected"),
        (["gravity"], ([0.0, 0.0], []), "3 numbers"),
        (["gravity"], ([0.0, 0.0, NAN],), "finite"),
        (["joint_timeouts", "warn_energy_share", "error_energy_share"], (["elbow=-1"], ["*=-1"]), "no less than 0"),
        (["effort_available", "effort_includes_gravity"], (["elbow=1"], ["elbow=no"]), "name=true or name=false"),
        (["joint_timeouts", "armature", "alarm.joints"], (["elbow=1", "elbow=1"],), "two entries for 'elbow'"),
        (["effort_scale"], (["elbow=0"],), "expected another number"),
    ],
    ids=str,
)
def test_wrong_values(names, values, expected):
    """Each is refused by the name of its parameter, with what was expected."""
    for name in names:
        for value in values:
            with pytest.raises(InputError) as error:
                Settings.of(DEFAULTS | {name: value})
            assert name in str(error.value) and expected in str(error.value)


THRESHOLDS = [
    # total, shares: warning and error each; the joint at which the error comes first, None: nowhere
    (2.0, 2.0, "", "", None),
    (2.0, 0.0, "", "", None),
    (0.0, 2.0, "", "", None),
    (2.0, 1.0, "", "", "warn_energy is 2 J"),
    (5.0, 0.0, "", "*=1", None),
    (0.0, 0.0, "elbow=2", "wrist=1", None),
    (0.0, 0.0, "elbow=2", "elbow=1", "'elbow'"),
    (0.0, 0.0, "*=2", "*=1", "'*'"),
    (0.0, 0.0, "*=2", "elbow=1", "'elbow'"),
    (0.0, 0.0, "elbow=2", "*=1", "'elbow'"),
    (0.0, 0.0, "*=2", "*=5 elbow=1", "'elbow'"),
    (0.0, 0.0, "*=2", "*=2 elbow=3", None),
    (0.0, 0.0, "*=2 elbow=1", "elbow=1", None),
    (0.0, 0.0, "*=2 elbow=0", "elbow=1", None),
    (0.0, 0.0, "elbow=2", "*=1 elbow=0", None),
]


@pytest.mark.parametrize(("warn", "error", "warn_share", "error_share", "joint"), THRESHOLDS)
def test_thresholds(warn, error, warn_share, error_share, joint):
    """An error before its warning is refused with both numbers; 0 is no threshold."""
    values = {"warn_energy": warn, "error_energy": error}
    values |= {"warn_energy_share": warn_share.split() or [""], "error_energy_share": error_share.split() or [""]}
    if joint is None:
        thresholds = Settings.of(DEFAULTS | values).thresholds
        assert (thresholds.warn, thresholds.error) == (warn, error)
        return
    with pytest.raises(InputError) as refusal:
        Settings.of(DEFAULTS | values)
    assert all(text in str(refusal.value) for text in (joint, "2 J", "1 J"))


def test_share_thresholds():
    """By joint, infinite where there is none; an unknown joint is refused by parameter and name."""
    thresholds = Thresholds(0.0, 0.0, {"elbow": 2.0, "*": 1.0}, {"wrist": 3.0, "elbow": 0.0})
    assert share_thresholds(thresholds, NAMES) == [[1.0, 2.0, 1.0], [INF, INF, 3.0]]
    for kind in ("warn", "error"):
        with pytest.raises(InputError, match=f"'{kind}_energy_share' names 'knee'"):
            share_thresholds(Thresholds(**{f"{kind}_share": {"knee": 1.0}}), NAMES)


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
        ({"effort_scale": ["*=1"], "effort_includes_gravity": ["elbow=true"]}, ("shoulder", "wrist")),
        ({"effort_available": ["shoulder=false"]}, ("elbow", "wrist")),
    ],
)
def test_undeclared_efforts(options, undeclared):
    """Joints whose efforts count although scale or gravity is a guess."""
    assert assembler(**options).efforts.undeclared == undeclared


@pytest.mark.parametrize("parameter", ["joint_timeouts", "effort_available", "effort_scale", "effort_includes_gravity"])
def test_entry_of_an_unknown_joint(parameter):
    """It is refused by parameter and joint, and the options in force stay."""
    entry = "knee=true" if parameter in ("effort_available", "effort_includes_gravity") else "knee=2"
    with pytest.raises(InputError, match=f"'{parameter}' names 'knee'"):
        assembler(**{parameter: [entry]})
    running = assembler(joint_timeout=1.5)
    others = {"joint_timeout": 9.0, "mimic_tolerance": 9.0, "max_age": 9.0, parameter: [entry]}
    with pytest.raises(InputError, match=f"'{parameter}' names 'knee'"):
        running.configure(settings(others).inputs)
    assert running.followers.tolerance == 0.01
    running.accept_values(NAMES, 1, 0, [np.zeros(3), np.zeros(3), np.zeros(0)], 10**12)
    assert running.stale(2_500_000_000) == [] and running.stale(2_500_000_001) == list(NAMES)


def test_gravity_of_a_mimic_joint():
    """It is declared for the joint that it follows."""
    with pytest.raises(InputError, match="'effort_includes_gravity' names 'heel'"):
        assembler(effort_includes_gravity=["heel=false"])
    assert EffortMeaning(
        ("elbow",), ("heel",), settings({"effort_includes_gravity": ["*=false"]}).inputs
    ).without_gravity == [1]
