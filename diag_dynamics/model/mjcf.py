# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models from MJCF, through MuJoCo's own parser and compiler: what that has made of the file is written as a URDF."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.exceptions import InputError, UnsupportedError, UrdfError
from diag_dynamics.model.options import warn
from diag_dynamics.model.parameters import of_joints, parameters_of
from diag_dynamics.model.rewriting import ENTRIES
from diag_dynamics.model.robot import RobotModel, load_urdf

OPTIONS = ("gravity", "floating_base", "armature", "estimate_inertias")
"""Options of load_urdf that an MJCF has itself."""

FLAGS = {
    "gravity": ("GRAVITY",),
    "equality": ("EQUALITY", "CONSTRAINT"),
    "frictionloss": ("FRICTIONLOSS", "CONSTRAINT"),
    "limit": ("LIMIT", "CONSTRAINT"),
    "spring": ("SPRING", "PASSIVE"),  # in older versions PASSIVE is of both
    "damper": ("DAMPER", "PASSIVE"),
    "clampctrl": ("CLAMPCTRL",),
    "actuation": ("ACTUATION",),
}
"""MuJoCo's flags that disable a thing, those that its version has."""

MAX_PREAMBLE = 1 << 16
"""Bytes in which the root element of an MJCF begins, after comments."""


class Described(NamedTuple):
    """A robot as a URDF, and what a URDF cannot say.

    Attributes
    ----------
    text : str
        The URDF.
    options : dict
        Options of :func:`load_urdf` that an MJCF says itself: floating_base, gravity, armature; none of a URDF.
    omitted : tuple of str
        See :attr:`RobotModel.omitted`.
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

    Hinges and slides, several at a body, with `pos` and `ref`; free bodies at the world; armature and damping, those of
    actuators times gear² included; friction loss and ranges; inertias as the compiler gives them, those of geometries
    included. Names are the file's, or ``body<number>`` and ``joint<number>``. Joints that an equality couples linearly are
    mimic joints. What a flag of the option disables is left out: gravity, equality, frictionloss, limit, spring, damper.
    Degrees of freedom are in the order of their names (see :class:`RobotModel`), which need not be MuJoCo's; of a free body
    q is x y z qx qy qz qw, and its rates are a twist in its own axes, linear first. A single free body is a floating base.

    Springs, tendons, gravity compensation, fluids, flexible bodies, passive plugins, nonlinear damping, and damping and
    friction loss of free joints change neither M nor C, ν, K and gravity. Forward and inverse dynamics omit their forces. A
    warning at load names them, and so does :attr:`RobotModel.omitted`. `gravcomp` is such a force: g(q) is gravity alone.

    A mocap body without joints below it is no part of the model, and neither are its children. A mocap body that carries
    joints is fixed where the file places it. The warning names both.

    A joint's effort limit is the lesser of the largest magnitude in its `actuatorfrcrange` and of the sum over the enabled
    actuators at that joint; infinite where neither is limited. An actuator's part is its gear times the largest magnitude in
    `forcerange`, or, of a plain motor (fixed gain, neither bias nor activation), of the gain times `ctrlrange`, if that is
    less. One actuator without a limit makes the sum infinite. The `ctrlrange` of any other actuator is no limit of effort,
    for it bounds a position, a velocity or an activation. Actuators at sites, bodies and tendons do not count.

    Parameters
    ----------
    source : str or os.PathLike
        Path of a file, or XML text.
    **options
        Those of :func:`load_urdf`, but for gravity, floating_base, armature and estimate_inertias, which the file has.

    Returns
    -------
    RobotModel

    Raises
    ------
    InputError
        mujoco is not installed, or an option is one that the file has.
    UrdfError
        MuJoCo refuses the file.
    UnsupportedError
        The file has what changes M, C, ν or K and cannot be modelled: ball joints, equalities that hold a body that moves,
        equalities of joints other than linear couplings of two, two equalities for one joint, and armature of a free joint,
        a tendon, or an actuator elsewhere than at a hinge or slide. The message names the first.
    DiagDynamicsError
        As :func:`load_urdf`.

    Warns
    -----
    ModelWarning
        Names everything in :attr:`RobotModel.omitted`.
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
    beside = options.get("parameters")
    if beside is not None:
        armature |= of_joints(parameters_of(beside), "armature")
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
        with open(path, "rb") as file:
            begin = file.read(MAX_PREAMBLE)
    except (OSError, ValueError):  # a name with a NUL, no permission
        return False
    # No part matches beyond its own end: many comments would take exponential time.
    before = rb"(\xef\xbb\xbf)?(\s|<\?((?!\?>).)*\?>|<!--((?!-->).)*-->)*"
    return re.match(before + rb"<mujoco[\s/>]", begin, re.S) is not None


def read_mjcf(source: str | os.PathLike[str]) -> Described:
    """Compile an MJCF, and describe it as a URDF; see :func:`load_mjcf`, also for its errors."""
    c = _Compiled(source)
    _reject_unsupported(c)
    top = [b for b in range(1, c.m.nbody) if c.m.body_parentid[b] == 0 and not c.is_marker(b)]
    floating = sum(map(c.is_free, c.joints)) == 1 and len(top) == 1
    writer = _Writer(c, floating)
    gravity = np.zeros(3) if c.is_disabled("gravity") else c.m.opt.gravity.copy()
    options = {"floating_base": floating, "gravity": gravity, "armature": writer.armature}
    return Described(writer.urdf(), options, tuple(_omitted(c)))


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
            raise UrdfError(f"MuJoCo refuses the MJCF: {' '.join(str(error).split())}") from error
        # nu counts controls since these may be several of one actuator.
        self.joints, self.actuators = range(self.m.njnt), range(getattr(self.m, "nactuator", self.m.nu))
        self.has_passive_forces = not (self.is_disabled("spring") and self.is_disabled("damper"))
        self.equalities = [] if self.is_disabled("equality") else list(filter(self._holds, range(self.m.neq)))

    def is_disabled(self, thing):
        """Return whether a flag of the file disables a key of FLAGS."""
        bits = (getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{flag}", 0) for flag in FLAGS[thing])
        return any(self.m.opt.disableflags & int(bit) for bit in bits)

    def name(self, kind, k):
        """Return the name of an object, made of its number if the file gives none."""
        return self.mujoco.mj_id2name(self.m, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), k) or f"{kind}{k}"

    def is_free(self, j):
        """Return whether a joint is free."""
        return self.m.jnt_type[j] == self.mujoco.mjtJoint.mjJNT_FREE

    def slides(self, j):
        """Return whether a joint is a slide."""
        return self.m.jnt_type[j] == self.mujoco.mjtJoint.mjJNT_SLIDE

    def dofs(self, j):
        """Return the degrees of freedom of a hinge, a slide or a free joint."""
        begin = int(self.m.jnt_dofadr[j])
        return slice(begin, begin + (6 if self.is_free(j) else 1))

    def any(self, attribute, index):
        """Return whether an attribute is nonzero there."""
        return hasattr(self.m, attribute) and np.any(getattr(self.m, attribute)[index])

    def moves(self, b):
        """Return whether a joint moves a body."""
        return self.m.body_dofnum[self.m.body_weldid[b]] > 0

    def is_marker(self, b):
        """Return whether a body is a mocap body, or on one, that carries no joint."""
        root = self.m.body_rootid[b]
        return self.m.body_mocapid[root] >= 0 and not np.any(self.m.body_dofnum[self.m.body_rootid == root])

    def joint_of(self, a):
        """Return the hinge or slide at which an actuator acts, None if it acts elsewhere."""
        transmissions = self.mujoco.mjtTrn.mjTRN_JOINT, self.mujoco.mjtTrn.mjTRN_JOINTINPARENT
        if int(self.m.actuator_trntype[a]) not in map(int, transmissions):
            return None
        j = int(self.m.actuator_trnid[a, 0])
        return j if self.slides(j) or self.m.jnt_type[j] == self.mujoco.mjtJoint.mjJNT_HINGE else None

    def gear(self, a):
        """Return the gear of an actuator at a hinge or slide."""
        row = self.m.actuator_outadr[a] if hasattr(self.m, "actuator_outadr") else a
        return float(self.m.actuator_gear[row, 0])

    def _holds(self, e):
        """Return whether an equality is active, and not between bodies that cannot move against each other."""
        m, kinds = self.m, self.mujoco.mjtEq
        if not m.eq_active0[e] or int(m.eq_type[e]) not in (int(kinds.mjEQ_CONNECT), int(kinds.mjEQ_WELD)):
            return bool(m.eq_active0[e])
        ends = [int(m.eq_obj1id[e]), int(m.eq_obj2id[e])]
        if self.is_of_sites(e):
            ends = [int(m.site_bodyid[site]) for site in ends]
        return m.body_weldid[ends[0]] != m.body_weldid[ends[1]] and any(map(self.moves, ends))

    def is_of_sites(self, e):
        """Return whether an equality holds sites."""
        return hasattr(self.m, "eq_objtype") and self.m.eq_objtype[e] == self.mujoco.mjtObj.mjOBJ_SITE


def _reject_unsupported(c):
    """Reject what changes M, C, ν or K and cannot be modelled."""
    for j in c.joints:
        _reject_joint(c, j, f"joint '{c.name('joint', j)}'")
    for a in c.actuators:
        if c.joint_of(a) is None and c.any("actuator_armature", a):
            raise UnsupportedError(
                f"actuator '{c.name('actuator', a)}' has armature, but is not at a hinge or slide, which is not supported."
            )
    for t in range(c.m.ntendon):
        if c.any("tendon_armature", t):
            raise UnsupportedError(f"tendon '{c.name('tendon', t)}' has armature, which is not supported.")
    coupled = {}
    for e in c.equalities:
        name = c.name("equality", e)
        is_of_joints = c.m.eq_type[e] == c.mujoco.mjtEq.mjEQ_JOINT and c.m.eq_obj2id[e] >= 0
        if not is_of_joints or np.any(c.m.eq_data[e, 2:5]):
            raise UnsupportedError(
                f"equality '{name}' ({_ends_of(c, e)}) is not a linear coupling of two joints, and is not supported. "
                'Remove it, or set active="false", if the model may move without it.'
            )
        first = int(c.m.eq_obj1id[e])
        if first in coupled:
            raise UnsupportedError(
                f"equality '{name}' couples joint '{c.name('joint', first)}', as equality "
                f"'{c.name('equality', coupled[first])}' does; only one is supported."
            )
        coupled[first] = e


def _ends_of(c, e):
    """Return the type of an equality, and the names of the objects that it holds."""
    kind = c.mujoco.mjtEq(int(c.m.eq_type[e])).name.removeprefix("mjEQ_").lower()
    of = {"joint": "joint", "tendon": "tendon", "connect": "body", "weld": "body"}.get(kind, "flex")
    of = "site" if c.is_of_sites(e) else of
    ends = (int(k) for k in (c.m.eq_obj1id[e], c.m.eq_obj2id[e]) if k >= 0)
    return f"{kind} of {of} " + ", ".join(f"'{c.name(of, k)}'" for k in ends)


def _reject_joint(c, j, named):
    if c.m.jnt_type[j] == c.mujoco.mjtJoint.mjJNT_BALL:
        raise UnsupportedError(f"{named} is a ball joint, which is not supported.")
    if c.is_free(j) and c.m.body_parentid[c.m.jnt_bodyid[j]] != 0:
        raise UnsupportedError(f"{named} is free, but its body is not at the world.")
    if c.is_free(j) and np.any(c.m.dof_armature[c.dofs(j)]):
        raise UnsupportedError(f"{named} is free and has armature, which is not supported.")


def _omitted(c) -> Iterator[str]:
    """Yield the texts of :attr:`RobotModel.omitted`, one for each kind, and for each tendon."""
    for what, kind, which in (*_omitted_of_joints(c), *_omitted_of_bodies(c)):
        if which:
            yield f"{what} {', '.join(repr(c.name(kind, k)) for k in which)}"
    tendons: dict[str, list[str]] = {}
    for t in range(c.m.ntendon):
        tendons.setdefault(", ".join(_parts_of_tendon(c, t)), []).append(repr(c.name("tendon", t)))
    for parts, names in tendons.items():
        yield f"tendon {', '.join(names)}{f' ({parts})' if parts else ''}"
    if c.has_passive_forces and (c.m.opt.density or c.m.opt.viscosity):
        yield f"fluid (density {c.m.opt.density:g}, viscosity {c.m.opt.viscosity:g})"


def _omitted_of_joints(c):
    """Yield a text, the kind and the numbers of joints and actuators of which forces are omitted."""
    m, free = c.m, list(filter(c.is_free, c.joints))
    if not c.is_disabled("spring"):
        yield "spring of joint", "joint", [j for j in c.joints if m.jnt_stiffness[j] or c.any("jnt_stiffnesspoly", j)]
    if not c.is_disabled("damper"):
        yield "damping of free joint", "joint", [j for j in free if np.any(m.dof_damping[c.dofs(j)])]
        yield "nonlinear damping of joint", "joint", [j for j in c.joints if c.any("dof_dampingpoly", c.dofs(j))]
        elsewhere = [a for a in c.actuators if c.joint_of(a) is None]
        yield "damping of actuator", "actuator", [a for a in elsewhere if c.any("actuator_damping", a)]
        nonlinear = [a for a in c.actuators if c.any("actuator_dampingpoly", a)]
        yield "nonlinear damping of actuator", "actuator", nonlinear
    if not c.is_disabled("frictionloss"):
        yield "friction loss of free joint", "joint", [j for j in free if np.any(m.dof_frictionloss[c.dofs(j)])]


def _omitted_of_bodies(c):
    """Yield what is omitted of bodies, as :func:`_omitted_of_joints`."""
    m, bodies = c.m, range(1, c.m.nbody)
    if c.has_passive_forces:
        if np.any(m.opt.gravity) and not c.is_disabled("gravity"):
            carried = [b for b in bodies if m.body_gravcomp[b] and m.body_mass[b] and c.moves(b)]
            yield "gravity compensation of body", "body", carried
        yield "plugin of body", "body", [b for b in bodies if m.body_plugin[b] >= 0]
        yield "flexible body", "flex", list(range(getattr(m, "nflex", 0)))
    mocap = [b for b in bodies if m.body_mocapid[b] >= 0]
    yield "mocap body", "body", [b for b in mocap if c.is_marker(b)]
    yield "motion of mocap body", "body", [b for b in mocap if not c.is_marker(b)]


def _parts_of_tendon(c, t):
    """Yield the forces of a tendon."""
    m = c.m
    if not c.is_disabled("spring") and (m.tendon_stiffness[t] or c.any("tendon_stiffnesspoly", t)):
        yield "spring"
    if not c.is_disabled("damper") and (m.tendon_damping[t] or c.any("tendon_dampingpoly", t)):
        yield "damping"
    if not c.is_disabled("frictionloss") and m.tendon_frictionloss[t]:
        yield "friction loss"
    if not c.is_disabled("limit") and m.tendon_limited[t]:
        yield "limits"
    at_tendon = int(c.mujoco.mjtTrn.mjTRN_TENDON)
    for a in c.actuators:
        if int(m.actuator_trntype[a]) == at_tendon and int(m.actuator_trnid[a, 0]) == t:
            yield f"actuator '{c.name('actuator', a)}'"


def _effort_limits(c):
    """Return the effort limit of each joint [N m, N], infinite where there is none."""
    sums = {}
    for a in c.actuators:
        j = c.joint_of(a)
        if j is not None and not _is_disabled_actuator(c, a):
            sums[j] = sums.get(j, 0.0) + _actuator_limit(c, a)
    limits = np.array([sums.get(j, np.inf) for j in c.joints])
    own = np.where(c.m.jnt_actfrclimited, np.abs(c.m.jnt_actfrcrange).max(axis=1, initial=0.0), np.inf)
    return np.minimum(limits, own)


def _is_disabled_actuator(c, a):
    """Return whether a flag or the actuator's group disables it."""
    group = int(c.m.actuator_group[a])
    return c.is_disabled("actuation") or (0 <= group <= 30 and bool(c.m.opt.disableactuator >> group & 1))


def _actuator_limit(c, a):
    """Return the largest effort of an actuator at its joint, infinite where there is none."""
    m, mujoco = c.m, c.mujoco
    gear, force = abs(c.gear(a)), np.inf
    if gear == 0.0:
        return 0.0
    if m.actuator_forcelimited[a]:
        force = float(np.abs(m.actuator_forcerange[a]).max())
    control = m.actuator_ctrladr[a] if hasattr(m, "actuator_ctrladr") else a
    is_motor = (
        m.actuator_gaintype[a] == mujoco.mjtGain.mjGAIN_FIXED
        and m.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_NONE
        and m.actuator_dyntype[a] == mujoco.mjtDyn.mjDYN_NONE
        and m.actuator_plugin[a] < 0
    )
    if is_motor and m.actuator_ctrllimited[control] and not c.is_disabled("clampctrl"):
        force = min(force, float(np.abs(m.actuator_gainprm[a, 0] * m.actuator_ctrlrange[control]).max()))
    return gear * force


class _Writer:
    """Writer of a compiled model as a URDF; `armature` [kg m², kg] by joint name is complete after `urdf`."""

    def __init__(self, c, floating):
        m = c.m
        self._c, self._m, self._floating = c, m, floating
        self._elements, self._mimic, self.armature = [], {}, {}
        for e in c.equalities:  # q_1 − ref_1 = offset + multiplier (q_2 − ref_2)
            first, second = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
            multiplier = float(m.eq_data[e, 1])
            ref = [float(m.qpos0[m.jnt_qposadr[j]]) for j in (first, second)]
            offset = float(m.eq_data[e, 0]) + ref[0] - multiplier * ref[1]
            self._mimic[first] = c.name("joint", second), multiplier, offset
        self._limited = np.zeros(m.njnt, bool) if c.is_disabled("limit") else m.jnt_limited.astype(bool)
        self._friction = np.zeros(m.nv) if c.is_disabled("frictionloss") else m.dof_frictionloss
        self._effort = _effort_limits(c)
        self._armature, self._damping = m.dof_armature.copy(), m.dof_damping.copy()
        for values, attribute in ((self._armature, "actuator_armature"), (self._damping, "actuator_damping")):
            for a in c.actuators:  # MuJoCo adds these at run time
                joint = c.joint_of(a)
                if joint is not None and hasattr(m, attribute):
                    values[m.jnt_dofadr[joint]] += getattr(m, attribute)[a] * c.gear(a) ** 2
        if c.is_disabled("damper"):
            self._damping[:] = 0.0

    def urdf(self):
        """Return the text of the URDF."""
        m = self._m
        if not self._floating:
            self._link("world")
        for b in range(1, m.nbody):
            if not self._c.is_marker(b):
                self._body(b)
        robot = m.names[: m.names.index(b"\0")].decode() or "mjcf"
        return f"<robot name={quoteattr(robot)}>{''.join(self._elements)}</robot>"

    def _body(self, b):
        m, c = self._m, self._c
        name, parent = c.name("body", b), c.name("body", int(m.body_parentid[b]))
        place, turn = m.body_pos[b], self._rotation(m.body_quat[b])
        joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        self._link(name, b)
        if any(map(c.is_free, joints)):
            if not self._floating:
                self._joint(c.name("joint", joints[0]), "floating", "world", name, np.zeros(3), np.eye(3), "")
            return
        # Each joint turns or shifts all that follows about its anchor; the links between joints of one body have no inertia.
        anchor = np.zeros(3)
        for j in joints:
            joint, axis, ref = c.name("joint", j), m.jnt_axis[j], float(m.qpos0[m.jnt_qposadr[j]])
            child = f"{name}/{joint}"
            self._link(child)
            place = place + turn @ (m.jnt_pos[j] - anchor)
            if c.slides(j):  # at `ref` the body is where the file has it
                place = place - ref * (turn @ axis)
            else:
                turn = turn @ rotations.about_axis(axis, -ref)
            self._joint(joint, self._kind(j), parent, child, place, turn, self._of_joint(j))
            parent, place, turn, anchor = child, np.zeros(3), np.eye(3), m.jnt_pos[j]
            self.armature[joint] = float(self._armature[m.jnt_dofadr[j]])
        self._joint(f"{name}/fixed", "fixed", parent, name, place - turn @ anchor, turn, "")

    def _kind(self, j):
        return "prismatic" if self._c.slides(j) else "revolute" if self._limited[j] else "continuous"

    def _of_joint(self, j):
        m, dof = self._m, self._m.jnt_dofadr[j]
        text = f'<axis xyz="{_text(m.jnt_axis[j])}"/>'
        text += f'<dynamics damping="{_number(self._damping[dof])}" friction="{_number(self._friction[dof])}"/>'
        lower, upper = m.jnt_range[j] if self._limited[j] else (-np.inf, np.inf)
        limits = f'lower="{_number(lower)}" upper="{_number(upper)}" ' if self._kind(j) != "continuous" else ""
        text += f'<limit {limits}effort="{_number(self._effort[j])}" velocity="inf"/>'
        if j in self._mimic:
            leader, multiplier, offset = self._mimic[j]
            text += f'<mimic joint={quoteattr(leader)} multiplier="{_number(multiplier)}" offset="{_number(offset)}"/>'
        return text

    def _link(self, name, b=None):
        inertial = ""
        if b is not None and self._m.body_mass[b] > 0.0:
            m = self._m
            turn = self._rotation(m.body_iquat[b])
            own = turn @ np.diag(m.body_inertia[b]) @ turn.T
            inertia = " ".join(f'{entry}="{_number(own[place])}"' for entry, place in ENTRIES.items())
            inertial = f'<inertial><origin xyz="{_text(m.body_ipos[b])}"/><mass value="{_number(m.body_mass[b])}"/>'
            inertial += f"<inertia {inertia}/></inertial>"
        self._elements.append(f"<link name={quoteattr(name)}>{inertial}</link>")

    def _joint(self, name, kind, parent, child, place, turn, more):
        rpy = _text(rotations.to_rpy(turn))
        self._elements.append(
            f"<joint name={quoteattr(name)} type={quoteattr(kind)}><parent link={quoteattr(parent)}/>"
            f'<child link={quoteattr(child)}/><origin xyz="{_text(place)}" rpy="{rpy}"/>{more}</joint>'
        )

    def _rotation(self, quaternion):
        """Return the rotation matrix of a quaternion (w, x, y, z)."""
        matrix = np.zeros(9)
        self._c.mujoco.mju_quat2Mat(matrix, quaternion)
        return matrix.reshape(3, 3)


def _number(value):
    return repr(float(value))


def _text(values):
    return " ".join(map(_number, values))
