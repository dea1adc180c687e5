# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a recording: the page of a live robot, with a recording, in one HTML file."""

import numpy as np

import diag_dynamics
from diag_dynamics.atomic_file import AtomicFile
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model import end_effector_link
from diag_dynamics.page.frames import FrameMaker, States
from diag_dynamics.page.layout import thresholds_of
from diag_dynamics.page.meshes import MeshLibrary, pack, pack_meshes
from diag_dynamics.page.report import as_text, page_of, write_report
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.recordings.outputs.downsampling import (
    ContactRuns,
    Overview,
    make_records,
    mean_powers,
)

MAX_OVERVIEW, MAX_REPORT, MAX_MESHES = 3_000_000, 14_500_000, 2_000_000
"""Bytes of the overview before compression, of the file, and of compressed meshes."""

POWERS = "p_effort", "p_gravity", "p_friction", "p_external", "dK"


class ReportOutput:
    """Write the analysis of a Reading into a report."""

    def __init__(self, path, reading):
        self._target = AtomicFile(path)
        self._reading = reading
        self._dynamics = DiagonalDynamics(reading.model)
        self._points = self._contact_points()
        points = zip(self._points.names, self._points.links, strict=True) if self._points else ()
        observation = reading.settings.observation
        names = reading.model.dof_names
        covariance = observation.covariance_of(names) if observation else None
        self._maker = FrameMaker(self._dynamics, points, covariance)
        self._overview = Overview(max(200, MAX_OVERVIEW // (3 * self._maker.layout.size)))
        self._contacts = ContactRuns()
        self._count = 0
        self._first = None
        self._runs = []  # (largest |r|, start, track) of each one at full rate
        self._dropped = 0

    def write(self, piece):
        """Write a :class:`~diag_dynamics.recordings.analysis.Piece`."""
        states = self._records(piece)
        self._overview.add(states)
        self._add_runs(self._contacts.add(states))

    def close(self, summary):
        """Complete the file, with the summary of the analysis, and give it its name."""
        self._add_runs(self._contacts.finish())
        whole = self._track(self._overview.states())
        scene, meshes = self._scene()
        size = len(whole[1]) + sum(map(len, meshes.values()))
        self._fit(MAX_REPORT - sum(len(part.encode()) for part in page_of()) - as_text(size))
        data = {
            "layout": self._maker.layout.to_json(scene, self._thresholds()),
            "summary": summary,
            "parameters": self._parameters(),
            "begin": self._reading.time(self._first),
            "without_full_rate": self._dropped,
            "version": diag_dynamics.__version__,
        }
        runs = sorted(self._runs, key=lambda run: run[1])
        with self._target.errors():
            write_report(self._target.name, data, [whole, *(track for *_, track in runs)], meshes)
        self._target.commit()

    def drop(self):
        """Delete what has been written."""
        self._target.discard()

    def _records(self, piece):
        """Return the states of a piece as records: all that a report needs of them."""
        states, s, (residual, torque, norm, valid) = piece[:3]
        if self._first is None:
            self._first = int(states.stamp[0])
        t = (states.stamp - self._first) * 1e-9
        epsilon = np.where(states.effort_known[:, None], s.epsilon, np.nan)
        terms = epsilon, s.coriolis, s.gravity, s.articulated_inertia, s.kinetic_energy
        friction = np.zeros_like(s.nu) if s.friction is None else s.friction
        powers = [
            np.einsum("tk,tk->t", s.nu, force)
            for force in (epsilon, -s.gravity, -friction, residual)
        ]
        evaluated = t, states.position, states.velocity, states.effort, s.nu, *terms
        columns = {
            **dict(zip(States._fields, evaluated, strict=False)),
            "residual": np.where(valid[:, None], residual, np.nan),
            "external_torque": np.where(valid[:, None], torque, np.nan),
            "norm": np.where(valid, norm, np.nan),
            "collision": piece.judged.alarm,
            "contact": piece.contact.alarm,
            "velocity_estimated": states.velocity_estimated,
            "receive_time": states.stamp_received,
            "index": self._count + np.arange(len(t)),
            "powers": mean_powers(t, np.stack(powers, axis=1), s.kinetic_energy),
        }
        self._count += len(t)
        return make_records(columns)

    def _track(self, states):
        """Return the number of states, and their frames as packed numbers."""
        columns = {name: np.ascontiguousarray(states[name]) for name in states.dtype.names}
        evaluated = States(
            **{name: column for name, column in columns.items() if name in States._fields}
        )
        if self._points:
            evaluated = evaluated.with_contact_limits(
                self._dynamics.contact_limits(evaluated.q, evaluated.qd, self._points)
            )
        numbers = np.array(self._maker.frames(evaluated)["numbers"])
        layout = self._maker.layout
        for name, power in zip(POWERS, states["powers"].T, strict=True):
            numbers[:, layout.places[name].start] = power
        link = end_effector_link(self._reading.model)
        for row, q, nu in zip(numbers, evaluated.q, evaluated.nu, strict=True):
            row[layout.common :] = self._maker.chosen(q, nu, link)
        return len(states), pack(evaluated.t, numbers)

    def _add_runs(self, runs):
        for states in runs:
            norm = float(np.nanmax(states["norm"], initial=0.0))
            self._runs.append((norm, states["t"][0], self._track(states)))
            self._fit(MAX_REPORT)

    def _fit(self, size):
        """Drop the weakest contacts until the others take no more bytes of text than that."""
        while self._runs and as_text(sum(len(data) for *_, (_, data) in self._runs)) > size:
            del self._runs[int(np.argmin([norm for norm, *_ in self._runs]))]
            self._dropped += 1

    def _scene(self):
        """Return what is drawn of the robot, None without a description, and meshes by hash."""
        described = self._reading.described
        if described is None:
            return None, {}
        library = MeshLibrary(mesh_folders(described))
        try:
            scene = scene_of(self._reading.model, described, library)
        except UrdfError:
            return None, {}
        return scene, pack_meshes(library.meshes, MAX_MESHES)

    def _contact_points(self):
        """Return ContactPoints; None if there are none."""
        try:
            points, _ = self._reading.contact_points if self._reading.described else ((), ())
        except UrdfError:
            return None
        return points if len(points) else None

    def _thresholds(self):
        observation = self._reading.settings.observation
        if observation is None:
            return None
        return thresholds_of(observation.collision.of_names(self._reading.model.dof_names))

    def _parameters(self):
        """Return the monitor's parameters, those that differ from the default first."""
        rows = [
            {"name": name, "value": format_value(x), "default": bool(x == PARAMETERS[name].default)}
            for name, x in self._reading.settings.values.items()
        ]
        return sorted(rows, key=lambda row: row["default"])


def format_value(value):
    """Return the value of a parameter as people write it."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(map(format_value, value)) or "none"
    return str(value) or "none"
