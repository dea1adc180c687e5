# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names from files and messages: shown without any character that acts on a terminal, a log or a
picture.
"""

import math
import pickle
import unicodedata
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import diag_dynamics as dd
from diag_dynamics.exceptions import RejectedError
from diag_dynamics.text import MAX_LENGTH, distinct, number, plain

FORGED = "elbow\n[FATAL] [0.0] [safety_controller]: fire"
FORGED_SHOWN = r"elbow\n[FATAL] [0.0] [safety_controller]: fire"
HIDDEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories of characters that act."""

SHOWN = {
    "a\x1b[31mb": r"a\x1b[31mb",  # colour
    "\x1b]0;owned\x07": r"\x1b]0;owned\x07",  # title of the terminal
    FORGED: FORGED_SHOWN,
    "ellenbogen_größe_肘_локоть_कोहनी_مرفق é": "ellenbogen_größe_肘_локоть_कोहनी_مرفق é",
    r"C:\x1b\n": r"C:\x1b\n",
}


@pytest.mark.parametrize("text", SHOWN, ids=ascii)
def test_plain(text):
    assert plain(text) == SHOWN[text]


@given(st.text(st.characters() | st.sampled_from("\x1b\n\x9b\\\u202e")))
def test_plain_of_any_text(text):
    shown = plain(text)
    assert not {unicodedata.category(character) for character in shown} & HIDDEN
    assert len(shown.splitlines()) <= 1
    assert plain(shown) == shown
    if text.isprintable():
        assert shown == text


# --- Errors and warnings

ERRORS = (
    dd.InputError(FORGED),
    dd.MimicJointError(FORGED, [FORGED]),
    dd.MasslessLinkError(FORGED, [FORGED], [0.0]),
    dd.SingularMassMatrixError(FORGED, FORGED, 0.0),
    RejectedError("late", FORGED),
    dd.InertiaWarning(FORGED),
)


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors(error):
    """The text is plain; arguments and attributes are the names themselves."""
    assert str(error) == FORGED_SHOWN and FORGED in error.args
    assert getattr(error, "joints", (FORGED,)) == (FORGED,)
    if not isinstance(error, RejectedError):
        assert str(pickle.loads(pickle.dumps(error))) == str(error)


@pytest.mark.parametrize("kind", [dd.InputError, dd.InertiaWarning])
def test_length_of_errors(kind):
    text = str(kind("\n" * 1_000_000))
    assert text.isprintable() and len(text) <= MAX_LENGTH and " … (1000000 characters) … " in text
    assert str(dd.InputError(f"a{'x' * 1000}; expected z.")).endswith("x; expected z.")


def urdf(*, mass="1.0", ixx="0.01"):
    """Return a robot with control characters in names. XML allows &#10;, a new line, in an
    attribute.
    """
    name = FORGED.replace("\n", "&#10;")
    return f"""<robot name="arm&#10;&#x9b;31m"><link name="base"/>
      <joint name="{name}" type="continuous"><parent link="base"/><child link="&#x202e;tip"/>
        <axis xyz="0 0 1"/></joint>
      <link name="&#x202e;tip"><inertial><mass value="{mass}"/>
        <inertia ixx="{ixx}" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
          </robot>"""


def test_names_of_a_model():
    """A model keeps the names of its URDF; errors and warnings show them plainly."""
    model = dd.load_urdf(urdf())
    assert model.dof_names == (FORGED,)
    calls = {
        FORGED_SHOWN: lambda: dd.DiagonalDynamics(model).evaluate([np.nan], [0.0]),
        r"'\u202etip'": lambda: dd.load_urdf(urdf(mass="-1")),
        "not well-formed XML": lambda: dd.load_urdf(urdf().replace("&#x9b;", "&#x1b;")),
    }
    for key, call in calls.items():
        with pytest.raises(dd.DiagDynamicsError) as caught:
            call()
        assert key in str(caught.value) and str(caught.value).isprintable()
    with pytest.warns(dd.InertiaWarning) as warned:
        dd.load_urdf(urdf(ixx="5.0"))
    shown = warnings.formatwarning(
        warned[0].message, warned[0].category, warned[0].filename, warned[0].lineno
    )
    assert r"robot 'arm\n\x9b31m'" in shown and r"'\u202etip'" in shown
    assert shown.splitlines()[0].isprintable()


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (math.nan, "-"),
        (math.inf, "-"),
        (0.0, "0"),
        (1.0, "1.00"),
        (1234.6, "1235"),
        (0.00123, "0.0012"),
        (99999.0, "99999"),
        (9.9997, "10.0"),
        (1e5, "1.0e5"),
        (-1e300, "-1.0e300"),
        (1e-4, "1.0e-4"),
        (5e-324, "4.9e-324"),
    ],
)
def test_numbers_are_those_of_the_page(value, expected):
    """Terminal views and plots have the rows of web/test/format.test.js, in ASCII."""
    assert number(value) == expected


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ((0.05000001, 0.05), ["0.05000001", "0.05"]),
        ((3.2, 3.0, -3.0), ["3.2", "3", "-3"]),
        ((np.nextafter(1.0, 2.0), 1.0), ["1.0000000000000002", "1"]),
        ((2.0, 2.0), ["2", "2"]),
    ],
)
def test_numbers_that_differ_in_print(values, texts):
    """An error never says that a value equals its bound."""
    assert distinct(*values) == texts


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_distinct_numbers(first, second):
    assert (first == second) == (len({float(text) for text in distinct(first, second)}) == 1)
