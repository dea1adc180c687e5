# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions from MJCF, through MuJoCo's own parser and compiler."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TypeGuard

import numpy as np
from lxml import etree

from diag_dynamics import rotations
from diag_dynamics.arrays import Array
from diag_dynamics.description.description import (
    Curve,
    Description,
    Inertial,
    Joint,
    Link,
    Loop,
    LoopEnd,
    Mimic,
    Remark,
)
from diag_dynamics.description.urdf import checked_joint, reject_large
from diag_dynamics.exceptions import InputError, UnsupportedError, UrdfError
from diag_dynamics.optional import require


def is_mjcf(source: object) -> TypeGuard[str | os.PathLike[str]]:
    """Whether this is the path of a file whose root element is <mujoco>."""
    if not isinstance(source, (str, os.PathLike)):
        return False
    try:
        path = os.path.expanduser(source)
        if not os.path.isfile(path):
            return False
        elements = etree.iterparse(
            path, ("start",), resolve_entities=False, no_network=True, load_dtd=False
        )
        return str(next(elements)[1].tag) == "mujoco"
    except (OSError, ValueError, StopIteration, etree.XMLSyntaxError):  # a NUL, no permission
        return False


def read_mjcf(source: str | os.PathLike[str]) -> Description:
    """Compile an MJCF, and describe it; see :func:`load_mjcf`, also for its errors."""
    c = _Compiled(source)
    reject_large("MJCF", len(c.joints), len(c.bodies))
    _reject_unsupported(c)
    top = [b for b in c.bodies if c.m.body_parentid[b] == 0 and not c.is_marker(b)]
    floating = len(c.free) == 1 and len(top) == 1
    reader = _Reader(c, floating)
    omitted = tuple(_omitted(c))
    return Description(
        name=c.m.names[: c.m.names.index(b"\0")].decode() or "mjcf",
        root=next(iter(reader.links)),
        links=reader.links,
        joints=reader.joints,
        loops=tuple(reader.loop(e) for e in c.equalities if c.equality_kinds[e] != "joint"),
        curves=reader.curves,
        driven=tuple(c.name("joint", j) for j in c.actuated.values()),
        floating_base=floating,
        gravity=np.zeros(3) if c.is_disabled("GRAVITY") else c.m.opt.gravity.copy(),
        locked=c.locked_joints(),
        omitted=omitted,
        balls=tuple(c.name("joint", j) for j in c.balls),
        remarks=(Remark("omitted", words=("; ".join(omitted),)),) if omitted else (),
    )


class _Compiled:
    """MuJoCo's model of a file or text, and questions to it.

    What older versions of MuJoCo lack is zero.
    """

    def __init__(self, source: str | os.PathLike[str]) -> None:
        self.mujoco, self.m = _compile(source)
        m = self.m
        self.bodies = range(1, m.nbody)
        self.joints = range(m.njnt)
        self.tendons = range(m.ntendon)
        self.joint_kinds = self.kinds("mjtJoint", "jnt_type")
        self.free = [j for j in self.joints if self.joint_kinds[j] == "free"]
        self.balls = [j for j in self.joints if self.joint_kinds[j] == "ball"]
        self.single = [j for j in self.joints if self.joint_kinds[j] in ("hinge", "slide")]
        # nu counts controls since these may be several of one actuator.
        self.actuators = range(getattr(m, "nactuator", m.nu))
        kinds = self.kinds("mjtTrn", "actuator_trntype")
        at_joint = [a for a in self.actuators if kinds[a] in ("joint", "jointinparent")]
        ends = {a: int(m.actuator_trnid[a, 0]) for a in at_joint}
        # The hinge or slide of an actuator
        self.actuated = {a: j for a, j in ends.items() if j in self.single}
        self.springs_act = not self.is_disabled("SPRING", "PASSIVE")
        self.dampers_act = not self.is_disabled("DAMPER", "PASSIVE")
        self.equality_kinds = self.kinds("mjtEq", "eq_type")
        has_equalities = not self.is_disabled("EQUALITY", "CONSTRAINT")
        self.equalities = list(filter(self._holds, range(m.neq))) if has_equalities else []
        # The first equality of each joint
        of_joints = [e for e in reversed(self.equalities) if self.equality_kinds[e] == "joint"]
        self.coupled = {int(m.eq_obj1id[e]): e for e in of_joints}
        has_limits = not self.is_disabled("LIMIT", "CONSTRAINT")
        self.limited = m.jnt_limited.astype(bool) & has_limits
        has_friction = not self.is_disabled("FRICTIONLOSS", "CONSTRAINT")
        self.friction = m.dof_frictionloss * has_friction
        self.damping = self._with_actuators("damping") * self.dampers_act
        self.armature = self._with_actuators("armature")

    def _with_actuators(self, name: str) -> Array:
        """Return damping or armature by degree of freedom.

        It includes that of actuators, which MuJoCo adds at run time.
        """
        m = self.m
        values: Array = getattr(m, f"dof_{name}").copy()
        for a in self.nonzero(self.actuated, f"actuator_{name}"):
            values[m.jnt_dofadr[self.actuated[a]]] += (
                getattr(m, f"actuator_{name}")[a] * self.gear(a) ** 2
            )
        return values

    def kinds(self, enum: str, attribute: str) -> list[str]:
        """Return the kind of each object, named as by an enumeration of MuJoCo.

        The kind of mjtJoint's mjJNT_HINGE is "hinge".
        """
        kind = getattr(self.mujoco, enum)
        return [
            kind(int(value)).name.partition("_")[2].lower() for value in getattr(self.m, attribute)
        ]

    def is_disabled(self, *flags: str) -> bool:
        """Return whether one of the flags, whose names depend on MuJoCo's version, is set."""
        bits = (getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{flag}", 0) for flag in flags)
        return any(self.m.opt.disableflags & int(bit) for bit in bits)

    def name(self, kind: str, k: int) -> str:
        """Return the name of an object, made of its number if the file gives none."""
        return (
            self.mujoco.mj_id2name(self.m, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), k)
            or f"{kind}{k}"
        )

    def nonzero(self, objects: Iterable[int], *attributes: str) -> list[int]:
        """Return those of some objects that have one of these attributes other than zero."""
        values = {name: getattr(self.m, name) for name in attributes if hasattr(self.m, name)}
        # The degrees of freedom of a joint have the same numbers.
        by_object = [
            x[self.m.jnt_dofadr] if name.startswith("dof_") else x for name, x in values.items()
        ]
        return [k for k in objects if any(np.any(x[k]) for x in by_object)]

    def is_marker(self, b: int) -> bool:
        """Return whether a body is a mocap body, or on one, that carries no joint."""
        root = self.m.body_rootid[b]
        return self.m.body_mocapid[root] >= 0 and not np.any(
            self.m.body_dofnum[self.m.body_rootid == root]
        )

    def reference(self, j: int) -> float:
        """Return the position of a hinge or slide in the pose of the file [rad, m]."""
        return float(self.m.qpos0[self.m.jnt_qposadr[j]])

    def locked_joints(self) -> dict[str, float]:
        """Return positions, by name, of joints that equalities without joint2 lock."""
        return {
            self.name("joint", j): self.reference(j) + float(self.m.eq_data[e, 0])
            for j, e in self.coupled.items()
            if self.m.eq_obj2id[e] < 0
        }

    def rotation(self, quaternion: Array) -> Array:
        """Return the rotation matrix of a quaternion (w, x, y, z)."""
        matrix = np.zeros(9)
        self.mujoco.mju_quat2Mat(matrix, quaternion)
        return matrix.reshape(3, 3)

    def gear(self, a: int) -> float:
        row = self.m.actuator_outadr[a] if hasattr(self.m, "actuator_outadr") else a
        return float(self.m.actuator_gear[row, 0])

    def ends(self, e: int) -> list[tuple[int, Array, Array]]:
        """Return body, position and rotation in it of both frames of a connect or weld."""
        m = self.m
        of = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
        if m.eq_objtype[e] == int(self.mujoco.mjtObj.mjOBJ_SITE):
            return [
                (int(m.site_bodyid[s]), m.site_pos[s], self.rotation(m.site_quat[s])) for s in of
            ]
        first = m.eq_data[e, :3]
        second = m.eq_data[e, 3:6]
        turn = np.eye(3)
        if self.equality_kinds[e] == "weld":
            first, second, turn = second, first, self.rotation(m.eq_data[e, 6:10])
        return [(of[0], first, turn), (of[1], second, np.eye(3))]

    def _holds(self, e: int) -> bool:
        """Return whether an equality is active and one of its bodies can move."""
        m = self.m
        is_active = bool(m.eq_active0[e])
        if self.equality_kinds[e] in ("connect", "weld"):
            bodies = m.body_weldid[[b for b, _, _ in self.ends(e)]]
            return is_active and m.body_dofnum[bodies].any()
        return is_active


def _compile(source: object) -> tuple[Any, Any]:
    """Return the module mujoco, and its model of an MJCF given by path or text."""
    mujoco = require("mujoco", "an MJCF")
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"source is {source!r}; expected the path of an MJCF, or its text.")
    try:
        if isinstance(source, str) and source.lstrip().startswith("<"):
            return mujoco, mujoco.MjModel.from_xml_string(source)
        return mujoco, mujoco.MjModel.from_xml_path(os.path.expanduser(os.fspath(source)))
    except (ValueError, mujoco.FatalError) as error:
        raise UrdfError(f"MuJoCo rejects the MJCF: {' '.join(str(error).split())}") from error


def _reject_unsupported(c: _Compiled) -> None:
    """Reject what changes M, C, ν or K and cannot be modelled."""
    elsewhere = [a for a in c.actuators if a not in c.actuated]
    for kind, objects, reason in (
        ("joint", c.nonzero([*c.balls, *c.free], "dof_armature"), "is no hinge and has armature"),
        (
            "actuator",
            c.nonzero(elsewhere, "actuator_armature"),
            "has armature, but is not at a hinge or slide",
        ),
        ("tendon", c.nonzero(c.tendons, "tendon_armature"), "has armature"),
    ):
        if objects:
            raise UnsupportedError(
                f"{kind} '{c.name(kind, objects[0])}' {reason}, which is not supported. "
                "Set its armature to zero in the file."
            )
    for e in c.equalities:
        kind = c.equality_kinds[e]
        is_supported = e in c.coupled.values()
        if kind in ("connect", "weld"):
            is_supported = all(c.m.body_mocapid[c.m.body_rootid[b]] < 0 for b, _, _ in c.ends(e))
        if not is_supported:
            raise UnsupportedError(
                f"equality '{c.name('equality', e)}' ({kind}) is neither a connect or weld of "
                "bodies of the robot nor the one equality of a joint, and is not supported. A "
                'model without it (active="false") has more degrees of freedom.'
            )


def _omitted(c: _Compiled) -> Iterator[str]:
    """Yield the texts of `RobotModel.omitted`, one for each kind of object."""
    m = c.m
    spinning = [*c.free, *c.balls]
    elsewhere = [a for a in c.actuators if a not in c.actuated]
    rows: list[tuple[str, Sequence[int]]] = []  # each text ends with the kind of the objects
    if c.springs_act:
        rows = [("spring of joint", c.nonzero(c.joints, "jnt_stiffness", "jnt_stiffnesspoly"))]
    if c.dampers_act:
        rows += [
            ("damping of joint", c.nonzero(spinning, "dof_damping")),
            ("nonlinear damping of joint", c.nonzero(c.joints, "dof_dampingpoly")),
            ("damping of actuator", c.nonzero(elsewhere, "actuator_damping")),
            ("nonlinear damping of actuator", c.nonzero(c.actuators, "actuator_dampingpoly")),
        ]
    if c.friction.any():
        rows.append(("friction loss of joint", c.nonzero(spinning, "dof_frictionloss")))
    if c.springs_act or c.dampers_act:
        rows += [
            ("gravity compensation of body", c.nonzero(c.bodies, "body_gravcomp")),
            ("plugin of body", [b for b in c.bodies if m.body_plugin[b] >= 0]),
            ("flex", range(m.nflex)),
        ]
    rows += [
        ("limit of ball joint", [j for j in c.balls if c.limited[j]]),
        ("mocap body", [b for b in c.bodies if m.body_mocapid[b] >= 0]),
        ("tendon", c.tendons),
    ]
    for text, objects in rows:
        if objects:
            kind = text.split()[-1]
            yield f"{text} {', '.join(repr(c.name(kind, k)) for k in objects)}"
    if (m.opt.density or m.opt.viscosity) and (c.springs_act or c.dampers_act):
        yield f"fluid (density {m.opt.density:g}, viscosity {m.opt.viscosity:g})"


def _effort_limits(c: _Compiled) -> Array:
    """Return the effort limit of each joint [N m, N], infinite where there is none."""
    m = c.m
    sums = dict.fromkeys(c.actuated.values(), 0.0)
    for a, j in c.actuated.items():
        if gear := abs(c.gear(a)):
            sums[j] += gear * _largest_force(m, a)
    limits: Array = np.abs(m.jnt_actfrcrange).max(axis=1, initial=0.0)
    limits[m.jnt_actfrclimited == 0] = np.inf
    for j, effort in sums.items():
        limits[j] = min(limits[j], effort)
    return limits


def _largest_force(m: Any, a: int) -> float:
    """Return the largest force of an actuator, which only a motor has from its control range."""
    force = float(np.abs(m.actuator_forcerange[a]).max()) if m.actuator_forcelimited[a] else np.inf
    control = m.actuator_ctrladr[a] if hasattr(m, "actuator_ctrladr") else a
    # The first of each of MuJoCo's types is that of a motor.
    other_types = m.actuator_gaintype[a], m.actuator_biastype[a], m.actuator_dyntype[a]
    is_motor = not any(other_types) and m.actuator_plugin[a] < 0
    if is_motor and m.actuator_ctrllimited[control]:
        forces = m.actuator_gainprm[a, 0] * m.actuator_ctrlrange[control]
        force = min(force, float(np.abs(forces).max()))
    return force


class _Reader:
    """Links and joints of a compiled model; each body has a chain of joints, the last one fixed."""

    def __init__(self, c: _Compiled, floating: bool) -> None:
        self._c = c
        self._floating = floating
        self._effort = _effort_limits(c)
        self.links: dict[str, Link] = {}
        self.joints: dict[str, Joint] = {}
        self.curves: dict[str, Curve] = {}
        if not floating:
            self._add_link("world")
        for b in c.bodies:
            if not c.is_marker(b):
                self._add_body(b)

    def loop(self, e: int) -> Loop:
        """Return a connect or weld; its joints begin where the file has them."""
        c = self._c
        kind = {"connect": "point", "weld": "weld"}[c.equality_kinds[e]]
        first, second = (
            LoopEnd(c.name("body", b), tuple(place.tolist()), rotations.to_rpy(turn))
            for b, place, turn in c.ends(e)
        )
        start = {c.name("joint", j): c.reference(j) for j in c.single if c.reference(j)}
        return Loop(c.name("equality", e), first, second, kind, (1.0, 0.0, 0.0), (), start)

    def _add_link(self, name: str, inertial: Inertial | None = None) -> None:
        if name in self.links:
            raise UrdfError(f"Two bodies have the name '{name}'; expected one. Rename the other.")
        self.links[name] = Link(name, inertial)

    def _add_joint(
        self, name: str, kind: str, parent: str, child: str, origin: Array, **fields: Any
    ) -> None:
        if name in self.joints:
            raise UrdfError(f"Two joints have the name '{name}'; expected one. Rename the other.")
        fields = {"axis": np.array([1.0, 0.0, 0.0]), **fields}
        self.joints[name] = checked_joint(Joint(name, kind, parent, child, origin, **fields))

    def _add_body(self, b: int) -> None:
        c = self._c
        m = c.m
        name = c.name("body", b)
        parent = c.name("body", int(m.body_parentid[b]))
        inertial = None
        if m.body_mass[b] > 0.0:
            turn = c.rotation(m.body_iquat[b])
            inertia = turn @ np.diag(m.body_inertia[b]) @ turn.T
            inertial = Inertial(float(m.body_mass[b]), rotations.pose(m.body_ipos[b]), inertia)
        self._add_link(name, inertial)
        joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        if any(j in c.free for j in joints):
            if not self._floating:
                self._add_joint(c.name("joint", joints[0]), "floating", "world", name, np.eye(4))
            return
        # Each joint turns or shifts all that follows about its anchor; links between joints of one
        # body have no inertia.
        place = m.body_pos[b]
        turn = c.rotation(m.body_quat[b])
        anchor = np.zeros(3)
        for j in joints:
            place = place + turn @ (m.jnt_pos[j] - anchor)
            anchor = m.jnt_pos[j]
            if c.joint_kinds[j] == "slide":  # at the reference the body is where the file has it
                place = place - c.reference(j) * (turn @ m.jnt_axis[j])
            elif c.joint_kinds[j] == "hinge":
                turn = turn @ rotations.about_axis(m.jnt_axis[j], -c.reference(j))
            for joint, kind, fields in self._freedoms(j):
                child = f"{name}/{joint}"
                self._add_link(child)
                self._add_joint(joint, kind, parent, child, rotations.pose(place, turn), **fields)
                parent = child
                place = np.zeros(3)
                turn = np.eye(3)
        origin = rotations.pose(place - turn @ anchor, turn)
        self._add_joint(f"{name}/fixed", "fixed", parent, name, origin)

    def _freedoms(self, j: int) -> Iterator[tuple[str, str, dict[str, Any]]]:
        """Yield name, type and numbers of a hinge or slide, or of the three hinges of a ball."""
        c = self._c
        name = c.name("joint", j)
        if j in c.balls:
            for letter, axis in zip("xyz", np.eye(3), strict=True):
                yield f"{name}_{letter}", "continuous", {"axis": axis}
        elif c.joint_kinds[j] == "slide":
            yield name, "prismatic", self._fields(j)
        else:
            yield name, "revolute" if c.limited[j] else "continuous", self._fields(j)

    def _fields(self, j: int) -> dict[str, Any]:
        """Return axis, friction, limits and coupling of a hinge or slide."""
        c = self._c
        m = c.m
        dof = m.jnt_dofadr[j]
        fields: dict[str, Any] = {
            "axis": m.jnt_axis[j].copy(),
            "damping": float(c.damping[dof]),
            "friction": float(c.friction[dof]),
            "armature": float(c.armature[dof]),
            "effort": float(self._effort[j]),
        }
        if c.limited[j]:
            fields["lower"], fields["upper"] = map(float, m.jnt_range[j])
        e = c.coupled.get(j, -1)
        source = int(m.eq_obj2id[e]) if e >= 0 else -1
        if source >= 0:  # q_1 − ref_1 = offset + multiplier (q_2 − ref_2), or a polynomial
            multiplier = float(m.eq_data[e, 1])
            offset = float(m.eq_data[e, 0]) + c.reference(j) - multiplier * c.reference(source)
            leader = c.name("joint", source)
            fields["mimic"] = Mimic(leader, multiplier, offset)
            if np.any(m.eq_data[e, 2:5]):
                distance = np.polynomial.Polynomial([-c.reference(source), 1.0])
                curve = np.polynomial.Polynomial(m.eq_data[e, :5])(distance) + c.reference(j)
                self.curves[c.name("joint", j)] = Curve(leader, np.array([[0.0, *curve.coef]]))
        return fields
