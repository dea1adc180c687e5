# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names that others have written: wherever they are shown, nothing of them acts on a terminal, a log or a picture."""

import io
import pickle
import unicodedata
import warnings
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

import diag_dynamics as dd
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.text import plain
from diag_dynamics.views.energy_history import EnergyHistory
from diag_dynamics.views.push_history import Moment, PushHistory, Seen
from diag_dynamics.views.terminal import energy_panel

FORGED = "\n[FATAL] [0.0] [safety_controller]: fire"
HOSTILE = {
    "colour": ("a\x1b[31mb", r"a\x1b[31mb"),
    "one character of it": ("a\x9b31mb", r"a\x9b31mb"),
    "title of the terminal": ("\x1b]0;owned\x07", r"\x1b]0;owned\x07"),
    "a line of its own": (f"elbow{FORGED}", r"elbow\x0a[FATAL] [0.0] [safety_controller]: fire"),
    "back to the beginning of the line": ("elbow\r[INFO]", r"elbow\x0d[INFO]"),
    "delete": ("a\x7f\b", r"a\x7f\x08"),
    "from right to left": ("a\u202egnol\u2066", r"a\u202egnol\u2066"),
    "not to be seen": ("a\u200bb\ufeff", r"a\u200bb\ufeff"),
    "lines of Unicode": ("a\u2028b\u2029c\x85d", r"a\u2028b\u2029c\x85d"),
    "half a character": ("a\udc9bb", r"a\udc9bb"),
    "tags": ("a\U000e0041b", r"a\U000e0041b"),
    "languages": ("ellenbogen_größe_肘_локоть_कोहनी_مرفق é", "ellenbogen_größe_肘_локоть_कोहनी_مرفق é"),
    "a backslash": (r"C:\x1b\n", r"C:\x1b\n"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_plain(case):
    """What would act is shown instead, and letters stay letters."""
    text, shown = HOSTILE[case]
    assert plain(text) == shown


@given(st.text(st.characters() | st.sampled_from("\x1b\n\x9b\\\u202e")))
def test_plain_of_any_text(text):
    """One line without anything that acts; once is as good as twice; what does not act is as it was."""
    shown = plain(text)
    hidden = {"Cc", "Cf", "Cs", "Zl", "Zp"}
    assert not {unicodedata.category(character) for character in shown} & hidden
    assert len(shown.splitlines()) <= 1
    assert plain(shown) == shown
    if not {unicodedata.category(character) for character in text} & hidden:
        assert shown == text


def test_an_error_is_short():
    """A million characters of which each one would become four are cut before."""
    text = str(dd.InputError("\n" * 1_000_000))
    assert text.isprintable() and len(text) < 50_000 and text.endswith("(1000000 characters)")


ERRORS = {
    "InputError": dd.InputError(f"joint '{FORGED}'"),
    "UrdfError": dd.UrdfError(f"joint '{FORGED}'"),
    "MimicJointError": dd.MimicJointError(f"joint '{FORGED}'", [FORGED]),
    "MasslessLinkError": dd.MasslessLinkError(f"joint '{FORGED}'", [FORGED], [0.0]),
    "SingularMassMatrixError": dd.SingularMassMatrixError(f"joint '{FORGED}'", FORGED, 0.0),
    "RejectedError": RejectedError("late", f"joint '{FORGED}'"),
    "InertiaWarning": dd.InertiaWarning(f"joint '{FORGED}'"),
}


@pytest.mark.parametrize("kind", ERRORS)
def test_errors(kind):
    """Their text is plain, whoever shows it; their arguments and what they say of joints are names as they are."""
    error = ERRORS[kind]
    assert str(error) == r"joint '\x0a[FATAL] [0.0] [safety_controller]: fire'"
    assert f"joint '{FORGED}'" in error.args
    if hasattr(error, "joints"):
        assert error.joints == (FORGED,)
    if kind != "RejectedError":
        assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_an_error_without_a_text():
    """It is nothing."""
    assert str(dd.InputError()) == ""


def urdf(*, mass="1.0", ixx="0.01"):
    """Return a robot whose names are hostile: &#10; is a new line, which XML allows in an attribute."""
    name = "elbow&#10;[FATAL] [0.0] [safety_controller]: fire"
    return f"""<robot name="arm&#10;&#x9b;31m"><link name="base"/>
      <joint name="{name}" type="continuous"><parent link="base"/><child link="&#x202e;tip"/><axis xyz="0 0 1"/></joint>
      <link name="&#x202e;tip"><inertial><mass value="{mass}"/>
        <inertia ixx="{ixx}" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link></robot>"""


def test_a_model_keeps_its_names():
    """Names are data: they are the URDF's, or no driver would be understood; what is said of them is plain."""
    model = dd.load_urdf(urdf())
    assert model.dof_names == (f"elbow{FORGED}",)
    with pytest.raises(dd.InputError) as caught:
        dd.DiagonalDynamics(model).evaluate([np.nan], [0.0])
    assert r"joint 'elbow\x0a[FATAL]" in str(caught.value)
    with pytest.raises(dd.UrdfError) as caught:
        dd.load_urdf(urdf(mass="-1"))
    assert r"'\u202etip'" in str(caught.value) and str(caught.value).isprintable()
    with pytest.raises(dd.UrdfError, match="not well-formed XML") as caught:
        dd.load_urdf(urdf().replace("&#x9b;", "&#x1b;"))
    assert str(caught.value).isprintable()


def test_a_warning_on_a_terminal():
    """What Python shows of a warning is one line with nothing that acts."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        dd.load_urdf(urdf(ixx="5.0"))
    shown = warnings.formatwarning(
        *(getattr(caught[0], part) for part in ("message", "category", "filename", "lineno"))
    )
    assert r"robot 'arm\x0a\x9b31m'" in shown and r"'\u202etip'" in shown
    assert shown.splitlines()[0].isprintable()


NAMES = [f"elbow{FORGED}", "\x1b[31mred", "[red]wrist[/]", "[/nothing]", r"$\frac", "a\x9b2J", "\u202etip"]


def history():
    """Return a history of joints with such names."""
    samples = EnergyHistory(NAMES)
    for k in range(50):
        samples.add(0.02 * k, np.arange(1.0, 8.0) + k, 1.0, 1e-16, 1e-3)
    return samples


@pytest.mark.parametrize("count", [0, 50], ids=["waiting", "showing"])
def test_terminal_view(count):
    """It shows names as they are written: no control sequence but its own, and no markup."""
    out = io.StringIO()
    console = Console(file=out, width=160, height=60, force_terminal=False)
    robot = "arm[/bold]\x1b[2J\n"
    console.print(energy_panel(robot, history() if count else EnergyHistory([]), 60, 160))
    shown = out.getvalue()
    assert all(line.isprintable() for line in shown.split("\n"))
    assert r"arm[/bold]\x1b[2J\x0a" in shown
    if count:
        for name in NAMES:
            assert plain(name)[:30] in shown


def test_summary_and_picture(tmp_path):
    """So do the summary and the pictures, in which a dollar is a dollar."""
    samples = history()
    lines = samples.summary()
    assert all(line.isprintable() for line in lines) and any(r"\u202etip" in line for line in lines)
    samples.picture(tmp_path / "energy.svg", "arm$\\frac\x1b\n: energy")
    ElementTree.parse(tmp_path / "energy.svg")  # well-formed, which no control character is
    push = PushHistory(10.0, 1.0, 1.0, 0.5)
    push.onset, push.end = 0.1, 0.2
    push.moments = [Moment(0.02 * k, 0.1, False, 0.0) for k in range(20)]
    push.seen = [Seen(0.02 * k, 0.1, False) for k in range(20)]
    push.picture(tmp_path / "push.svg", "arm$\\frac\x1b\n: push")
    ElementTree.parse(tmp_path / "push.svg")
