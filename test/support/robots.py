# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The URDFs of the `example-robot-data` wheel, and which of them have no diagonalized dynamics to
check.

A robot is *regular* when the mass matrix of its fixed-base model, every joint independent
(`mimic="free"`), is regular at random configurations. `EXCLUDED` lists the other files with their
reasons, and `test_massless.py` shows each reason. `robots_to_test` decides which robots the laws
run over, in the gate and in the full tier.
"""

import re
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from examples import all_robots_selected

WHEEL = "example-robot-data"

EMPTY = "the description has no link at all"
MOTIONLESS = "no moving joint: nv = 0"
SINGULAR = "singular mass matrix: joints that move links without inertia"


class Exclusion(NamedTuple):
    """Why a file is not among the regular robots: the reason, and the joints whose D vanishes."""

    reason: str
    joints: tuple[str, ...] = ()


# Every link of Romeo's hands has an <inertial> of zeros: 24 joints with D = 0 exactly, 24 zero rows
# in M. In
# romeo_laas_small only the two grippers are such: 2 zero rows. The next smallest D are above 1e-4.
_ROMEO_HANDS = tuple(
    f"{side}{name}"
    for side in "LR"
    for name in (
        "Hand",
        "Thumb1",
        "Thumb2",
        "Thumb3",
        *(f"Finger{n}" for n in (12, 13, 21, 22, 23, 31, 32, 33)),
    )
)

EXCLUDED = {
    "hector_description/robots/quadrotor_base.urdf": Exclusion(MOTIONLESS),
    "iris_description/robots/iris_simple.urdf": Exclusion(MOTIONLESS),
    "romeo_description/urdf/romeo.urdf": Exclusion(SINGULAR, _ROMEO_HANDS),
    "romeo_description/urdf/romeo_laas_small.urdf": Exclusion(
        SINGULAR, ("l_gripper_joint", "r_gripper_joint")
    ),
    "ur_description/urdf/ur3.urdf": Exclusion(EMPTY),
}


@cache
def robots_folder():
    """Return the wheel's `robots` folder, wherever pip put it."""
    try:
        files = distribution(WHEEL).files or []
    except PackageNotFoundError as error:
        raise RuntimeError(
            f"the tests need the robots of {WHEEL!r}: pip install {WHEEL}"
        ) from error
    for file in files:
        if file.suffix == ".urdf" and "robots" in file.parts:
            path = Path(file.locate()).resolve()
            return Path(*path.parts[: path.parts.index(WHEEL) + 1]) / "robots"
    raise RuntimeError(f"{WHEEL!r} is installed but lists no URDF")


def robot_path(robot):
    """Return the file of a robot id, for example `panda_description/urdf/panda.urdf`."""
    return robots_folder() / robot


@cache
def all_robots():
    """Return the id of every URDF of the wheel: its path below the `robots` folder."""
    return tuple(
        sorted(p.relative_to(robots_folder()).as_posix() for p in robots_folder().rglob("*.urdf"))
    )


def regular_robots():
    """Return the ids of the robots that the physics tests run over."""
    return tuple(robot for robot in all_robots() if robot not in EXCLUDED)


# --- robots written here: closed forms, and what the wheel has too little of


class Robot(NamedTuple):
    """A description to test: its source (path or XML text) and the options of its model."""

    id: str
    source: Path | str
    armature: Mapping[str, float] = MappingProxyType({})
    floating_base: bool = False
    locked_joints: Mapping[str, float] = MappingProxyType({})
    mimic: str = "free"

    @property
    def options(self):
        """Return the options that loader and oracles have in common."""
        return {
            "armature": self.armature,
            "floating_base": self.floating_base,
            "locked_joints": self.locked_joints,
        }

    @property
    def floating(self):
        """Return this robot with a floating base."""
        return self._replace(id=f"{self.id}+floating", floating_base=True)

    @property
    def urdf(self):
        """Return the XML text."""
        return (
            self.source.read_text(encoding="utf-8")
            if isinstance(self.source, Path)
            else self.source
        )


def robot(id):
    """Return a robot of the wheel."""
    return Robot(id, robot_path(id))


def link(name, mass=0.0, com=(0, 0, 0), inertia=(0, 0, 0, 0, 0, 0), rpy=(0, 0, 0)):
    """Return a URDF link; `inertia` is ixx ixy ixz iyy iyz izz about the centre of mass."""
    if not mass:
        return f'<link name="{name}"/>'
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    entries = " ".join(f'{n}="{float(v)!r}"' for n, v in zip(names, inertia, strict=True))
    return (
        f'<link name="{name}"><inertial><origin xyz="{_text(com)}" rpy="{_text(rpy)}"/>'
        f'<mass value="{float(mass)!r}"/><inertia {entries}/></inertial></link>'
    )


def joint(name, kind, parent, child, axis=(0, 0, 1), xyz=(0, 0, 0), rpy=(0, 0, 0)):
    """Return a URDF joint."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/><axis xyz="{_text(axis)}"/>'
        '<limit lower="-10" upper="10" effort="100" velocity="100"/></joint>'
    )


def description(name, *elements):
    """Return a whole URDF."""
    return f'<robot name="{name}">{"".join(elements)}</robot>'


def in_other_units(urdf, mass=1.0, length=1.0):
    """Return a URDF with all masses and lengths multiplied, and the moments of inertia with
    them.
    """
    robot = ET.fromstring(urdf)
    for element in robot.iter("mass"):
        element.set("value", repr(float(element.get("value")) * mass))
    for element in robot.iter("inertia"):
        for name, value in element.attrib.items():
            element.set(name, repr(float(value) * mass * length**2))
    for element in robot.iter("origin"):
        element.set("xyz", _text(float(x) * length for x in element.get("xyz", "0 0 0").split()))
    return ET.tostring(robot, encoding="unicode")


def _text(numbers):
    return " ".join(repr(float(x)) for x in numbers)


BOX = {"mass": 2.0, "com": (0.1, 0.2, 0.3), "inertia": (0.1, 0.0, 0.0, 0.2, 0.0, 0.3)}


def arm(*more, kind="revolute"):
    """Return the URDF of one link on a base, and of other elements."""
    return description(
        "arm", link("base"), link("upper", **BOX), joint("shoulder", kind, "base", "upper"), *more
    )


ARM = arm()


def changed(old, new, text=ARM):
    """Return a text with its first `old` replaced, which it must have."""
    assert old in text
    return text.replace(old, new, 1)


class TwoLinkArm(NamedTuple):
    """The textbook planar arm: masses m, length a, distances r of the centres of mass, inertias I
    there.
    """

    m1: float = 1.3
    m2: float = 0.7
    a1: float = 0.6
    r1: float = 0.25
    r2: float = 0.35
    I1: float = 0.05
    I2: float = 0.02

    @property
    def urdf(self):
        """Return the arm in the x-y plane, both axes along z."""
        return description(
            "two_link_arm",
            link("base"),
            link("upper", self.m1, (self.r1, 0, 0), (0.03, 0, 0, 0.03, 0, self.I1)),
            link("lower", self.m2, (self.r2, 0, 0), (0.01, 0, 0, 0.01, 0, self.I2)),
            joint("shoulder", "revolute", "base", "upper"),
            joint("elbow", "revolute", "upper", "lower", xyz=(self.a1, 0, 0)),
        )


PENDULUM = description(
    "pendulum",
    link("base"),
    link("rod", 0.8, (0, 0.05, -0.4), (0.02, 0.001, 0, 0.015, 0, 0.01)),
    joint(
        "pivot", "continuous", "base", "rod", axis=(1, 0, 0), xyz=(0.1, 0.2, 0.3), rpy=(0, 0, 0.4)
    ),
)

GANTRY = description(
    "gantry",
    link("base"),
    link("bridge", 20.0, (0, 0.1, 0), (1, 0, 0, 2, 0, 3)),
    link("trolley", 5.0, (0.2, 0, 0), (0.1, 0, 0, 0.2, 0, 0.3)),
    link("hoist", 2.0, (0, 0, -0.5), (0.1, 0, 0, 0.1, 0, 0.05)),
    joint("x", "prismatic", "base", "bridge", axis=(1, 0, 0)),
    joint("y", "prismatic", "bridge", "trolley", axis=(0, 1, 0), rpy=(0.3, 0, 0)),
    joint("z", "prismatic", "trolley", "hoist", axis=(0.6, 0, 0.8), rpy=(0, 0.2, 0.1)),
)


KINDS = ("revolute", "continuous", "prismatic")
SEVERAL = ("planar", "floating")


def random_tree(seed, joints=12, kinds=KINDS):
    """Return a tree of mixed joints with crooked axes and frames, fixed joints, and links without
    inertia.
    """
    rng = np.random.default_rng(seed)
    elements = [link("root", *_random_inertia(rng))]
    moving = ["root"]
    for k in range(joints):
        # Two in three extend the newest branch, so that both depth and branching occur.
        parent = moving[-1] if rng.random() < 2 / 3 else str(rng.choice(moving))
        kind = str(rng.choice(kinds))
        pose = {"xyz": rng.uniform(-0.4, 0.4, 3), "rpy": rng.uniform(-3, 3, 3)}
        axis = rng.standard_normal(3)
        if kind == "planar":
            axis = np.array([0.0, 0.0, 1.0])  # the only one that Pinocchio knows
        # Names that neither sort nor count in the order of the tree.
        name = f"{chr(ord('a') + int(rng.integers(26)))}_joint_{k}"
        elements.append(joint(name, kind, parent, f"link_{k}", axis / np.linalg.norm(axis), **pose))
        moving.append(f"link_{k}")
        if k % 4 == 3:  # a body behind a fixed joint, and a mere frame behind that
            elements.append(link(f"link_{k}", *_random_inertia(rng)))
            elements.append(joint(f"weld_{k}", "fixed", f"link_{k}", f"tool_{k}", **pose))
            elements.append(link(f"tool_{k}", *_random_inertia(rng), rpy=rng.uniform(-3, 3, 3)))
            elements.append(
                joint(f"mark_{k}", "fixed", f"tool_{k}", f"frame_{k}", rpy=rng.uniform(-3, 3, 3))
            )
            elements.append(link(f"frame_{k}"))
        elif k % 4 == 1 and k + 1 < joints:  # all of the inertia sits behind a fixed joint
            elements.append(link(f"link_{k}"))
            elements.append(joint(f"weld_{k}", "fixed", f"link_{k}", f"tool_{k}", **pose))
            elements.append(link(f"tool_{k}", *_random_inertia(rng)))
        else:
            elements.append(link(f"link_{k}", *_random_inertia(rng), rpy=rng.uniform(-3, 3, 3)))
    return description(f"random_tree_{seed}", *elements)


def _random_inertia(rng):
    """Return mass, centre of mass and a physically possible inertia: that of a cloud of points."""
    mass = rng.uniform(0.2, 3.0)
    A = rng.uniform(-0.2, 0.2, (3, 3))
    second_moment = mass * A @ A.T
    i = np.trace(second_moment) * np.eye(3) - second_moment
    return mass, rng.uniform(-0.2, 0.2, 3), (i[0, 0], i[0, 1], i[0, 2], i[1, 1], i[1, 2], i[2, 2])


def _geared(seed):
    """Return a random tree with armature at two joints in three."""
    urdf = random_tree(seed)
    names = [
        j.get("name") for j in ET.fromstring(urdf).findall("joint") if j.get("type") != "fixed"
    ]
    rng = np.random.default_rng(seed)
    return Robot(
        f"geared_tree_{seed}", urdf, {n: rng.uniform(0.01, 2) for i, n in enumerate(names) if i % 3}
    )


def textbook_robots():
    """Return the robots with closed forms; their bases have no inertia, so they do not float."""
    return (
        Robot("pendulum", PENDULUM),
        Robot("gantry", GANTRY),
        Robot("two_link_arm", TwoLinkArm().urdf),
    )


def random_robots():
    """Return the robots made at random; every one of them is regular."""
    return (
        *(Robot(f"random_tree_{seed}", random_tree(seed)) for seed in range(4)),
        *(
            Robot(f"mobile_tree_{seed}", random_tree(seed, kinds=KINDS + SEVERAL))
            for seed in (20, 21, 22)
        ),
        *(_geared(seed) for seed in (10, 11)),
    )


def cured_robots():
    """Return the singular robots of the wheel with the joints locked that make them so."""
    return tuple(
        robot(id)._replace(id=f"{id}+locked", locked_joints=dict.fromkeys(exclusion.joints, 0.0))
        for id, exclusion in EXCLUDED.items()
        if exclusion.reason == SINGULAR
    )


def coupled_robots():
    """Return robots whose mimic joints are coupled: those of the wheel, and those written for the
    tests.
    """
    from coupling import NAMED, wheel  # which import this module

    return tuple(
        robot._replace(id=f"{robot.id}+coupled", mimic="embed")
        for robot in (*wheel(), *NAMED.values())
    )


GATE = (
    "pendulum",
    "two_link_arm",
    "gantry",
    "panda_description/urdf/panda.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "tiago_description/robots/tiago.urdf",
    "talos_data/robots/talos_reduced.urdf+floating",
    "go2_description/urdf/go2.urdf+floating",
    "romeo_description/urdf/romeo_laas_small.urdf+locked",
    "random_tree_0",
    "mobile_tree_20",
    "geared_tree_10+floating",
    "panda_description/urdf/panda.urdf+coupled+floating",
)
"""The gate's robots: all types of joints, free bases, rotor inertias, locked and mimic joints,
links without inertia.
"""


def robots_to_test():
    """Return the robots that the laws run over: :data:`GATE` in the gate, all of them in the full
    tier.
    """
    fixed = (
        *(robot(id) for id in regular_robots()),
        *cured_robots(),
        *random_robots(),
        *coupled_robots(),
    )
    motionless = (robot(id) for id, exclusion in EXCLUDED.items() if exclusion.reason == MOTIONLESS)
    every = textbook_robots() + fixed + tuple(robot.floating for robot in (*fixed, *motionless))
    if all_robots_selected():
        return every
    by_id = {robot.id: robot for robot in every}
    return tuple(by_id[id] for id in GATE)


# --- states

SPEEDS = (
    0.3,
    1.0,
    10.0,
)  # one sample each, [rad/s] or [m/s]; at the last the velocity terms dominate


class Sample(NamedTuple):
    """A random state: positions [rad or m], rates, torques [N m or N] and accelerations."""

    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    qdd: np.ndarray


def samples(id, oracle):
    """Return the states of a robot, always the same ones; continuous joints beyond one turn."""
    rng = np.random.default_rng(zlib.crc32(id.encode()))
    # Drawn by sorted name, so that the state does not depend on the order of dofs.
    names = sorted(oracle.dof_names)
    at = [names.index(name) for name in oracle.dof_names]
    reach = np.array(
        [
            0.3 if oracle.is_prismatic(k) else 6.0 if oracle.is_circular(k) else 3.0
            for k in range(oracle.nv)
        ]
    )
    out = []
    for speed in SPEEDS:
        q = oracle.moved(oracle.neutral, reach * rng.uniform(-1, 1, oracle.nv)[at])
        qd, tau, qdd = (scale * rng.standard_normal(oracle.nv)[at] for scale in (speed, 5.0, 10.0))
        out.append(Sample(q, qd, tau, qdd))
    return out


def without_hand(panda):
    """Return the URDF of a Panda whose hand and fingers have no inertia."""
    link = r'<link name="panda_(hand|leftfinger|rightfinger)">.*?</link>'
    inertial = re.compile("<inertial>.*?</inertial>", re.DOTALL)
    return re.sub(link, lambda result: inertial.sub("", result.group(0)), panda, flags=re.DOTALL)
