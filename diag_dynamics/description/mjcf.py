# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models from MJCF, through MuJoCo's own parser and compiler: what that has made of the file is written as a URDF."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from lxml import etree

from diag_dynamics import rotations
from diag_dynamics.description.parameters import numbers_text, set_inertia
from diag_dynamics.exceptions import InputError, UnsupportedError, UrdfError

# MuJoCo's flags that disable a thing beside the flag of its name; those of passive forces depend on
# the version
FLAGS = {"spring": "PASSIVE", "damper": "PASSIVE"} | dict.fromkeys(
    ("equality", "frictionloss", "limit"), "CONSTRAINT"
)


class Described(NamedTuple):
    """A robot as the text of a URDF, and what a URDF cannot say.

    `options` of :func:`load_urdf` are floating_base, gravity, armature and locked_joints of an
    MJCF; none of a URDF.
    """

    text: str
    options: Mapping[str, Any] = MappingProxyType({})
    omitted: tuple[str, ...] = ()
    balls: tuple[str, ...] = ()  # ball joints, each of three hinges

    @property
    def is_mjcf(self) -> bool:
        """Whether it was an MJCF."""
        return bool(self.options)


def is_mjcf(source: object) -> bool:
    """Whether this is the path of a file whose root element is <mujoco>."""
    try:
        if not isinstance(source, (str, os.PathLike)) or not os.path.isfile(
            path := os.path.expanduser(source)
        ):
            return False
        begin = etree.iterparse(
            path, ("start",), resolve_entities=False, no_network=True, load_dtd=False
        )
        return next(begin)[1].tag == "mujoco"
    except (
        OSError,
        ValueError,
        StopIteration,
        etree.XMLSyntaxError,
    ):  # a name with a NUL, no permission
        return False


def read_mjcf(source: str | os.PathLike[str]) -> Described:
    """Compile an MJCF, and describe it as a URDF; see :func:`load_mjcf`, also for its errors."""
    c = _Compiled(source)
    _reject_unsupported(c)
    top = [b for b in c.bodies if c.m.body_parentid[b] == 0 and not c.is_marker(b)]
    floating = len(c.free) == 1 and len(top) == 1
    gravity = np.zeros(3) if c.is_disabled("gravity") else c.m.opt.gravity.copy()
    armature = {c.name("joint", j): float(c.armature[c.m.jnt_dofadr[j]]) for j in c.single}
    options = {
        "floating_base": floating,
        "gravity": gravity,
        "armature": armature,
        "locked_joints": c.locked_joints(),
    }
    text = etree.tostring(_Writer(c, floating).robot, encoding="unicode")
    balls = tuple(c.name("joint", j) for j in c.balls)
    return Described(text, options, tuple(_omitted(c)), balls)


class _Compiled:
    """MuJoCo's model of a file or text, and questions to it; what older versions of MuJoCo lack is zero."""

    def __init__(self, source):
        self.mujoco, self.m = _compile(source)
        m = self.m
        self.bodies, self.joints, self.tendons = range(1, m.nbody), range(m.njnt), range(m.ntendon)
        self.joint_kinds = self.kinds("mjtJoint", "jnt_type")
        self.free = [j for j in self.joints if self.joint_kinds[j] == "free"]
        self.balls = [j for j in self.joints if self.joint_kinds[j] == "ball"]
        self.single = [j for j in self.joints if self.joint_kinds[j] in ("hinge", "slide")]
        # nu counts controls since these may be several of one actuator.
        self.actuators = range(getattr(m, "nactuator", m.nu))
        at_joint = [
            kind in ("joint", "jointinparent") for kind in self.kinds("mjtTrn", "actuator_trntype")
        ]
        ends = {a: int(m.actuator_trnid[a, 0]) for a in self.actuators if at_joint[a]}
        self.actuated = {
            a: j for a, j in ends.items() if j in self.single
        }  # the hinge or slide of an actuator
        self.equality_kinds = self.kinds("mjtEq", "eq_type")
        self.equalities = (
            [] if self.is_disabled("equality") else list(filter(self._holds, range(m.neq)))
        )
        self.limited = (
            np.zeros(m.njnt, bool) if self.is_disabled("limit") else m.jnt_limited.astype(bool)
        )
        self.friction = np.zeros(m.nv) if self.is_disabled("frictionloss") else m.dof_frictionloss
        self.damping = (
            np.zeros(m.nv) if self.is_disabled("damper") else self._with_actuators("damping")
        )
        self.armature = self._with_actuators("armature")

    def _with_actuators(self, name):
        """Return damping or armature by degree of freedom, with that of actuators, which MuJoCo adds at run time."""
        m, values = self.m, getattr(self.m, f"dof_{name}").copy()
        for a in self.nonzero(self.actuated, f"actuator_{name}"):
            values[m.jnt_dofadr[self.actuated[a]]] += (
                getattr(m, f"actuator_{name}")[a] * self.gear(a) ** 2
            )
        return values

    def kinds(self, enum, attribute):
        """Return the kind of each object, named as by an enumeration of MuJoCo: "hinge" of mjtJoint's mjJNT_HINGE."""
        kind = getattr(self.mujoco, enum)
        return [
            kind(int(value)).name.partition("_")[2].lower() for value in getattr(self.m, attribute)
        ]

    def is_disabled(self, thing):
        flags = (thing.upper(), FLAGS.get(thing, ""))
        bits = (getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{flag}", 0) for flag in flags)
        return any(self.m.opt.disableflags & int(bit) for bit in bits)

    def name(self, kind, k):
        """Return the name of an object, made of its number if the file gives none."""
        return (
            self.mujoco.mj_id2name(self.m, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), k)
            or f"{kind}{k}"
        )

    def nonzero(self, which, *attributes):
        """Return those of some objects that have one of these attributes other than zero."""
        values = {name: getattr(self.m, name) for name in attributes if hasattr(self.m, name)}
        # The degrees of freedom of a joint have the same numbers.
        by_object = [
            x[self.m.jnt_dofadr] if name.startswith("dof_") else x for name, x in values.items()
        ]
        return [k for k in which if any(np.any(x[k]) for x in by_object)]

    def moves(self, b):
        return self.m.body_dofnum[self.m.body_weldid[b]] > 0

    def is_marker(self, b):
        """Return whether a body is a mocap body, or on one, that carries no joint."""
        root = self.m.body_rootid[b]
        return self.m.body_mocapid[root] >= 0 and not np.any(
            self.m.body_dofnum[self.m.body_rootid == root]
        )

    def reference(self, j):
        """Return the position of a hinge or slide at which its body is where the file has it [rad, m]."""
        return float(self.m.qpos0[self.m.jnt_qposadr[j]])

    def locked_joints(self):
        """Return positions, by name, of joints that equalities without joint2 lock."""
        equalities = [e for e in self.equalities if self.equality_kinds[e] == "joint"]
        locked = [(e, self.m.eq_obj1id[e]) for e in equalities if self.m.eq_obj2id[e] < 0]
        return {
            self.name("joint", j): self.reference(j) + float(self.m.eq_data[e, 0])
            for e, j in locked
        }

    def rotation(self, quaternion):
        """Return the rotation matrix of a quaternion (w, x, y, z)."""
        matrix = np.zeros(9)
        self.mujoco.mju_quat2Mat(matrix, quaternion)
        return matrix.reshape(3, 3)

    def gear(self, a):
        row = self.m.actuator_outadr[a] if hasattr(self.m, "actuator_outadr") else a
        return float(self.m.actuator_gear[row, 0])

    def ends(self, e):
        """Return body, position and rotation in it of both frames of a connect or weld."""
        m, of = self.m, (int(self.m.eq_obj1id[e]), int(self.m.eq_obj2id[e]))
        if hasattr(m, "eq_objtype") and m.eq_objtype[e] == int(self.mujoco.mjtObj.mjOBJ_SITE):
            return [
                (int(m.site_bodyid[s]), m.site_pos[s], self.rotation(m.site_quat[s])) for s in of
            ]
        first, second, turn = m.eq_data[e, :3], m.eq_data[e, 3:6], np.eye(3)
        if self.equality_kinds[e] == "weld":
            first, second, turn = second, first, self.rotation(m.eq_data[e, 6:10])
        return [(of[0], first, turn), (of[1], second, np.eye(3))]

    def _holds(self, e):
        """Return whether an equality is active, and not between bodies that cannot move against each other."""
        m = self.m
        if not m.eq_active0[e] or self.equality_kinds[e] not in ("connect", "weld"):
            return bool(m.eq_active0[e])
        ends = [b for b, _, _ in self.ends(e)]
        return m.body_weldid[ends[0]] != m.body_weldid[ends[1]] and any(map(self.moves, ends))


def _compile(source):
    """Return the module mujoco, and its model of an MJCF given by path or text."""
    try:
        mujoco = import_module("mujoco")
    except ImportError as error:
        raise InputError("An MJCF needs MuJoCo's parser: pip install mujoco.") from error
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"source is {source!r}, expected the path of an MJCF, or its text.")
    try:
        if isinstance(source, str) and source.lstrip().startswith("<"):
            return mujoco, mujoco.MjModel.from_xml_string(source)
        return mujoco, mujoco.MjModel.from_xml_path(os.path.expanduser(os.fspath(source)))
    except (ValueError, mujoco.FatalError) as error:
        raise UrdfError(f"MuJoCo rejects the MJCF: {' '.join(str(error).split())}") from error


def _reject_unsupported(c):
    """Reject what changes M, C, ν or K and cannot be modelled."""
    elsewhere = [a for a in c.actuators if a not in c.actuated]
    for kind, which, reason in (
        ("joint", c.nonzero(c.balls, "dof_armature"), "is a ball joint and has armature"),
        ("joint", c.nonzero(c.free, "dof_armature"), "is free and has armature"),
        (
            "actuator",
            c.nonzero(elsewhere, "actuator_armature"),
            "has armature, but is not at a hinge or slide",
        ),
        ("tendon", c.nonzero(c.tendons, "tendon_armature"), "has armature"),
    ):
        if which:
            raise UnsupportedError(
                f"{kind} '{c.name(kind, which[0])}' {reason}, which is not supported."
            )
    coupled = set()
    for e in c.equalities:
        kind, joint = c.equality_kinds[e], int(c.m.eq_obj1id[e])
        if kind in ("connect", "weld"):
            if all(c.m.body_mocapid[c.m.body_rootid[b]] < 0 for b, _, _ in c.ends(e)):
                continue
        elif kind == "joint" and joint not in coupled:
            coupled.add(joint)
            continue
        raise UnsupportedError(
            f"equality '{c.name('equality', e)}' ({kind}) is neither a connect or weld of bodies of the robot nor the one "
            'equality of a joint, and is not supported. A model without it (active="false") has '
            "more degrees of freedom."
        )


def _omitted(c) -> Iterator[str]:
    """Yield the texts of `RobotModel.omitted`, one for each kind of object."""
    for what, which in _omitted_objects(c):
        if which:
            kind = "flex" if what == "flexible body" else what.split()[-1]
            yield f"{what} {', '.join(repr(c.name(kind, k)) for k in which)}"
    opt = c.m.opt
    if (opt.density or opt.viscosity) and not (c.is_disabled("spring") and c.is_disabled("damper")):
        yield f"fluid (density {opt.density:g}, viscosity {opt.viscosity:g})"


def _omitted_objects(c):
    """Yield texts that end with a kind of object, and which of these exert forces that are omitted."""
    m = c.m
    spring, damper = not c.is_disabled("spring"), not c.is_disabled("damper")
    if spring:
        yield "spring of joint", c.nonzero(c.joints, "jnt_stiffness", "jnt_stiffnesspoly")
    if damper:
        elsewhere = [a for a in c.actuators if a not in c.actuated]
        yield "damping of free joint", c.nonzero(c.free, "dof_damping")
        yield "damping of ball joint", c.nonzero(c.balls, "dof_damping")
        yield "nonlinear damping of joint", c.nonzero(c.joints, "dof_dampingpoly")
        yield "damping of actuator", c.nonzero(elsewhere, "actuator_damping")
        yield "nonlinear damping of actuator", c.nonzero(c.actuators, "actuator_dampingpoly")
    if not c.is_disabled("frictionloss"):
        yield "friction loss of free joint", c.nonzero(c.free, "dof_frictionloss")
        yield "friction loss of ball joint", c.nonzero(c.balls, "dof_frictionloss")
    if spring or damper:
        if np.any(m.opt.gravity) and not c.is_disabled("gravity"):
            carried = c.nonzero(c.nonzero(c.bodies, "body_gravcomp"), "body_mass")
            yield "gravity compensation of body", [b for b in carried if c.moves(b)]
        yield "plugin of body", [b for b in c.bodies if m.body_plugin[b] >= 0]
        yield "flexible body", range(getattr(m, "nflex", 0))
    yield "limit of ball joint", [j for j in c.balls if c.limited[j]]
    yield "mocap body", [b for b in c.bodies if m.body_mocapid[b] >= 0]
    yield "tendon", c.tendons


def _effort_limits(c):
    """Return the effort limit of each joint [N m, N], infinite where there is none."""
    sums = {}
    for a, j in c.actuated.items():
        group = int(c.m.actuator_group[a])
        if not (
            c.is_disabled("actuation")
            or (0 <= group <= 30 and c.m.opt.disableactuator >> group & 1)
        ):
            gear = abs(c.gear(a))
            sums[j] = sums.get(j, 0.0) + (gear * _largest_force(c, a) if gear else 0.0)
    limits = np.array([sums.get(j, np.inf) for j in c.joints])
    own = np.where(
        c.m.jnt_actfrclimited, np.abs(c.m.jnt_actfrcrange).max(axis=1, initial=0.0), np.inf
    )
    return np.minimum(limits, own)


def _largest_force(c, a):
    m = c.m
    force = float(np.abs(m.actuator_forcerange[a]).max()) if m.actuator_forcelimited[a] else np.inf
    control = m.actuator_ctrladr[a] if hasattr(m, "actuator_ctrladr") else a
    kinds = [
        c.kinds(f"mjt{part}", f"actuator_{part.lower()}type")[a] for part in ("Gain", "Bias", "Dyn")
    ]
    is_motor = kinds == ["fixed", "none", "none"] and m.actuator_plugin[a] < 0
    if is_motor and m.actuator_ctrllimited[control] and not c.is_disabled("clampctrl"):
        force = min(
            force, float(np.abs(m.actuator_gainprm[a, 0] * m.actuator_ctrlrange[control]).max())
        )
    return force


def _add(parent, tag, **attributes):
    """Add an element; numbers keep their bits."""
    texts = {
        name: x if isinstance(x, str) else numbers_text(np.atleast_1d(x))
        for name, x in attributes.items()
    }
    return etree.SubElement(parent, tag, texts)


class _Writer:
    """Writer of a compiled model as the <robot> element of a URDF."""

    def __init__(self, c, floating):
        self._c, self._m, self._floating = c, c.m, floating
        self._effort = _effort_limits(c)
        self._equality = {
            int(c.m.eq_obj1id[e]): e
            for e in c.equalities
            if c.equality_kinds[e] == "joint" and c.m.eq_obj2id[e] >= 0
        }
        self.robot = etree.Element(
            "robot", name=c.m.names[: c.m.names.index(b"\0")].decode() or "mjcf"
        )
        if not floating:
            _add(self.robot, "link", name="world")
        for b in c.bodies:
            if not c.is_marker(b):
                self._add_body(b)
        for e in c.equalities:
            if c.equality_kinds[e] != "joint":
                self._add_loop(e)

    def _add_loop(self, e):
        """Add a connect or weld; its joints begin where the file has them, and actuated ones are independent."""
        c, kind = self._c, {"connect": "spherical", "weld": "fixed"}[self._c.equality_kinds[e]]
        loop = _add(self.robot, "loop_joint", name=c.name("equality", e), type=kind)
        for tag, (b, place, turn) in zip(("link1", "link2"), c.ends(e), strict=True):
            _add(loop, tag, link=c.name("body", b), xyz=place, rpy=rotations.to_rpy(turn))
        for j in c.single:
            if c.reference(j):
                _add(loop, "start", joint=c.name("joint", j), position=c.reference(j))
        for j in c.actuated.values():
            _add(_add(self.robot, "transmission"), "joint", name=c.name("joint", j))

    def _add_body(self, b):
        m, c = self._m, self._c
        name, parent = c.name("body", b), c.name("body", int(m.body_parentid[b]))
        link = _add(self.robot, "link", name=name)
        if m.body_mass[b] > 0.0:
            turn = c.rotation(m.body_iquat[b])
            inertia = turn @ np.diag(m.body_inertia[b]) @ turn.T
            set_inertia(_add(link, "inertial"), m.body_mass[b], m.body_ipos[b], inertia)
        joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        if any(j in c.free for j in joints):
            if not self._floating:
                self._add_joint(
                    c.name("joint", joints[0]), "floating", "world", name, np.zeros(3), np.eye(3)
                )
            return
        # Each joint turns or shifts all that follows about its anchor; links between joints of one
        # body have no inertia.
        place, turn, anchor = m.body_pos[b], c.rotation(m.body_quat[b]), np.zeros(3)
        for j in joints:
            joint = c.name("joint", j)
            if j in c.balls:  # three hinges at one point
                place = place + turn @ (m.jnt_pos[j] - anchor)
                for letter, axis in zip("xyz", np.eye(3), strict=True):
                    child = f"{name}/{joint}_{letter}"
                    _add(self.robot, "link", name=child)
                    hinge = self._add_joint(
                        f"{joint}_{letter}", "continuous", parent, child, place, turn
                    )
                    _add(hinge, "axis", xyz=axis)
                    parent, place, turn = child, np.zeros(3), np.eye(3)
                anchor = m.jnt_pos[j]
                continue
            axis, ref = m.jnt_axis[j], c.reference(j)
            child, slides = f"{name}/{joint}", c.joint_kinds[j] == "slide"
            _add(self.robot, "link", name=child)
            place = place + turn @ (m.jnt_pos[j] - anchor)
            if slides:  # at `ref` the body is where the file has it
                place = place - ref * (turn @ axis)
            else:
                turn = turn @ rotations.about_axis(axis, -ref)
            kind = "prismatic" if slides else "revolute" if c.limited[j] else "continuous"
            self._describe(self._add_joint(joint, kind, parent, child, place, turn), j)
            parent, place, turn, anchor = child, np.zeros(3), np.eye(3), m.jnt_pos[j]
        self._add_joint(f"{name}/fixed", "fixed", parent, name, place - turn @ anchor, turn)

    def _add_joint(self, name, kind, parent, child, place, turn):
        joint = _add(self.robot, "joint", name=name, type=kind)
        _add(joint, "parent", link=parent)
        _add(joint, "child", link=child)
        _add(joint, "origin", xyz=place, rpy=rotations.to_rpy(turn))
        return joint

    def _describe(self, joint, j):
        """Add axis, friction, limits and coupling of a hinge or slide."""
        m, c, dof = self._m, self._c, self._m.jnt_dofadr[j]
        _add(joint, "axis", xyz=m.jnt_axis[j])
        _add(joint, "dynamics", damping=c.damping[dof], friction=c.friction[dof])
        limits = {"effort": self._effort[j], "velocity": np.inf}
        if joint.get("type") != "continuous":
            limits["lower"], limits["upper"] = m.jnt_range[j] if c.limited[j] else (-np.inf, np.inf)
        _add(joint, "limit", **limits)
        if j in self._equality:  # q_1 − ref_1 = offset + multiplier (q_2 − ref_2), or a polynomial
            e = self._equality[j]
            source, multiplier = int(m.eq_obj2id[e]), float(m.eq_data[e, 1])
            offset = float(m.eq_data[e, 0]) + c.reference(j) - multiplier * c.reference(source)
            mimic = _add(
                joint, "mimic", joint=c.name("joint", source), multiplier=multiplier, offset=offset
            )
            if np.any(m.eq_data[e, 2:5]):
                distance = np.polynomial.Polynomial([-c.reference(source), 1.0])
                curve = np.polynomial.Polynomial(m.eq_data[e, :5])(distance) + c.reference(j)
                mimic.set("polynomial", numbers_text(curve.coef))
