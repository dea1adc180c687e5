# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of an identification: parameters by joint and link, the model with them, certainty of a payload."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np

from diag_dynamics.identification import inertias
from diag_dynamics.identification.regressors import DAMPING, FRICTION, OFFSET, ROTOR
from diag_dynamics.model import JointParameters, Parameters, Payload, RobotModel

MAX_DEVIATION = 0.5  # relative standard deviation above which a payload's inertia is unknown


class Identification:
    """Identified parameters and their quality.

    Attributes
    ----------
    model : RobotModel
        With the parameters.
    parameters : Parameters
    quality : dict
        Plain values in SI units. Pairs are before and after, on the part held out, for parameters
        fitted to the rest: ``held_out`` (begin and end of that part, in times of the last recording),
        ``held_out_duration``, ``torque_rms``, ``row_residual`` and ``observer_spread`` by joint [N m, N],
        ``explained``, ``explained_total``, ``kinetic_energy``. Of the fit: ``taken``, ``ladder``, ``kept``,
        ``effort_factor``, ``efforts_judged``, ``velocity_delay``, ``effective_parameters``, ``payload``,
        ``warnings``, ``findings``. docs/identify.md explains each.
    """

    def __init__(self, model: RobotModel, parameters: Parameters, quality: dict[str, Any]) -> None:
        self.model, self.parameters, self.quality = model, parameters, quality

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the parameters into a YAML file, for :meth:`RobotModel.with_parameters` and the nodes.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        self.parameters.save(path)

    def __repr__(self) -> str:
        shares = self.quality["explained_total"]  # that of dK/dt is noise if the robot is slow
        before, after = ("-" if share is None else f"{share:.2f}" for share in shares)
        taken = ", ".join(self.quality["taken"]) or "nothing"
        return (
            f"<Identification of '{self.model.name}': {taken}; of d(K + U)/dt explained {before} before, {after} after>"
        )


def model_of(layout, x, loaded=False):
    """Return the layout's model with inertias, rotors and, if `loaded`, payload of its unknowns, without their friction."""
    robot, bodies = layout.effective(x, loaded), layout.model.bodies.copy()
    for k, body in enumerate(layout.bodies.tolist()):
        parameters = robot[layout.block(k)]
        rotational = inertias.rotational_of(parameters)
        bodies["mass"][body], bodies["first_moment"][body] = parameters[0], parameters[1:4]
        bodies["inertia"][body] = [rotational[i, j] for i, j in inertias.UPPER]
    own = bodies["owner"] == np.arange(len(bodies))
    bodies["armature"] = np.where(own, np.r_[0.0, robot[layout.own(ROTOR)]][1 + bodies["dof"]], 0.0)
    bodies["armature"][0] = 0.0
    return replace(layout.model, bodies=bodies)


def friction_of(layout, x):
    """Return friction and offset as a function of rates, (T, nv) to (T, nv)."""
    damping, coulomb, offset = (x[layout.own(column)] for column in (DAMPING, FRICTION, OFFSET))
    velocity = layout.model.friction_velocity

    def friction(qd):
        return damping * qd + coulomb * (np.tanh(qd / velocity) if velocity > 0.0 else np.sign(qd)) + offset

    return friction


def parameters_of(layout, x, free, origin):
    """Return the :class:`Parameters` of all unknowns that were fitted, and of rotors that were left out."""
    payloads = {layout.payload.link: Payload(*payload_in_link(layout, x, layout.payload))} if free.payload else {}
    velocity = layout.model.friction_velocity if free.friction.any() else None
    links = _links(layout, x) if free.inertias else {}
    return Parameters(
        joints=_joints(layout, x, free), links=links, payloads=payloads, friction_velocity=velocity, origin=origin
    )


def _joints(layout, x, free):
    """Return numbers of the joints that were fitted, and zeros of their mimic joints, whose friction is in them."""
    found, mimics = {}, layout.model.mimics
    for k, name in enumerate(layout.model.dof_names):
        columns = {"damping": DAMPING, "friction": FRICTION, "effort_offset": OFFSET} if free.friction[k] else {}
        if free.rotors[k] or layout.without_rotors:
            columns = columns | {"armature": ROTOR}
        if columns:
            found[name] = JointParameters(**{key: float(x[layout.own(column)[k]]) for key, column in columns.items()})
            for joint in (joint for joint, mimic in mimics.items() if mimic.leader == name):
                found[joint] = JointParameters(**dict.fromkeys(columns, 0.0))
    return found


def _links(layout, x):
    """Return inertias of the links without payloads."""
    model, found = layout.model, {}
    for k, body in enumerate(layout.bodies.tolist()):
        if model.bodies["mass"][body] > 0.0:  # one without may carry a payload, and was not fitted
            found |= _share_out(model, body, x[layout.block(k)])
    return found


def _share_out(model, body, whole, written=None):
    """Return inertias of a body's links, given the body's, which has the model's payloads in it.

    All links change alike, so that each stays physical. Payloads in `written`, by link, become part of
    the links; those of the model do not.
    """
    found, names, parts, places = {}, [], [], []
    for record in model.links[model.links["body"] == body]:
        link = model.link_names[record["index"]]
        _, placement = model.placement_in_body(link)
        own = inertias.parameters_of_record(record)
        if link in model.payloads:
            carried = _carried(model.payloads[link], placement)
            own, whole = own - carried, whole - carried
        if written and link in written:
            own = own - _carried(written[link], placement)
        if own[0] > 0.0:
            names.append(link)
            parts.append(inertias.floored(own))
            places.append(np.linalg.inv(placement))
        elif np.any(own):  # inertia without mass goes to the other links
            found[link] = Payload(0.0, np.zeros(3), np.zeros((3, 3)))
    if names:
        shares = inertias.share_out(parts, inertias.pseudo_inertia(whole))
        for link, share, place in zip(names, shares, places, strict=True):
            found[link] = Payload(*inertias.about_centre(inertias.parameters_of_pseudo(place @ share @ place.T)))
    return found


def _carried(payload, placement):
    """Return ten parameters of a payload, in the frame of its link's placement."""
    return inertias.moved(inertias.of_body(*payload), placement)


def without_impossible_links(model, parameters):
    """Return parameters for a URDF, in which each link is a physical body, and the names of links that were changed.

    A payload may take off more than its link has, such as a hand that is not mounted. The links that
    move with it then share the rest. A link that was not physical before stays as it is.
    """
    records = {model.link_names[record["index"]]: record for record in model.links}
    links, payloads, shared = dict(parameters.links), dict(parameters.payloads), []
    for link, payload in parameters.payloads.items():
        record = records.get(link)
        if record is None or link not in payloads:
            continue
        own, (_, placement) = inertias.parameters_of_record(record), model.placement_in_body(link)
        if link in model.payloads:
            own = own - _carried(model.payloads[link], placement)
        before, body = own - _carried(payload, placement), record["body"]
        whole = sum(inertias.parameters_of_record(one) for one in records.values() if one["body"] == body)
        if inertias.is_physical(own) or not inertias.is_physical(before) or not inertias.is_physical(whole):
            continue
        found = _share_out(model, body, whole, payloads)
        links |= found
        shared += found
        payloads = {name: one for name, one in payloads.items() if records[name]["body"] != body}
    return replace(parameters, links=links, payloads=payloads), shared


def payload_in_link(layout, x, payload):
    """Return mass, centre and inertia about it, in the axes of the payload's link."""
    return inertias.about_centre(inertias.moved(x[layout.robot :], np.linalg.inv(payload.placement)))


def payload_certainty(layout, fit):
    """Return a payload's numbers with their standard deviations, as plain values."""
    payload, inverse = layout.payload, np.linalg.inv(layout.payload.placement)
    block = np.searchsorted(fit.free, np.arange(layout.robot, layout.size))
    turned = np.column_stack([inertias.moved(unit, inverse) for unit in np.eye(10)])
    covariance = turned @ fit.covariance[np.ix_(block, block)] @ turned.T
    x = inertias.moved(fit.x[layout.robot :], inverse)
    mass, centre, inertia = inertias.about_centre(x)
    deviations = _deviations(covariance, x, lambda y: np.r_[_flat(y), np.trace(inertias.about_centre(y)[2])])
    trace = float(np.trace(inertia))
    known = trace != 0.0 and deviations[-1] / abs(trace) <= MAX_DEVIATION
    return {
        "link": payload.link,
        "mass": mass,
        "com": centre.tolist(),
        "inertia": inertia.tolist(),
        "mass_deviation": float(np.sqrt(covariance[0, 0])),
        "com_deviation": deviations[1:4].tolist(),
        "inertia_deviation": deviations[4:13].reshape(3, 3).tolist(),
        "inertia_known": "its inertia is known to 20 to 50 % only"
        if known
        else "its inertia is not known from this motion: the value depends on the sphere that the fit assumes",
    }


def _flat(parameters):
    mass, centre, inertia = inertias.about_centre(parameters)
    return np.r_[mass, centre, inertia.ravel()]


def _deviations(covariance, x, function):
    """Return standard deviations of a function of the ten parameters, by differences."""
    here, slopes = function(x), []
    for j in range(len(x)):
        ahead, step = x.copy(), 1e-6 * max(abs(x[j]), 1e-3)
        ahead[j] += step
        slopes.append((function(ahead) - here) / step)
    return np.sqrt(np.maximum(np.einsum("ji,jk,ki->i", slopes, covariance, slopes), 0.0))
