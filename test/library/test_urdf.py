# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""URDFs: models of valid ones, named errors of the others, and bounds on the cost of untrusted
ones.
"""

import ctypes
import io
import os
import subprocess
import sys
import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.description import urdf
from diag_dynamics.description.urdf import MAX_JOINTS
from examples import shortened
from robots import ARM, BOX, arm, changed, description, joint, link

WELD = joint("weld", "fixed", "upper", "l")


# --- Sources


def test_sources(tmp_path, monkeypatch):
    """Path, path in the home folder, text, bytes and open files give the same model."""
    monkeypatch.setenv("HOME", str(tmp_path))
    file = tmp_path / "arm ü.urdf"
    text = '<?xml version="1.0" encoding="utf-8"?>\n' + ARM
    file.write_text(text, encoding="utf-8")
    expected = dd.load_urdf(ARM)
    with file.open(encoding="utf-8") as as_text, file.open("rb") as as_bytes:
        open_files = [as_text, as_bytes, io.StringIO(text)]
        paths = [file, str(file), "~/arm ü.urdf", Path("~/arm ü.urdf")]
        for source in (*paths, text, text.encode(), "\ufeff  " + text, *open_files):
            model = dd.load_urdf(source)
            assert model.bodies.tobytes() == expected.bodies.tobytes()
            assert model.links.tobytes() == expected.links.tobytes()


def test_no_other_file_is_opened(tmp_path):
    """The loader opens neither meshes nor the files of a document type or an entity."""
    libc = ctypes.CDLL(None, use_errno=True)
    watch = libc.inotify_init1(os.O_NONBLOCK)

    def was_opened():
        try:
            return bool(os.read(watch, 4096))
        except BlockingIOError:
            return False

    secret = tmp_path / "secret"
    secret.write_text("0.1", encoding="utf-8")
    assert libc.inotify_add_watch(watch, str(secret).encode(), 0x20) >= 0  # IN_OPEN
    try:
        secret.read_text(encoding="utf-8")
        assert was_opened()  # the watch works
        mesh = f'<geometry><mesh filename="file://{secret}"/></geometry>'
        shapes = f"<visual>{mesh}</visual><collision>{mesh}</collision>"
        assert (
            dd.load_urdf(changed('<link name="base"/>', f'<link name="base">{shapes}</link>')).nv
            == 1
        )
        for text in (
            f'<!DOCTYPE robot SYSTEM "file://{secret}">' + ARM,
            f'<!DOCTYPE robot [<!ENTITY x SYSTEM "file://{secret}">]>' + changed("shoulder", "&x;"),
            f'<!DOCTYPE robot [<!ENTITY % x SYSTEM "file://{secret}">%x;]>' + ARM,
        ):
            with pytest.raises(dd.UrdfError):
                dd.load_urdf(text)
        assert not was_opened()
    finally:
        os.close(watch)


# --- Models


def test_order_limits_and_defaults():
    """Depth first, siblings by the names of their joints; limits and damping where the URDF has
    them.
    """
    model = dd.load_urdf(
        description(
            "tree",
            *(link(name, **BOX) for name in ("root", "a", "b", "c", "hand")),
            joint("z", "prismatic", "root", "a"),
            joint("m", "continuous", "root", "b"),
            joint("weld", "fixed", "b", "hand"),
            '<joint name="y" type="revolute"><parent link="hand"/><child link="c"/>'
            '<limit lower="-1" upper="2" effort="3" velocity="4"/>'
            '<dynamics damping="0.5" friction="0.25"/></joint>',
        )
    )
    assert model.dof_names == model.joint_names == ("m", "y", "z")
    assert model.link_names == ("root", "b", "hand", "c", "a")
    assert (model.nq, model.nv, model.total_mass) == (3, 3, 10.0)
    assert model.root_link == "root" and model.fixed_joints == ("weld",)
    np.testing.assert_array_equal(model.lower, [-np.inf, -1, -10])
    np.testing.assert_array_equal(model.upper, [np.inf, 2, 10])
    np.testing.assert_array_equal(model.effort_limit, [100, 3, 100])
    np.testing.assert_array_equal(model.velocity_limit, [100, 4, 100])
    np.testing.assert_array_equal(model.damping, [0, 0.5, 0])
    np.testing.assert_array_equal(model.friction, [0, 0.25, 0])
    empty = changed('lower="-10" upper="10" effort="100" velocity="100"', 'lower="" upper=" "')
    model = dd.load_urdf(empty)
    assert (model.lower[0], model.upper[0], model.effort_limit[0]) == (-np.inf, np.inf, np.inf)


TOLERATED = {
    "capsule": (
        "</robot>",
        '<link name="l"><visual><geometry><capsule/></geometry></visual></link>' + WELD,
    ),
    "lost mesh": (
        "</link>",
        '<visual><geometry><mesh filename="package://no/no.stl"/></geometry></visual></link>',
    ),
    "nameless visual": ("</link>", "<visual/><visual/><collision/></link>"),
    "nameless robot": (' name="arm"', ""),
    "default namespace": ("<robot", '<robot xmlns="http://drake.mit.edu"'),
    "declared prefix": ("</robot>", '<s:camera xmlns:s="urn:s"/>'),
    "undeclared prefix": ("</robot>", '<sensor:camera name="c" a:b="1"/>'),
    "unknown in joint": (
        "</joint>",
        '<safety_controller soft="a"/><calibration/><hardwareInterface/></joint>',
    ),
    "broken extensions": (
        "</robot>",
        "<transmission/><gazebo reference='q'><plugin/></gazebo><material/>",
    ),
    "infinite effort": ('effort="100"', 'effort="inf"'),
    "comments": ("</robot>", '<!-- <joint name="no"/> & -->\n<?pi?>'),
}


@pytest.mark.parametrize("case", TOLERATED)
def test_tolerated(case):
    """Elements without a meaning for dynamics change nothing."""
    old, new = TOLERATED[case]
    model = dd.load_urdf(changed(old, new + "</robot>" if old == "</robot>" else new))
    assert model.bodies.tobytes() == dd.load_urdf(ARM).bodies.tobytes()


# --- Inertias


@pytest.mark.parametrize(
    ("inertia", "key"),
    [
        ((-0.1, 0, 0, 0.2, 0, 0.3), "negative"),
        ((0.1, 0, 0, 0.1, 0, 0.3), "over the sum of the others"),
        ((0.1, 0.3, 0, 0.1, 0, 0.1), "negative"),
        ((0.1, 0, 0, 0.1, 0, 0.2005), "over the sum of the others"),
        ((-2e-4, 0, 0, 0.1, 0, 0.1), "negative"),
    ],
)
def test_inertia_of_no_rigid_body_warns(inertia, key):
    odd = link("odd", mass=2.0, com=(0.5, 0, 0), inertia=inertia)
    with pytest.warns(dd.InertiaWarning, match="robot 'r': link 'odd'") as caught:
        assert (
            dd.load_urdf(description("r", link("a"), odd, joint("j", "revolute", "a", "odd"))).nv
            == 1
        )
    assert key in str(caught[0].message)


def rounded(inertia, digits):
    """Return ixx ixy ixz iyy iyz izz, rounded to some digits."""
    return [
        float(f"{inertia[i, j]:.{digits - 1}e}")
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    ]


def test_rounded_inertias_do_not_warn():
    """Plates and rods are at the bound of rigid bodies. Four digits suffice; zero inertia is
    valid.
    """
    rng = np.random.default_rng(0)
    inertias = [(0, 0, 0, 0, 0, 0), (0.1, 0, 0, 0.1, 0, 0.2), (1e-20, 0, 0, -1e-20, 0, 0)]
    for digits in (4, 5, 6, 9):
        for _ in range(shortened(50, 5)):
            a, b = rng.uniform(0.01, 2.0, 2) ** 2 * rng.uniform(0.1, 10.0) / 12.0
            rotation, _ = np.linalg.qr(rng.standard_normal((3, 3)))
            for body in (np.diag([a, b, a + b]), np.diag([0.0, a, a])):
                inertias += [rounded(body, digits), rounded(rotation @ body @ rotation.T, digits)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for inertia in inertias:
            dd.load_urdf(description("r", link("a", mass=1.0, inertia=inertia)))


# --- Errors

ENTITY = '<!DOCTYPE robot [<!ENTITY m "7">]>'
BOMB = (
    '<!DOCTYPE r [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]>'
    '<robot name="&c;"/>'
)
MASS, COM, LOWER = '<mass value="2.0"/>', 'xyz="0.1 0.2 0.3"', 'lower="-10"'
RING = (link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a"))
TWINS = (
    *(link(name, **BOX) for name in "abc"),
    joint("slide", "planar", "a", "b"),
    joint("slide/x", "revolute", "b", "c"),
)

BROKEN = {
    # sources
    "no such file": ("/nowhere/robot.urdf", "'/nowhere/robot.urdf'"),
    "a folder": (".", "'.': it is no file"),
    "a number": (7, "int"),
    "empty": ("", "is empty"),
    # XML
    "blank": ("<!-- nothing -->", "not well-formed XML"),
    "cut short": (ARM[:-30], "not well-formed XML"),
    "undeclared entity": (changed("base", "&base;"), "'base' not defined"),
    "depth bomb": ("<robot>" + "<a>" * 5000 + "</a>" * 5000 + "</robot>", "Excessive depth"),
    "entity bomb": (BOMB, "DOCTYPE"),
    "entity behind a decoy": (
        "<!-- <robot -->" + ENTITY + changed(MASS, '<mass value="&m;"/>'),
        "DOCTYPE",
    ),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="&a;"/>',
        "external entity",
    ),
    # tree
    "not a robot": ("<sdf/>", "<sdf>"),
    "no links": ('<robot name="r"/>', "no <link>"),
    "nameless link": (arm("\n<link/>"), "<link> in line 2 has no name"),
    "same link twice": (arm(link("upper")), "<link> have the name 'upper'"),
    "same joint twice": (
        arm(link("l"), joint("shoulder", "fixed", "upper", "l")),
        "<joint> have the name 'shoulder'",
    ),
    "positions of one name": (description("r", *TWINS), "'slide/x'"),
    "unknown type": (arm(kind="spherical"), "joint 'shoulder': unknown type 'spherical'"),
    "unknown parent": (
        arm(link("l"), joint("e", "fixed", "lower", "l")),
        "joint 'e' has parent 'lower'",
    ),
    "no child": (
        arm('<joint name="j" type="fixed"><parent link="base"/></joint>'),
        "joint 'j' has child None",
    ),
    "two roots": (arm(link("alone")), "2 root links ('base', 'alone')"),
    "loop": (
        arm(
            link("l", **BOX),
            joint("e", "revolute", "upper", "l"),
            joint("back", "revolute", "base", "l"),
        ),
        "two joints, 'e' and 'back'; expected a tree. Describe a loop by <loop_joint>",
    ),
    "ring": (description("r", *RING), "'a' is part of a loop"),
    "ring beside the tree": (arm(*RING), "'a' is part of a loop"),
    # numbers
    "no mass": (changed(MASS, ""), "link 'upper': <inertial> lacks <mass value="),
    "no izz": (changed(' izz="0.3"', ""), "link 'upper': <inertial> lacks <inertia izz="),
    "negative mass": (changed('"2.0"', '"-2"'), "link 'upper': mass is -2 kg"),
    "nan mass": (changed(MASS, '<mass value="nan"/>'), "link 'upper': <mass value='nan'>"),
    "other digits": (changed(MASS, '<mass value="٢"/>'), "link 'upper': <mass value='٢'>"),
    "long number": (changed(MASS, f'<mass value="{"9x" * 2000}"/>'), "(4002 characters)"),
    "huge number": (
        changed(COM, 'xyz="0.1 0.2 1e200"'),
        "<origin xyz='0.1 0.2 1e200'> is beyond 1e+30",
    ),
    "two coordinates": (changed(COM, 'xyz="0.1 0.2"'), "<origin xyz='0.1 0.2'> is not 3"),
    "zero axis": (
        changed('<axis xyz="0.0 0.0 1.0"/>', '<axis xyz="0 0 0"/>'),
        "joint 'shoulder': axis",
    ),
    "words for limits": (changed(LOWER, 'lower="low"'), "joint 'shoulder': <limit lower='low'>"),
    "crossed limits": (changed(LOWER, 'lower="11"'), "joint 'shoulder': lower limit is 11.0"),
    "negative damping": (
        changed("</joint>", '<dynamics damping="-1"/></joint>'),
        "joint 'shoulder': damping is -1.0",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken(case):
    source, key = BROKEN[case]
    with pytest.raises(dd.UrdfError) as caught:
        dd.load_urdf(source)
    assert isinstance(caught.value, dd.DiagDynamicsError)
    assert key in str(caught.value) and str(caught.value).count("Cannot read") <= 1


LARGE = np.diag([1e300, 1e300, 1e300])

BAD_OPTIONS = [
    ({"mimic": "both"}, "mimic is 'both'"),
    ({"massless": "drop"}, "massless is 'drop'"),
    ({"gravity": (0, 0)}, "gravity is (0, 0)"),
    ({"gravity": (0, 0, np.inf)}, "gravity is"),
    ({"gravity": (0, 1e305, 0)}, "±1000"),
    ({"armature": -1.0}, "armature of joint 'shoulder' is -1.0"),
    ({"armature": True}, "armature is True"),
    ({"armature": {"shoulder": 1e10}}, "armature of joint 'shoulder' is 10000000000.0"),
    ({"armature": {"elbow": 1.0}}, "armature has 'elbow'"),
    ({"locked_joints": {"elbow": 0.0}}, "locked_joints has 'elbow'"),
    ({"locked_joints": {"shoulder": np.nan}}, "joint 'shoulder' is nan"),
    ({"locked_joints": ["shoulder"]}, "locked_joints is ['shoulder']"),
    ({"payloads": {"hand": (1.0,)}}, "payloads has 'hand'"),
    ({"payloads": {"upper": (-1.0,)}}, "mass on link 'upper' is -1.0"),
    ({"payloads": {"upper": (1.0, (0, 1e200, 0))}}, "com on link 'upper' is (0, 1e+200, 0)"),
    ({"payloads": {"upper": (1.0, (0, 0, 0), LARGE)}}, "±1e+09"),
]


@pytest.mark.parametrize(("options", "key"), BAD_OPTIONS)
def test_bad_options(options, key):
    with pytest.raises(dd.InputError) as caught:
        dd.load_urdf(ARM, **options)
    assert key in str(caught.value)


# --- Size


def grown(count, parent=lambda k: k - 1, source=lambda k: None, kind="revolute"):
    """Return a robot of `count` joints; parent -1 is the root, and a joint whose source is None
    moves freely.
    """
    parts = [link("l-1")]
    for k in range(count):
        element = joint(f"j{k}", kind, f"l{parent(k)}", f"l{k}")
        if source(k) is not None:
            element = changed(
                "</joint>", f'<mimic joint="j{source(k)}" multiplier="-1"/></joint>', element
            )
        parts += [link(f"l{k}", 1.0, (0.1, 0.2, 0.3), (0.1, 0, 0, 0.1, 0, 0.1)), element]
    return description("grown", *parts)


STAR = {"parent": lambda k: -1}
PAIRS = {"source": lambda k: k - 1 if k % 2 else None}
ONE_SOURCE = {"source": lambda k: 0 if k else None}
CHAIN_OF_SOURCES = {"source": lambda k: k - 1 if k else None}

SHAPES = {
    "chain": {},
    "chain of fixed joints": {"kind": "fixed"},
    "pairs in a star": STAR | PAIRS,
    "one source, in a star": STAR | ONE_SOURCE,
    "chain of sources, in a chain": CHAIN_OF_SOURCES,
    "groups that join": {"source": lambda k: k // 2 if k else None},
}


def count_lines(text):
    """Count the lines of the package that loading executes, and calls of other functions."""
    count = 0

    def trace(frame, event, _):
        nonlocal count
        count += 1
        return trace if "diag_dynamics" in frame.f_code.co_filename else None

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        dd.load_urdf(text)
    finally:
        sys.settrace(before)
    return count


@pytest.mark.parametrize("shape", SHAPES)
def test_loading_takes_linear_time(shape):
    """Twice the joints, twice the lines; the compiled evaluation of a group is not counted."""
    sizes = [shortened(60, 20) * 2**k for k in range(3)]
    counts = [count_lines(grown(n, **SHAPES[shape])) for n in sizes]
    assert all(more < 2.3 * less for less, more in pairwise(counts)), counts


@pytest.fixture
def forbid(monkeypatch):
    """Return a function that makes a call of a function fail."""

    def never(*_):
        raise AssertionError("called for a description that should have been rejected before")

    return lambda module, name: monkeypatch.setattr(module, name, never)


@pytest.mark.parametrize("kind", ["revolute", "fixed"])
def test_many_joints_are_rejected_before_they_are_read(kind, forbid):
    forbid(urdf, "_read")
    with pytest.raises(
        dd.UrdfError, match=rf"{MAX_JOINTS + 1} joints .*no more than {MAX_JOINTS} joints"
    ):
        dd.load_urdf(grown(MAX_JOINTS + 1, kind=kind))
    count = MAX_JOINTS + 2
    with pytest.raises(dd.UrdfError, match=rf"0 joints and {count} links, and no more than"):
        dd.load_urdf(description("scattered", *(link(f"l{k}") for k in range(count))))


# --- yourdfpy


def test_yourdfpy_is_imported_when_a_urdf_is_read():
    script = (
        "import sys, diag_dynamics as dd, diag_dynamics.model, diag_dynamics.dynamics, "
        "diag_dynamics.cli.main;"
        "print('yourdfpy' in sys.modules); dd.load_urdf(sys.argv[1]); print('yourdfpy' in "
        "sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, ARM], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False", "True"]


def test_broken_yourdfpy_is_named(tmp_path, monkeypatch):
    """Its libraries may not fit the NumPy."""
    (tmp_path / "yourdfpy.py").write_text(
        "raise AttributeError('module numpy has no attribute in1d')"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "yourdfpy", raising=False)
    with pytest.raises(
        dd.UrdfError, match=r"yourdfpy cannot be imported.*in1d.*pip install yourdfpy"
    ):
        dd.load_urdf(ARM)
