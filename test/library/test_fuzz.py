# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fuzzed URDFs: the loader returns a model that works or raises one of the package's exceptions; it
never hangs.

Each seed mutates a real URDF or a random one: elements, attributes, text, encoding or bytes.
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
from accuracy import QUANTITIES
from examples import shortened

DIALECT = (
    '<robot version="1.2" xmlns:xacro="http://www.ros.org/wiki/xacro" '
    'xmlns:drake="http://drake.mit.edu" name="d">'
    '<xacro:property name="a" value="${1}"/><xacro:macro name="m"><link name="${a}"/>'
    '</xacro:macro><link name="base"/>'
    '<link name="a"><inertial><origin xyz="0 0 1" quat_xyzw="0 0.6 0 0.8"/><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision><origin quat_xyzw="1 0 0 0"/><geometry><box size="1 1 1"/></geometry>'
    "</collision></link>"
    '<joint name="j" type="revolute"><parent link="base"/><child link="a"/>'
    '<origin quat_xyzw="1 2 3 4"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1" jerk="1"/>'
    '<dynamics damping="0" armature="1"/></joint>'
    '<transmission name="t"><joint name="j"/><actuator name="m"><drake:rotor_inertia value="1e-4"/>'
    '<mechanicalReduction value="-50"/></actuator></transmission><gazebo><joint name="g">'
    "<child>a</child></joint></gazebo>"
    '<ros2_control><transmission name="t"><actuator name="n">'
    '<param name="rotor_inertia">1e-4</param></actuator>'
    '<joint name="j"><mechanical_reduction>2</mechanical_reduction></joint></transmission>'
    "</ros2_control></robot>"
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

VALUES = (
    "",
    "0",
    "1e-300",
    "1e308",
    "nan",
    "x",
    "٣",
    "0 0 0",
    "0 0 1e-200",
    "9" * 400,
    "${x}",
    "base",
    "revolute",
    "planar",
    "floating",
    "ball",
    "root_joint/qw",
    "\n",
)
BITS = (
    "",
    ">",
    "&",
    '"',
    "&#xD800;",
    "&x;",
    "<![CDATA[",
    "<!--",
    "-->",
    "</link>",
    "<joint/>",
    ' xmlns="u"',
    "<loop_joint/>",
    "<xacro:m/>",
    "<!DOCTYPE robot>",
    "\0",
    "\ud800",
    "\ufeff",
)


def mutate_tree(rng, root):
    """Change one thing in a tree of elements."""
    elements = list(root.iter())
    element = rng.choice(elements)
    other = rng.choice(elements)
    name = rng.choice(sorted(element.attrib) or ["name"])
    action = rng.randrange(8)
    if action < 3:
        element.set(name, rng.choice(VALUES))
    elif action == 3:
        element.attrib.pop(name, None)
    elif action == 4:
        element[:] = rng.sample(list(element), len(element) // 2)
    elif action == 5:
        other.append(copy.deepcopy(element))
    elif action == 6:
        element.tag = other.tag
    else:
        element.attrib, other.attrib = other.attrib, element.attrib


def mutated_text(rng, text):
    """Replace a part of a text, which may be empty or all of its end."""
    start = rng.randrange(len(text) + 1)
    return text[:start] + rng.choice(BITS) + text[start + rng.choice((0, 1, 100, len(text))) :]


def mutant(seed):
    """Return a mutated URDF, as text or bytes."""
    rng = random.Random(seed)
    root = ET.fromstring(rng.choice(SEEDS))
    for _ in range(rng.choice((0, 1, 2, 8))):
        mutate_tree(rng, root)
    source = ET.tostring(root, encoding="unicode")
    for _ in range(rng.choice((0, 0, 0, 1, 3))):
        source = mutated_text(rng, source)
    return source.encode("utf-8", "replace") if rng.random() < 0.2 else source


def load_and_use(source, **options):
    """Load and evaluate, or accept one of the package's exceptions."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", dd.ModelWarning)
        try:
            model = dd.load_urdf(source, **options)
        except dd.DiagDynamicsError as error:
            assert 0 < len(str(error)) < 20_000
            return
        assert len(set(model.dof_names)) == len(model.dof_names)
        rates = np.ones(model.nv)
        try:
            evaluation = dd.DiagonalDynamics(model).evaluate(model.neutral, rates, rates)
        except dd.SingularMassMatrixError:
            return
        for name in QUANTITIES:
            value = getattr(evaluation, name)
            assert value is None or np.isfinite(value).all(), name
        assert (evaluation.articulated_inertia > 0).all()


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
