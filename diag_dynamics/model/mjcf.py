# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models from MJCF, through MuJoCo's own parser and compiler: what that has made of the file is written as a URDF."""

from __future__ import annotations

import os
from importlib import import_module
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from diag_dynamics.exceptions import InputError, UnsupportedError, UrdfError
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


def load_mjcf(source: str | os.PathLike[str], **options: Any) -> RobotModel:
    """Build a model from an MJCF; `mujoco` has to be installed.

    Hinges and slides, several at a body, with `pos` and `ref`; free bodies at the world; armature and damping, those of
    actuators times gear² included; friction loss and ranges; inertias as the compiler gives them, those of geometries
    included. Names are the file's, or ``body<number>`` and ``joint<number>``. Joints that an equality couples linearly are
    mimic joints. What a flag of the option disables is left out: gravity, equality, frictionloss, limit, spring, damper.
    Degrees of freedom are in the order of their names (see :class:`RobotModel`), which need not be MuJoCo's; of a free body
    q is x y z qx qy qz qw, and its rates are a twist in its own axes, linear first. A single free body is a floating base.

    A joint's effort limit is the lesser of the largest magnitude in its `actuatorfrcrange` and of the sum over the enabled
    actuators at that joint; infinite where neither is limited. An actuator's part is its gear times the largest magnitude in
    `forcerange`, or, of a plain motor (fixed gain, neither bias nor activation), of the gain times `ctrlrange`, if that is
    less. One actuator without a limit makes the sum infinite. The `ctrlrange` of any other actuator is no limit of effort,
    for it bounds a position, a velocity or an activation. Actuators at sites and bodies do not count.

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
        The model has what no quantity here knows: ball joints, tendons, springs, equalities other than linear couplings of
        two joints, two equalities for one joint, fluids, gravity compensation, flexible bodies, mocap bodies, stiffness or
        damping with higher coefficients, armature, damping or friction loss of a free joint. The message names the first.
    DiagDynamicsError
        As :func:`load_urdf`.
    """
    for name in OPTIONS:
        if name in options:
            raise InputError(f"{name} is what the MJCF says; change the file, or use with_gravity of the model.")
    try:
        mujoco = import_module("mujoco")
    except ImportError as error:
        raise InputError("load_mjcf needs MuJoCo's parser: pip install mujoco.") from error
    m = _compiled(mujoco, source)
    _refuse(mujoco, m)
    free = [j for j in range(m.njnt) if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
    top = [b for b in range(1, m.nbody) if m.body_parentid[b] == 0]
    floating = len(free) == 1 and len(top) == 1
    writer = _Writer(mujoco, m, floating)
    return load_urdf(
        writer.urdf(),
        floating_base=floating,
        gravity=np.zeros(3) if _disabled(mujoco, m, "gravity") else m.opt.gravity.copy(),
        armature=writer.armature,
        **options,
    )


def _compiled(mujoco, source):
    """MuJoCo's model of a file or text."""
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"source is {source!r}, expected the path of an MJCF, or its text.")
    text = os.fspath(source)
    try:
        if isinstance(source, str) and text.lstrip().startswith("<"):
            return mujoco.MjModel.from_xml_string(text)
        return mujoco.MjModel.from_xml_path(os.path.expanduser(text))
    except ValueError as error:
        raise UrdfError(f"MuJoCo refuses the MJCF: {' '.join(str(error).split())}") from error


def _disabled(mujoco, m, thing):
    """Whether a flag of the file disables a thing; `thing` is a key of FLAGS."""
    bits = (getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}", 0) for flag in FLAGS[thing])
    return any(m.opt.disableflags & int(bit) for bit in bits)


def _refuse(mujoco, m):
    """Refuse what would be left out in silence."""
    name = _namer(mujoco, m)
    for j in range(m.njnt):
        _refuse_joint(mujoco, m, j, f"joint '{name('joint', j)}'")
    for a in range(_actuator_count(m)):
        _refuse_actuator(mujoco, m, a, f"actuator '{name('actuator', a)}'")
    if m.ntendon:
        raise UnsupportedError(f"tendon '{name('tendon', 0)}': tendons are not supported.")
    if getattr(m, "nflex", 0):
        raise UnsupportedError("Flexible bodies are not supported.")
    if m.opt.viscosity != 0.0 or m.opt.density != 0.0:
        raise UnsupportedError("A fluid (option density or viscosity) is not supported.")
    for b in range(1, m.nbody):
        if m.body_gravcomp[b] != 0.0:
            raise UnsupportedError(f"body '{name('body', b)}' compensates its gravity, which is not supported.")
        if m.body_mocapid[b] >= 0:
            raise UnsupportedError(f"body '{name('body', b)}' is a mocap body, which is not supported.")
    coupled = {}
    for e in _equalities(mujoco, m):
        if not _couples(mujoco, m, e):
            raise UnsupportedError(
                f"equality '{name('equality', e)}' is not a linear coupling of two joints, and is not supported."
            )
        first = int(m.eq_obj1id[e])
        if first in coupled:
            raise UnsupportedError(
                f"equality '{name('equality', e)}' couples joint '{name('joint', first)}', as equality "
                f"'{name('equality', coupled[first])}' does; only one is supported."
            )
        coupled[first] = e


def _refuse_joint(mujoco, m, j, named):
    """Refuse a joint that is not known, or has what is not known."""
    free = m.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE
    if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
        raise UnsupportedError(f"{named} is a ball joint, which is not supported.")
    if free and m.body_parentid[m.jnt_bodyid[j]] != 0:
        raise UnsupportedError(f"{named} is free, but its body is not at the world.")
    dofs = slice(m.jnt_dofadr[j], m.jnt_dofadr[j] + (6 if free else 1))
    damped = not _disabled(mujoco, m, "damper")
    if not _disabled(mujoco, m, "spring") and (m.jnt_stiffness[j] != 0.0 or _any(m, "jnt_stiffnesspoly", j)):
        raise UnsupportedError(f"{named} has a spring, which is not supported.")
    if damped and _any(m, "dof_dampingpoly", dofs):
        raise UnsupportedError(f"{named} has damping with higher coefficients, which is not supported.")
    if free and np.any(m.dof_armature[dofs]):
        raise UnsupportedError(f"{named} is free and has armature, which is not supported.")
    if free and damped and np.any(m.dof_damping[dofs]):
        raise UnsupportedError(f"{named} is free and has damping, which is not supported.")
    if free and not _disabled(mujoco, m, "frictionloss") and np.any(m.dof_frictionloss[dofs]):
        raise UnsupportedError(f"{named} is free and has friction loss, which is not supported.")


def _refuse_actuator(mujoco, m, a, named):
    """Refuse an actuator whose armature or damping is not that of a hinge or slide, or is not linear."""
    damped = not _disabled(mujoco, m, "damper")
    if damped and _any(m, "actuator_dampingpoly", a):
        raise UnsupportedError(f"{named} has damping with higher coefficients, which is not supported.")
    if _joint_of(mujoco, m, a) is None:
        if _any(m, "actuator_armature", a):
            raise UnsupportedError(f"{named} has armature, but is not at a hinge or slide, which is not supported.")
        if damped and _any(m, "actuator_damping", a):
            raise UnsupportedError(f"{named} has damping, but is not at a hinge or slide, which is not supported.")


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
    """Numbers of the equalities that are active."""
    return [] if _disabled(mujoco, m, "equality") else [e for e in range(m.neq) if m.eq_active0[e]]


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
                turn = turn @ _about(axis, -ref)
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
        effort = _number(self._effort[j])
        text += f'<limit lower="{_number(lower)}" upper="{_number(upper)}" effort="{effort}" velocity="inf"/>'
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
        self._elements.append(
            f"<joint name={quoteattr(name)} type={quoteattr(kind)}><parent link={quoteattr(parent)}/>"
            f'<child link={quoteattr(child)}/><origin xyz="{_text(place)}" rpy="{_text(_rpy(turn))}"/>{more}</joint>'
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


def _about(axis, angle):
    """Rotation about a unit axis."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)


def _rpy(R):
    """Roll, pitch and yaw of a rotation matrix; at a pitch of ±90°, where roll and yaw are one, with a roll of 0."""
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    if np.hypot(R[0, 0], R[1, 0]) < 1e-9:
        return 0.0, pitch, np.arctan2(-R[0, 1], R[1, 1])
    return np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])
