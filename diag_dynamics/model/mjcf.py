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
from diag_dynamics.model.robot import RobotModel, load_urdf

OPTIONS = ("gravity", "floating_base", "armature", "estimate_inertias")
"""Options of load_urdf that an MJCF says itself."""

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
    """Compile an MJCF, and describe it as a URDF; see :func:`load_mjcf`, also for what is raised."""
    try:
        mujoco = import_module("mujoco")
    except ImportError as error:
        raise InputError("An MJCF needs MuJoCo's parser: pip install mujoco.") from error
    m = _compiled(mujoco, source)
    _refuse(mujoco, m)
    free = [j for j in range(m.njnt) if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
    top = [b for b in range(1, m.nbody) if m.body_parentid[b] == 0 and not _is_marker(m, b)]
    floating = len(free) == 1 and len(top) == 1
    writer = _Writer(mujoco, m, floating)
    options = {
        "floating_base": floating,
        "gravity": np.zeros(3) if _disabled(mujoco, m, "gravity") else m.opt.gravity.copy(),
    }
    return Described(writer.urdf(), options | {"armature": writer.armature}, tuple(_omitted(mujoco, m)))


def _compiled(mujoco, source):
    """MuJoCo's model of a file or text."""
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"source is {source!r}, expected the path of an MJCF, or its text.")
    text = os.fspath(source)
    try:
        if isinstance(source, str) and text.lstrip().startswith("<"):
            return mujoco.MjModel.from_xml_string(text)
        return mujoco.MjModel.from_xml_path(os.path.expanduser(text))
    except (ValueError, mujoco.FatalError) as error:
        raise UrdfError(f"MuJoCo refuses the MJCF: {' '.join(str(error).split())}") from error


def _disabled(mujoco, m, thing):
    """Whether a flag of the file disables a thing; `thing` is a key of FLAGS."""
    bits = (getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}", 0) for flag in FLAGS[thing])
    return any(m.opt.disableflags & int(bit) for bit in bits)


def _refuse(mujoco, m):
    """Refuse what changes M, C, ν or K and cannot be modelled."""
    name = _namer(mujoco, m)
    for j in range(m.njnt):
        _refuse_joint(mujoco, m, j, f"joint '{name('joint', j)}'")
    for a in range(_actuator_count(m)):
        if _joint_of(mujoco, m, a) is None and _any(m, "actuator_armature", a):
            raise UnsupportedError(
                f"actuator '{name('actuator', a)}' has armature, but is not at a hinge or slide, which is not supported."
            )
    for t in range(m.ntendon):
        if _any(m, "tendon_armature", t):
            raise UnsupportedError(f"tendon '{name('tendon', t)}' has armature, which is not supported.")
    coupled = {}
    for e in _equalities(mujoco, m):
        if not _couples(mujoco, m, e):
            raise UnsupportedError(
                f"equality '{name('equality', e)}' ({_ends_of(mujoco, m, e)}) is not a linear coupling of two joints, and is "
                'not supported. Remove it, or set active="false", if the model may move without it.'
            )
        first = int(m.eq_obj1id[e])
        if first in coupled:
            raise UnsupportedError(
                f"equality '{name('equality', e)}' couples joint '{name('joint', first)}', as equality "
                f"'{name('equality', coupled[first])}' does; only one is supported."
            )
        coupled[first] = e


def _ends_of(mujoco, m, e):
    """Type of an equality, and the names of what it holds."""
    kind = mujoco.mjtEq(int(m.eq_type[e])).name.removeprefix("mjEQ_").lower()
    of = {"joint": "joint", "tendon": "tendon", "connect": "body", "weld": "body"}.get(kind, "flex")
    of = "site" if hasattr(m, "eq_objtype") and m.eq_objtype[e] == mujoco.mjtObj.mjOBJ_SITE else of
    return f"{kind} of {of} " + ", ".join(
        f"'{_namer(mujoco, m)(of, int(k))}'" for k in (m.eq_obj1id[e], m.eq_obj2id[e]) if k >= 0
    )


def _refuse_joint(mujoco, m, j, named):
    """Refuse a joint that is not known, or has what is not known."""
    if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
        raise UnsupportedError(f"{named} is a ball joint, which is not supported.")
    if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE:
        if m.body_parentid[m.jnt_bodyid[j]] != 0:
            raise UnsupportedError(f"{named} is free, but its body is not at the world.")
        if np.any(m.dof_armature[_dofs(mujoco, m, j)]):
            raise UnsupportedError(f"{named} is free and has armature, which is not supported.")


def _omitted(mujoco, m) -> Iterator[str]:
    """Texts of :attr:`RobotModel.omitted`, one for each kind, and for each tendon."""
    name = _namer(mujoco, m)
    for what, kind, which in (*_omitted_of_joints(mujoco, m), *_omitted_of_bodies(mujoco, m)):
        if which:
            yield f"{what} {', '.join(repr(name(kind, k)) for k in which)}"
    tendons: dict[str, list[str]] = {}
    for t in range(m.ntendon):
        tendons.setdefault(", ".join(_parts_of_tendon(mujoco, m, t)), []).append(repr(name("tendon", t)))
    for parts, names in tendons.items():
        yield f"tendon {', '.join(names)}{f' ({parts})' if parts else ''}"
    if _has_passive_forces(mujoco, m) and (m.opt.density or m.opt.viscosity):
        yield f"fluid (density {m.opt.density:g}, viscosity {m.opt.viscosity:g})"


def _omitted_of_joints(mujoco, m):
    """What is omitted of joints and actuators: a text, the kind of its names, and their numbers."""
    joints, actuators, free = range(m.njnt), range(_actuator_count(m)), mujoco.mjtJoint.mjJNT_FREE
    dofs = [_dofs(mujoco, m, j) for j in joints]
    if not _disabled(mujoco, m, "spring"):
        yield "spring of joint", "joint", [j for j in joints if m.jnt_stiffness[j] or _any(m, "jnt_stiffnesspoly", j)]
    if not _disabled(mujoco, m, "damper"):
        damped = [j for j in joints if m.jnt_type[j] == free and np.any(m.dof_damping[dofs[j]])]
        yield "damping of free joint", "joint", damped
        yield "nonlinear damping of joint", "joint", [j for j in joints if _any(m, "dof_dampingpoly", dofs[j])]
        elsewhere = [a for a in actuators if _joint_of(mujoco, m, a) is None]
        yield "damping of actuator", "actuator", [a for a in elsewhere if _any(m, "actuator_damping", a)]
        nonlinear = [a for a in actuators if _any(m, "actuator_dampingpoly", a)]
        yield "nonlinear damping of actuator", "actuator", nonlinear
    if not _disabled(mujoco, m, "frictionloss"):
        rubbed = [j for j in joints if m.jnt_type[j] == free and np.any(m.dof_frictionloss[dofs[j]])]
        yield "friction loss of free joint", "joint", rubbed


def _omitted_of_bodies(mujoco, m):
    """What is omitted of bodies, as :func:`_omitted_of_joints`."""
    bodies = range(1, m.nbody)
    if _has_passive_forces(mujoco, m):
        if np.any(m.opt.gravity) and not _disabled(mujoco, m, "gravity"):
            carried = [b for b in bodies if m.body_gravcomp[b] and m.body_mass[b] and _moves(m, b)]
            yield "gravity compensation of body", "body", carried
        yield "plugin of body", "body", [b for b in bodies if m.body_plugin[b] >= 0]
        yield "flexible body", "flex", list(range(getattr(m, "nflex", 0)))
    mocap = [b for b in bodies if m.body_mocapid[b] >= 0]
    yield "mocap body", "body", [b for b in mocap if _is_marker(m, b)]
    yield "motion of mocap body", "body", [b for b in mocap if not _is_marker(m, b)]


def _parts_of_tendon(mujoco, m, t):
    """Yield the forces of a tendon."""
    if not _disabled(mujoco, m, "spring") and (m.tendon_stiffness[t] or _any(m, "tendon_stiffnesspoly", t)):
        yield "spring"
    if not _disabled(mujoco, m, "damper") and (m.tendon_damping[t] or _any(m, "tendon_dampingpoly", t)):
        yield "damping"
    if not _disabled(mujoco, m, "frictionloss") and m.tendon_frictionloss[t]:
        yield "friction loss"
    if not _disabled(mujoco, m, "limit") and m.tendon_limited[t]:
        yield "limits"
    name, at_tendon = _namer(mujoco, m), int(mujoco.mjtTrn.mjTRN_TENDON)
    for a in range(_actuator_count(m)):
        if int(m.actuator_trntype[a]) == at_tendon and int(m.actuator_trnid[a, 0]) == t:
            yield f"actuator '{name('actuator', a)}'"


def _has_passive_forces(mujoco, m):
    """Whether MuJoCo computes passive forces: none if both springs and dampers are disabled."""
    return not (_disabled(mujoco, m, "spring") and _disabled(mujoco, m, "damper"))


def _moves(m, b):
    """Whether a joint moves a body."""
    return m.body_dofnum[m.body_weldid[b]] > 0


def _is_marker(m, b):
    """Whether a body is a mocap body, or on one, and no joint is on that."""
    root = m.body_rootid[b]
    return m.body_mocapid[root] >= 0 and not np.any(m.body_dofnum[m.body_rootid == root])


def _dofs(mujoco, m, j):
    """Degrees of freedom of a hinge, a slide or a free joint."""
    begin = int(m.jnt_dofadr[j])
    return slice(begin, begin + (6 if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE else 1))


def _any(m, attribute, index):
    """Whether an attribute, which older versions of MuJoCo do not have, is nonzero there."""
    return hasattr(m, attribute) and np.any(getattr(m, attribute)[index])


def _actuator_count(m):
    """Number of actuators; `nu` counts controls since these may be several of one actuator."""
    return getattr(m, "nactuator", m.nu)


def _joint_of(mujoco, m, a):
    """Hinge or slide at which an actuator acts, None where it is another thing."""
    transmissions = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT
    kinds = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
    if int(m.actuator_trntype[a]) not in map(int, transmissions):
        return None
    j = int(m.actuator_trnid[a, 0])
    return j if int(m.jnt_type[j]) in map(int, kinds) else None


def _gear(m, a):
    """Gear of an actuator at a hinge or slide."""
    row = m.actuator_outadr[a] if hasattr(m, "actuator_outadr") else a
    return float(m.actuator_gear[row, 0])


def _efforts(mujoco, m):
    """Effort limit of each joint [N m, N], infinite where there is none."""
    effort, sums = np.full(m.njnt, np.inf), {}
    for a in range(_actuator_count(m)):
        j = _joint_of(mujoco, m, a)
        if j is not None and _acts(mujoco, m, a):
            sums[j] = sums.get(j, 0.0) + _effort(mujoco, m, a)
    for j in range(m.njnt):
        effort[j] = sums.get(j, np.inf)
        if m.jnt_actfrclimited[j]:
            effort[j] = min(effort[j], np.abs(m.jnt_actfrcrange[j]).max())
    return effort


def _acts(mujoco, m, a):
    """Whether neither a flag nor the actuator's group disables it."""
    group = int(m.actuator_group[a])
    of_group = 0 <= group <= 30 and m.opt.disableactuator >> group & 1
    return not (of_group or _disabled(mujoco, m, "actuation"))


def _effort(mujoco, m, a):
    """Largest effort of an actuator at its joint, infinite where there is none."""
    gear, force = abs(_gear(m, a)), np.inf
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
    if is_motor and m.actuator_ctrllimited[control] and not _disabled(mujoco, m, "clampctrl"):
        force = min(force, float(np.abs(m.actuator_gainprm[a, 0] * m.actuator_ctrlrange[control]).max()))
    return gear * force


def _equalities(mujoco, m):
    """Numbers of the equalities that are active, but for those between bodies of which none moves against the other."""
    if _disabled(mujoco, m, "equality"):
        return []
    return [e for e in range(m.neq) if m.eq_active0[e] and not _is_idle(mujoco, m, e)]


def _is_idle(mujoco, m, e):
    """Whether an equality holds two bodies that do not move, or that no joint is between."""
    if int(m.eq_type[e]) not in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
        return False
    ends = [int(m.eq_obj1id[e]), int(m.eq_obj2id[e])]
    if hasattr(m, "eq_objtype") and int(m.eq_objtype[e]) == int(mujoco.mjtObj.mjOBJ_SITE):
        ends = [int(m.site_bodyid[site]) for site in ends]
    return m.body_weldid[ends[0]] == m.body_weldid[ends[1]] or not any(_moves(m, b) for b in ends)


def _couples(mujoco, m, e):
    """Whether an equality is a linear coupling of two joints."""
    is_of_joints = m.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and m.eq_obj2id[e] >= 0
    return is_of_joints and not np.any(m.eq_data[e, 2:5])


def _namer(mujoco, m):
    """Function that names an object, by its number where the file does not."""
    kinds = {
        "body": mujoco.mjtObj.mjOBJ_BODY,
        "joint": mujoco.mjtObj.mjOBJ_JOINT,
        "tendon": mujoco.mjtObj.mjOBJ_TENDON,
        "equality": mujoco.mjtObj.mjOBJ_EQUALITY,
        "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
        "site": mujoco.mjtObj.mjOBJ_SITE,
        "flex": getattr(mujoco.mjtObj, "mjOBJ_FLEX", None),
    }
    return lambda kind, k: mujoco.mj_id2name(m, kinds[kind], k) or f"{kind}{k}"


class _Writer:
    """Writes a compiled model as a URDF.

    Attributes
    ----------
    armature : dict
        Rotor inertia by joint name [kg m², kg].
    """

    def __init__(self, mujoco, m, floating):
        self._mujoco, self._m, self._floating = mujoco, m, floating
        self._name, self._elements, self.armature = _namer(mujoco, m), [], {}
        self._mimic = {}
        for e in _equalities(mujoco, m):  # q_1 − ref_1 = offset + multiplier (q_2 − ref_2)
            first, second = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
            multiplier = float(m.eq_data[e, 1])
            ref = [float(m.qpos0[m.jnt_qposadr[j]]) for j in (first, second)]
            offset = float(m.eq_data[e, 0]) + ref[0] - multiplier * ref[1]
            self._mimic[first] = self._name("joint", second), multiplier, offset
        self._limited = np.zeros(m.njnt, bool) if _disabled(mujoco, m, "limit") else m.jnt_limited.astype(bool)
        self._friction = np.zeros(m.nv) if _disabled(mujoco, m, "frictionloss") else m.dof_frictionloss
        self._effort = _efforts(mujoco, m)
        self._armature, self._damping = m.dof_armature.copy(), m.dof_damping.copy()
        for values, attribute in ((self._armature, "actuator_armature"), (self._damping, "actuator_damping")):
            for a in range(_actuator_count(m)):  # MuJoCo adds these at run time
                joint = _joint_of(mujoco, m, a)
                if joint is not None and hasattr(m, attribute):
                    values[m.jnt_dofadr[joint]] += getattr(m, attribute)[a] * _gear(m, a) ** 2
        if _disabled(mujoco, m, "damper"):
            self._damping[:] = 0.0

    def urdf(self):
        """Text of the URDF."""
        m = self._m
        if not self._floating:
            self._link("world")
        for b in range(1, m.nbody):
            if not _is_marker(m, b):
                self._body(b)
        robot = m.names[: m.names.index(b"\0")].decode() or "mjcf"
        return f"<robot name={quoteattr(robot)}>{''.join(self._elements)}</robot>"

    def _body(self, b):
        m = self._m
        name, parent = self._name("body", b), self._name("body", int(m.body_parentid[b]))
        place, turn = m.body_pos[b], _rotation(self._mujoco, m.body_quat[b])
        joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        self._link(name, b)
        if any(m.jnt_type[j] == self._mujoco.mjtJoint.mjJNT_FREE for j in joints):
            if not self._floating:
                joint = self._name("joint", joints[0])
                self._joint(joint, "floating", "world", name, np.zeros(3), np.eye(3), "")
            return
        # Each joint turns or shifts all that follows about its anchor; the links between joints of one body have no inertia.
        anchor = np.zeros(3)
        for j in joints:
            child = f"{name}/{self._name('joint', j)}"
            self._link(child)
            axis, ref = m.jnt_axis[j], float(m.qpos0[m.jnt_qposadr[j]])
            place = place + turn @ (m.jnt_pos[j] - anchor)
            if self._slides(j):  # at `ref` the body is where the file has it
                place = place - ref * (turn @ axis)
            else:
                turn = turn @ rotations.about_axis(axis, -ref)
            self._joint(self._name("joint", j), self._kind(j), parent, child, place, turn, self._of_joint(j))
            parent, place, turn, anchor = child, np.zeros(3), np.eye(3), m.jnt_pos[j]
            self.armature[self._name("joint", j)] = float(self._armature[m.jnt_dofadr[j]])
        self._joint(f"{name}/fixed", "fixed", parent, name, place - turn @ anchor, turn, "")

    def _slides(self, j):
        return self._m.jnt_type[j] == self._mujoco.mjtJoint.mjJNT_SLIDE

    def _kind(self, j):
        return "prismatic" if self._slides(j) else "revolute" if self._limited[j] else "continuous"

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
            turn = _rotation(self._mujoco, m.body_iquat[b])
            own = turn @ np.diag(m.body_inertia[b]) @ turn.T
            places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
            entries = {entry: own[place] for entry, place in places.items()}
            inertia = " ".join(f'{name}="{_number(value)}"' for name, value in entries.items())
            inertial = f'<inertial><origin xyz="{_text(m.body_ipos[b])}"/><mass value="{_number(m.body_mass[b])}"/>'
            inertial += f"<inertia {inertia}/></inertial>"
        self._elements.append(f"<link name={quoteattr(name)}>{inertial}</link>")

    def _joint(self, name, kind, parent, child, place, turn, more):
        rpy = _text(rotations.to_rpy(turn))
        self._elements.append(
            f"<joint name={quoteattr(name)} type={quoteattr(kind)}><parent link={quoteattr(parent)}/>"
            f'<child link={quoteattr(child)}/><origin xyz="{_text(place)}" rpy="{rpy}"/>{more}</joint>'
        )


def _number(value):
    return repr(float(value))


def _text(values):
    return " ".join(map(_number, values))


def _rotation(mujoco, quaternion):
    """Rotation matrix of a quaternion (w, x, y, z)."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
