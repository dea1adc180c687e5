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
from diag_dynamics.exceptions import InputError, UnsupportedError, UrdfError
from diag_dynamics.model.parameters import read_parameters
from diag_dynamics.model.remarks import warn
from diag_dynamics.model.rewriting import numbers_text, set_inertia
from diag_dynamics.model.robot import RobotModel, load_urdf

OPTIONS = ("gravity", "floating_base", "armature", "estimate_inertias")
"""Options of load_urdf that an MJCF has itself."""

FLAGS = {"spring": "PASSIVE", "damper": "PASSIVE"} | dict.fromkeys(("equality", "frictionloss", "limit"), "CONSTRAINT")
"""MuJoCo's flags that disable a thing beside the flag of its name; those of passive forces depend on the version."""


class Described(NamedTuple):
    """A robot as the text of a URDF, and what a URDF cannot say.

    `options` of :func:`load_urdf` are floating_base, gravity and armature of an MJCF; none of a URDF.
    """

    text: str
    options: Mapping[str, Any] = MappingProxyType({})
    omitted: tuple[str, ...] = ()

    @property
    def is_mjcf(self) -> bool:
        """Whether it was an MJCF."""
        return bool(self.options)


def load_mjcf(source: str | os.PathLike[str], **options: Any) -> RobotModel:
    """Build a model from an MJCF; `mujoco` has to be installed.

    Joints that an equality couples linearly are mimic joints. Names are the file's, or ``body<number>`` and
    ``joint<number>``. A single free body is a floating base. Degrees of freedom are in the order of :class:`RobotModel`,
    which need not be MuJoCo's. Forward and inverse dynamics omit some forces, such as those of springs: a ModelWarning
    names them, and `RobotModel.omitted` has them.

    `source` is the path of a file, or XML text. Options are those of :func:`load_urdf`, but for gravity, floating_base,
    armature and estimate_inertias, which the file has.

    Raises
    ------
    UrdfError
        MuJoCo rejects the file.
    UnsupportedError
        The file has what changes M, C, ν or K and cannot be modelled: ball joints, equalities other than a linear coupling of
        two joints, or armature of a free joint, a tendon, or an actuator elsewhere than at a hinge or slide.
    """
    for name in OPTIONS:
        if name in options:
            raise InputError(f"{name} is what the MJCF says; change the file, or use with_gravity of the model.")
    return loaded(read_mjcf(source), **options)


def loaded(described: Described, **options: Any) -> RobotModel:
    """Build the model of a description; options of :func:`load_urdf` have precedence over those that the file says.

    Parameters beside the file, and `armature`, replace the armature of the joints that they name.
    """
    armature = dict(described.options.get("armature", {}))
    if (beside := options.get("parameters")) is not None:
        armature |= read_parameters(beside).by_joint("armature")
    armature |= options.get("armature") or {}
    model = load_urdf(described.text, **{**described.options, **options, "armature": armature})
    if described.omitted:
        text = f"Forward and inverse dynamics of robot '{model.name}' omit: {'; '.join(described.omitted)}. "
        warn(f"{text}M, C, ν and K do not depend on these.", stacklevel=4)
    return model.with_omitted(described.omitted)


def is_mjcf(source: object) -> bool:
    """Whether this is the path of a file whose root element is <mujoco>."""
    try:
        if not isinstance(source, (str, os.PathLike)) or not os.path.isfile(path := os.path.expanduser(source)):
            return False
        begin = etree.iterparse(path, ("start",), resolve_entities=False, no_network=True, load_dtd=False)
        return next(begin)[1].tag == "mujoco"
    except (OSError, ValueError, StopIteration, etree.XMLSyntaxError):  # a name with a NUL, no permission
        return False


def read_mjcf(source: str | os.PathLike[str]) -> Described:
    """Compile an MJCF, and describe it as a URDF; see :func:`load_mjcf`, also for its errors."""
    c = _Compiled(source)
    _reject_unsupported(c)
    top = [b for b in c.bodies if c.m.body_parentid[b] == 0 and not c.is_marker(b)]
    floating = sum(map(c.is_free, c.joints)) == 1 and len(top) == 1
    writer = _Writer(c, floating)
    gravity = np.zeros(3) if c.is_disabled("gravity") else c.m.opt.gravity.copy()
    options = {"floating_base": floating, "gravity": gravity, "armature": writer.armature}
    return Described(etree.tostring(writer.robot, encoding="unicode"), options, tuple(_omitted(c)))


class _Compiled:
    """MuJoCo's model of a file or text, and questions to it; what older versions of MuJoCo lack is zero."""

    def __init__(self, source):
        try:
            self.mujoco = import_module("mujoco")
        except ImportError as error:
            raise InputError("An MJCF needs MuJoCo's parser: pip install mujoco.") from error
        if not isinstance(source, (str, os.PathLike)):
            raise InputError(f"source is {source!r}, expected the path of an MJCF, or its text.")
        text, build = os.fspath(source), self.mujoco.MjModel
        try:
            if isinstance(source, str) and text.lstrip().startswith("<"):
                self.m = build.from_xml_string(text)
            else:
                self.m = build.from_xml_path(os.path.expanduser(text))
        except (ValueError, self.mujoco.FatalError) as error:
            raise UrdfError(f"MuJoCo rejects the MJCF: {' '.join(str(error).split())}") from error
        m = self.m
        self.bodies, self.joints, self.tendons = range(1, m.nbody), range(m.njnt), range(m.ntendon)
        # nu counts controls since these may be several of one actuator.
        self.actuators = range(getattr(m, "nactuator", m.nu))
        self.equalities = [] if self.is_disabled("equality") else list(filter(self._holds, range(m.neq)))

    def is_disabled(self, thing):
        flags = (thing.upper(), FLAGS.get(thing, ""))
        bits = (getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{flag}", 0) for flag in flags)
        return any(self.m.opt.disableflags & int(bit) for bit in bits)

    def is_a(self, attribute, k, enum, *names):
        """Return whether the type of an object is one of an enumeration's names."""
        kinds = getattr(self.mujoco, f"mjt{enum}")
        return int(getattr(self.m, attribute)[k]) in [int(getattr(kinds, f"mj{name}")) for name in names]

    def name(self, kind, k):
        """Return the name of an object, made of its number if the file gives none."""
        return self.mujoco.mj_id2name(self.m, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), k) or f"{kind}{k}"

    def is_free(self, j):
        return self.is_a("jnt_type", j, "Joint", "JNT_FREE")

    def slides(self, j):
        return self.is_a("jnt_type", j, "Joint", "JNT_SLIDE")

    def any(self, attribute, index):
        """Return whether an attribute is nonzero there."""
        return hasattr(self.m, attribute) and bool(np.any(getattr(self.m, attribute)[index]))

    def any_dof(self, attribute, j):
        """Return whether an attribute is nonzero at a degree of freedom of a hinge, a slide or a free joint."""
        begin = int(self.m.jnt_dofadr[j])
        return self.any(attribute, slice(begin, begin + (6 if self.is_free(j) else 1)))

    def moves(self, b):
        return self.m.body_dofnum[self.m.body_weldid[b]] > 0

    def is_marker(self, b):
        """Return whether a body is a mocap body, or on one, that carries no joint."""
        root = self.m.body_rootid[b]
        return self.m.body_mocapid[root] >= 0 and not np.any(self.m.body_dofnum[self.m.body_rootid == root])

    def joint_of(self, a):
        """Return the hinge or slide at which an actuator acts, None if it acts elsewhere."""
        if not self.is_a("actuator_trntype", a, "Trn", "TRN_JOINT", "TRN_JOINTINPARENT"):
            return None
        j = int(self.m.actuator_trnid[a, 0])
        return j if self.is_a("jnt_type", j, "Joint", "JNT_SLIDE", "JNT_HINGE") else None

    def gear(self, a):
        row = self.m.actuator_outadr[a] if hasattr(self.m, "actuator_outadr") else a
        return float(self.m.actuator_gear[row, 0])

    def _holds(self, e):
        """Return whether an equality is active, and not between bodies that cannot move against each other."""
        m = self.m
        if not m.eq_active0[e] or not self.is_a("eq_type", e, "Eq", "EQ_CONNECT", "EQ_WELD"):
            return bool(m.eq_active0[e])
        ends = [int(m.eq_obj1id[e]), int(m.eq_obj2id[e])]
        if hasattr(m, "eq_objtype") and self.is_a("eq_objtype", e, "Obj", "OBJ_SITE"):
            ends = [int(m.site_bodyid[site]) for site in ends]
        return m.body_weldid[ends[0]] != m.body_weldid[ends[1]] and any(map(self.moves, ends))


def _reject_unsupported(c):
    """Reject what changes M, C, ν or K and cannot be modelled."""
    balls = [j for j in c.joints if c.is_a("jnt_type", j, "Joint", "JNT_BALL")]
    for kind, which, reason in (
        ("joint", balls, "is a ball joint"),
        ("joint", [j for j in c.joints if c.is_free(j) and c.any_dof("dof_armature", j)], "is free and has armature"),
        (
            "actuator",
            [a for a in c.actuators if c.joint_of(a) is None and c.any("actuator_armature", a)],
            "has armature, but is not at a hinge or slide",
        ),
        ("tendon", [t for t in c.tendons if c.any("tendon_armature", t)], "has armature"),
    ):
        if which:
            raise UnsupportedError(f"{kind} '{c.name(kind, which[0])}' {reason}, which is not supported.")
    coupled = set()
    for e in c.equalities:
        is_of_joints = c.is_a("eq_type", e, "Eq", "EQ_JOINT") and c.m.eq_obj2id[e] >= 0
        joint = int(c.m.eq_obj1id[e])
        if not is_of_joints or np.any(c.m.eq_data[e, 2:5]) or joint in coupled:
            kind = c.mujoco.mjtEq(int(c.m.eq_type[e])).name.removeprefix("mjEQ_").lower()
            raise UnsupportedError(
                f"equality '{c.name('equality', e)}' ({kind}) is not the one linear coupling of a joint to "
                'another one, and is not supported. Remove it, or set active="false".'
            )
        coupled.add(joint)


def _omitted(c) -> Iterator[str]:
    """Yield the texts of `RobotModel.omitted`, one for each kind of object."""
    for what, kind, which in _omitted_objects(c):
        if which:
            yield f"{what} {', '.join(repr(c.name(kind, k)) for k in which)}"
    opt = c.m.opt
    if (opt.density or opt.viscosity) and not (c.is_disabled("spring") and c.is_disabled("damper")):
        yield f"fluid (density {opt.density:g}, viscosity {opt.viscosity:g})"


def _omitted_objects(c):
    """Yield a text, the kind and the numbers of objects of which forces are omitted."""
    m, free = c.m, list(filter(c.is_free, c.joints))
    spring, damper = not c.is_disabled("spring"), not c.is_disabled("damper")
    if spring:
        springs = [j for j in c.joints if c.any("jnt_stiffness", j) or c.any("jnt_stiffnesspoly", j)]
        yield "spring of joint", "joint", springs
    if damper:
        yield "damping of free joint", "joint", [j for j in free if c.any_dof("dof_damping", j)]
        yield "nonlinear damping of joint", "joint", [j for j in c.joints if c.any_dof("dof_dampingpoly", j)]
        elsewhere = [a for a in c.actuators if c.joint_of(a) is None and c.any("actuator_damping", a)]
        yield "damping of actuator", "actuator", elsewhere
        nonlinear = [a for a in c.actuators if c.any("actuator_dampingpoly", a)]
        yield "nonlinear damping of actuator", "actuator", nonlinear
    if not c.is_disabled("frictionloss"):
        yield "friction loss of free joint", "joint", [j for j in free if c.any_dof("dof_frictionloss", j)]
    if spring or damper:
        if np.any(m.opt.gravity) and not c.is_disabled("gravity"):
            carried = [b for b in c.bodies if m.body_gravcomp[b] and m.body_mass[b] and c.moves(b)]
            yield "gravity compensation of body", "body", carried
        yield "plugin of body", "body", [b for b in c.bodies if m.body_plugin[b] >= 0]
        yield "flexible body", "flex", list(range(getattr(m, "nflex", 0)))
    yield "mocap body", "body", [b for b in c.bodies if m.body_mocapid[b] >= 0]
    yield "tendon", "tendon", list(c.tendons)


def _effort_limits(c):
    """Return the effort limit of each joint [N m, N], infinite where there is none."""
    sums = {}
    for a in c.actuators:
        j, group = c.joint_of(a), int(c.m.actuator_group[a])
        disabled = c.is_disabled("actuation") or (0 <= group <= 30 and c.m.opt.disableactuator >> group & 1)
        if j is not None and not disabled:
            gear = abs(c.gear(a))
            sums[j] = sums.get(j, 0.0) + (gear * _largest_force(c, a) if gear else 0.0)
    limits = np.array([sums.get(j, np.inf) for j in c.joints])
    own = np.where(c.m.jnt_actfrclimited, np.abs(c.m.jnt_actfrcrange).max(axis=1, initial=0.0), np.inf)
    return np.minimum(limits, own)


def _largest_force(c, a):
    m = c.m
    force = float(np.abs(m.actuator_forcerange[a]).max()) if m.actuator_forcelimited[a] else np.inf
    control = m.actuator_ctrladr[a] if hasattr(m, "actuator_ctrladr") else a
    is_motor = (
        c.is_a("actuator_gaintype", a, "Gain", "GAIN_FIXED")
        and c.is_a("actuator_biastype", a, "Bias", "BIAS_NONE")
        and c.is_a("actuator_dyntype", a, "Dyn", "DYN_NONE")
        and m.actuator_plugin[a] < 0
    )
    if is_motor and m.actuator_ctrllimited[control] and not c.is_disabled("clampctrl"):
        force = min(force, float(np.abs(m.actuator_gainprm[a, 0] * m.actuator_ctrlrange[control]).max()))
    return force


class _Writer:
    """Writer of a compiled model as the <robot> element of a URDF; `armature` [kg m², kg] is by joint name."""

    def __init__(self, c, floating):
        self._c, self._m, self._floating, self.armature = c, c.m, floating, {}
        m = c.m
        self._limited = np.zeros(m.njnt, bool) if c.is_disabled("limit") else m.jnt_limited.astype(bool)
        self._effort = _effort_limits(c)
        self._equality = {int(m.eq_obj1id[e]): e for e in c.equalities}
        self._friction = np.zeros(m.nv) if c.is_disabled("frictionloss") else m.dof_frictionloss
        self._armature, self._damping = m.dof_armature.copy(), m.dof_damping.copy()
        for values, attribute in ((self._armature, "actuator_armature"), (self._damping, "actuator_damping")):
            for a in c.actuators:  # MuJoCo adds these at run time
                joint = c.joint_of(a)
                if joint is not None and hasattr(m, attribute):
                    values[m.jnt_dofadr[joint]] += getattr(m, attribute)[a] * c.gear(a) ** 2
        if c.is_disabled("damper"):
            self._damping[:] = 0.0
        self.robot = etree.Element("robot", name=m.names[: m.names.index(b"\0")].decode() or "mjcf")
        if not floating:
            self._add("link", name="world")
        for b in c.bodies:
            if not c.is_marker(b):
                self._add_body(b)

    def _add(self, tag, parent=None, **attributes):
        return etree.SubElement(self.robot if parent is None else parent, tag, attributes)

    def _add_body(self, b):
        m, c = self._m, self._c
        name, parent = c.name("body", b), c.name("body", int(m.body_parentid[b]))
        link = self._add("link", name=name)
        if m.body_mass[b] > 0.0:
            turn = self._rotation(m.body_iquat[b])
            inertia = turn @ np.diag(m.body_inertia[b]) @ turn.T
            set_inertia(self._add("inertial", link), m.body_mass[b], m.body_ipos[b], inertia)
        joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        if any(map(c.is_free, joints)):
            if not self._floating:
                self._add_joint(c.name("joint", joints[0]), "floating", "world", name, np.zeros(3), np.eye(3))
            return
        # Each joint turns or shifts all that follows about its anchor; links between joints of one body have no inertia.
        place, turn, anchor = m.body_pos[b], self._rotation(m.body_quat[b]), np.zeros(3)
        for j in joints:
            joint, axis, ref = c.name("joint", j), m.jnt_axis[j], float(m.qpos0[m.jnt_qposadr[j]])
            child = f"{name}/{joint}"
            self._add("link", name=child)
            place = place + turn @ (m.jnt_pos[j] - anchor)
            if c.slides(j):  # at `ref` the body is where the file has it
                place = place - ref * (turn @ axis)
            else:
                turn = turn @ rotations.about_axis(axis, -ref)
            kind = "prismatic" if c.slides(j) else "revolute" if self._limited[j] else "continuous"
            self._describe(self._add_joint(joint, kind, parent, child, place, turn), j)
            parent, place, turn, anchor = child, np.zeros(3), np.eye(3), m.jnt_pos[j]
            self.armature[joint] = float(self._armature[m.jnt_dofadr[j]])
        self._add_joint(f"{name}/fixed", "fixed", parent, name, place - turn @ anchor, turn)

    def _add_joint(self, name, kind, parent, child, place, turn):
        joint = self._add("joint", name=name, type=kind)
        self._add("parent", joint, link=parent)
        self._add("child", joint, link=child)
        self._add("origin", joint, xyz=numbers_text(place), rpy=numbers_text(rotations.to_rpy(turn)))
        return joint

    def _describe(self, joint, j):
        """Add axis, friction, limits and coupling of a hinge or slide."""
        m, dof = self._m, self._m.jnt_dofadr[j]
        self._add("axis", joint, xyz=numbers_text(m.jnt_axis[j]))
        friction = {"damping": self._damping[dof], "friction": self._friction[dof]}
        limits = {"effort": self._effort[j], "velocity": np.inf}
        if joint.get("type") != "continuous":
            limits["lower"], limits["upper"] = m.jnt_range[j] if self._limited[j] else (-np.inf, np.inf)
        for tag, values in (("dynamics", friction), ("limit", limits)):
            self._add(tag, joint, **{name: repr(float(value)) for name, value in values.items()})
        if j in self._equality:  # q_1 − ref_1 = offset + multiplier (q_2 − ref_2)
            e = self._equality[j]
            source, multiplier = int(m.eq_obj2id[e]), float(m.eq_data[e, 1])
            ref, ref_of_source = (float(m.qpos0[m.jnt_qposadr[k]]) for k in (j, source))
            offset = float(m.eq_data[e, 0]) + ref - multiplier * ref_of_source
            name = self._c.name("joint", source)
            self._add("mimic", joint, joint=name, multiplier=repr(multiplier), offset=repr(offset))

    def _rotation(self, quaternion):
        """Return the rotation matrix of a quaternion (w, x, y, z)."""
        matrix = np.zeros(9)
        self._c.mujoco.mju_quat2Mat(matrix, quaternion)
        return matrix.reshape(3, 3)
