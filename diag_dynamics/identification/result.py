# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What comes of a fit: parameters by the names of joints and links, and the model that has them."""

from dataclasses import replace

import numpy as np

from diag_dynamics.identification import inertias
from diag_dynamics.identification.equations import DAMPING, FRICTION, OFFSET, ROTOR
from diag_dynamics.model import JointParameters, Parameters, Payload

ROUGHLY = 0.5
"""Standard deviation of a payload's inertia, in parts of it, above which nothing is known of it."""


def model_of(layout, x, loaded=False):
    """The layout's model with the inertias, rotors and, if `loaded`, the payload of its unknowns; friction is left alone."""
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


def friction_of(layout, x, velocity):
    """Friction and offset as a function of rates, (T, nv) to (T, nv)."""
    damping, coulomb, offset = (x[layout.own(column)] for column in (DAMPING, FRICTION, OFFSET))

    def friction(qd):
        turned = np.tanh(qd / velocity) if velocity > 0.0 else np.sign(qd)
        return damping * qd + coulomb * turned + offset

    return friction


def parameters_of(layout, x, free, velocity, origin):
    """Return :class:`Parameters` of all unknowns that were fitted, and rotor inertias that were left out."""
    payloads = {}
    if free.payload:
        payloads[free.payload.link] = Payload(*payload_in_link(layout, x, free.payload))
    return Parameters(
        joints=_joints(layout, x, free),
        links=_links(layout, x) if free.inertias else {},
        payloads=payloads,
        friction_velocity=velocity if free.friction.any() else None,
        origin=origin,
    )


def _joints(layout, x, free):
    """Numbers of the joints that were fitted; their followers, whose friction is in them, have none of their own."""
    found = {}
    followers = {}
    for joint, mimic in layout.model.mimics.items():
        followers.setdefault(mimic.leader, []).append(joint)
    for k, name in enumerate(layout.model.dof_names):
        entry, none = {}, {}
        if free.friction[k]:
            for key, column in (("damping", DAMPING), ("friction", FRICTION), ("effort_offset", OFFSET)):
                entry[key], none[key] = float(x[layout.own(column)[k]]), 0.0
        if free.rotors[k] or layout.without_rotors:
            entry["armature"], none["armature"] = float(x[layout.own(ROTOR)[k]]), 0.0
        if entry:
            found[name] = JointParameters(**entry)
            for follower in followers.get(name, ()):
                found[follower] = JointParameters(**none)
    return found


def _links(layout, x):
    """Inertias of the links, their own without payloads."""
    model, found = layout.model, {}
    for k, body in enumerate(layout.bodies.tolist()):
        if model.bodies["mass"][body] > 0.0:  # else it may carry a payload, and was not fitted
            found |= _shared_out(model, body, x[layout.block(k)])
    return found


def _shared_out(model, body, whole, written=None):
    """Inertias of a body's links, which are changed alike, so that each stays physical.

    `whole` has payloads in it: those of the model stay apart from the links; `written`, by link, become part of them.
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
        elif np.any(own):  # inertia without mass: it goes to the others
            found[link] = Payload(0.0, np.zeros(3), np.zeros((3, 3)))
    if names:
        shares = inertias.shared_out(parts, inertias.pseudo_inertia(whole))
        for link, share, place in zip(names, shares, places, strict=True):
            found[link] = Payload(*inertias.about_centre(inertias.parameters_of_pseudo(place @ share @ place.T)))
    return found


def _carried(payload, placement):
    """Ten parameters of a payload, in the frame that its link's placement is in."""
    mass, centre, about_centre = payload
    return inertias.moved(inertias.of_body(mass, centre, np.asarray(about_centre)), placement)


def without_impossible_links(model, parameters):
    """Parameters of a model as a URDF can have them: each link is a body by itself.

    A payload may take off more than its link has, as of a hand that is fixed to it and is not there. The links that move
    with each other, locked joints between them included, then share what is left of them together. A link that was none
    before stays as it is. Returns the parameters, and the names of those links.
    """
    records = {model.link_names[record["index"]]: record for record in model.links}
    links, payloads, shared = dict(parameters.links), dict(parameters.payloads), []
    for link in parameters.payloads:
        record = records.get(link)
        if record is None:  # it has no mass, nor what it carries
            continue
        own = inertias.parameters_of_record(record)
        if link in model.payloads:
            own = own - _carried(model.payloads[link], model.placement_in_body(link)[1])
        before = own - _carried(parameters.payloads[link], model.placement_in_body(link)[1])
        if link not in payloads or inertias.is_physical(own) or not inertias.is_physical(before):
            continue
        body = record["body"]
        whole = sum(inertias.parameters_of_record(one) for one in records.values() if one["body"] == body)
        if not inertias.is_physical(whole):
            continue
        found = _shared_out(model, body, whole, payloads)
        links |= found
        shared += found
        payloads = {name: one for name, one in payloads.items() if records[name]["body"] != body}
    return replace(parameters, links=links, payloads=payloads), shared


def payload_in_link(layout, x, payload):
    """Mass, centre and inertia about it, in the axes of the payload's link."""
    own = inertias.moved(x[layout.robot : layout.size], np.linalg.inv(payload.placement))
    return inertias.about_centre(own)


def payload_certainty(layout, fit, payload):
    """A payload's numbers with their standard deviations, as plain values, and what is known of its inertia in words."""
    mass, centre, inertia = payload_in_link(layout, fit.x, payload)
    block = np.searchsorted(fit.free, np.arange(layout.robot, layout.size))
    inverse = np.linalg.inv(payload.placement)
    turned = np.column_stack([inertias.moved(unit, inverse) for unit in np.eye(10)])
    covariance = turned @ fit.covariance[np.ix_(block, block)] @ turned.T
    x = inertias.moved(fit.x[layout.robot : layout.size], inverse)
    told = {
        "link": payload.link,
        "mass": mass,
        "com": centre.tolist(),
        "inertia": inertia.tolist(),
        "mass_deviation": float(np.sqrt(covariance[0, 0])),
        "com_deviation": _deviations(covariance, x, lambda y: inertias.about_centre(y)[1]).tolist(),
        "inertia_deviation": _deviations(covariance, x, lambda y: inertias.about_centre(y)[2].ravel())
        .reshape(3, 3)
        .tolist(),
    }
    trace = float(np.trace(inertia))
    size = float(_deviations(covariance, x, lambda y: np.atleast_1d(np.trace(inertias.about_centre(y)[2])))[0])
    relative = size / abs(trace) if trace else np.inf
    told["inertia_known"] = (
        "its inertia is known to 20 to 50 % only"
        if relative <= ROUGHLY
        else "its inertia is not known from this motion: the value depends on the sphere that the fit assumes"
    )
    return told


def _deviations(covariance, x, function):
    """Standard deviations of a function of the ten parameters, by differences."""
    here = function(x)
    jacobian = np.zeros((len(here), len(x)))
    for j in range(len(x)):
        step = 1e-6 * max(abs(x[j]), 1e-3)
        ahead = x.copy()
        ahead[j] += step
        jacobian[:, j] = (function(ahead) - here) / step
    return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian), 0.0))
