# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fuzzed URDFs: the loader returns a model that works or raises one of the package's exceptions; it never hangs.

Hypothesis mutates real URDFs and random ones. It removes, doubles, moves and renames elements, replaces attributes, cuts
and overwrites text.
"""

import copy
import random
import warnings
import xml.etree.ElementTree as ET

import numpy as np
from hypothesis import given, note, settings
from hypothesis import strategies as st

import diag_dynamics as dd
import robots
from examples import shortened

DIALECT = (
    '<robot version="1.2" xmlns:xacro="http://www.ros.org/wiki/xacro" xmlns:drake="http://drake.mit.edu" name="d">'
    '<xacro:property name="a" value="${1}"/><xacro:macro name="m"><link name="${a}"/></xacro:macro><link name="base"/>'
    '<link name="a"><inertial><origin xyz="0 0 1" quat_xyzw="0 0.6 0 0.8"/><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision><origin quat_xyzw="1 0 0 0"/><geometry><box size="1 1 1"/></geometry></collision></link>'
    '<joint name="j" type="revolute"><parent link="base"/><child link="a"/><origin quat_xyzw="1 2 3 4"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1" jerk="1"/><dynamics damping="0" armature="1"/></joint>'
    '<transmission name="t"><joint name="j"/><actuator name="m"><drake:rotor_inertia value="1e-4"/>'
    '<mechanicalReduction value="-50"/></actuator></transmission><gazebo><joint name="g"><child>a</child></joint></gazebo>'
    '<ros2_control><transmission name="t"><actuator name="n"><param name="rotor_inertia">1e-4</param></actuator>'
    '<joint name="j"><mechanical_reduction>2</mechanical_reduction></joint></transmission></ros2_control></robot>'
)
"""Quaternions, transmissions, definitions of xacro, attributes that URDF has not."""

SEEDS = (
    DIALECT,
    DIALECT,
    *(
        robots.robot(id).urdf
        for id in (
            "double_pendulum_description/urdf/double_pendulum.urdf",
            "finger_edu_description/robots/finger_edu.urdf",
            "panda_description/urdf/panda.urdf",
            "ur_description/urdf/ur5_robot.urdf",
        )
    ),
    robots.PENDULUM,
    robots.TwoLinkArm().urdf,
    robots.random_tree(20, 6, robots.KINDS + robots.SEVERAL),
    robots.random_tree(0, 5),
)

NUMBERS = (
    *(
        "0",
        "-0",
        "1e-300",
        "1e-308",
        "5e-324",
        "1e308",
        "-1e308",
        "1e200",
        "1e999",
        "-1",
        "1",
        "nan",
        "inf",
        "-inf",
    ),
    *(
        "",
        " ",
        "x",
        "0x10",
        "1_0",
        "1,5",
        "٣",
        "1e",
        "--1",
        "1 2",
        "0 0 0",
        "nan nan nan",
        "1e200 1e200 1e200",
    ),
    *(
        "1 2 3",
        "0 0 1e-200",
        "-1 -1 -1",
        "${x}",
        "$(arg x)",
        "\t1\n",
        "1\u00a02\u00a03",
        "9" * 400,
        "1 " * 300,
    ),
)
WORDS = (
    *(
        "",
        " ",
        "base",
        "revolute",
        "continuous",
        "prismatic",
        "planar",
        "floating",
        "fixed",
        "ball",
        "Fixed",
    ),
    *(
        "é",
        "\u202e",
        "\U0001f916",
        "a/v_x",
        "root_joint",
        "root_joint/qw",
        "x" * 1000,
        "${name}",
        "\n",
        "{0}",
        "%s",
    ),
    *("link_0", "root", "world", "panda_joint1", "panda_link0", "elbow", "upper", "lower"),
)
CONTROL = map(chr, (0, 1, 7, 8, 11, 27, 127, 0x85, 0xFFFE, 0xFFFF, 0xD800, 0xFEFF))
BITS = (
    *(
        "<",
        ">",
        "&",
        '"',
        "'",
        "&amp;",
        "&#0;",
        "&#xD800;",
        "&lt;",
        "&x;",
        "]]>",
        "<![CDATA[",
        "<!--",
        "-->",
        "<?x?>",
    ),
    *(
        "<link>",
        "</link>",
        '<link name="a"/>',
        "<joint/>",
        "<robot>",
        "</robot>",
        "<x:y/>",
        ' xmlns="u"',
    ),
    *(
        "<!-- -- -->",
        "<!----",
        "--->",
        "<loop_joint/>",
        "<xacro:arg/>",
        "<xacro:m/>",
        "<drake:joint/>",
        "<mass/>",
    ),
    *("<a b='1' b='2'>", "<!DOCTYPE robot>", '<!DOCTYPE r [<!ENTITY x "y">]>', "\ufeff", "\r"),
    *('<?xml version="1.0" encoding="utf-16"?>', *CONTROL),
)
ENCODINGS = (
    *(
        "utf-8",
        "utf-16",
        "utf-32",
        "latin-1",
        "ascii",
        "cp1252",
        "big5",
        "idna",
        "punycode",
        "hex",
        "rot13",
    ),
    *(
        "undefined",
        "unicode_escape",
        "raw_unicode_escape",
        "zlib",
        "base64",
        "mbcs",
        "x" * 100,
        "utf-8-sig",
    ),
)


def mutated_tree(rng, root):
    """Change one thing in a tree of elements."""
    elements = list(root.iter())
    parent_of = {child: parent for parent in elements for child in parent}
    element = rng.choice(elements)
    action = rng.randrange(10)
    if action < 4 and element.attrib:
        name = rng.choice(list(element.attrib))
        element.set(name, rng.choice(NUMBERS if rng.random() < 0.7 else WORDS))
    elif action == 4 and element.attrib:
        del element.attrib[rng.choice(list(element.attrib))]
    elif action == 5 and element in parent_of:
        parent_of[element].remove(element)
    elif action == 6 and element in parent_of:  # doubled, next to itself or elsewhere
        rng.choice(elements if rng.random() < 0.3 else [parent_of[element]]).append(
            copy.deepcopy(element)
        )
    elif action == 7:  # two elements swap their attributes
        other = rng.choice(elements)
        element.attrib, other.attrib = other.attrib, element.attrib
    elif action == 8:
        element.tag = rng.choice([other.tag for other in elements])
    else:  # a value of another element
        donor = rng.choice([other for other in elements if other.attrib] or [root])
        element.attrib |= rng.sample(sorted(donor.attrib.items()), min(1, len(donor.attrib)))


def mutated_text(rng, text):
    """Change one thing in a text."""
    at = rng.randrange(len(text) + 1)
    to = min(len(text), at + rng.choice((1, 2, 10, 100, 10**6)))
    action = rng.randrange(4)
    if action == 0:
        return text[:at]  # cut off
    if action == 1:
        return text[:at] + text[to:]
    if action == 2:
        return text[:at] + rng.choice(BITS) + text[at:]
    return text[:at] + rng.choice(BITS) + text[to:]


def mutated_bytes(rng, data):
    """Change some bytes, or declare another encoding."""
    if rng.random() < 0.5:
        return b'<?xml version="1.0" encoding="%s"?>' % rng.choice(ENCODINGS).encode() + data
    data = bytearray(data)
    for _ in range(rng.choice((1, 3, 30))):
        if data:
            data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def mutant(seed):
    """Return a mutated URDF, as text or bytes."""
    rng = random.Random(seed)
    source = rng.choice(SEEDS)
    if rng.random() < 0.8:
        root = ET.fromstring(source)
        for _ in range(rng.choice((1, 1, 2, 3, 8))):
            mutated_tree(rng, root)
            if len(list(root.iter())) > 2000:  # doubled too often
                break
        source = ET.tostring(root, encoding="unicode")
    if rng.random() < 0.35:
        for _ in range(rng.choice((1, 2, 5))):
            source = mutated_text(rng, source)
    if rng.random() < 0.2:
        return mutated_bytes(
            rng, source.encode(rng.choice(("utf-8", "utf-16", "latin-1")), errors="replace")
        )
    return source


def load_and_use(source, **options):
    """Load and evaluate. Return the model, or None after one of the package's exceptions."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", dd.ModelWarning)
        try:
            model = dd.load_urdf(source, **options)
        except dd.DiagDynamicsError as error:
            assert 0 < len(str(error)) < 20_000
            return None
        assert isinstance(model, dd.RobotModel)
        assert len(set(model.dof_names)) == len(model.dof_names)
        dyn, one = dd.DiagonalDynamics(model), np.ones(model.nv)
        try:
            s = dyn.evaluate(model.neutral, one, one)
        except dd.SingularMassMatrixError:
            return model
        for value in (
            s.nu,
            s.xi,
            s.epsilon,
            s.kappa,
            s.coriolis,
            s.coriolis_unnormalized,
            s.gravity,
            s.link_energy,
        ):
            assert np.isfinite(value).all()
        assert (s.articulated_inertia > 0).all()
        return model


OPTIONS = st.fixed_dictionaries(
    {
        "mimic": st.sampled_from(("embed", "free", "lock")),
        "massless": st.sampled_from(("error", "lock")),
        "floating_base": st.booleans(),
    }
)


@settings(max_examples=shortened(1200, 120))
@given(st.integers(0, 2**64 - 1), OPTIONS)
def test_mutated_urdfs(seed, options):
    source = mutant(seed)
    note(repr(source))
    load_and_use(source, **options)


@settings(max_examples=shortened(300, 30))
@given(st.one_of(st.binary(max_size=200), st.text(max_size=200).map(lambda text: "<" + text)))
def test_random_bytes(source):
    load_and_use(source)
