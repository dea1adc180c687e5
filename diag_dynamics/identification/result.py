# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of an identification: parameters by joint and link, and the certainty of a payload."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.identification import inertias
from diag_dynamics.identification.normal_equations import FRICTION, LOAD, PARAMETERS, ROOT
from diag_dynamics.model import JointParameters, Parameters, Payload, RobotModel
from diag_dynamics.recordings.data_checks import jackknife

MAX_DEVIATION = 0.5  # relative standard deviation above which a payload's inertia is unknown
INERTIA_KNOWN = (
    "its inertia is not observable in this motion: the value depends on the sphere that the fit "
    "assumes",
    "its inertia has an error of 20 to 50 %",
)


@dataclass(eq=False)
class Identification:
    """Identified parameters and their quality.

    Attributes
    ----------
    model : RobotModel
        With the parameters.
    parameters : Parameters
    quality : dict
        Plain values in SI units by the keys of docs/identification.md. Pairs are before and after,
        on the part held out, for parameters fitted to the rest.
    curves : Curves
        Efforts on held-out parts, which the report draws.
    """

    model: RobotModel
    parameters: Parameters
    quality: dict[str, Any]
    curves: Any = None

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the parameters into a YAML file.

        It is for the nodes and for :meth:`RobotModel.with_parameters`.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        self.parameters.save(path)

    def __repr__(self) -> str:
        shares = self.quality["explained_total"]  # that of dK/dt is noise if the robot is slow
        before, after = ("-" if share is None else f"{share:.2f}" for share in shares)
        steps = ", ".join(self.quality["taken"]) or "nothing"
        return (
            f"<Identification of '{self.model.name}': {steps}; variance explained of d(K + U)/dt: "
            f"{before} → {after}>"
        )


def parameters_of(layout, x, free, origin=None):
    """Return the :class:`Parameters` of the `free` unknowns (bool), and of omitted rotors."""
    model = layout.model
    links = {}
    payloads = {}
    if layout.payload:
        payloads[layout.payload.link] = Payload(*inertias.about_centre(layout.payload_of(x, free)))
    for k, body in enumerate(layout.bodies.tolist()):
        if free[layout.block(k)].all():
            links |= _split_body(model, body, x[layout.block(k)])
    is_velocity_used = any(free[layout.own(column)].any() for column in (FRICTION, LOAD, ROOT))
    return Parameters(
        joints=_joints(layout, x, free),
        links=links,
        payloads=payloads,
        friction_velocity=model.friction_velocity if is_velocity_used else None,
        origin=origin or {},
    )


def _joints(layout, x, free):
    """Return numbers of the fitted joints, and zeros of mimic joints.

    Friction of a mimic joint is in that of its source joint.
    """
    joints = {}
    mimics = layout.model.mimics
    for k, name in enumerate(layout.model.dof_names):
        numbers = layout.fitted_of(k, x, free)
        if layout.without_rotors:
            numbers["armature"] = 0.0
        if numbers:
            joints[name] = JointParameters(**numbers)
            mimic_joints = [joint for joint, mimic in mimics.items() if mimic.leader == name]
            joints |= dict.fromkeys(mimic_joints, JointParameters(**dict.fromkeys(numbers, 0.0)))
    return joints


def deviations_of(layout, free, fit, fits):
    """Return standard deviations of the numbers of joints that were fitted, by joint and name.

    The larger one of noise alone, and of fits without each block in turn (jackknife), which also
    contains what the model lacks.
    """
    noise = np.maximum(np.diag(fit.certainty.covariance), 0.0)
    larger = np.sqrt(np.maximum(noise, jackknife(fits)))
    names = layout.model.dof_names
    deviations = {name: layout.fitted_of(k, larger, free) for k, name in enumerate(names)}
    return {name: numbers for name, numbers in deviations.items() if numbers}


def _split_body(model, body, whole):
    """Return inertias of a body's links, given the body's."""
    links = {}
    names = []
    parts = []
    places = []
    for record in model.links[model.links["body"] == body]:
        link = model.link_names[record["index"]]
        _, placement = model.placement_in_body(link)
        carried = _carried(model.payloads.get(link), placement)
        bare = inertias.parameters_of_record(record) - carried
        whole = whole - carried
        if bare[0] > 0.0:
            names.append(link)
            parts.append(inertias.floored(bare))
            places.append(np.linalg.inv(placement))
        elif np.any(bare):  # inertia without mass goes to the other links
            links[link] = Payload(0.0, np.zeros(3), np.zeros((3, 3)))
    shares = inertias.share_out(parts, inertias.pseudo_inertia(whole)) if names else []
    for link, share, place in zip(names, shares, places, strict=True):
        moved = inertias.parameters_of_pseudo(place @ share @ place.T)
        links[link] = Payload(*inertias.about_centre(moved))
    return links


def _carried(payload, placement):
    """Return ten parameters of a link's payload or None, in the frame of the link's placement."""
    return (
        inertias.moved(inertias.of_body(*payload), placement) if payload else np.zeros(PARAMETERS)
    )


def require_masses(model, payloads):
    """Reject payloads that leave their links a negative mass, which a URDF cannot have."""
    for record in model.links:
        link = model.link_names[record["index"]]
        mass = float(record["mass"])
        if mass < 0.0 and link in payloads:
            raise InputError(
                f"payload of '{link}' is {payloads[link].mass:.3g} kg, which leaves {mass:.3g} kg; "
                "expected a mass >= 0 for --write-urdf. Use -o ARM.yaml."
            )


def payload_certainty(layout, fit, fits):
    """Return a payload's numbers with their standard deviations, as plain values.

    Variances are those of the fits without each block in turn (jackknife), and those by priors and
    gains.
    """
    x = fit.x[layout.robot :]
    prior = fit.certainty.by_gains[layout.robot :, layout.robot :]
    steps = np.diag(1e-6 * np.maximum(np.abs(x), 1e-3))
    slopes = np.array([(_numbers(x + step) - _numbers(x)) / step.sum() for step in steps])
    by_gains = np.maximum(np.einsum("ji,jk,ki->i", slopes, prior, slopes), 0.0)
    left_out = np.array([_numbers(payload) for payload in fits[:, layout.robot :]])
    deviations = np.sqrt(by_gains + jackknife(left_out))
    mass, centre, inertia = inertias.about_centre(x)
    return {
        "link": layout.payload.link,
        "mass": mass,
        "com": centre.tolist(),
        "inertia": inertia.tolist(),
        "mass_deviation": float(deviations[0]),
        "com_deviation": deviations[1:4].tolist(),
        "inertia_known": INERTIA_KNOWN[
            bool(0.0 < deviations[-1] <= MAX_DEVIATION * abs(np.trace(inertia)))
        ],
    }


def _numbers(parameters):
    """Return mass, centre, and the trace of the inertia about it."""
    mass, centre, inertia = inertias.about_centre(parameters)
    return np.r_[mass, centre, np.trace(inertia)]
