# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces of the environment on a robot, for frames: at the touched link, and wrenches at links."""

from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.dynamics.contact_force import ContactForce
from diag_dynamics.page.layout import center_of_body

UPPER = np.triu_indices(3)
"""Entries of a symmetric matrix that a frame has, row by row."""

CANDIDATES, MIN_PROBABILITY = 3, 0.2
"""Links that a page names at most, and the probability that the second and third one need."""

BLOCK = 512
"""Number of states whose intervals are computed at once."""


class ForceOptions(NamedTuple):
    """Options of forces, which need a covariance Σ of the external torque, shape (nv, nv)."""

    covariance: Any = None
    links: tuple[str, ...] = ()
    """Links with a wrench at their origin, in their axes."""
    max_deviation: tuple[float, float] = (10.0, 1.0)
    """Standard deviations above which a direction is not observed [N, N m]."""

    @classmethod
    def of(cls, observation, values, model):
        """Return options by the Observation of a monitor, or None, and its parameters."""
        covariance = observation.covariance_of(model.dof_names) if observation else None
        frames = dict.fromkeys(values["external_wrench.frames"])
        links = tuple(name for name in frames if name in model.link_names)
        force, torque = (f"external_wrench.max_{kind}_deviation" for kind in ("force", "torque"))
        return cls(covariance, links, (values[force], values[torque]))


NO_FORCES = ForceOptions()
"""Options without a covariance of the external torque."""


class Forces:
    """Estimate forces from external torque, with :class:`ForceOptions`."""

    def __init__(self, dynamics, options):
        self._dynamics = dynamics
        self._names = dynamics.model.link_names
        self._covariance = options.covariance
        self._links = options.links
        if options.covariance is not None:
            self._force = ContactForce(dynamics.model, options.covariance)
        self._options = {"covariance": options.covariance, "max_deviation": options.max_deviation}

    def with_touched_links(self, states):
        """Return States with the touched link at contacts and collisions, unless they have one."""
        if self._covariance is None or np.isfinite(states.touched_link).any():
            return states
        torque, is_finite = self._torque(states)
        links, probabilities = np.full((2, len(torque), CANDIDATES), np.nan)
        in_contact = np.logical_or(states.contact, states.collision)
        rows = np.flatnonzero(is_finite & np.isfinite(states.norm) & in_contact)
        if len(rows):
            touched = self._dynamics.touched_link(states.q[rows], torque[rows], self._covariance)
            order = np.argsort(-touched.probability, axis=1)[:, :CANDIDATES]
            probability = np.take_along_axis(touched.probability, order, axis=1)
            index = np.array([self._names.index(name) for name in touched.links])[order]
            index[touched.link == "", 0] = -1
            is_named = probability >= MIN_PROBABILITY
            is_named[:, 0] = True
            places = rows[:, None], np.arange(order.shape[1])
            links[places] = np.where(is_named, index, np.nan)
            probabilities[places] = np.where(is_named, probability, np.nan)
        return states._replace(touched_link=links, touched_probability=probabilities)

    def _torque(self, states):
        """Return external torque, shape (T, nv), and whether it is finite."""
        torque = np.broadcast_to(states.external_torque, (len(states.t), self._dynamics.model.nv))
        return torque, np.isfinite(torque).all(axis=1)

    def fields(self, states):
        """Return fields of States, by name; NaN where they are unknown."""
        if self._covariance is None:
            return {}
        torque, is_finite = self._torque(states)
        count = len(torque)
        q = states.q
        first = states.touched_link[:, 0] if np.ndim(states.touched_link) else states.touched_link
        touched = np.where(is_finite, first, np.nan)
        fields = {
            "touch_force": np.full((count, 3), np.nan),
            "touch_root": np.full((count, 6), np.nan),
            "touch_interval": np.full((count, 2), np.nan),
        }
        for k in np.unique(touched[touched >= 0.0]).astype(int).tolist():
            rows = np.flatnonzero(touched == k)
            for name, values in self._at_center(q[rows], torque[rows], k).items():
                fields[name][rows] = values
        rows = np.flatnonzero(touched >= 0.0)
        for first in range(0, len(rows), BLOCK):
            block = rows[first : first + BLOCK]
            fields["touch_interval"][block] = self._force.interval(q[block], torque[block])
        if self._links:
            wrenches, deviations = np.full((2, count, len(self._links), 6), np.nan)
            for n, link in enumerate(self._links):
                w = self._dynamics.wrench(q[is_finite], link, torque[is_finite], **self._options)
                wrenches[is_finite, n] = w.wrench
                deviations[is_finite, n] = component_deviations(w)
            fields["wrench"] = wrenches.reshape(count, -1)
            fields["wrench_deviation"] = deviations.reshape(count, -1)
        return fields

    def _at_center(self, q, torque, k):
        """Return the force on a link at the centre of mass of its body, in the world's axes.

        It has the symmetric root of its covariance, which maps the unit sphere to the ellipsoid of
        one standard deviation; NaN where a direction of the force is not observed.
        """
        name = self._names[k]
        options = {"frame": "world", "force_only": True} | self._options
        center = center_of_body(self._dynamics.model, name)
        w = self._dynamics.wrench(q, name, torque, point=center, **options)
        whole = w.observed.sum(axis=1) == 3
        values, axes = np.linalg.eigh(w.covariance[whole, :3, :3])
        root = np.full((len(whole), 3, 3), np.nan)
        root[whole] = np.einsum("tij,tj,tkj->tik", axes, np.sqrt(np.maximum(values, 0.0)), axes)
        return {"touch_force": w.wrench[:, :3], "touch_root": root[:, UPPER[0], UPPER[1]]}


def component_deviations(w):
    """Return the standard deviation of each component of an ExternalWrench [N, N m].

    The wrench is of one state or of many. NaN: the component is not observed.
    """
    variances = np.diagonal(w.covariance, axis1=-2, axis2=-1)
    return np.where(np.isinf(variances), np.nan, np.sqrt(variances))
