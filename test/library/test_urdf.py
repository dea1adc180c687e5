# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a URDF becomes, and what is said of one that cannot become a model."""

import ctypes
import os
import warnings

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.sweeps.bodies import FLOATING, PLANAR, POSITIONS_OF, PRISMATIC, REVOLUTE
from robots import description, joint, link, robot_path

BOX = {"mass": 2.0, "com": (0.1, 0.2, 0.3), "inertia": (0.1, 0.0, 0.0, 0.2, 0.0, 0.3)}


def arm(*more, first="revolute"):
    return description("arm", link("base"), link("upper", **BOX), joint("shoulder", first, "base", "upper"), *more)


# --- What is read ---


def test_path_text_and_bytes_are_the_same(tmp_path):
    file = tmp_path / "arm ü.urdf"
    text = '<?xml version="1.0" encoding="utf-8"?>\n' + arm()
    file.write_text(text, encoding="utf-8")
    models = [dd.load_urdf(source) for source in (file, str(file), text, text.encode(), "\ufeff  " + text)]
    for model in models[1:]:
        assert model.bodies.tobytes() == models[0].bodies.tobytes()


def test_path_in_the_home_directory(tmp_path, monkeypatch):
    """``~`` in a path is who reads it's own, as parameters and launch arguments have it, which no shell has expanded."""
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "my.urdf").write_text(description("mine", link("base")))
    assert dd.load_urdf("~/my.urdf").name == "mine"


def test_no_other_file_is_opened(tmp_path):
    """Neither meshes nor what a document type or an entity names: who sends a description reads no files by it."""
    libc = ctypes.CDLL(None, use_errno=True)
    watch = libc.inotify_init1(os.O_NONBLOCK)
    assert watch >= 0

    def opened():
        try:
            return os.read(watch, 4096)
        except BlockingIOError:
            return b""

    secret = tmp_path / "secret"
    secret.write_text("0.1", encoding="utf-8")
    assert libc.inotify_add_watch(watch, str(secret).encode(), 0x20) >= 0  # IN_OPEN
    try:
        secret.read_text(encoding="utf-8")
        assert opened()  # the watch works
        mesh = f'<geometry><mesh filename="file://{secret}"/></geometry>'
        seen = arm().replace(
            '<link name="base"/>', f'<link name="base"><visual>{mesh}</visual><collision>{mesh}</collision></link>'
        )
        assert dd.load_urdf(seen).nv == 1
        for kind in ("", "% "):
            for text in (
                f'<!DOCTYPE robot [<!ENTITY {kind}x SYSTEM "file://{secret}">]>' + arm(),
                f'<!DOCTYPE robot SYSTEM "file://{secret}">' + arm(),
                f'<!DOCTYPE robot [<!ENTITY {kind}x SYSTEM "file://{secret}">{"%x;" if kind else ""}]>'
                + arm().replace("shoulder", "" if kind else "&x;", 1),
            ):
                with pytest.raises(dd.UrdfError):
                    dd.load_urdf(text)
        assert not opened()
    finally:
        os.close(watch)


def test_declared_encoding(tmp_path):
    """The bytes of a file are in the encoding they declare; text is text whatever it declares."""
    text = '<?xml version="1.0" encoding="iso-8859-1"?>' + arm().replace("shoulder", "Schläger")
    file = tmp_path / "latin.urdf"
    file.write_bytes(text.encode("iso-8859-1"))
    for source in (file, text, text.encode("iso-8859-1")):
        assert dd.load_urdf(source).dof_names == ("Schläger",)


def test_order_limits_and_defaults():
    """Depth first, siblings by joint name; limits and damping where the URDF has them."""
    model = dd.load_urdf(
        description(
            "tree",
            *(link(name, **BOX) for name in ("root", "a", "b", "c", "hand")),
            joint("z", "prismatic", "root", "a"),
            joint("m", "continuous", "root", "b"),
            joint("weld", "fixed", "b", "hand"),
            '<joint name="y" type="revolute"><parent link="hand"/><child link="c"/>'
            '<limit lower="-1" upper="2" effort="3" velocity="4"/><dynamics damping="0.5" friction="0.25"/></joint>',
        )
    )
    assert model.dof_names == model.joint_names == ("m", "y", "z")
    assert model.link_names == ("root", "b", "hand", "c", "a")
    assert (model.nq, model.nv) == (3, 3)
    assert model.root_link == "root"
    assert model.fixed_joints == ("weld",)
    assert model.total_mass == 10.0
    np.testing.assert_array_equal(model.lower, [-np.inf, -1, -10])
    np.testing.assert_array_equal(model.upper, [np.inf, 2, 10])
    np.testing.assert_array_equal(model.effort_limit, [100, 3, 100])
    np.testing.assert_array_equal(model.velocity_limit, [100, 4, 100])
    np.testing.assert_array_equal(model.damping, [0, 0.5, 0])
    np.testing.assert_array_equal(model.friction, [0, 0.25, 0])


def test_model_is_immutable():
    model = dd.load_urdf(arm())
    with pytest.raises(AttributeError):
        model.name = "other"
    for array in (model.gravity, model.lower, model.bodies, model.links, model.damping):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    moon = model.with_gravity((0, 0, -1.62))
    assert moon.gravity[2] == -1.62 and model.gravity[2] == -9.81
    assert moon.bodies is model.bodies


def test_what_dynamics_does_not_need_is_not_looked_at():
    """Meshes, broken visuals, unknown extensions and comments neither matter nor prevent loading."""
    extras = (
        '<link name="more"><visual><geometry><capsule radius="1"/></geometry></visual><visual><geometry>'
        '<mesh filename="package://nowhere/nothing.stl"/></geometry></visual><collision/></link>'
        + joint("weld", "fixed", "upper", "more")
        + '<!-- <joint name="no"/> --><material/><transmission/><gazebo><plugin/></gazebo><unknown x="1"/>'
    )
    plain = dd.load_urdf(arm(link("more"), joint("weld", "fixed", "upper", "more")))
    assert dd.load_urdf(arm(extras)).bodies.tobytes() == plain.bodies.tobytes()
    assert dd.load_urdf(arm().replace(' name="arm"', "")).name == "robot"


def test_motionless_robot_gives_empty_vectors():
    model = dd.load_urdf(description("rock", link("base", **BOX)))
    dynamics = dd.DiagonalDynamics(model)
    s = dynamics.evaluate([], [], [])
    assert model.nv == 0 and s.nu.shape == s.epsilon.shape == (0,)
    assert s.kinetic_energy == 0.0 and s.link_energy.tolist() == [0.0]
    assert dynamics.factors([]).m.shape == dynamics.mass_matrix([]).shape == (0, 0)
    assert dynamics.forward_dynamics([], [], []).shape == (0,)


def test_axes_need_no_unit_length():
    rest = {"xyz": (0, 0, 1), "rpy": (0.3, 0.2, 0.1)}
    one, three = (
        dd.DiagonalDynamics(dd.load_urdf(arm(link("l", **BOX), joint("e", "revolute", "upper", "l", axis=a, **rest))))
        for a in ((1, 2, 2), (3, 6, 6))
    )
    np.testing.assert_allclose(one.mass_matrix([0.1, 0.2]), three.mass_matrix([0.1, 0.2]), rtol=1e-15)


TOLERATED = {
    "capsule": (
        "</robot>",
        '<link name="x"><visual><geometry><capsule/></geometry></visual></link>' + "{weld}</robot>",
    ),
    "nameless visual": ("</link>", "<visual/><visual/></link>"),
    "nameless robot": (' name="arm"', ""),
    "default namespace": ("<robot", '<robot xmlns="http://drake.mit.edu"'),
    "declared prefix": ("</robot>", '<s:camera xmlns:s="urn:s"/></robot>'),
    "undeclared prefix": ("</robot>", '<sensor:camera name="c" a:b="1"/></robot>'),
    "undeclared prefix within": ("</link>", "<gazebo:thing><x:y/></gazebo:thing></link>"),
    "unknown within inertial": ("</inertial>", "<density value='?'/></inertial>"),
    "unknown within joint": ("</joint>", '<safety_controller soft="a"/><calibration/><hardwareInterface/></joint>'),
    "broken extensions": ("</robot>", "<transmission/><gazebo reference='q'/><material/><sensor/></robot>"),
    "infinite effort": ('effort="100.0"', 'effort="inf"'),
    "comments": ("</robot>", '<!-- <joint name="no"/> & -->\n<?pi?></robot>'),
}


@pytest.mark.parametrize("case", TOLERATED)
def test_tolerated(case):
    """It loads, and into the very same model."""
    before, after = TOLERATED[case]
    text = arm().replace('effort="100"', 'effort="100.0"')
    assert before in text
    weld = joint("weld", "fixed", "upper", "x")
    model = dd.load_urdf(text.replace(before, after.replace("{weld}", weld)))
    assert model.bodies.tobytes() == dd.load_urdf(arm()).bodies.tobytes()


def test_empty_limits():
    model = dd.load_urdf(arm().replace('lower="-10" upper="10" effort="100" velocity="100"', 'lower="" upper=" "'))
    assert (model.lower[0], model.upper[0], model.effort_limit[0]) == (-np.inf, np.inf, np.inf)


def test_unicode_names():
    model = dd.load_urdf(arm().replace("shoulder", "関節 ä'\u200b").replace('"upper"', '"Oberarm ✓"'))
    assert model.dof_names == ("関節 ä'\u200b",)
    assert model.link_names == ("base", "Oberarm ✓")


@pytest.mark.parametrize(
    ("inertia", "reason"),
    [
        ((-0.1, 0, 0, 0.2, 0, 0.3), "principal moments -0.1, 0.2, 0.3 are not all positive"),
        ((0.1, 0, 0, 0.1, 0, 0.3), "principal moments 0.1, 0.1, 0.3 break the triangle inequality"),
        ((0.1, 0.3, 0, 0.1, 0, 0.1), "are not all positive"),
        ((0.1, 0, 0, 0.1, 0, 0.2005), "break the triangle inequality"),
        ((-2e-4, 0, 0, 0.1, 0, 0.1), "are not all positive"),
    ],
)
def test_inertia_of_no_rigid_body_loads_with_a_warning(inertia, reason):
    text = description("r", link("a"), link("odd", mass=2.0, com=(0.5, 0, 0), inertia=inertia))
    text = text.replace("</robot>", joint("j", "revolute", "a", "odd") + "</robot>")
    with pytest.warns(dd.InertiaWarning, match="link 'odd' of robot 'r'") as caught:
        assert dd.load_urdf(text).nv == 1
    assert reason in str(caught[0].message)


def rounded(inertia, digits):
    """Return ixx ixy ixz iyy iyz izz as a URDF has them that gives so many digits of each."""
    return [float(f"{inertia[i, j]:.{digits - 1}e}") for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]


def test_rounding_makes_no_warning():
    """Plates and rods of any size and direction are on the edge of what bodies have; four digits of them suffice."""
    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for digits in (4, 5, 6, 9):
            for _ in range(50):
                a, b = rng.uniform(0.01, 2.0, 2) ** 2 * rng.uniform(0.1, 10.0) / 12.0
                turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
                for body in (np.diag([a, b, a + b]), np.diag([0.0, a, a])):
                    for inertia in (body, turn @ body @ turn.T):
                        text = link("a", mass=1.0, inertia=rounded(inertia, digits))
                        dd.load_urdf(description("r", text))


@pytest.mark.parametrize("inertia", [(0, 0, 0, 0, 0, 0), (0.1, 0, 0, 0.1, 0, 0.2), (1e-20, 0, 0, -1e-20, 0, 0)])
def test_points_and_plates_give_no_warning(inertia):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dd.load_urdf(description("r", link("a", mass=1.0, inertia=inertia)))


# --- Mimic joints ---

FOLLOWER = '<joint name="follower" type="revolute"><parent link="upper"/><child link="l"/><mimic joint="{}"/></joint>'


def test_mimic_is_embedded_unless_free_or_locked():
    urdf = arm(link("l", **BOX), FOLLOWER.format("shoulder"))
    model = dd.load_urdf(urdf)
    assert model.dof_names == ("shoulder",)
    assert dict(model.mimics) == {"follower": dd.Mimic("shoulder", 1.0, 0.0)}
    assert model.coupled_groups == (("shoulder", "follower"),)
    assert dd.load_urdf(urdf, mimic="free").dof_names == ("shoulder", "follower")
    assert dd.load_urdf(urdf, mimic="lock").locked_joints == {"follower": 0.0}


def test_bodies_carry_the_kind_of_their_joint():
    """Each body of a joint says which joint it is: neither their number nor their directions do."""
    kinds = {
        "revolute": REVOLUTE,
        "continuous": REVOLUTE,
        "prismatic": PRISMATIC,
        "planar": PLANAR,
        "floating": FLOATING,
    }
    for first, kind in kinds.items():
        model = dd.load_urdf(arm(first=first))
        assert (model.bodies["kind"][1:] == kind).all() and model.nq == POSITIONS_OF[kind]
        assert (model.bodies["dofs"][1:] == model.nv).all()
        assert sum(component >= 0 for component in model.orientations) == 4 * (kind == FLOATING)


def test_positions_of_one_name_are_refused():
    """A planar joint's are called <joint>/x and so on, which another joint may be called, too."""
    urdf = description(
        "r",
        link("a", **BOX),
        link("b", **BOX),
        link("c", **BOX),
        joint("slide", "planar", "a", "b", axis=(0, 0, 1)),
        joint("slide/x", "revolute", "b", "c", axis=(0, 0, 1)),
    )
    with pytest.raises(dd.UrdfError, match="Two positions would have the name 'slide/x'"):
        dd.load_urdf(urdf)


def test_mimic_of_an_unknown_joint_is_refused():
    urdf = arm(link("l", **BOX), FOLLOWER.format("nobody"))
    with pytest.raises(dd.MimicJointError, match=r"'follower'.*mimics 'nobody'.*mimic='free'") as caught:
        dd.load_urdf(urdf)
    assert caught.value.joints == ("follower",)
    assert isinstance(caught.value, dd.UrdfError)


# --- What cannot be a model ---

BROKEN = {
    "no such file": (
        "/nowhere/robot.urdf",
        dd.UrdfError,
        "Cannot read the URDF file '/nowhere/robot.urdf'",
    ),
    "a folder": (".", dd.UrdfError, "Cannot read the URDF file '.': it is no file."),
    "empty": ("", dd.UrdfError, "The URDF is empty."),
    "blank": ("<!-- nothing -->", dd.UrdfError, "The URDF is not well-formed XML"),
    "a number": (7, dd.UrdfError, "A URDF is a path or XML text, not a int."),
    "cut short": (arm()[:-30], dd.UrdfError, "The URDF is not well-formed XML"),
    "not a robot": ("<sdf/>", dd.UrdfError, "The root element is <sdf>, expected <robot>."),
    "no links": ('<robot name="r"/>', dd.UrdfError, "The URDF has no <link>."),
    "wrong bytes": (b"<robot>\xff</robot>", dd.UrdfError, "The URDF is not utf-8 text"),
    "doctype": (
        '<!DOCTYPE r [<!ENTITY a "b">]><robot name="r"><link name="l"/></robot>',
        dd.UrdfError,
        "The URDF has a DOCTYPE, which is not accepted: entities are never expanded.",
    ),
    "xacro": (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><xacro:macro name="m"/><link name="l"/></robot>',
        dd.UrdfError,
        "The URDF contains <xacro:macro>: it is unexpanded xacro. Run xacro on it first.",
    ),
    "entity bomb": (
        '<!DOCTYPE r [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]><robot name="&c;"/>',
        dd.UrdfError,
        "The URDF has a DOCTYPE, which is not accepted: entities are never expanded.",
    ),
    "entity behind a decoy": (
        '<!-- <robot --><!DOCTYPE robot [<!ENTITY m "7">]>'
        + arm().replace('<mass value="2.0"/>', '<mass value="&m;"/>'),
        dd.UrdfError,
        "The URDF has a DOCTYPE, which is not accepted: entities are never expanded.",
    ),
    "entity as content behind a decoy": (
        '<!-- <robot --><!DOCTYPE robot [<!ENTITY m "7">]>' + arm().replace("</robot>", "&m;</robot>"),
        dd.UrdfError,
        "The URDF has a DOCTYPE, which is not accepted: entities are never expanded.",
    ),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="r"><link name="&a;"/></robot>',
        dd.UrdfError,
        "The URDF has a DOCTYPE, which is not accepted: entities are never expanded.",
    ),
    "remote schema": (
        '<!DOCTYPE robot SYSTEM "http://127.0.0.1:1/robot.dtd"><robot name="r"/>',
        dd.UrdfError,
        "The URDF has a DOCTYPE, which is not accepted: entities are never expanded.",
    ),
    "depth bomb": (
        "<robot>" + "<a>" * 5000 + "</a>" * 5000 + "</robot>",
        dd.UrdfError,
        "not well-formed XML: Excessive depth",
    ),
    "too large": ("<robot>" + " " * (33 << 20) + "</robot>", dd.UrdfError, "has more than the 33554432 bytes accepted"),
    "odd encoding": (
        b'<?xml version="1.0" encoding="punycode"?><robot/>',
        dd.UrdfError,
        "The URDF declares the encoding 'punycode', expected UTF-8 or another usual one.",
    ),
    "undeclared entity": (
        arm().replace("base", "&base;"),
        dd.UrdfError,
        "not well-formed XML: Entity 'base' not defined",
    ),
    "xacro without prefix declared": (
        '<robot name="r"><xacro:include filename="x"/><link name="l"/></robot>',
        dd.UrdfError,
        "The URDF contains <xacro:include>: it is unexpanded xacro. Run xacro on it first.",
    ),
    "xacro in a name": (
        arm().replace('"upper"', '"${side}_upper"'),
        dd.UrdfError,
        "The name of a <link> in line 1 is '${side}_upper', which is unexpanded xacro. Run xacro on it first.",
    ),
    "xacro in a type": (
        arm(first="$(arg kind)"),
        dd.UrdfError,
        "joint 'shoulder': type is '$(arg kind)', which is unexpanded xacro. Run xacro on it first.",
    ),
    "huge number": (
        arm().replace('xyz="0.1 0.2 0.3"', 'xyz="0.1 0.2 1e200"'),
        dd.UrdfError,
        "link 'upper': <origin xyz='0.1 0.2 1e200'> is beyond 1e+30.",
    ),
    "long number": (
        arm().replace('<mass value="2.0"/>', f'<mass value="{"9x" * 2000}"/>'),
        dd.UrdfError,
        "(4002 characters)> is not a finite number.",
    ),
    "other digits": (
        arm().replace('<mass value="2.0"/>', '<mass value="٢"/>'),
        dd.UrdfError,
        "link 'upper': <mass value='٢'> is not a finite number.",
    ),
    "negative damping": (
        arm().replace("</joint>", '<dynamics damping="-1"/></joint>'),
        dd.UrdfError,
        "joint 'shoulder': damping -1.0 is negative.",
    ),
    "crossed limits": (
        arm().replace('lower="-10"', 'lower="11"'),
        dd.UrdfError,
        "joint 'shoulder': lower limit 11.0 is above the upper one, 10.0.",
    ),
    "xacro property": (
        arm().replace('<mass value="2.0"/>', '<mass value="${m}"/>'),
        dd.UrdfError,
        "link 'upper': <mass value='${m}'> is unexpanded xacro. Run xacro on it first.",
    ),
    "nameless link": (arm("\n<link/>"), dd.UrdfError, "A <link> in line 2 has no name."),
    "same link twice": (arm(link("upper")), dd.UrdfError, "Two elements <link> have the name 'upper'."),
    "same joint twice": (
        arm(link("l"), joint("shoulder", "fixed", "upper", "l")),
        dd.UrdfError,
        "Two elements <joint> have the name 'shoulder'.",
    ),
    "unknown type": (
        arm(first="spherical"),
        dd.UrdfError,
        "joint 'shoulder': unknown type 'spherical'; known are revolute, continuous, prismatic, fixed, floating, "
        "planar.",
    ),
    "unknown parent": (
        arm(link("l"), joint("elbow", "fixed", "lower", "l")),
        dd.UrdfError,
        "joint 'elbow': parent link 'lower' is not a link of this URDF.",
    ),
    "no child": (
        description("r", link("a"), '<joint name="j" type="fixed"><parent link="a"/></joint>'),
        dd.UrdfError,
        "joint 'j': child link None is not a link of this URDF.",
    ),
    "two roots": (
        arm(link("astray")),
        dd.UrdfError,
        "The URDF has 2 root links ('base', 'astray'), expected one: join them with fixed joints.",
    ),
    "loop": (
        arm(link("l", **BOX), joint("elbow", "revolute", "upper", "l"), joint("back", "revolute", "base", "l")),
        dd.UrdfError,
        "link 'l' is the child of two joints, 'elbow' and 'back': the URDF has a loop, and only trees can be modelled. "
        "Cut it at one of the two.",
    ),
    "ring": (
        description("r", link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")),
        dd.UrdfError,
        "Every link is the child of a joint: the joints form a loop through 'a'.",
    ),
    "ring aside": (
        arm(link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")),
        dd.UrdfError,
        "link 'a' is part of a loop of joints that the root 'base' does not reach.",
    ),
    "no mass": (
        arm().replace('<mass value="2.0"/>', ""),
        dd.UrdfError,
        "link 'upper': <inertial> lacks <mass value=…>.",
    ),
    "no izz": (
        arm().replace(' izz="0.3"', ""),
        dd.UrdfError,
        "link 'upper': <inertial> lacks <inertia izz=…>.",
    ),
    "negative mass": (arm().replace('"2.0"', '"-2"'), dd.UrdfError, "link 'upper': mass -2 kg is negative."),
    "nan mass": (
        arm().replace('<mass value="2.0"/>', '<mass value="nan"/>'),
        dd.UrdfError,
        "link 'upper': <mass value='nan'> is not a finite number.",
    ),
    "two coordinates": (
        arm().replace('xyz="0.1 0.2 0.3"', 'xyz="0.1 0.2"'),
        dd.UrdfError,
        "link 'upper': <origin xyz='0.1 0.2'> is not 3 finite numbers.",
    ),
    "zero axis": (
        arm().replace('<axis xyz="0.0 0.0 1.0"/>', '<axis xyz="0 0 0"/>'),
        dd.UrdfError,
        "joint 'shoulder': axis '0.0 0.0 0.0' has no direction.",
    ),
    "words for limits": (
        arm().replace('lower="-10"', 'lower="low"'),
        dd.UrdfError,
        "joint 'shoulder': <limit lower='low'> is not a finite number.",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken(case):
    source, kind, message = BROKEN[case]
    with pytest.raises(kind) as caught:
        dd.load_urdf(source)
    assert isinstance(caught.value, dd.DiagDynamicsError)
    assert message in str(caught.value)


def test_massless_links_are_all_named_with_their_cure():
    urdf = arm(
        link("wrist"),
        joint("roll", "revolute", "upper", "wrist"),
        link("rod", mass=1.0, com=(0, 0, 1), inertia=(0.1, 0, 0, 0.1, 0, 0)),
        joint("spin", "revolute", "upper", "rod"),
        link("rail"),
        joint("slide", "prismatic", "upper", "rail"),
    )
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(urdf)
    assert caught.value.joints == ("roll", "slide", "spin")
    assert caught.value.articulated_inertia == pytest.approx((0, 0, 0), abs=1e-15)
    message = str(caught.value)
    for expected in (
        "3 joint(s) that move no inertia",
        "joint 'roll' (D = 0): link 'wrist' has no <inertial>",
        "joint 'spin' (D = 0): link 'rod' has little inertia about that axis",
        "armature={'roll': …}",
    ):
        assert expected in message
    cured = dd.load_urdf(urdf, armature={"roll": 1e-4, "spin": 1e-4, "slide": 1e-3})
    np.testing.assert_array_equal(cured.armature, [0, 1e-4, 1e-3, 1e-4])


def test_light_links_are_no_false_alarm():
    """Grams and millimetres are light but not massless."""
    allegro = dd.load_urdf(robot_path("allegro_hand_description/urdf/allegro_left_hand.urdf"))
    q = np.full(allegro.nv, 0.3)
    assert dd.DiagonalDynamics(allegro).evaluate(q, q).articulated_inertia.min() < 2e-5
    speck = {"mass": 1e-6, "com": (0, 0, 1e-3), "inertia": (1e-13, 0, 0, 1e-13, 0, 1e-13)}
    assert dd.load_urdf(arm(link("speck", **speck), joint("j", "revolute", "upper", "speck"))).nv == 2


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"mimic": "both"}, dd.InputError, "mimic is 'both', expected one of 'embed', 'free', 'lock'."),
        ({"massless": "drop"}, dd.InputError, "massless is 'drop', expected one of 'error', 'lock'."),
        ({"gravity": (0, 0)}, dd.InputError, "gravity is (0, 0), expected three finite numbers [m/s²]."),
        ({"gravity": (0, 0, np.inf)}, dd.InputError, "expected three finite numbers"),
        ({"gravity": (0, 1e305, 0)}, dd.InputError, "expected three finite numbers [m/s²], none beyond ±1000."),
        ({"gravity": (0, 0, -9810.0)}, dd.InputError, "none beyond ±1000"),
        ({"armature": {"shoulder": 1e10}}, dd.InputError, "armature of joint 'shoulder' is 10000000000.0, expected"),
        ({"locked_joints": {"shoulder": -1e300}}, dd.InputError, "'shoulder' is -1e+300, expected a finite number"),
        (
            {"payloads": {"upper": (1e300,)}},
            dd.InputError,
            "mass on link 'upper' is 1e+300, expected a finite number >=",
        ),
        (
            {"payloads": {"upper": (1.0, (0, 1e200, 0))}},
            dd.InputError,
            "com on link 'upper' is (0, 1e+200, 0), expected",
        ),
        (
            {"payloads": {"upper": (1.0, (0, 0, 0), np.diag([1e300, 1e300, 1e300]))}},
            dd.InputError,
            "3 x 3 finite numbers [kg m²], none beyond ±1e+09.",
        ),
        (
            {"armature": {"elbow": 1.0}},
            dd.InputError,
            "armature: 'elbow' is not a joint of one degree of freedom of this robot",
        ),
        ({"armature": -1.0}, dd.InputError, "armature of joint 'shoulder' is -1.0, expected a finite number >= 0."),
        ({"armature": "heavy"}, dd.InputError, "armature is 'heavy', expected a finite number >= 0"),
        ({"armature": True}, dd.InputError, "armature is True, expected a finite number >= 0"),
        ({"gravity": "down"}, dd.InputError, "gravity is 'down', expected three finite numbers [m/s²]."),
        ({"locked_joints": {"elbow": 0.0}}, dd.InputError, "locked_joints: 'elbow' is not a joint of robot 'arm'."),
        ({"locked_joints": {"shoulder": np.nan}}, dd.InputError, "position of joint 'shoulder' is nan"),
        ({"locked_joints": ["shoulder"]}, dd.InputError, "locked_joints is ['shoulder'], expected a dict by name."),
        ({"payloads": {"hand": (1.0,)}}, dd.InputError, "payloads: 'hand' is not a link of robot 'arm'."),
        (
            {"payloads": {"upper": (-1.0,)}},
            dd.InputError,
            "mass on link 'upper' is -1.0, expected a finite number >= 0",
        ),
        ({"payloads": {"upper": (1.0, (0, 0))}}, dd.InputError, "com on link 'upper' is (0, 0), expected three finite"),
        ({"payloads": {"upper": None}}, dd.InputError, "payloads: 'upper' has None, expected (mass, com, inertia)."),
    ],
)
def test_bad_options(options, kind, message):
    with pytest.raises(kind) as caught:
        dd.load_urdf(arm(), **options)
    assert message in str(caught.value)


# --- Wrong arguments ---


@pytest.fixture(scope="module")
def two():
    urdf = arm(link("l", **BOX), joint("elbow", "prismatic", "upper", "l"))
    return dd.DiagonalDynamics(dd.load_urdf(urdf))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda d: d.evaluate([0.0], [0, 0]),
            "q has shape (1,), expected (2,): one entry for each of shoulder",
        ),
        (lambda d: d.evaluate(0.0, [0, 0]), "q has shape ()"),
        (lambda d: d.evaluate([0, 0], [0, np.nan]), "qd of joint 'elbow' is nan, expected a finite number."),
        (lambda d: d.evaluate([np.inf, 0], [0, 0]), "q of joint 'shoulder' is inf, expected a finite number."),
        (lambda d: d.evaluate([0, 0], [0, 0], [0, -np.inf]), "tau of joint 'elbow' is -inf"),
        (lambda d: d.evaluate(["a", "b"], [0, 0]), "q is not a vector of numbers"),
        (lambda d: d.evaluate([[1], 2], [0, 0]), "q is not a vector of numbers"),
        (lambda d: d.evaluate([1j, 2], [0, 0]), "q is not a vector of numbers"),
        (lambda d: d.evaluate([0, 0], [1e200, 0]), "qd, tau are too large: a result overflows"),
        (lambda d: d.evaluate([0, 0], [1e150, 0], [1e200, 0]), "qd, tau are too large: a result overflows"),  # power
        (
            lambda d: d.evaluate_batch([[0, 0]] * 9, [[0, 1e150]] * 9, [[0, 1e200]] * 9),
            "state 0: q, qd, tau are too large",
        ),
        (lambda d: d.evaluate([0, 0], [1e150, 0], f_ext={"upper": [0, 1e200, 0, 0, 0, 1e200]}), "the power overflows"),
        (lambda d: d.forward_dynamics([0, 0], [1e200, 0], [0, 0]), "are too large: a result overflows"),
        (lambda d: d.inverse_dynamics([0, 0], [1e200, 0], [0, 0]), "are too large: a result overflows"),
        (lambda d: d.evaluate([0, 0], [0, 0], f_ext={"hand": [0] * 6}), "f_ext: 'hand' is not a link of robot 'arm'."),
        (lambda d: d.evaluate([0, 0], [0, 0], f_ext={"upper": [0] * 5}), "f_ext on link 'upper' is [0, 0, 0, 0, 0]"),
        (lambda d: d.evaluate([0, 0], [0, 0], f_ext=np.zeros(6)), "expected a dict by name"),
        (lambda d: d.evaluate([0, 0], [0, 0], frame="body"), "frame is 'body', expected 'link' or 'world'."),
        (lambda d: d.factors([np.nan, 0]), "q of joint 'shoulder' is nan"),
        (lambda d: d.forward_dynamics([0, 0], [0, 0], [np.nan, 0]), "tau of joint 'shoulder' is nan"),
        (lambda d: d.inverse_dynamics([0, 0], [0, 0], [np.nan, 0]), "qdd of joint 'shoulder' is nan"),
        (lambda d: d.mass_matrix([0, np.nan]), "q of joint 'elbow' is nan"),
        (lambda d: d.bias([0, 0], [np.nan, 0]), "qd of joint 'shoulder' is nan"),
        (lambda d: d.gravity_torque([0, np.nan]), "q of joint 'elbow' is nan"),
        (lambda d: d.nu_from_qd([0, 0], [0, np.nan]), "qd of joint 'elbow' is nan"),
        (lambda d: d.qd_from_nu([0, 0], [0, np.nan]), "nu of joint 'elbow' is nan"),
        (lambda d: d.epsilon_from_tau([0, 0], [0, np.inf]), "tau of joint 'elbow' is inf"),
        (lambda d: d.tau_from_epsilon([0, 0], [[0, 0]]), "epsilon has shape (1, 2)"),
        (lambda d: dd.DiagonalDynamics("arm.urdf"), "DiagonalDynamics needs a RobotModel"),
    ],
)
def test_wrong_arguments_are_named(two, call, message):
    with pytest.raises(dd.InputError) as caught:
        call(two)
    assert message in str(caught.value)
    assert two.evaluate([0.1, 0.2], [0.3, 0.4]).kinetic_energy > 0.0  # and nothing is broken afterwards


def test_any_kind_of_vector_is_taken(two):
    """Lists, other dtypes, strided and read-only arrays give the same, and are not written to."""
    q, qd = np.array([0.1, 0.2]), np.array([0.3, 0.4])
    expected = two.evaluate(q, qd).nu
    strided = np.array([0.1, 9.0, 0.2, 9.0])[::2]
    frozen = q.copy()
    frozen.flags.writeable = False
    for other in ([0.1, 0.2], (0.1, 0.2), strided, frozen):
        np.testing.assert_array_equal(two.evaluate(other, qd).nu, expected)
    np.testing.assert_allclose(two.evaluate(q.astype(np.float32), qd).nu, expected, rtol=1e-6)
