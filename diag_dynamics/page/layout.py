# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layout of a frame for server, page and report, and the tree for placements of links."""

import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import LoopError
from diag_dynamics.model import end_effector_link
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.model.mimic import FollowerMotion
from diag_dynamics.sweeps.records import FLOATING, PLANAR, PRISMATIC, REVOLUTE

KINDS = {REVOLUTE: "revolute", PRISMATIC: "prismatic", PLANAR: "planar", FLOATING: "floating"}


def tree_of(model):
    """Return the tree of a RobotModel, for JSON.

    ``bodies``: parent, kind of the joint (its axis is z), q (index of its first position; those of
    followers with changing ratios come after the model's, see :func:`with_followers`), multiplier
    and offset of a mimic joint's position, placement in the parent at position 0 (4x4, row by row).
    A body precedes those that it carries; body 0 is the world. ``links``: body, placement in it,
    dofs that move the link, centre of mass of the body in the link's axes. ``link_of_dof``: see
    :func:`links_of_dofs`.
    """
    bodies = [_body(body, bool(number)) for number, body in enumerate(model.bodies)]
    for k, name in enumerate(model.followers):
        bodies[model.first_body(name)] |= {"q": model.nq + k, "multiplier": 1.0, "offset": 0.0}
    links = [_link(model, name) for name in model.link_names]
    return {"bodies": bodies, "links": links, "link_of_dof": links_of_dofs(model)}


def with_followers(model, q, motion=None):
    """Return positions (T, nq) and those of followers; NaN where a loop cannot be closed."""
    if not model.followers:
        return q
    motion = motion or FollowerMotion(model)
    followers = np.full((len(q), len(model.followers)), np.nan)
    for position, row in zip(q, followers, strict=True):
        with suppress(LoopError):
            row[:] = motion.at(position).position[len(model.mimics) :]
    return np.hstack([q, followers])


def links_of_dofs(model):
    """Return the name of the link that each degree of freedom moves."""
    links = [""] * model.nv
    for k, body in enumerate(model.bodies[1:], 1):
        if body["leader"] == k:
            links[body["dof"]] = model.link_names[body["link"]]
    return links


def center_of_body(model, name):
    """Return the centre of mass of a link's body in the link's axes [m]; 0 without mass."""
    number, placement = model.placement_in_body(name)
    body = model.bodies[number]
    if not body["mass"] > 0.0:
        return np.zeros(3)
    return placement[:3, :3].T @ (body["first_moment"] / body["mass"] - placement[:3, 3])


def _body(body, moves):
    placement = np.eye(4)
    if moves:
        placement[:3, :3] = body["rotation"].reshape(3, 3)
        placement[:3, 3] = body["translation"]
    # Of a joint with several degrees of freedom the first body has the whole motion.
    kind = KINDS[int(body["kind"])] if moves and not body["rank"] else "fixed"
    numbers = {name: body[name].item() for name in ("parent", "q", "multiplier", "offset")}
    return {"kind": kind, **numbers, "placement": placement.ravel().tolist()}


def _link(model, name):
    number, placement = model.placement_in_body(name)
    body = model.bodies[number]
    first = int(body["dof"] - body["rank"])
    dofs = list(range(first, first + int(body["dofs"]))) if number else []
    center = center_of_body(model, name).tolist()
    return {"body": number, "placement": placement.ravel().tolist(), "dofs": dofs, "center": center}


# --- Fields of a frame

CAUSES = {
    **{"velocity_estimated": 1, "effort_missing": 2, "no_external_torque": 4, "collision": 8},
    **{"receive_time": 16, "other_model": 32, "contact": 64},
}
"""Bits of the field `flags`. receive_time: the source sent no stamp. other_model: the monitor has
another model than this process, so that values of links are not the monitor's."""

CHOSEN = ("mobility_root", "link_velocity")
"""Fields of the link that a page has chosen. They are the last ones: all others are the same for
all pages."""

FIELDS = (
    ("coordinates", 1, "q"),
    ("dofs", 1, "qd effort gravity_torque external_torque nu epsilon coriolis gravity residual D"),
    ("links", 1, "link_energy"),
    ("", 1, "K p_effort p_gravity p_friction p_external dK norm torque_norm flags"),
    ("contact_limits", 1, "contact_limits_worst"),
    ("contact_limits", 3, "contact_limits_position"),
    ("points", 1, "contact_limits_speed contact_limits_allowed contact_limits_mass"),
    ("points", 1, "contact_limits_energy"),
    ("", 3, "touched_link touched_probability touch_force"),
    ("", 2, "touch_interval"),
    ("", 6, "mobility_root"),
    ("", 3, "link_velocity"),
)
"""Fields in their order, in SI units: what they have entries of, numbers per entry, names."""


class Field(NamedTuple):
    """A field: how many numbers it has, and of what; empty for a single entry."""

    name: str
    size: int
    of: str


class Layout:
    """Fields of a robot's frames.

    Parameters
    ----------
    model : RobotModel
    points : iterable of (str, str)
        Name and link of each point of contact.

    Attributes
    ----------
    fields : tuple of Field
    places : dict of str to slice
        Place of each field in a frame.
    size, common : int
        Numbers of a frame, and those before the fields of a chosen link.
    dtype : numpy.dtype
        A frame: `t` [s], float64, and `numbers`, float32 of shape (size,). Little-endian, without
        padding.
    """

    def __init__(self, model, points=()):
        self._model = model
        self.points = tuple(points)
        counts = {
            "": 1,
            "coordinates": model.nq + len(model.followers),
            "dofs": model.nv,
            "links": len(model.link_names),
            "points": len(self.points),
            "contact_limits": min(1, len(self.points)),
        }
        self.places = {}
        self.size = 0
        fields = []
        for of, each, names in FIELDS:
            size = each * counts[of]
            for name in names.split():
                fields.append(Field(name, size, of))
                self.places[name] = slice(self.size, self.size + size)
                self.size += size
        self.fields = tuple(fields)
        self.common = self.places[CHOSEN[0]].start
        self.dtype = np.dtype([("t", "<f8"), ("numbers", "<f4", (self.size,))])

    def to_json(self, scene=None, thresholds=None):
        """Return all that a page needs before the first frame, as JSON.

        `scene` is of :func:`~diag_dynamics.page.scene.scene_of`, `thresholds` of
        :func:`thresholds_of`.
        """
        model = self._model
        unlimited = [math.inf] * (self._model.nv + 2)
        points = [{"name": name, "link": link} for name, link in self.points]
        return {
            "robot": model.name,
            "dofs": list(model.dof_names),
            "coordinates": [*model.coordinate_names, *model.followers],
            "links": list(model.link_names),
            "angular": [not slides for slides in sliding_dofs(model)],
            "floating_base": model.floating_base,
            "fields": [field._asdict() for field in self.fields],
            "limits": {"effort": finite(model.effort_limit)},
            "thresholds": thresholds or thresholds_of(unlimited),
            "causes": CAUSES,
            "tree": tree_of(model),
            "scene": scene,
            "end_effector": end_effector_link(model),
            "contact_limits": {"points": points},
        }


def thresholds_of(limits):
    """Return thresholds of each |(m r)_k| [N m, N], of ‖m r‖ [N m] and of |r| [J^½/s] as JSON."""
    *joints, torque_norm, norm = finite(limits)
    return {"external_torque": joints, "external_torque_norm": torque_norm, "norm": norm}


def finite(values):
    """Return numbers for JSON, which has no infinity and no NaN: None instead."""
    return [value if math.isfinite(value) else None for value in map(float, values)]
