# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a recording: what the page of a live robot shows, in one HTML file."""

from typing import NamedTuple

import numpy as np

import diag_dynamics
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model import end_effector_link
from diag_dynamics.page.contact import kept_about, kept_of, kept_width, mass_of_half
from diag_dynamics.page.frames import FrameMaker, Seen, States, Told
from diag_dynamics.page.layout import finite
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.packing import pack_meshes
from diag_dynamics.page.report import EVERY, as_text, full_rate, overview, page_of, write_report
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.recordings.atomic_file import AtomicFile
from diag_dynamics.recordings.outputs.telling import Contacts, Overview, Rows, Works, mean_powers

OVERVIEW = 5_200_000
"""Bytes of the states that stand for the whole recording, before they are made small."""

LARGEST = 14_500_000
"""Bytes of a report: where contacts would need more, the weakest ones have only the overview's states."""

MESHES = 2_000_000
"""Most bytes of meshes, before they are text."""


class _Run(NamedTuple):
    """States at full rate, and how strong the contact is."""

    begin: float
    norm: float
    track: object


class ReportOutput:
    """Writes pieces into a report.

    Parameters
    ----------
    path : str or Path
    reading : Reading

    Raises
    ------
    InputError
        The file cannot be written.
    """

    def __init__(self, path, reading):
        self._part, self._reading = AtomicFile(path), reading
        self._dynamics = DiagonalDynamics(reading.model)
        self._maker = FrameMaker(self._dynamics)
        self._layout, self._drawn = self._maker.layout, self._scene()
        self._end_effector = end_effector_link(reading.model)
        self._points, self._left_out = self._contact_points()
        width = self._layout.size + (kept_width(self._points) if self._points else 0)
        self._overview, self._contacts = Overview(max(200, OVERVIEW // (2 * width))), Contacts()
        self._works, self._runs, self._dropped, self._first = Works(), [], 0, None

    def write(self, piece):
        """Take in a piece."""
        states = piece.states
        if self._first is None:
            self._first = int(states.stamp[0])
        rows = self._rows(piece)
        chosen = self._overview.choose(rows)
        self._overview.take(rows, chosen, self._numbers(rows.part(chosen)))
        for run in self._contacts.take(rows):
            self._keep(run)

    def close(self, summary):
        """Have the file be whole, with an analysis' summary in it."""
        for run in self._contacts.end():
            self._keep(run)
        rows, numbers = self._overview.all()
        self._put_powers(numbers, rows)
        self._put_end_effector(numbers, rows)
        whole, (scene, meshes) = overview(self._layout, rows.t, numbers, self._touch(rows)), self._drawn
        meshes = pack_meshes(meshes, MESHES)
        page = sum(len(part.encode()) for part in page_of())
        self._fit(LARGEST - page - as_text(whole.size + sum(map(len, meshes.values()))))
        tracks = [whole, *(run.track for run in sorted(self._runs, key=lambda run: run.begin))]
        told = {
            "layout": self._layout.to_json(scene, self._thresholds()),
            "summary": summary,
            "parameters": self._parameters(),
            "begin": (self._first - self._reading.offset) * 1e-9,
            "without_full_rate": self._dropped,
            "half": mass_of_half(self._reading.model),
            "contact": kept_about(self._points) if self._points else [],
            "left_out": self._left_out,
            "version": diag_dynamics.__version__,
        }
        write_report(self._part.name, told, tracks, meshes)
        self._part.commit()

    def drop(self):
        """Leave nothing behind."""
        self._part.discard()

    # --- States ---

    def _rows(self, piece):
        states, s = piece.states, piece.s
        residual, torque, norm, valid, collision = piece.observed[:5]
        t = (states.stamp - self._first) * 1e-9
        unknown = ~states.effort_known[:, None]
        epsilon = np.where(unknown, np.nan, s.epsilon)
        friction = np.zeros_like(s.nu) if s.friction is None else s.friction
        forces = epsilon, -s.gravity, -friction, residual
        powers = np.stack([np.einsum("tk,tk->t", s.nu, force) for force in forces], axis=1)
        given = states.position, states.velocity, states.effort
        terms = s.nu, epsilon, s.coriolis, s.gravity, s.articulated_inertia, s.kinetic_energy
        observed = residual, torque, norm, valid, np.asarray(collision, dtype=bool)
        return Rows(
            t, *given, *terms, *observed, states.velocity_estimated, states.stamp_received, *self._works.take(t, powers)
        )

    def _numbers(self, rows):
        """Frames of states, whose powers are not theirs yet."""
        of = {name: getattr(rows, name) for name in States._fields}
        seen = Seen(rows.valid, rows.residual, rows.external_torque, rows.norm, rows.collision)
        told = Told(velocity_estimated=rows.estimated, receive_time=rows.received)
        return np.array(self._maker.frames(States(**of), seen, told)["numbers"])

    def _put_powers(self, numbers, rows):
        powers = mean_powers(rows)
        for k, name in enumerate(("p_effort", "p_gravity", "p_friction", "p_external", "dK")):
            numbers[:, self._layout.place(name).start] = powers[:, k]

    def _put_end_effector(self, numbers, rows, every=1):
        """Write mobility and velocity of the end-effector link into the numbers of some states."""
        for k in range(0, len(numbers), every):
            numbers[k, self._layout.common :] = self._maker.chosen(rows.q[k], rows.nu[k], self._end_effector)

    def _touch(self, rows):
        """What a touch would have cost at some states; None where nothing is looked at."""
        if not self._points:
            return None
        return kept_of(self._dynamics.contact_batch(rows.q, rows.qd, self._points))

    def _keep(self, rows):
        """Keep a run at full rate."""
        numbers = self._numbers(rows)
        self._put_powers(numbers, rows)
        self._put_end_effector(numbers, rows, EVERY)
        norm = float(np.nanmax(rows.norm, initial=0.0))
        self._runs.append(_Run(float(rows.t[0]), norm, full_rate(self._layout, rows.t, numbers, self._touch(rows))))
        self._fit(LARGEST)

    def _fit(self, room):
        """Keep no more runs than there is room for as text."""
        while self._runs and as_text(sum(run.track.size for run in self._runs)) > room:
            weakest = min(range(len(self._runs)), key=lambda k: self._runs[k].norm)
            del self._runs[weakest]
            self._dropped += 1

    # --- What else is told ---

    def _scene(self):
        """What is drawn of the robot, and its meshes by their hashes."""
        described, model = self._reading.described, self._reading.model
        if described is None:
            return None, {}
        library = MeshLibrary(mesh_folders(described))
        try:
            scene = scene_of(model, described, library)
        except UrdfError:
            return None, {}
        wanted = {visual["mesh"] for link in scene["links"] for visual in link["visuals"] if visual["mesh"]}
        return scene, {sha: library.data(sha) for sha in sorted(wanted)}

    def _contact_points(self):
        """ContactPoints, and of how many links no shape counts; None without a description, or where nothing moves."""
        if self._reading.described is None:
            return None, 0
        try:
            points, left_out = self._reading.contact_points
        except UrdfError:
            return None, 0
        return (points, len(left_out)) if len(points) else (None, 0)

    def _thresholds(self):
        """Thresholds of alarms, or of the observer; None where nothing is judged."""
        wanted, names = self._reading.settings.observation, self._reading.model.dof_names
        if wanted is None:
            return None
        limits = np.full(len(names) + 2, np.inf)
        limits[-1] = wanted.threshold
        if wanted.alarms:
            limits = wanted.alarms.limits(names)
        *joints, torque_norm, norm = finite(limits)
        return {"external_torque": joints, "external_torque_norm": torque_norm, "norm": norm, "energy": None}

    def _parameters(self):
        """Of the monitor, those that are not as by default first."""
        values = self._reading.settings.values
        rows = [
            {"name": name, "value": in_words(values[name]), "default": bool(values[name] == spec.default)}
            for name, spec in PARAMETERS.items()
            if name in values
        ]
        return sorted(rows, key=lambda row: row["default"])


def in_words(value):
    """A parameter's value as people write it."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(map(in_words, value)) or "none"
    return str(value) or "none"
