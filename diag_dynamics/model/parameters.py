# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a robot beside its URDF, mostly identified from recordings, in a file."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.checks import numbers
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.joint_types import SINGLE
from diag_dynamics.model.options import LARGEST, Payload, checked_inertia, friction_velocity_of, not_physical
from diag_dynamics.model.tree import Tree
from diag_dynamics.rigid_body import RigidBody, symmetric
from diag_dynamics.yaml_files import read_yaml, yaml_text


class JointParameters(NamedTuple):
    """Numbers of a joint of one degree of freedom; None leaves what the model has.

    Attributes
    ----------
    damping : float or None
        Viscous friction d, not negative [N m s/rad, N s/m].
    friction : float or None
        Coulomb friction f, not negative [N m, N].
    effort_offset : float or None
        Effort that is measured, or commanded, where none acts: a part of friction that does not turn round [N m, N].
    armature : float or None
        Reflected rotor inertia, not negative [kg m², kg].
    """

    damping: float | None = None
    friction: float | None = None
    effort_offset: float | None = None
    armature: float | None = None


def _nothing() -> Mapping[str, Any]:
    return MappingProxyType({})


@dataclass(frozen=True)
class Parameters:
    """Parameters of a robot beside its URDF.

    For :meth:`RobotModel.with_parameters`, ``load_urdf(…, parameters=…)``, and the parameter `parameters_file` of the nodes.

    Attributes
    ----------
    joints : mapping
        :class:`JointParameters` by name of the joint.
    links : mapping
        Inertia of a link, as :class:`Payload`, in place of what the URDF says, by name of the link.
    payloads : mapping
        :class:`Payload` by name of the link, added to its own inertia and not listed by `RobotModel.payloads`. Its mass is
        negative if the robot lacks a part that the URDF has.
    friction_velocity : float or None
        v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s].
    origin : mapping
        Origin of the numbers, as plain values of YAML: recordings, date, method, quality, and the `locked_joints` with which
        they were identified.
    """

    joints: Mapping[str, JointParameters] = field(default_factory=_nothing)
    links: Mapping[str, Payload] = field(default_factory=_nothing)
    payloads: Mapping[str, Payload] = field(default_factory=_nothing)
    friction_velocity: float | None = None
    origin: Mapping[str, Any] = field(default_factory=_nothing)

    @property
    def lighter_links(self) -> list[str]:
        """Links that a payload of negative mass makes lighter."""
        return [name for name, payload in self.payloads.items() if payload.mass < 0.0]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Parameters:
        """Read them from a YAML file, as :meth:`save` writes it."""
        source = f"file of parameters '{os.fspath(path)}'"
        return cls.of(read_yaml(path, source), source)

    @classmethod
    def of(cls, content: object, source: str = "parameters") -> Parameters:
        """Return the parameters of a dict that has attributes of this class as keys, all optional, as the file has them."""
        if isinstance(content, Parameters):
            return content
        given = _mapping(content, source, _FIELDS)
        joints = {
            str(name): _joint(entry, f"{source}: joint '{name}'")
            for name, entry in _mapping(given.get("joints") or {}, f"{source}: joints").items()
        }
        links, payloads = (
            {
                str(name): _body(entry, f"{source}: {what} '{name}'", what == "payload")
                for name, entry in _mapping(given.get(f"{what}s") or {}, f"{source}: {what}s").items()
            }
            for what in ("link", "payload")
        )
        velocity = given.get("friction_velocity")
        return cls(
            MappingProxyType(joints),
            MappingProxyType(links),
            MappingProxyType(payloads),
            friction_velocity=None if velocity is None else friction_velocity_of(_number(velocity)),
            origin=MappingProxyType(dict(_mapping(given.get("origin") or {}, f"{source}: origin"))),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain dicts, lists and numbers, as the file has them, without empty entries."""
        content: dict[str, Any] = {
            "joints": {
                name: {key: float(value) for key, value in entry._asdict().items() if value is not None}
                for name, entry in self.joints.items()
            }
        }
        for what, bodies in (("links", self.links), ("payloads", self.payloads)):
            content[what] = {
                name: {
                    "mass": float(body.mass),
                    "com": np.asarray(body.com, float).tolist(),
                    "inertia": np.asarray(body.inertia, float).tolist(),
                }
                for name, body in bodies.items()
            }
        content["friction_velocity"] = None if self.friction_velocity is None else float(self.friction_velocity)
        content["origin"] = dict(self.origin)
        return {key: value for key, value in content.items() if value not in (None, {})}

    def followed_by(self, later: Parameters) -> Parameters:
        """Return these parameters merged with later ones, identified with a model that had these.

        Later numbers of a joint replace earlier ones, entry by entry. The later inertia of a link replaces the earlier one
        and the payload of the link, which was fitted with it. Later payloads are added. `origin` is the later one.
        """
        joints = dict(self.joints)
        for name, entry in later.joints.items():
            known = {key: value for key, value in entry._asdict().items() if value is not None}
            joints[name] = joints.get(name, JointParameters())._replace(**known)
        payloads = {link: payload for link, payload in self.payloads.items() if link not in later.links}
        for link, payload in later.payloads.items():
            both = _together(_rigid(payloads[link]), _rigid(payload)) if link in payloads else _rigid(payload)
            if both is None:
                raise InputError(f"parameters: two payloads of link '{link}' have no mass together, and so no centre.")
            payloads[link] = Payload(both.mass, both.centre, both.inertia)
        return Parameters(
            MappingProxyType(joints),
            MappingProxyType({**self.links, **later.links}),
            MappingProxyType(payloads),
            friction_velocity=self.friction_velocity if later.friction_velocity is None else later.friction_velocity,
            origin=later.origin,
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write them into a YAML file; numbers come back with the same bits."""
        try:
            Path(path).write_text(_HEAD + yaml_text(self.to_dict()), encoding="utf-8")
        except OSError as error:
            raise InputError(f"Cannot write the file of parameters '{path}': {error.strerror or error}.") from error


_FIELDS = ("joints", "links", "payloads", "friction_velocity", "origin")

_HEAD = """\
# Parameters of a robot beside its URDF: load_urdf(…, parameters=…), and parameters_file of every node of diag_dynamics.
# Of a joint: damping [N m s/rad], friction (Coulomb) [N m], effort_offset [N m], armature (reflected rotor) [kg m²];
# prismatic: N s/m, N, N, kg. Of links (in place of the URDF's) and payloads (beside it): mass [kg], com [m] in the axes of
# the link, inertia about com [kg m²].
"""


def _mapping(value: object, source: str, known: Iterable[str] = ()) -> Mapping[Any, Any]:
    """Return the value if it is a dict that has only known keys."""
    known = tuple(known)
    if not isinstance(value, Mapping):
        expected = f"{', '.join(known)}" if known else "entries by name"
        raise InputError(f"{source}: {value!r} stands there, expected {expected}.")
    for key in value:
        if known and key not in known:
            near = get_close_matches(str(key), known, n=1)
            raise InputError(f"{source} has '{key}', expected {near[0]!r}." if near else _none_of(source, key, known))
    return value


def _none_of(source: str, key: object, known: Iterable[str]) -> str:
    return f"{source} has '{key}', expected one of {', '.join(known)}."


def _number(value: object) -> object:
    """Return a number, also one that YAML reads as text: 1e-3 without a dot."""
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _joint(entry: object, source: str) -> JointParameters:
    if isinstance(entry, JointParameters):
        entry = entry._asdict()
    checked = {}
    for key, value in _mapping(entry, source, JointParameters._fields).items():
        if value is None:
            continue
        unit, signed = _UNITS[key], key == "effort_offset"
        expected = f"a finite number{'' if signed else ' >= 0'} {unit}"
        checked[key] = float(numbers(f"{source}: {key}", _number(value), (), expected, LARGEST))
        if checked[key] < 0.0 and not signed:
            raise InputError(f"{source}: {key} is {value!r}, expected {expected}.")
    return JointParameters(**checked)


_UNITS = {
    "damping": "[N m s/rad, N s/m]",
    "friction": "[N m, N]",
    "effort_offset": "[N m, N]",
    "armature": "[kg m², kg]",
}


def _body(entry: object, source: str, signed: bool) -> Payload:
    if isinstance(entry, Payload):
        entry = entry._asdict()
    given = _mapping(entry, source, Payload._fields)
    if "mass" not in given:
        raise InputError(f"{source} has no mass.")
    named = {key: _numbers(value) for key, value in given.items() if value is not None}
    return checked_inertia(lambda part: f"{source}: {part}", Payload(**named), signed)


def _numbers(value: object) -> Any:
    return [_numbers(part) for part in value] if isinstance(value, (list, tuple)) else _number(value)


def robot_with(robot: Any, parameters: Parameters) -> Any:
    """Return the robot of a URDF with these damping and friction of joints, and inertias and payloads of links."""
    links = [link.name for link in robot.links]
    _refuse_unknown("joint", parameters.joints, (joint.name for joint in robot.joints), robot)
    _refuse_unknown("link", (*parameters.links, *parameters.payloads), links, robot)
    robot = copy.copy(robot)
    robot.joints = [_resisting(joint, parameters.joints.get(joint.name)) for joint in robot.joints]
    robot.links = [
        _carrying(_of_inertia(link, parameters.links.get(link.name)), parameters.payloads.get(link.name))
        for link in robot.links
    ]
    return robot


def _refuse_unknown(what: str, given: Iterable[str], known: Iterable[str], robot: Any) -> None:
    known = list(known)
    for name in given:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            raise InputError(
                f"parameters: '{name}' is not a {what} of robot '{robot.name}'."
                + (f" Is '{near[0]}' meant?" if near else f" Its {what}s are {', '.join(known[:12])}.")
            )


def _resisting(joint: Any, given: JointParameters | None) -> Any:
    if given is None:
        return joint
    if joint.type not in SINGLE:
        raise InputError(f"parameters: joint '{joint.name}' is {joint.type}, expected one degree of freedom.")
    joint, own = copy.copy(joint), joint.dynamics
    joint.dynamics = SimpleNamespace(
        **{
            name: getattr(own, name, None) if getattr(given, name) is None else getattr(given, name)
            for name in ("damping", "friction")
        }
    )
    return joint


def _of_inertia(link: Any, given: Payload | None) -> Any:
    if given is None:
        return link
    link, place = copy.copy(link), np.eye(4)
    place[:3, 3] = np.asarray(given.com, float)
    link.inertial = SimpleNamespace(mass=given.mass, inertia=np.array(given.inertia, float), origin=place)
    return link


def _carrying(link: Any, payload: Payload | None) -> Any:
    """Return the link with a payload as part of its own inertia."""
    if payload is None or payload.mass == 0.0:
        return link
    own = link.inertial
    if own is None or own.mass is None or own.inertia is None:
        return _of_inertia(link, payload)
    place = np.eye(4) if own.origin is None else own.origin
    both = _together(RigidBody(own.mass, place[:3, 3], place[:3, :3] @ own.inertia @ place[:3, :3].T), _rigid(payload))
    if both is None:
        raise InputError(
            f"parameters: the payload of {payload.mass:g} kg leaves link '{link.name}' without mass. Give it as links: "
            f"{link.name}: {{mass: 0}}."
        )
    return _of_inertia(link, Payload(both.mass, both.centre, both.inertia))


def _together(first: RigidBody, second: RigidBody) -> RigidBody | None:
    """Return two bodies as one; None if that has no mass, and so no centre."""
    return None if abs(first.mass + second.mass) <= NOTHING * abs(second.mass) else RigidBody.union(first, second)


def _rigid(payload: Payload) -> RigidBody:
    return RigidBody(payload.mass, np.asarray(payload.com, float), np.asarray(payload.inertia, float))


NOTHING = 1e-9
"""Part of a mass that is nothing but rounding."""


def refuse_too_light(tree: Tree, names: Iterable[str], origin: Mapping[str, Any]) -> None:
    """Reject links from which more mass is taken off than moves with them."""
    bodies, _ = tree.records({}, {})
    of_link = {link.name: body for link, body, _ in tree.links}
    for name in names:
        body = bodies[of_link[name]]
        mass = float(body["mass"])
        reason = f"which leaves {mass:.3g} kg"
        if mass > 0.0:
            whole = RigidBody.about_origin(mass, body["first_moment"], symmetric(body["inertia"]))
            unphysical = not_physical(whole.inertia, mass)
            reason = f"which leaves {mass:.3g} kg {unphysical}" if unphysical else ""
        if reason:
            raise InputError(
                f"parameters: a payload of negative mass is on link '{name}', {reason}: more is taken off than moves with "
                f"that link.{_locked_then(origin)}"
            )


def _locked_then(origin: Mapping[str, Any]) -> str:
    """Return a text on the joints that were locked when parameters were identified: links behind them moved with theirs."""
    locked = origin.get("locked_joints")
    if not isinstance(locked, Mapping) or not locked:
        return ""
    return f" It was identified with locked_joints {', '.join(f'{name}={value}' for name, value in locked.items())}."


def perturbed_links(robot: Any, part: float, rng: np.random.Generator) -> dict[str, Payload]:
    """Return inertias of links with random errors, see :meth:`RobotModel.perturbed`."""
    links = {}
    for link in robot.links:
        own = link.inertial
        if own is None or not own.mass or own.inertia is None:
            continue
        place = np.eye(4) if own.origin is None else own.origin
        turned = place[:3, :3] @ own.inertia @ place[:3, :3].T
        moments = 0.5 * np.trace(turned) * np.eye(3) - turned  # second moments, of which inertia is trace less matrix
        heavier = 1.0 + part * rng.uniform(-1.0, 1.0)
        radius = np.sqrt(max(np.trace(moments), 0.0) / own.mass)
        centre = place[:3, 3] + part * radius * rng.uniform(-1.0, 1.0, 3) / np.sqrt(3.0)
        stretch = np.eye(3) + 0.25 * part * (lambda one: one + one.T)(rng.uniform(-1.0, 1.0, (3, 3)))
        moments = heavier * stretch @ moments @ stretch
        links[link.name] = Payload(heavier * own.mass, centre, np.trace(moments) * np.eye(3) - moments)
    return links


def parameters_of(given: str | os.PathLike[str] | Parameters | Mapping[str, Any]) -> Parameters:
    """Return parameters given as the path of a file, as themselves or as a dict."""
    return Parameters.load(given) if isinstance(given, (str, os.PathLike)) else Parameters.of(given)


def of_joints(parameters: Parameters, name: str) -> dict[str, float]:
    """One number by joint, of those that have it."""
    found = {joint: getattr(entry, name) for joint, entry in parameters.joints.items()}
    return {joint: value for joint, value in found.items() if value is not None}
