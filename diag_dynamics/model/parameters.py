# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a robot beside its URDF, mostly identified from recordings, in a file, or written into a URDF."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from lxml import etree

from diag_dynamics.arrays import Array
from diag_dynamics.atomic_file import write_text
from diag_dynamics.checks import choice, listed, mapping, not_negative, number, numbers, positive
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.inertias import LARGEST, Payload, checked_body, not_physical
from diag_dynamics.model.joint_types import SINGLE
from diag_dynamics.model.tree import Tree
from diag_dynamics.model.urdf import parse_urdf, read_urdf
from diag_dynamics.rigid_body import RigidBody, symmetric
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
# Parameters of a robot beside its URDF: load_urdf(…, parameters=…), and parameters_file of every node of diag_dynamics.
# Of a joint: damping [N m s/rad], friction (Coulomb) [N m], effort_offset [N m], armature (reflected rotor) [kg m²],
# load_friction (Coulomb, by the torque of gravity) [1], root_friction (by the root of the rate) [N m √(s/rad)],
# effort_scale (effort by reported unit, .nan if unknown) [N m]; prismatic: N s/m, N, N, kg, 1, N √(s/m), N.
# Of flexible_joints: stiffness [N m/rad], rotor_inertia of the motor [kg m²], damping [N m s/rad], gear, and what joint
# states carry, position: motor or link, effort: motor or spring.
# Of links (in place of the URDF's) and payloads (beside it): mass [kg], com [m] in the axes of the link, inertia about com
# [kg m²].
"""

_END = "# End of file. Number of joints: {}\n"


class FlexibleJoint(NamedTuple):
    """Spring and rotor of a joint in the reduced model, in which a rotor has the energy of its own spin alone.

    With the motor's position θ = θ_motor/N and the link's q the spring torque is τ_J = k(θ − q) + d(θ̇ − q̇), and
    B = N²J_rotor. Joint states carry the position of the "motor" (θ) or the "link" (q), and the effort of the "motor"
    (N τ_motor) or of the "spring" (τ_J).
    """

    stiffness: float  # k [N m/rad, N/m]
    rotor_inertia: float  # J_rotor, at the motor [kg m²]
    damping: float = 0.0  # d [N m s/rad, N s/m]
    gear: float = 1.0  # N [1, prismatic: rad/m]
    position: str = "motor"
    effort: str = "motor"

    @property
    def reflected_inertia(self) -> float:
        """B [kg m², kg]."""
        return self.gear**2 * self.rotor_inertia


class JointParameters(NamedTuple):
    """Numbers of a joint of one degree of freedom; None leaves what the model has.

    Viscous friction `damping` [N m s/rad, N s/m], Coulomb `friction` [N m, N], the effort that is measured where none acts,
    `effort_offset` [N m, N], the reflected rotor inertia `armature` [kg m², kg], Coulomb friction by the torque of gravity
    `load_friction` [1], friction by √|q̇| `root_friction` [N m √(s/rad), N √(s/m)], and the effort by reported unit
    `effort_scale` [N m, N], NaN if it is unknown. Only offset and scale may be negative.
    """

    damping: float | None = None
    friction: float | None = None
    effort_offset: float | None = None
    armature: float | None = None
    load_friction: float | None = None
    root_friction: float | None = None
    effort_scale: float | None = None

    @property
    def known(self) -> dict[str, float]:
        """The numbers that are not None, by name."""
        return {name: float(value) for name, value in self._asdict().items() if value is not None}


class Coupling(NamedTuple):
    """Motor that turns several joints: its rate by that of each joint, its damping and its Coulomb friction at that rate.

    `joints` maps names to ratios, 1 for the joint that the coupling is named after. Friction [N m s/rad, N m] acts on each of
    the joints times its ratio, beside friction of the joints themselves.
    """

    joints: Mapping[str, float]
    damping: float = 0.0
    friction: float = 0.0


@dataclass(frozen=True)
class Parameters:
    """Parameters of a robot beside its URDF, see :meth:`RobotModel.with_parameters`.

    Attributes
    ----------
    joints, links, payloads : mapping
        :class:`JointParameters` by joint; inertia of a link, as :class:`Payload`, in place of what the URDF says; and
        :class:`Payload` by link, added to its own inertia and not listed by `RobotModel.payloads`. The mass of a payload
        is negative if the robot lacks a part that the URDF has.
    couplings : mapping
        :class:`Coupling` by the joint whose motor also turns others, as in wrists of six-axis arms.
    motor_efforts : bool
        Whether reported efforts are of these motors, at the side of the joints: τ = Tᵀu with motor rates T q̇.
    friction_velocity : float or None
        v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s].
    origin : mapping
        Origin of the numbers, as plain values of YAML: recordings, date, method, quality, and the `locked_joints` with which
        they were identified.
    flexible_joints : mapping
        :class:`FlexibleJoint` by joint.
    """

    joints: Mapping[str, JointParameters] = field(default_factory=dict)
    links: Mapping[str, Payload] = field(default_factory=dict)
    payloads: Mapping[str, Payload] = field(default_factory=dict)
    couplings: Mapping[str, Coupling] = field(default_factory=dict)
    motor_efforts: bool = False
    friction_velocity: float | None = None
    origin: Mapping[str, Any] = field(default_factory=dict)
    flexible_joints: Mapping[str, FlexibleJoint] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("joints", "links", "payloads", "couplings", "origin", "flexible_joints"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for name, entry in self.joints.items():
            _joint(entry, f"parameters: joint '{name}'")

    @property
    def lighter_links(self) -> list[str]:
        """Links with a payload of negative mass."""
        return [name for name, payload in self.payloads.items() if payload.mass < 0.0]

    @property
    def joint_count(self) -> int:
        """Number of joints with parameters."""
        return len({*self.joints, *self.couplings, *self.flexible_joints})

    def by_joint(self, name: str) -> dict[str, float]:
        """Return one number of :class:`JointParameters` by joint, of those that have it."""
        return {
            joint: entry.known[name] for joint, entry in self.joints.items() if name in entry.known
        }

    def with_effort_scale(self, scale: Mapping[str, float]) -> Parameters:
        """Return these parameters with another effort by reported unit, by joint; NaN if it is unknown."""
        joints = dict(self.joints)
        for name, value in scale.items():
            joints[name] = joints.get(name, JointParameters())._replace(effort_scale=value)
        return replace(self, joints=joints)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Parameters:
        """Read them from a YAML file, as :meth:`save` writes it or without its first line."""
        source = f"file of parameters '{os.fspath(path)}'"
        parameters = cls.from_dict(read_yaml(path, source), source)
        text, end = read_text(path, source), _END.format(parameters.joint_count)
        if text.startswith(_HEAD[: _HEAD.index("\n")]) and not text.endswith(end):
            raise InputError(
                f"{source} ends with {text[-40:]!r}; expected {end!r} because it begins as a whole "
                "file of this package. Write it again, or remove its first line."
            )
        return parameters

    @classmethod
    def from_dict(cls, content: object, source: str = "parameters") -> Parameters:
        """Return the parameters of a dict that has attributes of this class as keys, all optional, as the file has them."""
        if isinstance(content, Parameters):
            return content
        given = mapping(source, content, tuple(cls.__dataclass_fields__))
        joints, links, payloads, couplings, origin, flexible = (
            mapping(f"{source}: {key}", given.get(key) or {})
            for key in ("joints", "links", "payloads", "couplings", "origin", "flexible_joints")
        )
        of_motors = given.get("motor_efforts", False)
        if not isinstance(of_motors, bool):
            raise InputError(f"{source}: motor_efforts is {of_motors!r}, expected true or false.")
        velocity = given.get("friction_velocity")
        if velocity is not None:
            velocity = not_negative("friction_velocity", velocity, "[rad/s, m/s]")
        return cls(
            {
                str(name): _joint(entry, f"{source}: joint '{name}'")
                for name, entry in joints.items()
            },
            {
                str(name): _body(entry, f"{source}: link '{name}'", False)
                for name, entry in links.items()
            },
            {
                str(name): _body(entry, f"{source}: payload '{name}'", True)
                for name, entry in payloads.items()
            },
            {str(name): _coupling(entry, str(name), source) for name, entry in couplings.items()},
            of_motors,
            velocity,
            origin,
            {
                str(name): _flexible(entry, f"{source}: flexible joint '{name}'")
                for name, entry in flexible.items()
            },
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain dicts, lists and numbers, as the file has them, without empty entries."""
        velocity = self.friction_velocity
        content = {
            "joints": {name: entry.known for name, entry in self.joints.items()},
            "links": {name: _plain(body) for name, body in self.links.items()},
            "payloads": {name: _plain(body) for name, body in self.payloads.items()},
            "couplings": {
                name: one._asdict() | {"joints": dict(one.joints)}
                for name, one in self.couplings.items()
            },
            "motor_efforts": self.motor_efforts or None,
            "friction_velocity": None if velocity is None else float(velocity),
            "flexible_joints": {name: one._asdict() for name, one in self.flexible_joints.items()},
            "origin": dict(self.origin),
        }
        return {key: value for key, value in content.items() if value not in (None, {})}

    def merged_with(self, later: Parameters) -> Parameters:
        """Return these parameters merged with later ones, identified with a model that had these.

        Later numbers replace earlier ones; the later inertia of a link also its payload, which was fitted with it. Later
        payloads are added.
        """
        joints = dict(self.joints)
        for name, entry in later.joints.items():
            joints[name] = joints.get(name, JointParameters())._replace(**entry.known)
        payloads = {
            link: payload for link, payload in self.payloads.items() if link not in later.links
        }
        for link, payload in later.payloads.items():
            payloads[link] = (
                _union(_rigid(payloads[link]), payload, link) if link in payloads else payload
            )
        velocity = (
            self.friction_velocity if later.friction_velocity is None else later.friction_velocity
        )
        couplings, of_motors = (
            {**self.couplings, **later.couplings},
            self.motor_efforts or later.motor_efforts,
        )
        links, flexible = (
            {**self.links, **later.links},
            {**self.flexible_joints, **later.flexible_joints},
        )
        return Parameters(
            joints, links, payloads, couplings, of_motors, velocity, later.origin, flexible
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write them into a YAML file; numbers come back with the same bits."""
        end = _END.format(self.joint_count)
        write_text(path, _HEAD + yaml_text(self.to_dict()) + end)


def read_parameters(given: str | os.PathLike[str] | Parameters | Mapping[str, Any]) -> Parameters:
    """Return parameters given as the path of a file, as themselves or as a dict."""
    return (
        Parameters.load(given)
        if isinstance(given, (str, os.PathLike))
        else Parameters.from_dict(given)
    )


def _joint(entry: object, source: str) -> JointParameters:
    checked = {}
    for key, value in mapping(source, entry, JointParameters._fields).items():
        if value is None:
            continue
        expected = f"a finite number{'' if key in SIGNED else ' >= 0'} {_UNITS[key]}"
        if key == "effort_scale":
            expected = f"a number other than 0 {_UNITS[key]}, .nan if it is unknown"
        is_unknown = key == "effort_scale" and isinstance(value, float) and np.isnan(value)
        x = (
            np.nan
            if is_unknown
            else float(numbers(f"{source}: {key}", value, (), expected, LARGEST))
        )
        if (x < 0.0 and key not in SIGNED) or (x == 0.0 and key == "effort_scale"):
            raise InputError(f"{source}: {key} is {value!r}, expected {expected}.")
        checked[key] = x
    return JointParameters(**checked)


def _flexible(entry: object, source: str) -> FlexibleJoint:
    fields = FlexibleJoint._fields
    values = {"gear": 1.0, "damping": 0.0, **mapping(source, entry, fields, fields[:2])}
    for name, unit in _POSITIVE.items():
        values[name] = positive(f"{source}: {name}", values[name], unit)
    values["damping"] = not_negative(f"{source}: damping", values["damping"], "[N m s/rad, N s/m]")
    for name, known in _CHOICES.items():
        choice(f"{source}: {name}", values.get(name, known[0]), known)
    return FlexibleJoint(**values)


def _coupling(entry: object, name: str, source: str) -> Coupling:
    source = f"{source}: coupling '{name}'"
    entry = mapping(source, entry, Coupling._fields)
    joints = {name: 1.0} | {
        str(one): number(f"{source}: {one}", x, "a finite number")
        for one, x in mapping(source, entry.get("joints") or {}).items()
    }
    values = [
        not_negative(f"{source}: {key}", entry.get(key, 0.0), _UNITS[key])
        for key in Coupling._fields[1:]
    ]
    if len(joints) < 2 or joints[name] != 1.0:
        raise InputError(
            f"{source} has joints {joints}, expected others by ratio, and 1 for '{name}'."
        )
    return Coupling(joints, *values)


def _body(entry: object, source: str, may_be_negative: bool) -> Payload:
    entries = mapping(source, entry, Payload._fields).items()
    given = mapping(source, {key: x for key, x in entries if x is not None}, required=["mass"])
    return checked_body(Payload(**given), f"{source}: ", may_be_negative=may_be_negative)


def flexible_joints(
    tree: Tree, given: Mapping[str, FlexibleJoint], armature: Mapping[str, float]
) -> dict[str, Any]:
    """Return the flexible joints that are degrees of freedom, in their order; InputError names joints that cannot be."""
    types = {joint.name: joint.type for joint in tree.robot.joints}
    for name in given:
        reason = f"is no joint of robot '{tree.robot.name}', expected one of {listed(list(types))}"
        if name in types:
            reason = (
                "" if types[name] in SINGLE else f"is {types[name]}, expected one degree of freedom"
            )
        if not reason and name not in (*tree.dof_names, *tree.locked):
            reason = "follows other joints, expected a degree of freedom"
        if armature.get(name):
            reason = (
                f"has armature {armature[name]:g}, expected none. Set its rotor_inertia and gear"
            )
        if reason:
            raise InputError(f"flexible_joints: '{name}' {reason}.")
    return {name: given[name] for name in tree.dof_names if name in given}


def apply_parameters(robot: Any, parameters: Parameters) -> Any:
    """Return the robot of a URDF with these damping and friction of joints, and inertias and payloads of links."""
    _reject_unknown("joint", parameters.joints, robot.joints, robot.name)
    _reject_unknown("link", (*parameters.links, *parameters.payloads), robot.links, robot.name)
    robot = copy.copy(robot)
    robot.joints = [
        _with_resistance(joint, parameters.joints.get(joint.name)) for joint in robot.joints
    ]
    robot.links = [_with_bodies(link, parameters) for link in robot.links]
    return robot


def _reject_unknown(what: str, given: Iterable[str], elements: Iterable[Any], robot: str) -> None:
    known = [element.name for element in elements]
    for name in given:
        if name not in known:
            text = f"parameters: '{name}' is not a {what} of robot '{robot}'. Its {what}s are {listed(known)}."
            raise InputError(text)


def _with_resistance(joint: Any, given: JointParameters | None) -> Any:
    if given is None:
        return joint
    if joint.type not in SINGLE:
        raise InputError(
            f"parameters: joint '{joint.name}' is {joint.type}, expected one degree of freedom."
        )
    joint, own = copy.copy(joint), joint.dynamics
    names = ("damping", "friction")
    joint.dynamics = SimpleNamespace(
        **{name: given.known.get(name, getattr(own, name, None)) for name in names}
    )
    return joint


def _with_bodies(link: Any, parameters: Parameters) -> Any:
    """Return the link with its inertia of the parameters, and with a payload as part of its inertia."""
    if link.name in parameters.links:
        link = _with_inertia(link, parameters.links[link.name])
    payload = parameters.payloads.get(link.name)
    if payload is None or payload.mass == 0.0:
        return link
    return _with_inertia(
        link, payload if link.inertial is None else _union(_body_of(link), payload, link.name)
    )


def _with_inertia(link: Any, given: Payload) -> Any:
    link, place = copy.copy(link), np.eye(4)
    place[:3, 3] = np.asarray(given.com, float)
    link.inertial = SimpleNamespace(
        mass=given.mass, inertia=np.array(given.inertia, float), origin=place
    )
    return link


def _plain(body: Payload) -> dict[str, Any]:
    return {key: np.asarray(value, float).tolist() for key, value in body._asdict().items()}


def _rigid(payload: Payload) -> RigidBody:
    return RigidBody(
        payload.mass, np.asarray(payload.com, float), np.asarray(payload.inertia, float)
    )


def _body_of(link: Any) -> RigidBody:
    """Return the inertia of a link in its own axes."""
    own = link.inertial
    place = np.eye(4) if own.origin is None else own.origin
    return RigidBody(own.mass, place[:3, 3], place[:3, :3] @ own.inertia @ place[:3, :3].T)


def _union(body: RigidBody, payload: Payload, link: str) -> Payload:
    """Return a body and a payload of a link as one."""
    if abs(body.mass + payload.mass) <= NEGLIGIBLE * abs(payload.mass):
        raise InputError(
            f"parameters: the payload of {payload.mass:g} kg leaves link '{link}' without mass, and so without a centre. "
            f"To remove it, give links: {link}: {{mass: 0}}."
        )
    both = RigidBody.union(body, _rigid(payload))
    return Payload(both.mass, both.centre, both.inertia)


def reject_too_light(tree: Tree, parameters: Parameters) -> None:
    """Reject payloads that take more mass off a link than moves with it."""
    bodies, _ = tree.records({}, {})
    of_link = {link.name: body for link, body, _ in tree.links}
    for name in parameters.lighter_links:
        body = bodies[of_link[name]]
        mass, reason = float(body["mass"]), None
        if mass > 0.0:
            whole = RigidBody.about_origin(mass, body["first_moment"], symmetric(body["inertia"]))
            reason = not_physical(whole.inertia, mass)
        if mass <= 0.0 or reason:
            text = (
                f"parameters: a payload of negative mass is on link '{name}', which leaves {mass:.3g} kg {reason or ''}: "
                "more is taken off than moves with that link."
            )
            locked = parameters.origin.get("locked_joints")
            if (
                isinstance(locked, Mapping) and locked
            ):  # links behind these joints moved with theirs
                listed_joints = ", ".join(
                    f"{joint}={position}" for joint, position in locked.items()
                )
                text += f" It was identified with locked_joints {listed_joints}."
            raise InputError(text)


def perturbed_links(robot: Any, part: float, rng: np.random.Generator) -> dict[str, Payload]:
    """Return inertias of links with random errors, see :meth:`RobotModel.perturbed`."""
    links = {}
    for link in robot.links:
        if link.inertial is None or not link.inertial.mass:
            continue
        own = _body_of(link)
        moments = (
            0.5 * np.trace(own.inertia) * np.eye(3) - own.inertia
        )  # second moments: inertia is trace less matrix
        heavier = 1.0 + part * rng.uniform(-1.0, 1.0)
        radius = np.sqrt(max(np.trace(moments), 0.0) / own.mass)
        centre = own.centre + part * radius * rng.uniform(-1.0, 1.0, 3) / np.sqrt(3.0)
        random = rng.uniform(-1.0, 1.0, (3, 3))
        stretch = np.eye(3) + 0.25 * part * (random + random.T)
        moments = heavier * stretch @ moments @ stretch
        links[link.name] = Payload(
            heavier * own.mass, centre, np.trace(moments) * np.eye(3) - moments
        )
    return links


# --- A URDF written anew with parameters; all else in the file stays, comments too

ENTRIES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def numbers_text(values: Iterable[float]) -> str:
    """Return numbers as the text of an attribute that has the same bits."""
    return " ".join(repr(float(value)) for value in values)


def set_inertia(inertial: Any, mass: float, centre: Array, inertia: Array) -> None:
    """Add to an `<inertial>` the mass [kg], centre (3,) [m] and inertia (3, 3) about it [kg m²]."""
    etree.SubElement(inertial, "origin", xyz=numbers_text(centre), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=repr(float(mass)))
    etree.SubElement(
        inertial,
        "inertia",
        {entry: repr(float(inertia[place])) for entry, place in ENTRIES.items()},
    )


def insert_inertia(link: Any, said: str, mass: float, centre: Array, inertia: Array) -> None:
    """Insert an `<inertial>` with a comment into a link, in the file's manner of indenting."""
    inertial = etree.Element("inertial")
    inertial.append(_comment(said))
    set_inertia(inertial, mass, centre, inertia)
    _insert_first(link, inertial)


def _comment(said: str) -> Any:
    return etree.Comment(
        f" {said} ".replace("--", "- -")
    )  # a comment has no two dashes in a row, a file's name may


def _insert_first(parent: Any, element: Any) -> None:
    """Insert an element of a link or joint, with its children, on lines of their own."""
    indent = parent.text if len(parent) and not (parent.text or "").strip() else None
    parent.text, element.tail = indent or "\n    ", indent or "\n  "
    etree.indent(element, space="  ", level=2)
    parent.insert(0, element)


def urdf_with(text: str, parameters: Parameters) -> str:
    """Return a URDF's text with inertias, payloads, damping and friction; it has no place for armature and offsets."""
    element = parse_urdf(text, comments=True)
    robot, _ = read_urdf(element)
    inertials = {link.name: link.inertial for link in apply_parameters(robot, parameters).links}
    origin = [
        str(parameters.origin[key]) for key in ("method", "date") if parameters.origin.get(key)
    ]
    source = ", ".join(["written by diag_dynamics", *origin])
    for link in element.findall("link"):
        name = link.get("name")
        payload = parameters.payloads.get(name)
        if name in parameters.links or (payload is not None and payload.mass):
            etree.strip_elements(link, "inertial", with_tail=False)
            own = inertials[name]
            insert_inertia(link, source, own.mass, own.origin[:3, 3], np.asarray(own.inertia))
    for joint in element.findall("joint"):
        given = parameters.joints.get(joint.get("name"), JointParameters()).known
        if numbers := {
            name: repr(x) for name, x in given.items() if name in ("damping", "friction")
        }:
            _set_dynamics(joint, numbers, source)
    return etree.tostring(element.getroottree(), encoding="unicode")


def _set_dynamics(joint: Any, numbers: dict[str, str], source: str) -> None:
    dynamics = joint.find("dynamics")
    if dynamics is None:
        dynamics = etree.Element("dynamics")
        _insert_first(joint, dynamics)
    dynamics.attrib.update(numbers)
    comment, before = _comment(source), dynamics.getprevious()
    comment.tail = (
        joint.text if before is None else before.tail
    )  # on a line of its own, as the element is
    joint.insert(joint.index(dynamics), comment)
