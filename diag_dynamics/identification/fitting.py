# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""``identify``: from recordings to a model that explains them."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter
from typing import TypeAlias

import numpy as np

from diag_dynamics.checks import instance
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.identification.dataset import MAX_VALUES, Dataset, list_recordings
from diag_dynamics.identification.fit import Carrier, ConvergenceError
from diag_dynamics.identification.gains import (
    correct_gains,
    effort_scale,
    find_gains,
    with_known_payload,
)
from diag_dynamics.identification.normal_equations import (
    DAMPING,
    FRICTION,
    LOAD,
    OFFSET,
    ROOT,
    ROTOR,
    Regressors,
    require_single_joints,
)
from diag_dynamics.identification.quality import quality_of
from diag_dynamics.identification.result import Identification, parameters_of
from diag_dynamics.identification.selection import PAYLOAD, STEPS, Selection, read_what
from diag_dynamics.model import RobotModel
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.recordings.findings import Finding
from diag_dynamics.recordings.recording import Recording

# A recording in memory, or a function that returns pieces
Readable: TypeAlias = Recording | Callable[[], Iterable[Recording]]
# Blocks of cross-validation, and the length of more blocks: six time constants [s]
MIN_BLOCKS, MAX_BLOCKS, MIN_BLOCK = 2, 12, 1.0

MOVING, EACH_WAY, RANGE = 0.05, 1.0, 0.5
"""Velocity [rad/s], time above it each way [s], and range [rad] of a joint that moves enough."""

PRISMATIC, TRAVEL = 0.1, 0.02
"""Factor of these for a prismatic joint [m], and travel that shows an offset [rad, m]."""


def identify(
    recordings: Readable | Sequence[Readable],
    model: RobotModel,
    what: str | Sequence[str] = STEPS,
    *,
    reference: Readable | Sequence[Readable] | None = None,
) -> Identification:
    """Identify friction, rotor inertias, a payload or link inertias from motion without contact.

    The momentum balance is fitted through a low-pass of 1 Hz, which needs no accelerations.
    Inertias stay physical, and near the model's where the motion does not determine them; friction
    and rotor inertias stay positive. A step is taken if it reduces the residual in cross-validation
    over blocks of all recordings, friction and rotors joint by joint. All rows are then fitted. See
    docs/identification.md for the equations.

    Parameters
    ----------
    recordings : Recording, callable, or sequence of these
        Without contact, with efforts that contain gravity [N m, N]. A callable returns the pieces
        of one recording: ``lambda: dd.stream_recording(path, model)``.
    model : RobotModel
        With a fixed base, and joints of one degree of freedom each.
    what : str or sequence of str
        ``"friction"`` (damping, Coulomb friction and offset of each joint that moves enough),
        ``"rotors"`` (reflected inertia of motors, for efforts measured by current), ``"gears"``
        (friction by the torque of gravity and by the root of the rate), ``"gains"`` (torque by unit
        of effort of joints that carry weight, for currents and raw units of drives),
        ``"payload:<link>"`` (mass that a link carries beside the model, or lacks; with gains,
        ``"payload:<link>=<mass>"`` is a known mass [kg], whose weight shows gains of more joints),
        ``"inertias"`` (of all links; alone, it includes the other steps).
    reference : Recording, callable, or sequence of these, optional
        Of the same robot without the payload: its links are then fitted too, so that their errors
        do not become part of the payload.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        An argument has a wrong value, a recording is of another robot, has no efforts, or has
        velocities or efforts that cannot be in SI units, or no joint moves enough.
    UnsupportedError
        The robot has a floating base, or a joint of several degrees of freedom.
    """
    instance("model", model, RobotModel)
    names, steps, masses = read_what(what, model)
    if len(masses) > 1:
        raise InputError(f"what is {what!r}; expected one payload at most.")
    if masses and reference is None and "inertias" in steps:
        raise InputError(
            f"what is {what!r}, but reference is missing. Give a recording without the payload."
        )
    if reference is not None and not masses:
        raise InputError(
            f"what is {what!r}; expected payload:<link>, because reference is a recording without "
            "it."
        )
    if model.flexible_joints:
        raise UnsupportedError(
            f"joint '{min(model.flexible_joints)}' is flexible; expected rigid joints, because "
            "recordings lack springs. Load the model without flexible_joints."
        )
    require_single_joints(model)
    payload = next((Carrier(link, *model.placement_in_body(link)) for link in masses), None)
    data = FitData(model, payload, recordings, reference, "gains" in names, masses)
    try:
        selection = Selection(model, steps, payload, data)
    except ConvergenceError as error:
        if payload is None:
            raise
        text = f"{error} Leave {PAYLOAD}{payload.link} out of what"
        if not steps or reference is not None:
            raise ConvergenceError(f"{text}.") from error
        selection = Selection(model, steps, None, data)
        selection.warnings.append(f"no payload was identified: {text}")
    if "gains" in names and reference is None and None in masses.values():
        selection.warnings.append(
            "gains contain the weight of the payload. Give a reference without it, or its mass "
            "(payload:LINK=MASS)"
        )
    last = selection.fit_all()
    free = selection.free(selection.taken)
    quality, curves = quality_of(model, selection, data, last)
    if "inertias" not in selection.taken:  # fitted along to a reference, but not asked for
        free &= ~selection.layout.inertial
    parameters = parameters_of(selection.layout, last.x, free, _origin(model, data, quality))
    if data.gains is not None:
        parameters = parameters.with_effort_scale(effort_scale(model, data.gains[0]))
    return Identification(model.with_parameters(parameters), parameters, quality, curves)


class FitData:
    """Recordings of an identification: their checks and their normal equations.

    `gains` are those of the efforts with standard deviations, (2, nv), None if efforts are in N m
    and N; `left_out_gains` those without each block relative to them, (blocks, nv).

    `loaded` are the Datasets of recordings, `datasets` these and those of references, `relations`
    their efforts against the model, `able` the joints that move enough for a column, `measured`
    those with efforts (bool), `findings` on the others, `duration` the time of all [s].

    Normal equations are those of `blocks`, parts of equal duration, and their sum `fitted`; and of
    references, `unloaded`, None without any. `parts` are the segments of each block with the joints
    that have efforts there (bool).
    """

    def __init__(self, model, payload, recordings, reference, with_gains, masses):
        self.regressors = Regressors(model, [payload.body] if payload else [])
        loaded = list_recordings("recordings", recordings)
        unloaded = [] if reference is None else list_recordings("reference", reference)
        share = MAX_VALUES // (len(loaded) + len(unloaded))
        self.left_out_gains = None
        self.loaded, self._references = (
            [
                Dataset(f"{name}[{k}]", recording, model, share, in_torque=not with_gains)
                for k, recording in enumerate(group)
            ]
            for name, group in (("recordings", loaded), ("reference", unloaded))
        )
        self.datasets = [*self.loaded, *self._references]
        self.gains = None
        if with_gains:
            self._find_gains(model, masses)
        self.relations = [dataset.check_efforts(model) for dataset in self.datasets]
        able, self.findings = check_motion(model, self.datasets, np.array(sliding_dofs(model)))
        self.measured = np.any([dataset.known for dataset in self.datasets], axis=0)
        able &= self.measured
        self.able = {OFFSET: able[0], DAMPING: able[1], FRICTION: able[1]}
        self.able |= dict.fromkeys((ROTOR, LOAD, ROOT), able[2])
        self.duration = sum(dataset.duration for dataset in self.datasets)
        self.use_load_of(model)
        if with_gains and self._carrying is not None:
            factors = correct_gains(self._carrying, self)
            for dataset in self.datasets:
                dataset.scale_efforts(model, factors)
            self.use_load_of(model)

    def _find_gains(self, model, masses):
        """Multiply efforts by gains; an unknown payload leaves these to references."""
        self._carrying = model
        mass = next(iter(masses.values()), None)
        if mass is not None:
            payload = self.loaded, self._references, *masses, mass
            self._carrying = with_known_payload(model, *payload)
        elif masses and self._references:
            self._carrying = None
        pairs = [(self._carrying, dataset) for dataset in self.loaded if self._carrying]
        pairs += [(model, dataset) for dataset in self._references]
        self.gains = find_gains(pairs)
        for dataset in self.datasets:
            dataset.scale_efforts(model, self.gains[0])

    def left_out(self):
        """Return normal equations without each block in turn, with gains of the other blocks."""
        sums = [self.fitted - block for block in self.blocks]
        if self.left_out_gains is None:
            return sums
        for products, gains in zip(sums, self.left_out_gains, strict=True):
            for k, gain in enumerate(gains):
                scale = np.append(np.ones(len(products[k]) - 1), gain)
                products[k] = products[k] * scale[:, None] * scale
        return sums

    def use_load_of(self, model):
        """Sum normal equations with load columns of a model."""
        self.regressors.load_of = DiagonalDynamics(model)
        self.blocks, self.parts = self._cut_blocks(_in_order(self.loaded))
        self.fitted = sum(self.blocks)
        references = _in_order(self._references)
        sums = [
            self.regressors.sum_segment(*segment.columns, measured)
            for segment, measured in references
        ]
        self.unloaded = sum(sums) if sums else None

    def beginnings(self):
        """Return names and beginnings [s] of recordings on the time axis of all blocks."""
        begin = 0.0
        names = []
        for dataset in sorted(self.loaded, key=attrgetter("key")):
            names.append((dataset.name, begin))
            begin += float(dataset.duration)
        return names

    def sum_recordings(self):
        """Return the normal equations of each recording."""
        add = self.regressors.sum_segment
        return [
            sum(add(*segment.columns, measured) for segment in dataset.segments)
            for dataset, measured in zip(self.loaded, _measured(self.loaded), strict=True)
        ]

    def _cut_blocks(self, segments):
        """Return normal equations and segments of blocks, given all segments."""
        duration = sum(segment.duration for segment, _ in segments)
        elapsed = 0.0
        count = int(np.clip(duration // MIN_BLOCK, MIN_BLOCKS, MAX_BLOCKS))
        blocks = [0.0] * count
        parts = [[] for _ in range(count)]
        for segment, measured in segments:
            since = elapsed + segment.t - segment.t[0]
            number = np.minimum(since * count / duration, count - 1).astype(int)
            elapsed += segment.duration
            for block in np.unique(number).tolist():
                is_in_block = number == block
                if np.count_nonzero(is_in_block) > 1:  # the end of a segment may begin a block
                    parts[block].append((segment.part(is_in_block), measured))
            first = 1
            for rows, weights in self.regressors.filtered_rows(*segment.columns, measured):
                part = number[first : first + len(rows)]
                first += len(rows)
                for block in np.unique(part).tolist():
                    chosen = part == block
                    blocks[block] = blocks[block] + self.regressors.sum_rows(
                        rows[chosen], weights[chosen]
                    )
        return blocks, parts


def check_motion(model, datasets, slides):
    """Return which joints move, move in each direction, and move far, bool (3, nv), and findings.

    Findings are on the other joints. An offset requires the first, friction the second, and what
    depends on acceleration or load the third.
    """
    unit = np.where(slides, PRISMATIC, 1.0)
    times = np.zeros((2, model.nv))
    segments = [segment for dataset in datasets for segment in dataset.segments]
    for t, states in segments:
        step = np.diff(t, prepend=t[0])
        times += [step @ (sign * states.velocity > MOVING * unit) for sign in (1.0, -1.0)]
    moved = np.ptp(np.vstack([states.position for _, states in segments]), axis=0)
    each_way = (times >= EACH_WAY).all(axis=0)
    findings = []
    for k in np.flatnonzero(~each_way):
        metre = "m" if slides[k] else "rad"
        text = (
            f"joint '{model.dof_names[k]}' moves {times[0, k]:.2g} s forward and {times[1, k]:.2g} "
            f"s backward above {MOVING * unit[k]:g} {metre}/s; its friction requires "
            f"{EACH_WAY:g} s each way, and keeps the model's values"
        )
        findings.append(Finding("not excited", 1, text))
    able = moved > TRAVEL, each_way, each_way & (moved >= RANGE * unit)
    return np.array(able), findings


def _measured(datasets):
    """Return which joints of each dataset have efforts that count, bool (datasets, nv).

    Those of a joint that stands count only if it stands in all datasets, because stiction may carry
    any torque.
    """
    measured = np.array([dataset.known for dataset in datasets], bool)
    moves = np.zeros_like(measured)
    for moved, dataset in zip(moves, datasets, strict=True):
        positions = np.vstack([segment.states.position for segment in dataset.segments])
        moved[:] = np.ptp(positions, axis=0) > TRAVEL
    return measured & (moves | ~(measured & moves).any(axis=0))


def _in_order(datasets):
    """Return segments and joints with efforts, in an order that does not depend on datasets."""
    pairs = zip(datasets, _measured(datasets), strict=True)
    return [
        (segment, measured)
        for dataset, measured in sorted(pairs, key=lambda pair: pair[0].key)
        for segment in dataset.segments
    ]


def _origin(model, data, quality):
    locked = {name: float(value) for name, value in model.locked_joints.items()}
    return ({"locked_joints": locked} if locked else {}) | {
        "recordings": [dataset.origin for dataset in data.datasets],
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "method": "filtered momentum, " + (", ".join(quality["taken"]) or "nothing taken"),
        "quality": {
            key: quality[key]
            for key in (
                "held_out",
                "torque_rms",
                "explained",
                "observer_spread",
                "deviations",
                "effort_gain",
            )
            if quality[key] is not None
        },
    }
