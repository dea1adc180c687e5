# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""``identify``: from recordings to a model whose numbers explain them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

import numpy as np

from diag_dynamics.checks import instance
from diag_dynamics.exceptions import DiagDynamicsError, InputError, UnsupportedError
from diag_dynamics.identification.attempt import STEPS, Attempt
from diag_dynamics.identification.fit import Payload
from diag_dynamics.identification.found import Identification
from diag_dynamics.identification.gathered import Gathered
from diag_dynamics.identification.prepared import Prepared, several
from diag_dynamics.model import RobotModel
from diag_dynamics.model.single_joints import single_joints
from diag_dynamics.recordings.recording import Recording

Readable: TypeAlias = Recording | Callable[[], Iterable[Recording]]
"""A recording: in memory, or a function that yields its pieces whenever it is called."""

PAYS = 0.3
"""What a payload that nobody asked for would have to take off the residual of rows held out to be told of."""

TIPS = 3
"""Of how many ends of a robot that is tried: each costs as much as a fit."""


def identify(
    recordings: Readable | Sequence[Readable],
    model: RobotModel,
    what: str | Sequence[str] = ("friction", "rotors"),
    *,
    reference: Readable | Sequence[Readable] | None = None,
) -> Identification:
    """Identify what the URDF does not know of a robot, from recordings without contact.

    The momentum's balance through a low-pass of 1 Hz, which needs no accelerations, is fitted with each joint's rows weighted
    by their residual's variance; inertias stay physical and near the model's where the motion does not tell, friction and
    rotor inertias stay positive. Each step beyond the model is taken only if it makes the residual of rows that it was not
    fitted to a tenth smaller, friction and rotors for those joints only whose residual in cross-validation they make smaller;
    then everything is fitted to all rows. Columns as of Gautier and Khalil, the prior as of Lee, Wensing and Park (IEEE T-RO
    36(2), 2020). See docs/identify.md.

    A recording is read three times, in portions: its length takes time and no memory, but for what holds it.

    Parameters
    ----------
    recordings : Recording, callable, or sequence of these
        Without contact, with efforts that hold gravity [N m, N]. A callable yields the pieces of one recording anew whenever
        it is called, as ``lambda: dd.stream_recording(path, model)`` does.
    model : RobotModel
        What it is identified against. Its base is fixed, and its joints have one degree of freedom each.
    what : str or sequence of str
        ``"friction"`` (damping, Coulomb friction and offset of each joint that moves enough), ``"rotors"`` (reflected inertia
        of motors, for efforts measured by current), ``"payload:<link>"`` (what a link carries beside the model, or lacks),
        ``"inertias"`` (of all links).
    reference : Recording, callable, or sequence of these, optional
        Of the same robot without the payload: its links are then fitted along, so that their errors are not taken for the
        payload's.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        An argument has a wrong value, or can be read only once; or a recording is of another robot, has no efforts, or has
        velocities or efforts that cannot be in SI units, or no joint moves enough, or it has other states when it is read
        again. The joint and, where it can be guessed, the unit are named. Efforts are judged last, by all states.
    UnsupportedError
        The robot has a floating base, or a joint of several degrees of freedom.
    """
    instance("model", model, RobotModel)
    steps, payload = _what(what, model, reference)
    refuse_unsupported(model)
    loaded = _prepared("recordings", recordings, model)
    unloaded = _prepared("reference", reference, model) if reference is not None else []
    tips = _tips(model)
    carriers = [one.body for one in ([payload] if payload else tips)]
    gathered = Gathered(model, carriers, loaded, unloaded, payload is not None)
    found = Attempt(model, steps, payload, gathered).outcome()
    if payload is None and "inertias" not in found.quality["taken"]:
        found.quality["warnings"] += _untold_payload(model, steps, tips, gathered, found.quality["ladder"])
    return found


def _tips(model):
    """Payloads at ends of the robot, that nobody told of."""
    bodies = model.bodies
    tips = np.setdiff1d(np.arange(1, len(bodies)), bodies["parent"])[-TIPS:]
    return [Payload.of(model, model.link_names[bodies["link"][tip]]) for tip in tips]


def _untold_payload(model, steps, tips, gathered, ladder):
    """A payload at an end of the robot that would explain much of what is left, in words: of one that nobody told of."""
    left = min(rung["score"] for rung in ladder if rung["taken"])
    best, told = (1.0 - PAYS) * left, []
    for payload in tips:
        attempt = Attempt(model, steps, payload, gathered)
        try:
            _, fit, rungs = attempt.ladder()
        except DiagDynamicsError:  # nobody asked for this payload: what was identified stays
            continue
        score = min(rung["score"] for rung in rungs if rung["taken"])
        if score < best:
            best, mass = score, attempt.payload_mass(fit)
            told = [
                f"a payload of {mass:+.2g} kg at '{payload.link}' would make the residual of what was held out "
                f"{1.0 - score / left:.0%} smaller: if the robot carries, or lacks, something there, ask for "
                f"payload:{payload.link}, too; else for inertias"
            ]
    return told


def _what(what, model, reference):
    """Steps, in order, and the Payload or None."""
    names = (what,) if isinstance(what, str) else tuple(what)
    steps, payloads = [], []
    for name in names:
        if isinstance(name, str) and name.startswith("payload:"):
            link = name.removeprefix("payload:")
            if link not in model.link_names:
                raise InputError(f"what: '{link}' is not a link of robot '{model.name}'.")
            if model.placement_in_body(link)[0] == 0:
                raise InputError(f"what: no joint moves link '{link}', so that nothing can be known of its payload.")
            payloads.append(link)
        elif name in STEPS:
            steps.append(name)
        else:
            raise InputError(f"what has {name!r}, expected {', '.join(STEPS)} or payload:<link>.")
    if not names:
        raise InputError(f"what is empty, expected some of {', '.join(STEPS)}, payload:<link>.")
    if len(payloads) > 1:
        raise InputError(f"what has {len(payloads)} payloads, expected one.")
    if reference is not None and not payloads:
        raise InputError("reference is for a payload, and what has none.")
    if payloads and reference is None and "inertias" in steps:
        raise InputError(
            f"what has both inertias and payload:{payloads[0]}, which are one to a recording: give one without the payload "
            "as reference."
        )
    return [step for step in STEPS if step in steps], Payload.of(model, payloads[0]) if payloads else None


def refuse_unsupported(model: RobotModel) -> None:
    """Refuse a robot that cannot be identified.

    Raises
    ------
    UnsupportedError
        It has a floating base, or a joint of several degrees of freedom.
    """
    if model.floating_base:
        raise UnsupportedError(f"robot '{model.name}' has a floating base, whose support nothing measures.")
    if len(single_joints(model)) != len(model.joint_names):
        several = next(name for name in model.joint_names if name not in set(single_joints(model)))
        raise UnsupportedError(f"joint '{several}' has several degrees of freedom, which is not supported here.")


def _prepared(name, recordings, model):
    return [Prepared(f"{name}[{k}]", one, model) for k, one in enumerate(several(name, recordings))]
