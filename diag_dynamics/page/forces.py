# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces of the environment on a robot, for frames: at the touched link."""

import numpy as np

from diag_dynamics.dynamics.contact_force import ContactForce
from diag_dynamics.page.layout import center_of_body

CANDIDATES, MIN_PROBABILITY = 3, 0.2
"""Links that a page names at most, and the probability that the second and third one need."""


class Forces:
    """Estimate forces from external torque.

    They need a covariance Σ of the external torque, shape (nv, nv); without one, None, they are
    unknown.
    """

    def __init__(self, dynamics, covariance):
        self._dynamics = dynamics
        self._names = dynamics.model.link_names
        self._covariance = covariance
        if covariance is not None:
            self._force = ContactForce(dynamics.model, covariance)

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
        forces = np.full((count, 3), np.nan)
        intervals = np.full((count, 2), np.nan)
        for k in np.unique(touched[touched >= 0.0]).astype(int).tolist():
            rows = np.flatnonzero(touched == k)
            forces[rows] = self._at_center(q[rows], torque[rows], self._names[k])
        rows = np.flatnonzero(touched >= 0.0)
        if rows.size:
            intervals[rows] = self._force.interval(q[rows], torque[rows])
        return {"touch_force": forces, "touch_interval": intervals}

    def _at_center(self, q, torque, link):
        """Return the force on a link at the centre of mass of its body, in the world's axes.

        It is NaN where a direction of the force is not observed.
        """
        center = center_of_body(self._dynamics.model, link)
        w = self._dynamics.wrench(
            q, link, torque, self._covariance, point=center, frame="world", force_only=True
        )
        return np.where(w.observed.sum(axis=1, keepdims=True) == 3, w.wrench[:, :3], np.nan)
