# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stream of one robot: frames of its newest state, made when a page asks for one."""

import json
import threading
import time
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import SingularMassMatrixError
from diag_dynamics.model import end_effector_link
from diag_dynamics.page.frames import FrameMaker, States
from diag_dynamics.page.layout import links_of_dofs, thresholds_of

STALE = 1.0
"""Age of the last state above which a robot is not alive [s]."""

SEVERITY, ERROR = (3, 1, 0, 2), 2
"""Place of each level of diagnostics, the worst first, and that of an error; STALE is 3."""

RATE_PERIOD = 0.5
"""Shortest time over which the rate of states is measured [s]."""


class Received(NamedTuple):
    """The newest state of a robot."""

    states: States
    """One state, of the robot in force."""
    received: float
    """Time of reception by :func:`time.monotonic` [s]."""
    count: int = 1
    """States received since the last call, this one included."""
    limits: tuple[float, ...] = ()
    """Thresholds of alarms as of :func:`~diag_dynamics.page.layout.thresholds_of`; empty if
    unknown."""
    points: tuple[tuple[str, str], ...] = ()
    """Name and link of each point of contact."""


class Newest(NamedTuple):
    """Number and JSON of layout and diagnostics, the chosen link, number and frame of the state."""

    layout: tuple[int, str]
    diagnostics: tuple[int, str]
    link: str
    number: int
    frame: bytes


def compile_frames(dynamics, covariance):
    """Compile what frames of a robot need, or load it from the cache."""
    model = dynamics.model
    q = model.start
    zero = np.zeros(model.nv)
    maker = FrameMaker(dynamics, (), covariance)
    with suppress(SingularMassMatrixError):  # at the start alone: other states can be shown
        pushed = {"external_torque": zero[None], "norm": np.ones(1), "collision": True}
        states = States.of(0.0, q, zero, zero, dynamics.evaluate(q, zero, zero), **pushed)
        maker.frames(states)
        maker.frames(states._replace(touched_link=model.link_names.index(links_of_dofs(model)[-1])))
    maker.chosen(q, zero, model.root_link)


class RobotStream:
    """One robot for any number of pages: each frame is made once. All methods are thread-safe.

    Parameters
    ----------
    name : str
        Namespace of the robot, by which pages ask for it.
    read : callable
        Called with the DiagonalDynamics in force by one thread at a time; returns the newest state
        since the last call as
        :class:`Received`, or None. It raises nothing.

    Attributes
    ----------
    name : str
    waiting : str
        Why no state comes; the last state stays, with its age.
    error : str
        Why robot or states will not come; empty: they may.
    """

    def __init__(self, name, read):
        self.name = name
        self._read = read
        self._lock = threading.RLock()
        self._dynamics = self._scene = self._meshes = self._last = self._rate = None
        self._covariance = None
        self._layout = (0, "")
        self._diagnostics = (0, "[]")
        self._number = 0
        self._frames = {}
        self.waiting = "waiting for a robot"
        self._worst = ""
        self._end_effector = ""
        self.error = self._diagnosed_error = self._difference = ""
        self._counted = 0
        self._since = 0.0

    def set_robot(self, dynamics, scene=None, meshes=None, covariance=None, difference=""):
        """Replace the robot and what is drawn of it; `dynamics` is this object's own from now on.

        `difference` is why it differs from the monitor's robot, if it does.
        """
        with self._lock:
            self._dynamics = dynamics
            self._covariance = covariance
            self._scene = scene
            self._meshes = meshes
            self._end_effector = end_effector_link(dynamics.model)
            self._last = None
            self.waiting = ""
            self._difference = difference
            self._lay_out((), ())

    def set_diagnostics(self, statuses):
        """Set the newest diagnostics, a list of dicts: level, name, message and values of each."""
        statuses = sorted(statuses, key=lambda status: (SEVERITY[status["level"]], status["name"]))
        worst = statuses[0] if statuses else {"level": 0}
        with self._lock:
            self._worst = ""
            if worst["level"]:
                name = worst["name"].partition(": ")[2] or worst["name"]
                self._worst = f"{name}: {worst['message']}"
            self._diagnosed_error = self._worst if worst["level"] == ERROR else ""
            if (text := json.dumps(statuses)) != self._diagnostics[1]:
                self._diagnostics = self._diagnostics[0] + 1, text

    def newest(self, link=""):
        """Return the :class:`Newest` with the fields of a link, by default of the end effector."""
        with self._lock:
            self._refresh()
            if not self._dynamics or link not in self._dynamics.model.link_names:
                link = self._end_effector
            return Newest(self._layout, self._diagnostics, link, self._number, self._frame(link))

    def mesh(self, sha):
        """Return the bytes of a mesh; None if there is none of this hash."""
        with self._lock:
            return self._meshes.meshes.get(sha) if self._meshes else None

    def about(self):
        """Return name, robot, whether it is alive, age and rate of its states, for JSON.

        `waiting` is why there is no state, `error` why none will come, `difference` that of
        :meth:`set_robot`.
        """
        with self._lock:
            self._refresh()
            age = time.monotonic() - self._last.received if self._last else None
            alive = age is not None and age < STALE
            missing = self._worst or ("waiting for the first state" if age is None else "")
            return {
                "name": self.name,
                "robot": self._dynamics and self._dynamics.model.name,
                "alive": alive,
                "age": age,
                "rate": self._rate,
                "waiting": self.waiting or ("" if alive else missing),
                "error": self.error or (self._diagnosed_error if age is None else ""),
                "difference": self._difference,
            }

    def _lay_out(self, limits, points):
        """Start a new layout."""
        self._limits = limits
        self._points = points
        self._maker = FrameMaker(self._dynamics, points, self._covariance)
        layout = self._maker.layout.to_json(self._scene, thresholds_of(limits) if limits else None)
        self._layout = (self._layout[0] + 1, json.dumps(layout, allow_nan=False))
        self._frames = {}

    def _refresh(self):
        """Read the newest state, if there is one since."""
        received = self._read(self._dynamics) if self._dynamics else None
        if received is None:
            return
        if (received.limits, received.points) != (self._limits, self._points):
            self._lay_out(received.limits, received.points)
        self._counted = self._counted + received.count
        now = received.received
        if now - self._since >= RATE_PERIOD:
            self._rate = self._counted / (now - self._since) if self._since else None
            self._counted = 0
            self._since = now
        self._last = received
        self._number = self._number + received.count
        self._frames = {}

    def _frame(self, link):
        """Return the frame of the last state, made once per link; empty before the first state."""
        if self._last is None or link in self._frames:
            return self._frames.get(link, b"")
        states = self._last.states
        maker = self._maker
        if "" not in self._frames:
            frame = maker.frames(states).tobytes()
            self._frames[""] = frame[: 8 + 4 * maker.layout.common]
        chosen = maker.chosen(states.q[0], states.nu[0], link).tobytes()
        self._frames[link] = self._frames[""] + chosen
        return self._frames[link]
