# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a robot beside its URDF, mostly identified, in a file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.atomic_file import write_text
from diag_dynamics.checks import choice, mapping, not_negative, numbers, positive
from diag_dynamics.description.description import (
    LARGEST_INERTIA,
    Description,
    FlexibleJoint,
    Link,
    Payload,
)
from diag_dynamics.exceptions import InputError
from diag_dynamics.rigid_body import RigidBody, not_physical
from diag_dynamics.yaml_files import read_text, read_yaml, yaml_text

NEGLIGIBLE = 1e-9  # fraction of a mass that is rounding

_UNITS = {
    "damping": "[N m s/rad, N s/m]",
    "friction": "[N m, N]",
    "effort_offset": "[N m, N]",
    "armature": "[kg m², kg]",
    "load_friction": "[N m/N m, N/N]",
    "root_friction": "[N m √(s/rad), N √(s/m)]",
    "effort_scale": "[N m, N by reported unit]",
}
SIGNED = "effort_offset", "effort_scale"
_POSITIVE = {"stiffness": "[N m/rad, N/m]", "rotor_inertia": "[kg m²]", "gear": "[1, rad/m]"}
_CHOICES = {"position": ("motor", "link"), "effort": ("motor", "spring")}

_HEAD = """\
# Parameters of a robot beside its URDF: load_urdf(…, parameters=…), \
and parameters_file of every node of diag_dynamics.
# Of a joint: damping [N m s/rad], friction (Coulomb) [N m], effort_offset [N m], \
armature (reflected rotor) [kg m²],
# load_friction (Coulomb, by the torque of gravity) [1], \
root_friction (by the root of the rate) [N m √(s/rad)],
# effort_scale (effort by reported unit, .nan if unknown) [N m]; prismatic: N s/m, N, N, kg, 1, \
N √(s/m), N.
# Of flexible_joints: stiffness [N m/rad], rotor_inertia of the motor [kg m²], \
damping [N m s/rad], gear, and what joint
# states carry, position: motor or link, effort: motor or spring.
# Of links (in place of the URDF's) and payloads (beside it): mass [kg], \
com [m] in the axes of the link, inertia about com
# [kg m²].
"""

_END = "# End of file. Number of joints: {}\n"


class JointParameters(NamedTuple):
    """Numbers of a joint of one degree of freedom; None leaves what the model has.

    Viscous friction `damping` [N m s/rad, N s/m], Coulomb `friction` [N m, N], the effort that is
    measured where none acts, `effort_offset` [N m, N], the reflected rotor inertia `armature` [kg
    m², kg], Coulomb friction by the torque of gravity `load_friction` [1], friction by √|q̇|
    `root_friction` [N m √(s/rad), N √(s/m)], and the effort by reported unit `effort_scale` [N m,
    N], NaN if it is unknown. Only offset and scale may be negative.
    """

    damping: float | None = None
    friction: float | None = None
    effort_offset: float | None = None
    armature: float | None = None
    load_friction: float | None = None
    root_friction: float | None = None
    effort_scale: float | None = None

    @property
    def known(self) -> dict[str, Any]:
        """The numbers that are not None, by name."""
        return {name: float(value) for name, value in self._asdict().items() if value is not None}


@dataclass(frozen=True)
class Parameters:
    """Parameters of a robot beside its URDF, see :meth:`RobotModel.with_parameters`.

    Attributes
    ----------
    joints, links, payloads : mapping
        :class:`JointParameters` by joint; inertia of a link, as :class:`Payload`, in place of what
        the URDF says; and :class:`Payload` by link, added to its own inertia and not listed by
        `RobotModel.payloads`. The mass of a payload is negative if the robot lacks a part that the
        URDF has.
    friction_velocity : float or None
        v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s].
    origin : mapping
        Origin of the numbers, as plain values of YAML: recordings, date, method, quality, and the
        `locked_joints` with which they were identified.
    flexible_joints : mapping
        :class:`FlexibleJoint` by joint.
    """

    joints: Mapping[str, JointParameters] = field(default_factory=dict)
    links: Mapping[str, Payload] = field(default_factory=dict)
    payloads: Mapping[str, Payload] = field(default_factory=dict)
    friction_velocity: float | None = None
    origin: Mapping[str, Any] = field(default_factory=dict)
    flexible_joints: Mapping[str, FlexibleJoint] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("joints", "links", "payloads", "origin", "flexible_joints"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for name, entry in self.joints.items():
            _joint(entry, f"parameters: joint '{name}'", name)

    @property
    def lighter_links(self) -> list[str]:
        """Links with a payload of negative mass."""
        return [name for name, payload in self.payloads.items() if payload.mass < 0.0]

    @property
    def joint_count(self) -> int:
        """Number of joints with parameters."""
        return len({*self.joints, *self.flexible_joints})

    def with_effort_scale(self, scale: Mapping[str, float]) -> Parameters:
        """Return these parameters with another effort by reported unit, by joint.

        NaN is an unknown one.
        """
        joints = dict(self.joints)
        for name, value in scale.items():
            joints[name] = joints.get(name, JointParameters())._replace(effort_scale=value)
        return replace(self, joints=joints)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Parameters:
        """Read them from a YAML file, as :meth:`save` writes it or without its first line."""
        source = f"file of parameters '{os.fspath(path)}'"
        parameters = cls.from_dict(read_yaml(path, source), source)
        text = read_text(path, source)
        end = _END.format(parameters.joint_count)
        if text.startswith(_HEAD[: _HEAD.index("\n")]) and not text.endswith(end):
            raise InputError(
                f"{source} ends with {text[-40:]!r}; expected {end!r} because it begins as a whole "
                "file of this package. Write it again, or remove its first line."
            )
        return parameters

    @classmethod
    def from_dict(cls, content: object, source: str = "parameters") -> Parameters:
        """Return the parameters of a dict that has attributes of this class as keys.

        All keys are optional, as in a file.
        """
        if isinstance(content, Parameters):
            return content
        content = mapping(source, content, tuple(cls.__dataclass_fields__))
        velocity = content.get("friction_velocity")
        if velocity is not None:
            velocity = not_negative("friction_velocity", velocity, "[rad/s, m/s]")
        fields: dict[str, Any] = {"friction_velocity": velocity}
        for key, (kind, read) in READERS.items():
            fields[key] = {}
            for name, entry in mapping(f"{source}: {key}", content.get(key) or {}).items():
                fields[key][str(name)] = read(entry, f"{source}: {kind} '{name}'", str(name))
        return cls(**fields, origin=mapping(f"{source}: origin", content.get("origin") or {}))

    def to_dict(self) -> dict[str, Any]:
        """Return plain dicts, lists and numbers, as the file has them, without empty entries."""
        content: dict[str, Any] = {key: _plain(getattr(self, key)) for key in READERS}
        content["friction_velocity"] = self.friction_velocity
        content["origin"] = dict(self.origin)
        return {key: value for key, value in content.items() if value not in (None, {})}

    def merged_with(self, later: Parameters) -> Parameters:
        """Return these parameters merged with later ones, identified with a model that had these.

        Later numbers replace earlier ones; the later inertia of a link also its payload, which was
        fitted with it. Later payloads are added.
        """
        joints = dict(self.joints)
        for name, entry in later.joints.items():
            joints[name] = joints.get(name, JointParameters())._replace(**entry.known)
        payloads = {name: x for name, x in self.payloads.items() if name not in later.links}
        for name, load in later.payloads.items():
            has_load = name in payloads
            payloads[name] = _union(payloads[name].body, load, name) if has_load else load
        velocity = later.friction_velocity
        return Parameters(
            joints,
            {**self.links, **later.links},
            payloads,
            self.friction_velocity if velocity is None else velocity,
            later.origin,
            {**self.flexible_joints, **later.flexible_joints},
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write them into a YAML file; numbers come back with the same bits."""
        end = _END.format(self.joint_count)
        write_text(path, _HEAD + yaml_text(self.to_dict()) + end)


def read_parameters(source: str | os.PathLike[str] | Parameters | Mapping[str, Any]) -> Parameters:
    """Return parameters given as the path of a file, as themselves or as a dict."""
    if isinstance(source, (str, os.PathLike)):
        return Parameters.load(source)
    return Parameters.from_dict(source)


def _joint(entry: object, source: str, _: str) -> JointParameters:
    checked = {}
    for key, value in mapping(source, entry, JointParameters._fields).items():
        if value is None:
            continue
        is_scale = key == "effort_scale"
        is_signed = key in SIGNED
        expected = f"a finite number{'' if is_signed else ' >= 0'} {_UNITS[key]}"
        if is_scale:
            expected = f"a number other than 0 {_UNITS[key]}, .nan if it is unknown"
        x = np.nan
        if not (is_scale and isinstance(value, float) and np.isnan(value)):
            x = float(numbers(f"{source}: {key}", value, (), expected, LARGEST_INERTIA))
        if (x < 0.0 and not is_signed) or (x == 0.0 and is_scale):
            raise InputError(f"{source}: {key} is {value!r}; expected {expected}.")
        checked[key] = x
    return JointParameters(**checked)


def _flexible(entry: object, source: str, _: str) -> FlexibleJoint:
    fields = FlexibleJoint._fields
    values = {"gear": 1.0, "damping": 0.0, **mapping(source, entry, fields, fields[:2])}
    for name, unit in _POSITIVE.items():
        values[name] = positive(f"{source}: {name}", values[name], unit)
    values["damping"] = not_negative(f"{source}: damping", values["damping"], _UNITS["damping"])
    for name, choices in _CHOICES.items():
        choice(f"{source}: {name}", values.get(name, choices[0]), choices)
    return FlexibleJoint(**values)


def checked_body(
    body: Payload, before: str, after: str = "", may_be_negative: bool = False
) -> Payload:
    """Return a body, whose mass may be negative if it is taken off.

    Errors name a part between two texts.
    """
    mass_name, com_name, inertia_name = (f"{before}{part}{after}" for part in Payload._fields)
    expected = "a finite number [kg]" if may_be_negative else "a finite number >= 0 [kg]"
    mass = float(numbers(mass_name, body.mass, (), expected, LARGEST_INERTIA))
    if mass < 0.0 and not may_be_negative:
        raise InputError(f"{mass_name} is {mass}; expected {expected}.")
    com = numbers(com_name, body.com, (3,), "three finite numbers [m]", LARGEST_INERTIA)
    inertia = numbers(
        inertia_name, body.inertia, (3, 3), "3 x 3 finite numbers [kg m²]", LARGEST_INERTIA
    )
    reason = None if mass < 0.0 else not_physical(inertia, mass)
    if reason or np.abs(inertia - inertia.T).max() > 1e-9 * np.abs(inertia).max():
        raise InputError(f"{inertia_name} is {inertia.tolist()}, {reason or 'not symmetric'}.")
    inertia = 0.5 * (inertia + inertia.T)
    com.flags.writeable = inertia.flags.writeable = False
    return Payload(mass, com, inertia)


def _body(entry: object, source: str, _: str, may_be_negative: bool = False) -> Payload:
    entries = mapping(source, entry, Payload._fields).items()
    fields = mapping(source, {key: x for key, x in entries if x is not None}, required=["mass"])
    return checked_body(Payload(**fields), f"{source}: ", may_be_negative=may_be_negative)


READERS: dict[str, tuple[str, Callable[[object, str, str], object]]] = {
    "joints": ("joint", _joint),
    "links": ("link", _body),
    "payloads": ("payload", partial(_body, may_be_negative=True)),
    "flexible_joints": ("flexible joint", _flexible),
}
"""Kind of the entries of each key of a file, and how one is read: content, text for errors,
name."""


def with_parameters(description: Description, parameters: Parameters) -> Description:
    """Return a description with parameters; a spring takes the place of the joint's armature."""
    joints = dict(description.joints)
    links = dict(description.links)
    for name in (*parameters.flexible_joints, *parameters.joints):
        description.single_joint("parameters", name)
    for name in (*parameters.links, *parameters.payloads):
        description.link("parameters", name)
    for name, spring in parameters.flexible_joints.items():
        joints[name] = joints[name]._replace(spring=spring, armature=0.0)
    for name, entry in parameters.joints.items():
        joints[name] = joints[name]._replace(**entry.known)
    for name, body in parameters.links.items():
        links[name] = Link(name, body.inertial)
    for name, payload in parameters.payloads.items():
        inertial = links[name].inertial
        if payload.mass != 0.0:
            body = payload if inertial is None else _union(inertial.body, payload, name)
            links[name] = Link(name, body.inertial)
    velocity = parameters.friction_velocity
    return description._replace(
        joints=joints,
        links=links,
        friction_velocity=description.friction_velocity if velocity is None else velocity,
    )


def _plain(value: Any) -> Any:
    """Return records, mappings and arrays as dicts, lists and numbers of YAML, without None."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {name: _plain(x) for name, x in value.items() if x is not None}
    return value if isinstance(value, str) else np.asarray(value, float).tolist()


def _union(body: RigidBody, payload: Payload, link: str) -> Payload:
    """Return a body and a payload of a link as one."""
    if abs(body.mass + payload.mass) <= NEGLIGIBLE * abs(payload.mass):
        raise InputError(
            f"parameters: the payload of {payload.mass:g} kg leaves link '{link}' without mass, "
            f"and so without a centre. To remove it, give links: {link}: {{mass: 0}}."
        )
    whole = RigidBody.union(body, payload.body)
    return Payload(whole.mass, whole.centre, whole.inertia)
