# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a recording: the page of a live robot, with a recording, in one HTML file."""

import json

import numpy as np

import diag_dynamics
from diag_dynamics.atomic_file import AtomicFile
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model import end_effector_link
from diag_dynamics.page.frames import FrameMaker, States
from diag_dynamics.page.layout import thresholds_of
from diag_dynamics.page.meshes import MeshLibrary, pack, pack_meshes
from diag_dynamics.page.recording_page import write_report
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.recordings.outputs.downsampling import Overview, energy_rate

MAX_STATES, MAX_MESHES = 7_000_000, 2_000_000
"""Bytes of states before compression, and of compressed meshes: a report has at most 14.5 MB."""


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
        self._overview = Overview(max(200, MAX_STATES // (3 * self._maker.layout.size)))
        self._count = 0
        self._first = None

    def write(self, piece):
        """Write a :class:`~diag_dynamics.recordings.analysis.Piece`."""
        self._overview.add(self._columns(piece))

    def close(self, summary):
        """Complete the file, with the summary of the analysis, and give it its name."""
        t, numbers = self._numbers()
        scene, meshes = self._scene()
        data = {
            "layout": self._maker.layout.to_json(scene, self._thresholds()),
            "summary": summary,
            "parameters": self._parameters(),
            "begin": self._reading.time(self._first),
            "states": len(t),
            "version": diag_dynamics.__version__,
        }
        with self._target.errors():
            write_report(self._target.name, data, pack(t, numbers), meshes)
        self._target.commit()

    def drop(self):
        """Delete what has been written."""
        self._target.discard()

    def _columns(self, piece):
        """Return the states of a piece as columns by name: all that a report needs of them."""
        states, s, (residual, torque, norm, _) = piece[:3]
        if self._first is None:
            self._first = int(states.stamp[0])
        t = (states.stamp - self._first) * 1e-9
        epsilon = np.where(states.effort_known[:, None], s.epsilon, np.nan)
        terms = epsilon, s.coriolis, s.gravity, s.articulated_inertia, s.kinetic_energy
        evaluated = t, states.position, states.velocity, states.effort, s.nu, *terms
        columns = {
            **dict(zip(States._fields, evaluated, strict=False)),
            "residual": residual,
            "external_torque": torque,
            "norm": norm,
            "collision": piece.judged.alarm,
            "contact": piece.contact.alarm,
            "velocity_estimated": states.velocity_estimated,
            "receive_time": states.stamp_received,
            "index": self._count + np.arange(len(t)),
            "rate": energy_rate(t, s.kinetic_energy),
        }
        self._count += len(t)
        return columns

    def _numbers(self):
        """Return times of the selected states [s], and the numbers of their frames."""
        columns = self._overview.states()
        evaluated = States(
            **{name: column for name, column in columns.items() if name in States._fields}
        )
        if self._points:
            evaluated = evaluated.with_contact_limits(
                self._dynamics.contact_limits(evaluated.q, evaluated.qd, self._points)
            )
        numbers = np.array(self._maker.frames(evaluated)["numbers"])
        layout = self._maker.layout
        numbers[:, layout.places["dK"].start] = columns["rate"]
        link = end_effector_link(self._reading.model)
        for row, q, nu in zip(numbers, evaluated.q, evaluated.nu, strict=True):
            row[layout.common :] = self._maker.chosen(q, nu, link)
        return evaluated.t, numbers

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
            {"name": name, "value": json.dumps(x), "default": bool(x == PARAMETERS[name].default)}
            for name, x in self._reading.settings.values.items()
        ]
        return sorted(rows, key=lambda row: row["default"])
