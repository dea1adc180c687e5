# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What stands where in a frame: the one list of fields that server, page and report go by."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.model import RobotModel, end_effector_link
from diag_dynamics.page.tree import tree_of
from diag_dynamics.sweeps.spatial import ANGULAR_X

VERSION = 2
"""Of the layout; a page that does not know it says so."""

CAUSES = {
    "velocity_estimated": 1,
    "effort_missing": 2,
    "no_external_torque": 4,
    "collision": 8,
    "late": 16,
    "receive_time": 32,
    "other_model": 64,
}
"""Bits of the field `flags`, by what they say of a state: the velocity of at least one joint was estimated from positions; an
effort is unknown; the observer has no result; it sees a collision; the stamp is more than :data:`LATE` behind the clock; the
source sent no stamp; what is computed here of the robot is not what the monitor computes, so that links are those of another
model."""

LATE = 1.0
"""How far a stamp may be behind the clock before a frame says so [s]."""

CHOSEN = ("mobility_root", "link_velocity")
"""Fields of the link that a page has chosen. They are the last ones, so that all that comes before is made once for all."""


class Field(NamedTuple):
    """One quantity of a frame: how many numbers it has, of what there is one each, and their unit."""

    name: str
    size: int
    of: str
    """dofs, coordinates or links, empty for a single number or where entries have no names."""
    unit: str


class Layout:
    """Fields of a robot's frames.

    Parameters
    ----------
    model : RobotModel
    live : bool
        Whether there are fields of a chosen link.

    Attributes
    ----------
    fields : tuple of Field
    size : int
        Numbers of a frame, its time apart.
    common : int
        Those that come before the fields of a chosen link.
    dtype : numpy.dtype
        Of a frame: `t` [s], float64, and `numbers`, float32 of shape (size,). Little-endian, without padding.
    """

    def __init__(self, model: RobotModel, live: bool = True) -> None:
        self._model = model
        nq, nv, links = model.nq, model.nv, len(model.link_names)
        per_dof = {
            "qd": "rad/s, m/s",
            "effort": "N m, N",
            "nu": "J^0.5",
            "epsilon": "J^0.5/s",
            "coriolis": "J^0.5/s",
            "gravity": "J^0.5/s",
            "gravity_torque": "N m, N",
            "D": "kg m^2, kg",
        }
        seen = {"residual": "J^0.5/s", "external_torque": "N m, N"}
        fields = [
            Field("q", nq, "coordinates", "rad, m"),
            *(Field(name, nv, "dofs", unit) for name, unit in per_dof.items()),
            Field("link_energy", links, "links", "J"),
            Field("K", 1, "", "J"),
            *(Field(name, 1, "", "W") for name in ("p_effort", "p_gravity", "p_friction", "p_external", "dK")),
            *(Field(name, nv, "dofs", unit) for name, unit in seen.items()),
            Field("norm", 1, "", "J^0.5/s"),
            Field("torque_norm", 1, "", "N m"),
            Field("coriolis_work", 1, "", ""),
            Field("latency", 1, "", "s"),
            Field("rate", 1, "", "1/s"),
            Field("flags", 1, "", ""),
        ]
        self.common = sum(field.size for field in fields)
        if live:
            fields += [Field("mobility_root", 6, "", "1/kg^0.5"), Field("link_velocity", 3, "", "m/s")]
        self.fields = tuple(fields)
        self.size = sum(field.size for field in fields)
        ends = np.cumsum([field.size for field in fields]).tolist()
        begins = [0, *ends[:-1]]
        self._places = {field.name: slice(*place) for field, *place in zip(fields, begins, ends, strict=True)}
        self.dtype = np.dtype([("t", "<f8"), ("numbers", "<f4", (self.size,))])

    def place(self, name: str) -> slice:
        """Where the numbers of a field are."""
        return self._places[name]

    def to_json(
        self, scene: Mapping[str, Any] | None = None, thresholds: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """All that a page has to know of the robot before the first frame, as JSON has it.

        Parameters
        ----------
        scene : dict
            Of :func:`~diag_dynamics.page.scene.scene_of`; None while it is not made yet.
        thresholds : dict
            See :func:`thresholds`; by default none.
        """
        model = self._model
        own = (body for k, body in enumerate(model.bodies) if k and body["owner"] == k)
        angular = {int(body["dof"]): bool(body["direction"] >= ANGULAR_X) for body in own}
        return {
            "version": VERSION,
            "robot": model.name,
            "dofs": list(model.dof_names),
            "coordinates": list(model.coordinate_names),
            "links": list(model.link_names),
            "angular": [angular[k] for k in range(model.nv)],
            "floating_base": model.floating_base,
            "gravity": model.gravity.tolist(),
            "has_friction": model.has_friction,
            "fields": [field._asdict() for field in self.fields],
            "dtype": "float32",
            "limits": {
                "effort": finite(model.effort_limit),
                "velocity": finite(model.velocity_limit),
                "lower": finite(model.lower),
                "upper": finite(model.upper),
            },
            "thresholds": dict(thresholds) if thresholds else none_of(model.nv),
            "causes": CAUSES,
            "tree": tree_of(model),
            "scene": scene,
            "end_effector": end_effector_link(model),
        }


def none_of(nv: int) -> dict[str, Any]:
    """Thresholds where nothing is judged."""
    return {"external_torque": [None] * nv, "external_torque_norm": None, "norm": None, "energy": None}


def finite(values: Iterable[float]) -> list[float | None]:
    """Numbers for JSON, which knows no infinity and no NaN: None instead."""
    return [value if math.isfinite(value) else None for value in map(float, values)]
